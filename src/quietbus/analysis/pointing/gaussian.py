"""Of a Gaussian deviation with one or two components."""

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from quietbus.analysis.pointing.statistic import Statistic


def gaussian_radius(confidence: float, covariance: np.ndarray) -> float:
    """Distance within which a Gaussian deviation stays with probability ``confidence``.

    Of one component abs(x), of two the length of the vector; of equal variances that is
    Rayleigh's ``sigma sqrt(-2 ln(1 - p))``. An ergodic process has the same over time, so that
    temporal and mixed interpretation agree.

    Args:
        covariance: (c, c), c = 1 or 2.
    """
    Statistic(confidence)
    size = np.linalg.eigvalsh(np.atleast_2d(covariance))
    if len(size) > 2:
        raise ValueError(f"image motion has one or two components, got {len(size)}")
    variances = size[size > 1e-14 * size[-1]] if size[-1] > 0.0 else size[:0]
    if not len(variances):
        return 0.0
    angle = np.pi * (np.arange(4096) + 0.5) / 4096
    low, high = variances[0], variances[-1]

    def beyond(ratio: float) -> float:
        """Probability of more than ``ratio`` times the larger sigma."""
        if len(variances) == 1:
            return float(2.0 * norm.sf(ratio))
        # polar coordinates: the radius integrates in closed form for each direction
        precision = np.cos(angle) ** 2 / high + np.sin(angle) ** 2 / low
        tail = np.exp(-0.5 * ratio**2 * high * precision) / precision
        return float(np.mean(tail) / np.sqrt(low * high))

    ratio = brentq(lambda r: beyond(r) - (1.0 - confidence), 0.0, 40.0, xtol=1e-12)
    return float(ratio * np.sqrt(high))
