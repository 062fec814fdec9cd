"""Numbers of a scenario as arrays of the model.

Plain NumPy on purpose: hundreds of small JAX operations would each be compiled on their own.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation


def array(value: Any) -> jax.Array:
    """Of doubles."""
    return jnp.asarray(np.asarray(value, dtype=float))


def limit(value: float | None) -> jax.Array:
    """A limit, infinite where there is none."""
    return array(np.inf if value is None else value)


def rotation(angles: tuple[float, float, float]) -> Rotation:
    """Turn by [roll, pitch, yaw] [rad], 3-2-1 sequence."""
    return Rotation.from_euler("ZYX", angles[::-1])


def quaternion(turn: Rotation) -> np.ndarray:
    """Hamilton quaternion, scalar first."""
    return np.roll(turn.as_quat(), 1)
