"""A rigid body, or several."""

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Body:
    """A rigid body; several of them have a leading axis on every field."""

    mass: Any  # [kg]
    centre: np.ndarray  # (..., 3) [m] in its frame
    inertia: np.ndarray  # (..., 3, 3) [kg m^2] about its mass centre
