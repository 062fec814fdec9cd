"""Motion of the legs from the motion of the two plates (Zhang and Xu, eq. 4-18)."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.hexapod import Hexapod
from quietbus.spatial.vector import cross, dot, rotate


class PlateMotion(eqx.Module):
    """Pose and speeds of bus and plate, inertial components."""

    R_NB: Float[Array, "3 3"]
    R_NP: Float[Array, "3 3"]
    p_BP: Float[Array, "3"]  # [m] from the origin of B to that of P
    v_B: Float[Array, "3"]  # [m/s] of the origin of B
    w_B: Float[Array, "3"]  # [rad/s]
    v_P: Float[Array, "3"]  # [m/s] of the origin of P
    w_P: Float[Array, "3"]  # [rad/s]


class LegMotion(eqx.Module):
    """Positions and rates of all legs at one instant, inertial components."""

    r_U: Float[Array, "leg 3"]  # [m] spherical joint from the origin of P
    r_A: Float[Array, "leg 3"]  # [m] universal joint from the origin of B
    length: Float[Array, " leg"]  # [m]
    s: Float[Array, "leg 3"]  # [-] unit vector from A to U
    length_rate: Float[Array, " leg"]  # [m/s]
    s_rate: Float[Array, "leg 3"]  # [1/s]
    k: Float[Array, "leg 3"]  # [-] fixed axis of the universal joint
    side: Float[Array, "leg 3"]  # [-] k x s, along the moving axis
    kappa: Float[Array, " leg"]  # [-] k . s: 0 at right angles, +-1 where the joint locks
    spin: Float[Array, " leg"]  # [rad/s] leg's angular velocity about its own axis, w_s
    spin_by_velocity: Float[Array, "leg 3"]  # [1/m] d w_s / d(v_U - v_A)
    spin_by_bus_rate: Float[Array, "leg 3"]  # [-] d w_s / d w_B
    w: Float[Array, "leg 3"]  # [rad/s] angular velocity (eq. 12)


def leg_motion(legs: Hexapod, plates: PlateMotion) -> LegMotion:
    """Kinematics of all legs (eq. 4-18).

    A universal joint lets the leg turn about k and about y = k x s, so the leg's angular velocity
    *relative to the base* has no component along h = y x k: ``(w_leg - w_B) . h = 0``. With
    kappa = k . s this gives the spin about the leg's own axis,

        w_s = [w_B . s - kappa w_B . k + kappa (k x s) . ds/dt] / (1 - kappa^2).

    (The paper's eq. 12 leaves w_B out: docs/theory.md.)
    """
    r_U = rotate(plates.R_NP, legs.p_PU_P)
    r_A = rotate(plates.R_NB, legs.p_BA_B)
    k = rotate(plates.R_NB, legs.k_B)
    span = plates.p_BP + r_U - r_A
    length = jnp.sqrt(dot(span, span))
    s = span / length[:, None]
    v_rel = plates.v_P + cross(plates.w_P, r_U) - plates.v_B - cross(plates.w_B, r_A)
    length_rate = dot(s, v_rel)
    s_rate = (v_rel - length_rate[:, None] * s) / length[:, None]
    kappa, side = dot(k, s), cross(k, s)
    lever = 1.0 / (1.0 - kappa**2)
    spin_by_velocity = (kappa * lever / length)[:, None] * side
    spin_by_bus_rate = lever[:, None] * (s - kappa[:, None] * k)
    spin = dot(spin_by_velocity, v_rel) + dot(spin_by_bus_rate, plates.w_B)
    w = cross(s, s_rate) + spin[:, None] * s
    return LegMotion(
        r_U,
        r_A,
        length,
        s,
        length_rate,
        s_rate,
        k,
        side,
        kappa,
        spin,
        spin_by_velocity,
        spin_by_bus_rate,
        w,
    )


class LegAccelerations(eqx.Module):
    """Second derivatives of the legs' motion, inertial components."""

    a_U: Float[Array, "leg 3"]  # [m/s^2] of the spherical joint
    a_A: Float[Array, "leg 3"]  # [m/s^2] of the universal joint
    s: Float[Array, "leg 3"]  # [1/s^2] of the direction
    spin: Float[Array, " leg"]  # [rad/s^2] of the spin about the leg's axis


def leg_accelerations(
    motion: LegMotion,
    plates: PlateMotion,
    dv_B: Float[Array, "3"],
    dw_B: Float[Array, "3"],
    dv_P: Float[Array, "3"],
    dw_P: Float[Array, "3"],
) -> LegAccelerations:
    """Accelerations of all legs (eq. 8, 9, 13-19) for accelerations of the two plates.

    Args:
        dv_B, dv_P: (3,) of the plates' origins [m/s^2].
        dw_B, dw_P: (3,) angular [rad/s^2].
    """
    w_B, w_P, s, s_rate = plates.w_B, plates.w_P, motion.s, motion.s_rate
    a_U = dv_P + cross(dw_P, motion.r_U) + cross(w_P, cross(w_P, motion.r_U))
    a_A = dv_B + cross(dw_B, motion.r_A) + cross(w_B, cross(w_B, motion.r_A))
    a_rel = a_U - a_A
    across = a_rel - dot(s, a_rel)[:, None] * s - 2.0 * motion.length_rate[:, None] * s_rate
    ds_rate = across / motion.length[:, None] - dot(s_rate, s_rate)[:, None] * s
    # w_s = n / (1 - kappa^2), n = w_B . s - kappa w_B . k + kappa (k x s) . ds/dt
    kappa, k, side = motion.kappa, motion.k, motion.side
    k_rate = cross(w_B, k)
    kappa_rate = dot(k_rate, s) + dot(k, s_rate)
    n_rate = (
        dot(dw_B, s - kappa[:, None] * k)
        + dot(w_B, s_rate)
        + kappa_rate * (dot(side, s_rate) - dot(w_B, k))
        + kappa * (dot(cross(k_rate, s), s_rate) + dot(side, ds_rate))
    )
    spin = (n_rate + 2.0 * kappa * kappa_rate * motion.spin) / (1.0 - kappa**2)
    return LegAccelerations(a_U, a_A, ds_rate, spin)
