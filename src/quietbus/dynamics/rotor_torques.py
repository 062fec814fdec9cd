"""Torques of the motors that turn the rotors.

Euler's equation of each rotor about its bearing, from the accelerations of what carries it. The
equations of motion do not need these torques, since the rotors' motion is prescribed; they are what
the motors have to give for it.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.closed_loop import ControlSignals
from quietbus.dynamics.equations import Accelerations
from quietbus.dynamics.state import State
from quietbus.model.cmg import ControlMomentGyro
from quietbus.model.satellite import Satellite
from quietbus.spatial.rotation import quaternion_to_matrix


def rotor_torques(
    satellite: Satellite, state: State, signals: ControlSignals, acceleration: Accelerations
) -> Float[Array, " cmg"]:
    """Torque of each motor on its rotor about the spin axis [N m].

    Args:
        state: with the rotors' angles and speeds.
        signals: what gimbals and rotors are made to do at this state.
        acceleration: of plate and bus at this state.
    """
    assert state.rotor is not None
    assert signals.rotor_acceleration is not None
    R_PN = quaternion_to_matrix(state.q_NP).T
    w_P, dw_P, dv_P = state.w_NP_P, R_PN @ acceleration.w_P, R_PN @ acceleration.v_P

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
        satellite.cluster,
        state.gimbal_angle,
        state.gimbal_rate,
        signals.gimbal_acceleration,
        state.rotor.angle,
        state.rotor.speed,
        signals.rotor_acceleration,
    )
