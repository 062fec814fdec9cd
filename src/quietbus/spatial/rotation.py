"""Rotation matrices, unit quaternions and rotation vectors.

Quaternions are Hamilton's, scalar first; ``q_NB`` stands for ``R_NB``, the matrix that takes
components in frame B to components in frame N (docs/notation.md).
"""

import jax.numpy as jnp
from jaxtyping import Array, Float


def skew(a: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """Matrix of the cross product: ``skew(a) @ b == cross(a, b)``."""
    x, y, z = a
    return jnp.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_vector_to_matrix(theta: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """Matrix of the right-handed turn by abs(theta) [rad] about theta (Rodrigues)."""
    return quaternion_to_matrix(rotation_vector_to_quaternion(theta))


def rotation_vector_to_quaternion(theta: Float[Array, "3"]) -> Float[Array, "4"]:
    """Unit quaternion of the turn by abs(theta) [rad] about theta; smooth at zero."""
    square = theta @ theta
    small = square < 1e-8
    angle = jnp.sqrt(jnp.where(small, 1.0, square))
    # sin(x/2)/x and cos(x/2) by their series near zero, so that derivatives exist there
    scale = jnp.where(small, 0.5 - square / 48.0, jnp.sin(0.5 * angle) / angle)
    scalar = jnp.where(small, 1.0 - square / 8.0, jnp.cos(0.5 * angle))
    return jnp.concatenate([scalar[None], scale * theta])


def quaternion_to_matrix(q: Float[Array, "4"]) -> Float[Array, "3 3"]:
    """Rotation matrix of a quaternion, which need not be normalised."""
    w, x, y, z = q / jnp.sqrt(q @ q)
    return jnp.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_multiply(a: Float[Array, "4"], b: Float[Array, "4"]) -> Float[Array, "4"]:
    """Hamilton product: ``q_NC = quaternion_multiply(q_NB, q_BC)``."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return jnp.array(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ]
    )


def quaternion_conjugate(q: Float[Array, "4"]) -> Float[Array, "4"]:
    """Inverse of a unit quaternion."""
    return q * jnp.array([1.0, -1.0, -1.0, -1.0])


def quaternion_rate(q_NB: Float[Array, "4"], w_NB_B: Float[Array, "3"]) -> Float[Array, "4"]:
    """Time derivative of ``q_NB`` [1/s] for the angular velocity ``w_NB_B`` [rad/s]."""
    return 0.5 * quaternion_multiply(q_NB, jnp.concatenate([jnp.zeros(1), w_NB_B]))


def quaternion_normalize(q: Float[Array, "4"]) -> Float[Array, "4"]:
    """The quaternion at unit length."""
    return q / jnp.sqrt(q @ q)


def attitude_error(q_NR: Float[Array, "4"], q_NB: Float[Array, "4"]) -> Float[Array, "3"]:
    """Twice the vector part of the shortest turn from reference R to body B [rad], in B."""
    q_RB = quaternion_multiply(quaternion_conjugate(q_NR), q_NB)
    return 2.0 * jnp.where(q_RB[0] < 0.0, -1.0, 1.0) * q_RB[1:]


def quaternion_to_rotation_vector(q: Float[Array, "4"]) -> Float[Array, "3"]:
    """Shortest rotation vector [rad] of a unit quaternion."""
    q = jnp.where(q[0] < 0.0, -q, q)
    square = q[1:] @ q[1:]
    small = square < 1e-16
    norm = jnp.sqrt(jnp.where(small, 1.0, square))
    return q[1:] * jnp.where(small, 2.0, 2.0 * jnp.arctan2(norm, q[0]) / norm)
