"""Motion of the legs from the motion of the two bodies they join (Zhang and Xu, eq. 4-18).

All vectors are along the axes of the bodies' motions. P is the upper body, B the base.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.motion import Motion
from quietbus.spatial.vector import cross, dot, rotate


class Geometry(eqx.Module):
    """Where the joints of all legs are."""

    p_PU_P: Float[Array, "leg 3"]  # [m] spherical joints in the frame P of the upper body
    p_BA_B: Float[Array, "leg 3"]  # [m] universal joints in the frame B of the base
    k_B: Float[Array, "leg 3"]  # [-] unit fixed axes of the universal joints, base frame
    nominal_length: Float[Array, " leg"]  # [m] with both bodies in their nominal pose


class LegMotion(eqx.Module):
    """Positions and rates of all legs at one instant."""

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
    spin_by_base_rate: Float[Array, "leg 3"]  # [-] d w_s / d w_B
    w: Float[Array, "leg 3"]  # [rad/s] angular velocity (eq. 12)


def leg_motion(legs: Geometry, P: Motion, B: Motion) -> LegMotion:
    """Kinematics of all legs (eq. 4-18).

    A universal joint lets the leg turn about k and about y = k x s, so the leg's angular velocity
    *relative to the base* has no component along h = y x k: ``(w_leg - w_B) . h = 0``. With
    kappa = k . s this gives the spin about the leg's own axis,

        w_s = [w_B . s - kappa w_B . k + kappa (k x s) . ds/dt] / (1 - kappa^2).

    (The paper's eq. 12 leaves w_B out: docs/theory.md.)
    """
    r_U = rotate(P.R_AX, legs.p_PU_P)
    r_A = rotate(B.R_AX, legs.p_BA_B)
    k = rotate(B.R_AX, legs.k_B)
    span = P.p - B.p + r_U - r_A
    length = jnp.sqrt(dot(span, span))
    s = span / length[:, None]
    v_rel = P.v - B.v + cross(P.w, r_U) - cross(B.w, r_A)
    length_rate = dot(s, v_rel)
    s_rate = (v_rel - length_rate[:, None] * s) / length[:, None]
    kappa, side = dot(k, s), cross(k, s)
    lever = 1.0 / (1.0 - kappa**2)
    spin_by_velocity = (kappa * lever / length)[:, None] * side
    spin_by_base_rate = lever[:, None] * (s - kappa[:, None] * k)
    spin = dot(spin_by_velocity, v_rel) + dot(spin_by_base_rate, B.w)
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
        spin_by_base_rate,
        w,
    )


class LegAccelerations(eqx.Module):
    """Second derivatives of the legs' motion."""

    a_U: Float[Array, "leg 3"]  # [m/s^2] of the spherical joint
    a_A: Float[Array, "leg 3"]  # [m/s^2] of the universal joint
    s: Float[Array, "leg 3"]  # [1/s^2] of the direction
    spin: Float[Array, " leg"]  # [rad/s^2] of the spin about the leg's axis


def leg_accelerations(
    motion: LegMotion, P: Motion, B: Motion, u_rate: Float[Array, "12"]
) -> LegAccelerations:
    """Accelerations of all legs (eq. 8, 9, 13-19).

    Args:
        u_rate: (12,) accelerations dv_P, dw_P, dv_B, dw_B of both bodies [m/s^2, rad/s^2].
    """
    dv_P, dw_P, dv_B, dw_B = u_rate.reshape(4, 3)
    w_B, w_P, s, s_rate = B.w, P.w, motion.s, motion.s_rate
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
