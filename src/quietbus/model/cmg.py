"""Single-gimbal CMGs: gimbal body and unbalanced rotor, on the upper plate.

A reaction wheel is a unit whose gimbal is held: its gimbal body is the housing.

Axes of a unit's gimbal frame G: s (spin), t = g x s, g (gimbal axis). Gimbal angle gamma turns s
towards t; rotor angle phi turns t towards g about the spin axis. All imbalance lives in the
rotor's rigid-body properties, so its disturbance needs no force added by hand.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.model.rotor import RotorDrive, RunUp, WheelMotors
from quietbus.spatial.inertia import point_inertia


class Carried(eqx.Module):
    """Mass moments about the origin of P, in plate axes, of what the upper plate carries."""

    mass: Float[Array, ""]  # [kg]
    c: Float[Array, "3"]  # [kg m] first moment of mass
    J: Float[Array, "3 3"]  # [kg m^2] inertia
    p: Float[Array, "3"]  # [kg m/s] linear momentum of the motion relative to the plate
    H: Float[Array, "3"]  # [N m s] angular momentum of the motion relative to the plate


class ControlMomentGyro(eqx.Module):
    """One single-gimbal CMG; its rotor turns at constant speed unless ``drive`` changes it.

    A cluster is the same module with a leading axis on every field.
    """

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
    rotor_speed: Float[Array, ""]  # [rad/s] nominal; of a wheel that at t = 0
    rotor_phase: Float[Array, ""]  # [rad] rotor angle at t = 0
    drive: RotorDrive | None = None  # None: constant speed

    @property
    def wheels(self) -> bool:
        """Whether the units are reaction wheels, which have no gimbal motion."""
        return isinstance(self.drive, WheelMotors)

    @property
    def run_up(self) -> RunUp | None:
        """The prescribed change of speed, if there is one."""
        return self.drive.run_up if isinstance(self.drive, WheelMotors) else self.drive

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


class CarriedMotion(eqx.Module):
    """Mass moments of the moving cluster and their rates as seen in the plate."""

    mass: Float[Array, ""]  # [kg]
    c: Float[Array, "3"]  # [kg m]
    J: Float[Array, "3 3"]  # [kg m^2]
    p: Float[Array, "3"]  # [kg m/s] dc/dt
    H: Float[Array, "3"]  # [N m s]
    J_rate: Float[Array, "3 3"]  # [kg m^2/s]
    p_rate: Float[Array, "3"]  # [N]
    H_rate: Float[Array, "3"]  # [N m]


class ClusterMoments(eqx.Module):
    """Mass moments of the whole cluster as trigonometric polynomials of the angles.

    Every moment of a unit is a polynomial of degree one (c, H of the rotor's spin) or two (J) in
    the cosine and sine of its gimbal angle and of its rotor angle. Its coefficients follow
    *exactly* from five equally spaced samples of either angle, and its time derivatives from those
    of the basis 1, cos x, sin x, cos 2x, sin 2x. This makes the cluster cheap in the integrator's
    inner loop, and it is also the expansion that the harmonic view needs.
    """

    mass: Float[Array, ""]  # [kg] of the cluster
    rotor_speed: Float[Array, " cmg"]  # [rad/s]
    c_H: Float[Array, "6 cmg 3 3"]  # c and H of the spin, by gimbal and rotor basis of degree 1
    J: Float[Array, "6 cmg 5 5"]  # xx, yy, zz, xy, xz, yz
    H_gimbal: Float[Array, "3 cmg 3 5"]  # [kg m^2] H per gimbal rate
    # where speeds change:
    H_speed: Float[Array, "3 cmg 3 3"] | None = None  # [kg m^2] H of the spin per rotor speed
    rotor_acceleration: Float[Array, " cmg"] | None = None  # [rad/s^2]

    @classmethod
    def expand(cls, cluster: ControlMomentGyro) -> "ClusterMoments":
        """Coefficients of all units."""

        def sample(unit, gamma, phi):
            held, moving = unit.carried(gamma, phi, 0.0), unit.carried(gamma, phi, 1.0)
            return held.c, held.H, held.J[_PAIRS], moving.H - held.H

        def unit(unit):
            grid = jax.vmap(jax.vmap(sample, (None, None, 0)), (None, 0, None))
            c, H, J, H_gimbal = grid(unit, _SAMPLES, _SAMPLES)
            fit = lambda values: jnp.einsum("gi,fj,ijm->gfm", _FROM_SAMPLES, _FROM_SAMPLES, values)  # noqa: E731
            return fit(jnp.concatenate([c, H], axis=2))[:3, :3], fit(J), fit(H_gimbal)[:3]

        mass = jnp.sum(cluster.gimbal_mass + cluster.rotor_mass)
        c_H, J, H_gimbal = (jnp.moveaxis(m, -1, 0) for m in eqx.filter_vmap(unit)(cluster))
        H_speed = None
        if cluster.drive is not None:
            at_one = eqx.tree_at(
                lambda c: c.rotor_speed, cluster, jnp.ones_like(cluster.rotor_speed)
            )
            H_speed = jnp.moveaxis(eqx.filter_vmap(unit)(at_one)[0], -1, 0)[3:]
        return cls(mass, cluster.rotor_speed, c_H, J, H_gimbal, H_speed)

    def turning(
        self, speed: Float[Array, " cmg"], acceleration: Float[Array, " cmg"]
    ) -> "ClusterMoments":
        """The moments with the rotors at other speeds [rad/s], which change [rad/s^2].

        Only of a cluster whose speeds change.
        """
        assert self.H_speed is not None
        c_H = jnp.concatenate([self.c_H[:3], speed[:, None, None] * self.H_speed])
        changed = (speed, c_H, acceleration)
        where = lambda m: (m.rotor_speed, m.c_H, m.rotor_acceleration)  # noqa: E731
        return eqx.tree_at(where, self, changed, is_leaf=lambda leaf: leaf is None)

    def averaged(self) -> "ClusterMoments":
        """The moments averaged over the rotor angles: the imbalance's rotating part is gone.

        Only the constant of the rotor basis is left, on an axis of length one.
        """
        constant = lambda coefficients: coefficients[..., :1]  # noqa: E731
        return ClusterMoments(
            self.mass,
            self.rotor_speed,
            constant(self.c_H),
            constant(self.J),
            constant(self.H_gimbal),
            None if self.H_speed is None else constant(self.H_speed),
            self.rotor_acceleration,
        )

    def at(
        self,
        gamma: Float[Array, " cmg"],
        phi: Float[Array, " cmg"],
        gamma_rate: Float[Array, " cmg"],
        gamma_acceleration: Float[Array, " cmg"],
    ) -> CarriedMotion:
        """Moments and rates at gimbal and rotor angles [rad], gimbal rates and accelerations."""
        g, f = _basis(gamma)[:, :, :, None], _basis(phi)[:, :, None, : self.J.shape[-1]]
        rate, speed = gamma_rate[:, None, None], self.rotor_speed[:, None, None]
        acceleration = gamma_acceleration[:, None, None]
        # the products of both bases, and their first and second time derivatives
        b = g[0] * f[0]
        b1 = rate * g[1] * f[0] + speed * g[0] * f[1]
        b2 = (
            rate**2 * g[2] * f[0]
            + 2.0 * rate * speed * g[1] * f[1]
            + speed**2 * g[0] * f[2]
            + acceleration * g[1] * f[0]
        )
        spin_up: Array | float = 0.0
        if self.rotor_acceleration is not None:
            assert self.H_speed is not None
            rotor_acceleration = self.rotor_acceleration[:, None, None]
            b2 = b2 + rotor_acceleration * g[0] * f[1]
            spin_up = _contract((rotor_acceleration * b)[:, :3, :3], self.H_speed)
        c, b1_, p_rate = (_contract(row[:, :3, :3], self.c_H) for row in (b, b1, b2))
        J, J_rate = (_contract(row, self.J)[_SYMMETRIC] for row in (b, b1))
        H_gimbal = _contract(rate * b[:, :3], self.H_gimbal)
        H_gimbal_rate = _contract(rate * b1[:, :3] + acceleration * b[:, :3], self.H_gimbal)
        return CarriedMotion(
            mass=self.mass,
            c=c[:3],
            J=J,
            p=b1_[:3],
            H=c[3:] + H_gimbal,
            J_rate=J_rate,
            p_rate=p_rate[:3],
            H_rate=b1_[3:] + H_gimbal_rate + spin_up,
        )

    def order(
        self,
        h: int,
        gamma: Float[Array, " cmg"],
        gamma_rate: Float[Array, " cmg"],
        gamma_acceleration: Float[Array, " cmg"],
    ) -> CarriedMotion:
        """Complex amplitudes of each unit's moments at order h, with a leading axis of units.

        The moments are the real part of the sum of ``amplitude * exp(i h phi)`` over units and
        orders, from h = 0 (their mean) to 2. The mass, which is constant, is left out.
        """
        one, first, second = _basis(gamma)
        rate, acceleration = gamma_rate[:, None], gamma_acceleration[:, None]
        # the time derivative of exp(i h phi) is a factor, that of the gimbal basis is its own
        spin = 1j * h * self.rotor_speed[:, None] if h else 0.0
        b1 = spin * one + rate * first
        b2 = spin**2 * one + 2.0 * spin * rate * first + rate**2 * second + acceleration * first
        times = lambda row, k: jnp.einsum("jg,mjg->jm", row[:, : k.shape[2]], k)  # noqa: E731
        spin_up: Array | float = 0.0
        if self.rotor_acceleration is not None:
            assert self.H_speed is not None
            rotor_acceleration = self.rotor_acceleration[:, None]
            b2 = b2 + 1j * h * rotor_acceleration * one if h else b2
            spin_up = times(rotor_acceleration * one, _amplitude(self.H_speed, h))
        c_H, J, H_gimbal = (_amplitude(k, h) for k in (self.c_H, self.J, self.H_gimbal))
        at, at_rate, at_second = (times(row, c_H) for row in (one, b1, b2))
        return CarriedMotion(
            mass=jnp.zeros(len(gamma)),
            c=at[:, :3],
            J=times(one, J)[:, _SYMMETRIC],
            p=at_rate[:, :3],
            H=at[:, 3:] + times(rate * one, H_gimbal),
            J_rate=times(b1, J)[:, _SYMMETRIC],
            p_rate=at_second[:, :3],
            H_rate=at_rate[:, 3:] + times(rate * b1 + acceleration * one, H_gimbal) + spin_up,
        )


ORDERS = (1, 2)  # of a rigid rotor's mass moments
_PAIRS = (np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2]))  # of a symmetric matrix
_SYMMETRIC = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
_SAMPLES = 2.0 * np.pi / 5.0 * np.arange(5)


def _basis(x: Float[Array, " cmg"]) -> Float[Array, "3 cmg 5"]:
    """1, cos x, sin x, cos 2x, sin 2x with their first and second derivatives by x."""
    zero, cos, sin = jnp.zeros_like(x), jnp.cos(x), jnp.sin(x)
    cos2, sin2 = cos * cos - sin * sin, 2.0 * sin * cos
    return jnp.stack(
        [
            jnp.stack([zero + 1.0, cos, sin, cos2, sin2], axis=1),
            jnp.stack([zero, -sin, cos, -2.0 * sin2, 2.0 * cos2], axis=1),
            jnp.stack([zero, -cos, -sin, -4.0 * cos2, -4.0 * sin2], axis=1),
        ]
    )


_FROM_SAMPLES = np.linalg.inv(
    np.stack([0 * _SAMPLES + 1, *(trig(n * _SAMPLES) for n in (1, 2) for trig in (np.cos, np.sin))])
).T


def _amplitude(coefficients, h):
    """Complex amplitude of exp(i h phi), from coefficients by the rotor basis on the last axis."""
    if h == 0:
        return coefficients[..., 0]
    if 2 * h >= coefficients.shape[-1]:
        return jnp.zeros(coefficients.shape[:-1], complex)
    return coefficients[..., 2 * h - 1] - 1j * coefficients[..., 2 * h]


def _contract(row, coefficients):
    """Sum of a row (cmg x basis x basis) against coefficients, over units and bases.

    The moments come first in ``coefficients``, so that each is a dot product along memory.
    """
    return coefficients.reshape(len(coefficients), -1) @ row.reshape(-1)


def momentum_P(cluster: ControlMomentGyro, gamma: Float[Array, " cmg"]) -> Float[Array, "cmg 3"]:
    """Rotor momentum vector of each unit [N m s], plate axes (installation error left out)."""
    spin = eqx.filter_vmap(ControlMomentGyro.R_PG)(cluster, gamma)[:, :, 0]
    return cluster.momentum[:, None] * spin
