"""Torques of the motors that turn the rotors.

Euler's equation of each rotor about its bearing, from the accelerations of what carries it. The
equations of motion do not need these torques, since the rotors' motion is prescribed; they are what
the motors have to give for it.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.moments import Turning
from quietbus.model.motion import Motion
from quietbus.model.unit import ControlMomentGyro
from quietbus.spatial.vector import rotate


def rotor_torques(
    units: ControlMomentGyro,
    gimbal: Turning,
    rotor: Turning,
    P: Motion,
    u_rate: Float[Array, "6"],
) -> Float[Array, " cmg"]:
    """Torque of each motor on its rotor about the spin axis [N m].

    Args:
        P: motion of what carries the units.
        u_rate: (6,) its accelerations (dv, dw).
    """
    R_PA = P.R_AX.T
    w_P, dv_P, dw_P = (rotate(R_PA, vector) for vector in (P.w, u_rate[:3], u_rate[3:]))

    def torque(cmg: ControlMomentGyro, gamma, gamma_rate, gamma_acceleration, phi, speed, spin_up):
        """All vectors along plate axes."""
        R_PG = cmg.R_PG(gamma)
        R_PR, g = R_PG @ cmg.R_GR(phi), R_PG[:, 2]
        x, e = R_PR[:, 0], cmg.eccentricity * R_PR[:, 1]
        w_G = w_P + gamma_rate * g
        dw_G = dw_P + gamma_acceleration * g + gamma_rate * jnp.cross(w_P, g)
        w_R = w_G + speed * x
        dw_R = dw_G + spin_up * x + speed * jnp.cross(w_G, x)
        # acceleration of the bearing, on the gimbal, and of the mass centre
        p, r = cmg.p_PC_P, R_PG @ cmg.p_CR_G
        bearing = (
            dv_P
            + jnp.cross(dw_P, p)
            + jnp.cross(w_P, jnp.cross(w_P, p))
            + jnp.cross(dw_G, r)
            + jnp.cross(w_G, jnp.cross(w_G, r))
        )
        centre = bearing + jnp.cross(dw_R, e) + jnp.cross(w_R, jnp.cross(w_R, e))
        I = R_PR @ cmg.I_RRcm_R @ R_PR.T
        about_centre = I @ dw_R + jnp.cross(w_R, I @ w_R)
        return x @ (about_centre + cmg.rotor_mass * jnp.cross(e, centre))

    return eqx.filter_vmap(torque)(
        units,
        gimbal.angle,
        gimbal.rate,
        gimbal.acceleration,
        rotor.angle,
        rotor.rate,
        rotor.acceleration,
    )
