"""Inertia of and forces on the legs in the speeds (v_P, w_P, v_B, w_B) of the bodies they join.

A leg's kinetic energy is that of two point masses at its ends, joined, plus what its direction s
singles out (docs/theory.md):

    2 T = a |v_U|^2 + 2 b v_U . v_A + d |v_A|^2
          + (m_u - a) (s.v_U)^2 - 2 b (s.v_U)(s.v_A) + (m_d - d) (s.v_A)^2 + I_a w_s^2

so its mass matrix is an isotropic part, made of 4 x 4 second moments of the joint positions, and
three rows: the leg's line at U, its line at A, and its spin.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.legs.kinematics import LegMotion, leg_accelerations
from quietbus.model.motion import Motion
from quietbus.spatial.rotation import skew
from quietbus.spatial.vector import cross, dot, weighted_products


class LegParts(eqx.Module):
    """Mass properties of the lower or of the upper parts of all legs."""

    mass: Float[Array, " leg"]  # [kg]
    distance: Float[Array, " leg"]  # [m] from the joint at that part's end to its mass centre
    transverse_inertia: Float[Array, " leg"]  # [kg m^2] about the mass centre, across the leg
    axial_inertia: Float[Array, " leg"]  # [kg m^2] about the leg's axis


class LegBodies(eqx.Module):
    """Masses of the legs and friction of their joints."""

    upper: LegParts
    lower: LegParts
    spherical_friction: Float[Array, " leg"]  # [N m s/rad]
    universal_friction: Float[Array, " leg"]  # [N m s/rad]


class JointFriction(eqx.Module):
    """Viscous friction torques on the legs [N m]."""

    at_U: Float[Array, "leg 3"]
    at_A: Float[Array, "leg 3"]


def joint_friction(legs: LegBodies, motion: LegMotion, P: Motion, B: Motion) -> JointFriction:
    """``-c_s (w_leg - w_P)`` at the spherical joints, ``-c_u (w_leg - w_B)`` at the universal."""
    return JointFriction(
        -legs.spherical_friction[:, None] * (motion.w - P.w),
        -legs.universal_friction[:, None] * (motion.w - B.w),
    )


def leg_mass_matrix(legs: LegBodies, motion: LegMotion) -> Float[Array, "12 12"]:
    """Mass matrix of all legs on (v_P, w_P, v_B, w_B)."""
    m_u, m_d, I_t, I_a = _masses(legs)
    up, low = legs.upper.distance / motion.length, legs.lower.distance / motion.length
    turning = I_t / motion.length**2
    a = m_u * (1.0 - up) ** 2 + m_d * low**2 + turning
    b = m_u * (1.0 - up) * up + m_d * (1.0 - low) * low - turning
    d = m_u * up**2 + m_d * (1.0 - low) ** 2 + turning

    one = jnp.ones_like(motion.s[:, :1])
    z_U = jnp.concatenate([one, motion.r_U], axis=1)
    z_A = jnp.concatenate([one, motion.r_A], axis=1)

    line_U = jnp.concatenate([motion.s, cross(motion.r_U, motion.s)], axis=1)
    line_A = jnp.concatenate([motion.s, cross(motion.r_A, motion.s)], axis=1)
    by_v, by_w = motion.spin_by_velocity, motion.spin_by_base_rate
    spin_P = jnp.concatenate([by_v, cross(motion.r_U, by_v)], axis=1)
    spin_B = jnp.concatenate([-by_v, by_w - cross(motion.r_A, by_v)], axis=1)

    PP = (
        _joined_points(weighted_products(a, z_U, z_U))
        + weighted_products(m_u - a, line_U, line_U)
        + weighted_products(I_a, spin_P, spin_P)
    )
    PB = (
        _joined_points(weighted_products(b, z_U, z_A))
        - weighted_products(b, line_U, line_A)
        + weighted_products(I_a, spin_P, spin_B)
    )
    BB = (
        _joined_points(weighted_products(d, z_A, z_A))
        + weighted_products(m_d - d, line_A, line_A)
        + weighted_products(I_a, spin_B, spin_B)
    )
    return jnp.block([[PP, PB], [PB.T, BB]])


def leg_forces(
    legs: LegBodies,
    motion: LegMotion,
    P: Motion,
    B: Motion,
    u_rate: Float[Array, "12"],
    tension: Float[Array, " leg"],
) -> Float[Array, "12"]:
    """Forces of struts, friction and the legs' inertia on (v_P, w_P, v_B, w_B), at their rates.

    Args:
        tension: (leg,) of the struts [N].
    """
    m_u, m_d, I_t, I_a = (value[:, None] for value in _masses(legs))
    bias = leg_accelerations(motion, P, B, u_rate)
    friction = joint_friction(legs, motion, P, B)
    torque, s = friction.at_U + friction.at_A, motion.s
    d_u, d_d = legs.upper.distance[:, None], legs.lower.distance[:, None]
    upper = m_u * (bias.a_U - d_u * bias.s)
    lower = m_d * (bias.a_A + d_d * bias.s)
    # force on ds/dt: torques across the leg, and what its inertia asks for as the leg turns
    across = cross(torque - I_a * motion.spin[:, None] * motion.s_rate, s)
    across = across + d_u * upper - d_d * lower - I_t * bias.s
    across = (across - dot(s, across)[:, None] * s) / motion.length[:, None]
    about = (dot(torque, s) - I_a[:, 0] * bias.spin)[:, None]
    between = across + about * motion.spin_by_velocity - tension[:, None] * s
    f_U, f_A = between - upper, -between - lower
    t_P = cross(motion.r_U, f_U) - friction.at_U
    t_B = cross(motion.r_A, f_A) - friction.at_A + about * motion.spin_by_base_rate
    return jnp.sum(jnp.concatenate([f_U, t_P, f_A, t_B], axis=1), axis=0)


def _masses(legs: LegBodies) -> tuple[Float[Array, " leg"], ...]:
    return (
        legs.upper.mass,
        legs.lower.mass,
        legs.upper.transverse_inertia + legs.lower.transverse_inertia,
        legs.upper.axial_inertia + legs.lower.axial_inertia,
    )


def _joined_points(S: Float[Array, "4 4"]) -> Float[Array, "6 6"]:
    """Matrix on (v, w) x (v', w') of sum w_i v_i . v_i', from S = sum w_i (1, r_i)(1, r_i')^T."""
    second = S[1:, 1:]
    return jnp.block(
        [
            [S[0, 0] * jnp.eye(3), -skew(S[0, 1:])],
            [skew(S[1:, 0]), jnp.trace(second) * jnp.eye(3) - second.T],
        ]
    )
