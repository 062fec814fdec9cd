"""Noise in the windows of a metric that is linear in the motion: Gaussian as the noise is."""

import numpy as np

from quietbus.analysis.pointing.noise import ANGLES, Noise, largest, quantile, root
from quietbus.analysis.pointing.windows import Metric, gain

INSTANTS = np.linspace(0.0, 0.5, 17)  # of an RPE, in shares of the window from its middle
TIMES = 5  # in a stretch, at which the noise's largest value is looked at


class DeviationNoise:
    """Of a metric that is linear in the motion: Gaussian, like the noise."""

    def __init__(
        self,
        noise: Noise,
        metric: Metric,
        centers: np.ndarray,
        at: np.ndarray,
        stretch: tuple[float, float],
    ):
        self.noise, self.metric, (start, end) = noise, metric, stretch
        self.duration = max(0.0, end - start - metric.span)
        half = 0.5 * metric.span
        self.times = np.linspace(start + half, start + half + self.duration, TIMES)
        if metric.name == "RPE":
            each = np.stack([self._products(instant) for instant in INSTANTS])
            inside = np.stack([noise.at(centers, one) for one in each])  # (instant, n, c, c)
            place = np.abs(at) / INSTANTS[1]
            left = np.minimum(place.astype(int), len(INSTANTS) - 2)
            part, n = (place - left)[:, None, None], np.arange(len(centers))
            self.covariance = (1.0 - part) * inside[left, n] + part * inside[left + 1, n]
        else:
            self.covariance = noise.at(centers, self._products(0.0))
        self.spread = root(self.covariance)

    def _products(self, instant: float, moment: int = 0) -> np.ndarray:
        """(look, c, c) of all contributors together."""
        share = lambda f: np.abs(gain(self.metric, f, instant)) ** 2  # noqa: E731
        return self.noise.weighted(self.metric, share, moment).sum(axis=1)

    def quantile(
        self,
        confidence: float,
        deviation: np.ndarray,
        which: np.ndarray | slice,
        angles: int = ANGLES,
    ) -> float:
        """Of the length of deviations (n, c) in windows ``which`` with the noise on them."""
        return quantile(confidence, deviation, self.spread[which], angles)

    def largest(self, probability: np.ndarray) -> np.ndarray:
        """Radius (q,) that the noise alone does not leave in the stretch, of an RPE at any instant.

        Of an RPE with the largest gain that each frequency has at any instant: an upper bound.
        """
        instants = INSTANTS[:, None] if self.metric.name == "RPE" else np.zeros((1, 1))

        def share(f):
            return np.max([np.abs(gain(self.metric, f, x)) ** 2 for x in instants], axis=0)

        value, moving = (
            self.noise.at(self.times, self.noise.weighted(self.metric, share, moment).sum(axis=1))
            for moment in (0, 2)
        )
        return largest(probability, value, moving, self.duration)


class NoDeviationNoise:
    """No noise: deviations are as they are."""

    def quantile(
        self,
        confidence: float,
        deviation: np.ndarray,
        _: np.ndarray | slice,
        __: int = ANGLES,
    ) -> float:
        """Of the length of deviations (n, c)."""
        return float(np.quantile(np.linalg.norm(deviation, axis=1), confidence))

    def largest(self, probability: np.ndarray) -> np.ndarray:
        """Zero (q,)."""
        return np.zeros(len(probability))
