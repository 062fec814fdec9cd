"""The gimbal angles at which jitter is largest."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

SEARCHED = 64  # sets of gimbal angles looked at together


@dataclass(frozen=True)
class WorstAngles:
    """Gimbal angles at which jitter is largest."""

    gimbal_angle: np.ndarray  # (cmg,) [rad], within -pi to pi
    value: float  # what was sought, there
    evaluations: int


def worst_angles(measure: Callable[[np.ndarray], np.ndarray], count: int) -> WorstAngles:
    """Search all gimbal angles for the largest value of a measure.

    Differential evolution from a Sobol sample, always with the same seed.

    Args:
        measure: of (SEARCHED, count) angles at once, (SEARCHED,).
        count: number of CMGs.
    """
    start = qmc.scale(qmc.Sobol(count, seed=1).random(SEARCHED), -np.pi, np.pi)
    found = differential_evolution(
        lambda angles: -measure(angles.T),
        [(-np.pi, np.pi)] * count,
        init=start,
        maxiter=120,
        tol=1e-6,
        seed=1,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    return WorstAngles(found.x, -float(found.fun), SEARCHED * int(found.nfev))
