"""Constraint forces in the legs' joints (Zhang and Xu, eq. 22-26).

The paper's eq. 22 takes the leg's moment of inertia about the universal joint as if the upper part
did not slide: it lacks the Coriolis term ``2 m_u |r_u| (dl/dt) s x (w x s)``. Here Newton's and
Euler's equations are written for the two parts with their own accelerations, so it is in.
"""

import equinox as eqx
from jaxtyping import Array, Float

from quietbus.model.legs.inertia import LegBodies, joint_friction
from quietbus.model.legs.kinematics import LegMotion, leg_accelerations
from quietbus.model.motion import Motion
from quietbus.spatial.vector import cross, dot


class JointForces(eqx.Module):
    """Forces and torque that the joints exert on each leg, along the axes of the motions."""

    spherical_force: Float[Array, "leg 3"]  # [N] F_s, plate on upper part
    universal_force: Float[Array, "leg 3"]  # [N] F_u, base on lower part
    universal_moment: Float[Array, " leg"]  # [N m] M_u, base on lower part, about h
    universal_axis: Float[Array, "leg 3"]  # [-] h, normal to both axes of the universal joint


def joint_forces(
    legs: LegBodies,
    motion: LegMotion,
    P: Motion,
    B: Motion,
    u_rate: Float[Array, "12"],
    tension: Float[Array, " leg"],
) -> JointForces:
    """Joint forces from the motion and its accelerations.

    Args:
        u_rate: (12,) accelerations dv_P, dw_P, dv_B, dw_B of both bodies [m/s^2, rad/s^2].
        tension: (leg,) of the struts [N].
    """
    second = leg_accelerations(motion, P, B, u_rate)
    friction = joint_friction(legs, motion, P, B)
    s, length = motion.s, motion.length[:, None]
    m_u, m_d = legs.upper.mass[:, None], legs.lower.mass[:, None]
    d_u, d_d = legs.upper.distance[:, None], legs.lower.distance[:, None]
    a_u = second.a_U - d_u * second.s
    a_d = second.a_A + d_d * second.s
    # rate of the leg's spin momentum I_t s x ds/dt + I_a w_s s
    I_t = (legs.upper.transverse_inertia + legs.lower.transverse_inertia)[:, None]
    I_a = (legs.upper.axial_inertia + legs.lower.axial_inertia)[:, None]
    momentum_rate = I_t * cross(s, second.s) + I_a * (
        second.spin[:, None] * s + motion.spin[:, None] * motion.s_rate
    )
    # Euler about the universal joint A: C = S x F_s + M_u h
    inertia = momentum_rate + cross((length - d_u) * s, m_u * a_u) + cross(d_d * s, m_d * a_d)
    C = inertia - friction.at_U - friction.at_A
    h = s - motion.kappa[:, None] * motion.k
    h = h / (dot(h, h) ** 0.5)[:, None]
    moment = dot(s, C) / dot(s, h)
    # along s, Newton for the upper part: m_u a_u = F_s - (strut tension) s
    along = (m_u[:, 0] * dot(s, a_u) + tension)[:, None] * s
    across = cross(C - moment[:, None] * h, s) / length
    F_s = along + across
    return JointForces(F_s, m_u * a_u + m_d * a_d - F_s, moment, h)
