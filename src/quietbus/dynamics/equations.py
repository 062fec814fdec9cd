"""Kane's equations of bus, plate, legs and CMGs.

Generalised speeds ``u = (v_P, w_P, v_B, w_B)``, twelve numbers, inertial components. The bus is
one rigid body; all that the plate carries is one set of mass moments about the plate's origin;
the legs follow their two ends (``dynamics.legs``). Derivation: docs/theory.md. Every vector below
is in inertial components unless its name says otherwise.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.kinematics import PlateMotion, leg_motion
from quietbus.dynamics.legs import leg_forces, leg_mass_matrix
from quietbus.dynamics.state import State
from quietbus.model.cmg import CarriedMotion, ClusterMoments
from quietbus.model.satellite import Satellite
from quietbus.spatial.inertia import point_inertia
from quietbus.spatial.rotation import quaternion_to_matrix, skew
from quietbus.spatial.vector import cross, dot, rotate, solve_positive_definite


class Wrench(eqx.Module):
    """External forces [N] and torques [N m] on plate (about P) and bus (about B), inertial."""

    force_P: Float[Array, "3"]
    torque_P: Float[Array, "3"]
    force_B: Float[Array, "3"]
    torque_B: Float[Array, "3"]

    @classmethod
    def zero(cls) -> "Wrench":
        """No load."""
        return cls(*jnp.zeros((4, 3)))

    @property
    def on_speeds(self) -> Float[Array, "12"]:
        """Generalised force on the twelve speeds."""
        return jnp.concatenate([self.force_P, self.torque_P, self.force_B, self.torque_B])


class Accelerations(eqx.Module):
    """Time derivatives of the speeds, inertial components."""

    v_P: Float[Array, "3"]  # [m/s^2]
    w_P: Float[Array, "3"]  # [rad/s^2]
    v_B: Float[Array, "3"]  # [m/s^2]
    w_B: Float[Array, "3"]  # [rad/s^2]


def plate_motion(state: State) -> PlateMotion:
    """Pose and speeds of bus and plate in inertial components."""
    R_NB, R_NP = quaternion_to_matrix(state.q_NB), quaternion_to_matrix(state.q_NP)
    return PlateMotion(
        R_NB,
        R_NP,
        state.p_NP_N - state.p_NB_N,
        state.v_NB_N,
        rotate(R_NB, state.w_NB_B),
        state.v_NP_N,
        rotate(R_NP, state.w_NP_P),
    )


def accelerations(
    satellite: Satellite,
    state: State,
    rotor_angle: Float[Array, " cmg"],
    gimbal_acceleration: Float[Array, " cmg"],
    wrench: Wrench,
    moments: ClusterMoments | None = None,
    rotor_acceleration: Float[Array, " cmg"] | None = None,
) -> Accelerations:
    """Accelerations of plate and bus.

    Args:
        rotor_angle: (cmg,) rotor angles phi [rad].
        gimbal_acceleration: (cmg,) prescribed by the gimbal servos [rad/s^2].
        wrench: external loads.
        moments: ``ClusterMoments.expand(satellite.cluster)``, for callers who evaluate often.
        rotor_acceleration: (cmg,) prescribed by the rotors' motors [rad/s^2]; needed where the
            state holds the rotors' speeds.
    """
    if moments is None:
        moments = ClusterMoments.expand(satellite.cluster)
    if state.rotor is not None:
        assert rotor_acceleration is not None
        moments = moments.turning(state.rotor.speed, rotor_acceleration)
    plates = plate_motion(state)
    carried = moments.at(state.gimbal_angle, rotor_angle, state.gimbal_rate, gimbal_acceleration)
    M = mass_matrix(satellite, plates, carried)
    f = force(satellite, plates, carried, jnp.zeros(12)) + wrench.on_speeds
    if satellite.mount == "rigid":
        # v_P = v_B + w_B x r and w_P = w_B: the same twelve equations on six speeds
        r, w_B = rotate(plates.R_NB, satellite.p_BP_B), plates.w_B
        bias = cross(w_B, cross(w_B, r))  # of dv_P
        M6 = on_one_body(r, on_one_body(r, M).T)
        f6 = on_one_body(r, f - dot(M[:, :3], bias))
        dv_B, dw_B = solve_positive_definite(M6, f6).reshape(2, 3)
        u_rate = jnp.concatenate([dv_B + cross(dw_B, r) + bias, dw_B, dv_B, dw_B])
    else:
        u_rate = solve_positive_definite(M, f)
    return Accelerations(*u_rate.reshape(4, 3))


def mass_matrix(
    satellite: Satellite, plates: PlateMotion, carried: CarriedMotion
) -> Float[Array, "12 12"]:
    """M of ``M du/dt = f``."""
    legs = leg_mass_matrix(satellite.legs, leg_motion(satellite.legs, plates))
    return legs + body_mass_matrix(satellite, plates, carried)


def force(
    satellite: Satellite, plates: PlateMotion, carried: CarriedMotion, u_rate: Float[Array, "12"]
) -> Float[Array, "12"]:
    """``f - M du/dt``, external loads left out; the force f at ``u_rate`` zero."""
    legs = leg_forces(satellite.legs, leg_motion(satellite.legs, plates), plates, u_rate)
    return legs + body_force(satellite, plates, carried, u_rate)


def body_mass_matrix(
    satellite: Satellite, plates: PlateMotion, carried: CarriedMotion
) -> Float[Array, "12 12"]:
    """Mass matrix of the plate with all it carries and of the bus; without the legs."""
    moments = _with_plate(satellite, carried)
    R, c_skew = plates.R_NP, skew(rotate(plates.R_NP, moments.c))
    M_P = jnp.block([[moments.mass * jnp.eye(3), -c_skew], [c_skew, R @ moments.J @ R.T]])
    J_B = plates.R_NB @ satellite.bus.I_BBcm_B @ plates.R_NB.T
    zero = jnp.zeros((3, 3))
    M_B = jnp.block([[satellite.bus.mass * jnp.eye(3), zero], [zero, J_B]])
    zero = jnp.zeros((6, 6))
    return jnp.block([[M_P, zero], [zero, M_B]])


def body_force(
    satellite: Satellite, plates: PlateMotion, carried: CarriedMotion, u_rate: Float[Array, "12"]
) -> Float[Array, "12"]:
    """``f - M du/dt`` of the plate with all it carries and of the bus; without the legs."""
    dv_B, dw_B = u_rate[6:9], u_rate[9:]
    on_plate = plate_force(plates, _with_plate(satellite, carried), u_rate[:6])
    J = plates.R_NB @ satellite.bus.I_BBcm_B @ plates.R_NB.T
    torque = rotate(J, dw_B) + cross(plates.w_B, rotate(J, plates.w_B))
    return jnp.concatenate([on_plate, -satellite.bus.mass * dv_B, -torque])


def on_one_body(r: Float[Array, "3"], forces: Float[Array, "*n 12"]) -> Float[Array, "*n 6"]:
    """Forces on (v_P, w_P, v_B, w_B) as forces on (v_B, w_B), where both plates are one body.

    Args:
        r: (3,) from the origin of B to that of P [m].
        forces: along the last axis.
    """
    f_P, t_P, f_B, t_B = jnp.split(forces, 4, axis=-1)
    return jnp.concatenate([f_P + f_B, t_P + cross(r, f_P) + t_B], axis=-1)


def rigid_speeds(satellite: Satellite, plates: PlateMotion) -> Float[Array, "12 6"]:
    """The twelve speeds by those of the bus (v_B, w_B), where both plates are one body."""
    r = rotate(plates.R_NB, satellite.p_BP_B)
    return jnp.block([[jnp.eye(3), -skew(r)], [jnp.zeros((3, 3)), jnp.eye(3)], [jnp.eye(6)]])


def _with_plate(satellite, carried):
    """The moments of the plate and all it carries."""
    plate = satellite.plate
    return eqx.tree_at(
        lambda moments: (moments.mass, moments.c, moments.J),
        carried,
        (
            carried.mass + plate.mass,
            carried.c + plate.mass * plate.p_PPcm_P,
            carried.J + plate.I_PPcm_P + point_inertia(plate.mass, plate.p_PPcm_P),
        ),
    )


def plate_force(
    plates: PlateMotion, carried: CarriedMotion, u_rate: Float[Array, "6"]
) -> Float[Array, "6"]:
    """``f - M du/dt`` on (v_P, w_P) of mass moments that the plate carries; linear in these."""
    R = plates.R_NP
    w, dv, dw = (rotate(R.T, vector) for vector in (plates.w_P, u_rate[:3], u_rate[3:]))
    # d/dt of (m v + w x c + p, c x v + J w + H); rates are taken in the plate
    force = (
        carried.mass * dv
        + cross(dw, carried.c)
        + cross(w, cross(w, carried.c) + 2.0 * carried.p)
        + carried.p_rate
    )
    torque = (
        cross(carried.c, dv)
        + rotate(carried.J, dw)
        + rotate(carried.J_rate, w)
        + cross(w, rotate(carried.J, w) + carried.H)
        + carried.H_rate
    )
    return -jnp.concatenate([rotate(R, force), rotate(R, torque)])
