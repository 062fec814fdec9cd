"""The legs' parts as rigid bodies, joint by joint: a check that shares nothing with ``inertia``."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.element import RigidParts
from quietbus.model.legs.inertia import LegBodies
from quietbus.model.legs.kinematics import Geometry
from quietbus.model.motion import Motion


class JointMotion(eqx.Module):
    """Ends of the legs, and relative motion in the legs and their joints."""

    p_A: Float[Array, "leg 3"]  # [m]
    v_A: Float[Array, "leg 3"]  # [m/s]
    p_U: Float[Array, "leg 3"]  # [m]
    v_U: Float[Array, "leg 3"]  # [m/s]
    length: Float[Array, " leg"]  # [m]
    length_rate: Float[Array, " leg"]  # [m/s]
    s: Float[Array, "leg 3"]  # [-] from A to U
    w: Float[Array, "leg 3"]  # [rad/s] of the legs


def joint_motion(legs: Geometry, P: Motion, B: Motion) -> JointMotion:
    """Motion of the legs, joint by joint.

    A leg turns in the base at alpha about k and at beta about y = k x s. With ``d`` the velocity
    of s as the base sees it, ``d = alpha y + beta (y x s)``, and y is normal to y x s, both of
    length ``abs(y)``.
    """
    r_A, r_U, k = legs.p_BA_B @ B.R_AX.T, legs.p_PU_P @ P.R_AX.T, legs.k_B @ B.R_AX.T
    p_A, v_A = B.p + r_A, B.v + jnp.cross(B.w, r_A)
    p_U, v_U = P.p + r_U, P.v + jnp.cross(P.w, r_U)
    span = p_U - p_A
    length = jnp.linalg.norm(span, axis=1)
    s = span / length[:, None]
    length_rate = _dot(s, v_U - v_A)
    d = (v_U - v_A - length_rate[:, None] * s) / length[:, None] - jnp.cross(B.w, s)
    y = jnp.cross(k, s)
    alpha, beta = _dot(d, y) / _dot(y, y), _dot(d, jnp.cross(y, s)) / _dot(y, y)
    w = B.w + alpha[:, None] * k + beta[:, None] * y
    return JointMotion(p_A, v_A, p_U, v_U, length, length_rate, s, w)


def leg_rigid_parts(legs: LegBodies, joints: JointMotion) -> RigidParts:
    """Lower, then upper parts of all legs."""
    ss = joints.s[:, :, None] * joints.s[:, None, :]
    parts = []
    for part, p, v, side in (
        (legs.lower, joints.p_A, joints.v_A, 1.0),
        (legs.upper, joints.p_U, joints.v_U, -1.0),
    ):
        across, along = part.transverse_inertia[:, None, None], part.axial_inertia[:, None, None]
        r = side * part.distance[:, None] * joints.s
        inertia = across * (jnp.eye(3) - ss) + along * ss
        parts.append((part.mass, inertia, p + r, v + jnp.cross(joints.w, r), joints.w))
    return RigidParts(*(jnp.concatenate(pair) for pair in zip(*parts, strict=True)))


def _dot(a: Float[Array, "leg 3"], b: Float[Array, "leg 3"]) -> Float[Array, " leg"]:
    return jnp.sum(a * b, axis=1)
