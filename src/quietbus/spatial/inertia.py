"""Inertia tensors of points."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def point_inertia(mass: Float[Array, ""], r: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """Inertia [kg m^2] of a point mass at r [m] (the parallel-axis term)."""
    return mass * ((r @ r) * jnp.eye(3) - jnp.outer(r, r))
