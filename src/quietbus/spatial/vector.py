"""Products of 3-vectors, written out by component.

A small ``dot`` or ``jnp.cross`` is a kernel of its own for XLA on a CPU; these forms merge with
what surrounds them, and the equations of motion, all of them small, run about twice as fast.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact


def dot(a: Float[Array, "*n 3"], b: Float[Array, "*n 3"]) -> Float[Array, "*n"]:
    """Scalar product over the last axis."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def cross(a: Float[Array, "*n 3"], b: Float[Array, "*n 3"]) -> Float[Array, "*n 3"]:
    """Vector product over the last axis."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return jnp.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def rotate(R: Float[Array, "3 3"], v: Float[Array, "*n 3"]) -> Float[Array, "*n 3"]:
    """``R v`` for one vector or for rows of vectors."""
    return v[..., 0:1] * R[:, 0] + v[..., 1:2] * R[:, 1] + v[..., 2:3] * R[:, 2]


def weighted_products(
    w: Float[Array, " k"], x: Float[Array, "k n"], y: Float[Array, "k m"]
) -> Float[Array, "n m"]:
    """Sum of ``w_k x_k y_k^T`` over rows: ``x.T @ diag(w) @ y``.

    As a matrix product it would be a call into a library, which keeps all that stands around it
    from being compiled in one piece; with it the equations of motion take three times as long.
    """
    return jnp.sum(w[:, None, None] * x[:, :, None] * y[:, None, :], axis=0)


@jax.custom_jvp
def solve_positive_definite(M: Float[Array, "n n"], f: Float[Array, " n"]) -> Float[Array, " n"]:
    """Solve ``M x = f`` for a small symmetric positive definite M by elimination.

    Such a matrix needs no pivoting. A LAPACK call would do the same, but it is opaque to XLA and
    keeps the integrator's loop from being compiled as one piece (see jaxconfig).
    """
    rest = jnp.concatenate([M, f[:, None]], axis=1)
    pivots = []
    for _ in range(len(f)):
        pivot = rest[0] / rest[0, 0]
        pivots.append(pivot)
        rest = rest[1:, 1:] - rest[1:, :1] * pivot[1:]
    x = jnp.zeros(0)
    for pivot in reversed(pivots):
        x = jnp.concatenate([(pivot[-1] - pivot[1:-1] @ x)[None], x])
    return x


@solve_positive_definite.defjvp
def _solve_jvp(primals, tangents):
    """``dx = M^-1 (df - dM x)``, rather than the derivative of every elimination step."""
    (M, f), (dM, df) = primals, tangents
    x = solve_positive_definite(M, f)
    return x, jax.scipy.linalg.solve(M, df - dM @ x, assume_a="pos")


@jax.custom_jvp
@jax.jit  # traced once for many uses
def solve_small(A: Inexact[Array, "n n"], B: Inexact[Array, "n m"]) -> Inexact[Array, "n m"]:
    """Solve ``A X = B`` for a small A by elimination with partial pivoting.

    For many systems at once, under ``vmap``. It is faster there than a LAPACK call for each, and
    XLA on a CPU can wait for ever for several batches of such calls in one program.
    """
    rest = jnp.concatenate([A, B], axis=1)
    eliminated = []
    for _ in range(len(A)):
        # the row of the largest entry changes places with the first one
        largest = jnp.argmax(jnp.abs(rest[:, 0])) == jnp.arange(len(rest))
        row = jnp.sum(jnp.where(largest[:, None], rest, 0.0), axis=0)
        rest = jnp.where(largest[:, None], rest[0], rest)[1:]
        row = row / row[0]
        rest = rest[:, 1:] - rest[:, :1] * row[1:]
        eliminated.append(row[1:])
    X = jnp.zeros((0, B.shape[1]), rest.dtype)
    for row in reversed(eliminated):
        known = len(X)
        X = jnp.concatenate([row[None, known:] - row[None, :known] @ X, X])
    return X


@solve_small.defjvp
def _solve_small_jvp(primals, tangents):
    """``dX = A^-1 (dB - dA X)``."""
    (A, B), (dA, dB) = primals, tangents
    X = solve_small(A, B)
    return X, solve_small(A, dB - dA @ X)
