"""Inertia tensors: shifting them and judging whether matter can have them."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def point_inertia(mass: Float[Array, ""], r: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """Inertia [kg m^2] of a point mass at r [m] (the parallel-axis term)."""
    return mass * ((r @ r) * jnp.eye(3) - jnp.outer(r, r))


def inertia_defect(inertia: np.ndarray, relative_tolerance: float = 1e-9) -> str | None:
    """Why no rigid body can have this inertia matrix, or None if one can.

    A body's principal moments are positive, and each is at most the sum of the other two (the
    triangle inequality: the second moments of mass are not negative).
    """
    inertia = np.asarray(inertia, dtype=float)
    if not np.allclose(inertia, inertia.T, rtol=0.0, atol=1e-9 * np.abs(inertia).max()):
        return "it is not symmetric"
    principal = np.linalg.eigvalsh(inertia)
    listed = ", ".join(f"{value:.6g}" for value in principal)
    if principal[0] <= 0.0:
        return f"it is not positive definite: its principal moments are {listed} kg m^2"
    if principal[2] > (principal[0] + principal[1]) * (1.0 + relative_tolerance):
        return (
            f"its principal moments {listed} kg m^2 break the triangle inequality: "
            "the largest exceeds the sum of the other two, which no mass distribution can do"
        )
    return None
