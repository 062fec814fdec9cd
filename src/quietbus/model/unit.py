"""Single-gimbal CMGs: gimbal body and unbalanced rotor, on a body that carries them.

A reaction wheel is a unit whose gimbal is held: its gimbal body is the housing.

Axes of a unit's gimbal frame G: s (spin), t = g x s, g (gimbal axis). Gimbal angle gamma turns s
towards t; rotor angle phi turns t towards g about the spin axis. All imbalance lives in the
rotor's rigid-body properties, so its disturbance needs no force added by hand. P is the frame of
the body that carries the unit.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.spatial.inertia import point_inertia


class Carried(eqx.Module):
    """Mass moments about the origin of P, in plate axes, of what the upper plate carries."""

    mass: Float[Array, ""]  # [kg]
    c: Float[Array, "3"]  # [kg m] first moment of mass
    J: Float[Array, "3 3"]  # [kg m^2] inertia
    p: Float[Array, "3"]  # [kg m/s] linear momentum of the motion relative to the plate
    H: Float[Array, "3"]  # [N m s] angular momentum of the motion relative to the plate


class ControlMomentGyro(eqx.Module):
    """One single-gimbal CMG; a cluster's units are the same module with a leading axis."""

    p_PC_P: Float[Array, "3"]  # [m] unit's reference point, on the gimbal axis
    R_PG0: Float[Array, "3 3"]  # [-] gimbal frame (columns s, t, g) at gamma = 0
    gimbal_mass: Float[Array, ""]  # [kg]
    p_CGcm_G: Float[Array, "3"]  # [m] gimbal body's mass centre in G
    I_GGcm_G: Float[Array, "3 3"]  # [kg m^2] gimbal body about its mass centre
    rotor_mass: Float[Array, ""]  # [kg]
    p_CR_G: Float[Array, "3"]  # [m] rotor's geometric centre in G (p_CGcm_G + r_fg)
    R_GF: Float[Array, "3 3"]  # [-] installation error: bearing frame F of the rotor in G
    I_RRcm_R: Float[Array, "3 3"]  # [kg m^2] rotor about its mass centre, rotor axes
    eccentricity: Float[Array, ""]  # [m] of the rotor's mass centre, along rotor axis y
    rotor_speed: Float[Array, ""]  # [rad/s] nominal; where it changes, that at t = 0
    rotor_phase: Float[Array, ""]  # [rad] rotor angle at t = 0

    @property
    def momentum(self) -> Float[Array, ""]:
        """Rotor momentum about the spin axis [N m s]."""
        return self.I_RRcm_R[..., 0, 0] * self.rotor_speed

    def R_PG(self, gamma: Float[Array, ""]) -> Float[Array, "3 3"]:
        """Gimbal frame in the plate at gimbal angle gamma [rad]."""
        s0, t0, g = self.R_PG0.T
        cos, sin = jnp.cos(gamma), jnp.sin(gamma)
        return jnp.stack([cos * s0 + sin * t0, cos * t0 - sin * s0, g], axis=1)

    def R_GR(self, phi: Float[Array, ""]) -> Float[Array, "3 3"]:
        """Rotor frame in the gimbal frame at rotor angle phi [rad]."""
        x, y, z = self.R_GF.T
        cos, sin = jnp.cos(phi), jnp.sin(phi)
        return jnp.stack([x, cos * y + sin * z, cos * z - sin * y], axis=1)

    def carried(
        self, gamma: Float[Array, ""], phi: Float[Array, ""], gamma_rate: Float[Array, ""]
    ) -> Carried:
        """Mass moments of the unit at gimbal angle, rotor angle [rad] and gimbal rate [rad/s]."""
        # about the unit's reference point C, gimbal axes
        R_GR = self.R_GR(phi)
        r_G, e_G = self.p_CGcm_G, self.eccentricity * R_GR[:, 1]
        r_R = self.p_CR_G + e_G
        I_R = R_GR @ self.I_RRcm_R @ R_GR.T
        c_G = self.gimbal_mass * r_G + self.rotor_mass * r_R
        J_G = (
            self.I_GGcm_G
            + point_inertia(self.gimbal_mass, r_G)
            + I_R
            + point_inertia(self.rotor_mass, r_R)
        )
        w_R = self.rotor_speed * R_GR[:, 0]
        p_R = self.rotor_mass * jnp.cross(w_R, e_G)
        w_G = gamma_rate * jnp.array([0.0, 0.0, 1.0])
        p_G = jnp.cross(w_G, c_G) + p_R
        H_G = J_G @ w_G + I_R @ w_R + jnp.cross(r_R, p_R)

        # about the origin of P, plate axes
        R_PG, r = self.R_PG(gamma), self.p_PC_P
        mass = self.gimbal_mass + self.rotor_mass
        c, p = R_PG @ c_G, R_PG @ p_G
        rc = jnp.outer(r, c)
        J = (
            R_PG @ J_G @ R_PG.T
            + point_inertia(mass, r)
            + 2.0 * jnp.trace(rc) * jnp.eye(3)
            - rc
            - rc.T
        )
        return Carried(mass, mass * r + c, J, p, R_PG @ H_G + jnp.cross(r, p))


def momentum_P(units: ControlMomentGyro, gamma: Float[Array, " cmg"]) -> Float[Array, "cmg 3"]:
    """Rotor momentum vector of each unit [N m s], plate axes (installation error left out)."""
    spin = eqx.filter_vmap(ControlMomentGyro.R_PG)(units, gamma)[:, :, 0]
    return units.momentum[:, None] * spin


def rotor_centres_P(units: ControlMomentGyro, gamma: Float[Array, " cmg"]) -> Float[Array, "cmg 3"]:
    """Geometric centres of the rotors [m] at gimbal angles [rad]."""
    R_PG = eqx.filter_vmap(ControlMomentGyro.R_PG)(units, gamma)
    return units.p_PC_P + jnp.einsum("jab,jb->ja", R_PG, units.p_CR_G)


def balanced(units: ControlMomentGyro) -> ControlMomentGyro:
    """Units with balanced rotors, whose transverse inertia is its mean over a turn."""
    I = units.I_RRcm_R
    across = 0.5 * (I[:, 1, 1] + I[:, 2, 2])
    round_ = jnp.stack([I[:, 0, 0], across, across], axis=1)[:, :, None] * jnp.eye(3)
    where = lambda u: (u.eccentricity, u.I_RRcm_R)  # noqa: E731
    return eqx.tree_at(where, units, (0.0 * units.eccentricity, round_))
