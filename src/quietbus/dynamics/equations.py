"""Kane's equations of bus, plate, legs and CMGs.

Generalised speeds ``u = (v_P, w_P, v_B, w_B)``, twelve numbers, inertial components. The bus is
one rigid body. All that the plate carries is one set of mass moments about the plate's origin.
A leg moves with eleven scalar rates that are linear in u; each is a row of partial velocities,
with an inertia, the acceleration it has at du/dt = 0, and the force that acts along it:

    row                          inertia        motion
    mass centre of upper part    m_u  (3 rows)  v_U - d_u ds/dt
    mass centre of lower part    m_d  (3 rows)  v_A + d_d ds/dt
    direction of the leg         I_t  (3 rows)  ds/dt
    spin about the leg's axis    I_a            w_s
    length of the leg            0              dl/dt

Derivation: docs/theory.md. Every vector below is in inertial components unless its name says
otherwise.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.kinematics import LegMotion, leg_motion
from quietbus.dynamics.state import State
from quietbus.model.cmg import Carried, cluster_carried
from quietbus.model.hexapod import Hexapod
from quietbus.model.satellite import Satellite
from quietbus.spatial.inertia import point_inertia
from quietbus.spatial.rotation import quaternion_to_matrix, skew


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


class Accelerations(eqx.Module):
    """Time derivatives of the speeds, inertial components."""

    v_P: Float[Array, "3"]  # [m/s^2]
    w_P: Float[Array, "3"]  # [rad/s^2]
    v_B: Float[Array, "3"]  # [m/s^2]
    w_B: Float[Array, "3"]  # [rad/s^2]


def accelerations(
    satellite: Satellite,
    state: State,
    rotor_angle: Float[Array, " cmg"],
    gimbal_acceleration: Float[Array, " cmg"],
    wrench: Wrench,
) -> Accelerations:
    """Accelerations of plate and bus.

    Args:
        rotor_angle: (cmg,) rotor angles phi [rad].
        gimbal_acceleration: (cmg,) prescribed by the gimbal servos [rad/s^2].
        wrench: external loads.
    """
    R_NB, R_NP = quaternion_to_matrix(state.q_NB), quaternion_to_matrix(state.q_NP)
    w_B, w_P = R_NB @ state.w_NB_B, R_NP @ state.w_NP_P
    M_P, f_P = _plate(satellite, state, R_NP, w_P, rotor_angle, gimbal_acceleration)
    M_B, f_B = _bus(satellite, R_NB, w_B)
    M_legs, f_legs = _legs(satellite, state, R_NB, R_NP, w_B, w_P)
    loads = jnp.concatenate([wrench.force_P, wrench.torque_P, wrench.force_B, wrench.torque_B])
    M = M_legs.at[:6, :6].add(M_P).at[6:, 6:].add(M_B)
    f = f_legs + jnp.concatenate([f_P, f_B]) + loads
    if satellite.mount == "rigid":
        # v_P = v_B + w_B x r and w_P = w_B: the same twelve equations on six speeds
        r = R_NB @ satellite.p_BP_B
        T = jnp.block([[jnp.eye(3), -skew(r)], [jnp.zeros((3, 3)), jnp.eye(3)], [jnp.eye(6)]])
        bias = jnp.zeros(12).at[:3].set(jnp.cross(w_B, jnp.cross(w_B, r)))
        u_rate = T @ _solve(T.T @ M @ T, T.T @ (f - M @ bias)) + bias
    else:
        u_rate = _solve(M, f)
    return Accelerations(*u_rate.reshape(4, 3))


def _solve(M: Float[Array, "n n"], f: Float[Array, " n"]) -> Float[Array, " n"]:
    return jax.scipy.linalg.solve(M, f, assume_a="pos")


def _plate(satellite, state, R_NP, w_P, rotor_angle, gimbal_acceleration):
    """Mass matrix and force of the plate and all it carries, on (v_P, w_P)."""
    cluster, plate = satellite.cluster, satellite.plate

    def carried(gamma, phi, gamma_rate):
        return cluster_carried(cluster, gamma, phi, gamma_rate)

    moments, rate = jax.jvp(
        carried,
        (state.gimbal_angle, rotor_angle, state.gimbal_rate),
        (state.gimbal_rate, cluster.rotor_speed, gimbal_acceleration),
    )
    total = Carried(
        mass=moments.mass + plate.mass,
        c=moments.c + plate.mass * plate.p_PPcm_P,
        J=moments.J + plate.I_PPcm_P + point_inertia(plate.mass, plate.p_PPcm_P),
        p=moments.p,
        H=moments.H,
    )
    w = R_NP.T @ w_P
    # d/dt of (m v + w x c + p, c x v + J w + H) at dv/dt = dw/dt = 0; d'/dt is taken in the plate
    force = -(jnp.cross(w, jnp.cross(w, total.c) + 2.0 * total.p) + rate.p)
    torque = -(rate.J @ w + jnp.cross(w, total.J @ w + total.H) + rate.H)
    c = skew(R_NP @ total.c)
    J = R_NP @ total.J @ R_NP.T
    M = jnp.block([[total.mass * jnp.eye(3), -c], [c, J]])
    return M, jnp.concatenate([R_NP @ force, R_NP @ torque])


def _bus(satellite, R_NB, w_B):
    """Mass matrix and force of the bus, on (v_B, w_B)."""
    J = R_NB @ satellite.bus.I_BBcm_B @ R_NB.T
    zero = jnp.zeros((3, 3))
    M = jnp.block([[satellite.bus.mass * jnp.eye(3), zero], [zero, J]])
    return M, jnp.concatenate([jnp.zeros(3), -jnp.cross(w_B, J @ w_B)])


def _legs(satellite, state, R_NB, R_NP, w_B, w_P):
    """Mass matrix and force of legs, struts and joints, on all twelve speeds."""
    legs = satellite.legs
    motion = leg_motion(
        legs,
        R_NB,
        R_NP,
        state.p_NP_N - state.p_NB_N,
        state.v_NB_N,
        w_B,
        state.v_NP_N,
        w_P,
    )
    rows, inertia = partial_velocities(legs, motion)
    bias = bias_accelerations(legs, motion, w_B, w_P)
    friction = joint_friction(legs, motion, w_B, w_P)
    force = _row_forces(legs, motion, friction) - inertia * bias
    flat = rows.reshape(-1, 12)
    M = flat.T @ (inertia.reshape(-1, 1) * flat)
    f = flat.T @ force.reshape(-1)
    on_plate, on_bus = -jnp.sum(friction[0], axis=0), -jnp.sum(friction[1], axis=0)
    zero = jnp.zeros(3)
    return M, f + jnp.concatenate([zero, on_plate, zero, on_bus])


def partial_velocities(
    legs: Hexapod, motion: LegMotion
) -> tuple[Float[Array, "leg 11 12"], Float[Array, "leg 11"]]:
    """Partial velocities of the eleven leg rates by u, and their inertias."""
    s, length = motion.s, motion.length[:, None, None]
    E = jnp.broadcast_to(jnp.eye(3), (len(s), 3, 3))
    across = (E - s[:, :, None] * s[:, None, :]) / length  # ds/dt = across (v_U - v_A)
    upper, lower = (
        legs.upper.distance[:, None, None] * across,
        legs.lower.distance[:, None, None] * across,
    )
    spin, zero = motion.spin_by_velocity[:, None, :], jnp.zeros((len(s), 10, 3))
    by_v_U = jnp.concatenate([E - upper, lower, across, spin, s[:, None, :]], axis=1)
    by_v_A = jnp.concatenate([upper, E - lower, -across, -spin, -s[:, None, :]], axis=1)
    by_w_B = zero.at[:, 9].set(motion.spin_by_bus_rate)
    by_w_B = jnp.concatenate([by_w_B, jnp.zeros((len(s), 1, 3))], axis=1)
    rows = jnp.concatenate(
        [
            by_v_U,
            jnp.cross(motion.r_U[:, None, :], by_v_U),
            by_v_A,
            jnp.cross(motion.r_A[:, None, :], by_v_A) + by_w_B,
        ],
        axis=2,
    )
    I_t = legs.upper.transverse_inertia + legs.lower.transverse_inertia
    I_a = legs.upper.axial_inertia + legs.lower.axial_inertia
    m_u, m_d = legs.upper.mass, legs.lower.mass
    inertia = jnp.stack([m_u, m_u, m_u, m_d, m_d, m_d, I_t, I_t, I_t, I_a, 0.0 * I_a], axis=1)
    return rows, inertia


def bias_accelerations(
    legs: Hexapod, motion: LegMotion, w_B: Float[Array, "3"], w_P: Float[Array, "3"]
) -> Float[Array, "leg 11"]:
    """Accelerations of the eleven leg rates at du/dt = 0 (the last, of the length, is not used)."""
    s, length, s_rate = motion.s, motion.length[:, None], motion.s_rate
    a_U = jnp.cross(w_P, jnp.cross(w_P, motion.r_U))
    a_A = jnp.cross(w_B, jnp.cross(w_B, motion.r_A))
    s_bias = direction_acceleration(motion, a_U - a_A)
    # w_s = n / (1 - kappa^2), n = w_B . s - kappa w_B . k + kappa (k x s) . ds/dt
    kappa, k = motion.kappa, motion.k
    k_rate = jnp.cross(w_B, k)
    side = jnp.cross(k, s)
    kappa_rate = _dot(k_rate, s) + _dot(k, s_rate)
    n_rate = (
        s_rate @ w_B
        + kappa_rate * (_dot(side, s_rate) - k @ w_B)
        + kappa * (_dot(jnp.cross(k_rate, s), s_rate) + _dot(side, s_bias))
    )
    spin_bias = (n_rate + 2.0 * kappa * kappa_rate * motion.spin) / (1.0 - kappa**2)
    return jnp.concatenate(
        [
            a_U - legs.upper.distance[:, None] * s_bias,
            a_A + legs.lower.distance[:, None] * s_bias,
            s_bias,
            spin_bias[:, None],
            jnp.zeros_like(length),
        ],
        axis=1,
    )


def direction_acceleration(
    motion: LegMotion, a_rel: Float[Array, "leg 3"]
) -> Float[Array, "leg 3"]:
    """Second derivative of the legs' directions for the joints' relative acceleration a_U - a_A."""
    s, length, s_rate = motion.s, motion.length[:, None], motion.s_rate
    across = a_rel - _dot(s, a_rel)[:, None] * s
    turning = _dot(s_rate, s_rate)[:, None] * s
    return (across - 2.0 * motion.length_rate[:, None] * s_rate) / length - turning


def joint_friction(
    legs: Hexapod, motion: LegMotion, w_B: Float[Array, "3"], w_P: Float[Array, "3"]
) -> Float[Array, "2 leg 3"]:
    """Friction torques [N m] on the legs at their spherical and at their universal joints."""
    w = motion.w
    return jnp.stack(
        [
            -legs.spherical_friction[:, None] * (w - w_P),
            -legs.universal_friction[:, None] * (w - w_B),
        ]
    )


def _row_forces(legs, motion, friction):
    """Forces along the eleven leg rates: gyroscopic torque of the spin, friction, strut."""
    s, torque = motion.s, friction[0] + friction[1]
    I_a = legs.upper.axial_inertia + legs.lower.axial_inertia
    gyroscopic = (I_a * motion.spin)[:, None] * motion.s_rate
    zero = jnp.zeros((len(s), 6))
    along_direction = jnp.cross(torque - gyroscopic, s)
    along_spin = _dot(torque, s)[:, None]
    along_length = -legs.strut_force(motion.length, motion.length_rate)[:, None]
    return jnp.concatenate([zero, along_direction, along_spin, along_length], axis=1)


def _dot(a: Float[Array, "leg 3"], b: Float[Array, "leg 3"]) -> Float[Array, " leg"]:
    return jnp.sum(a * b, axis=1)
