"""Root mean square above a frequency, over the whole stretch."""

import numpy as np

from quietbus.analysis.pointing.judges.base import ALL, LOOKS, Judge, in_parts
from quietbus.analysis.pointing.motion import ImageMotion
from quietbus.analysis.pointing.noise import ANGLES
from quietbus.analysis.pointing.statistic import Phases
from quietbus.analysis.pointing.windows import Metric, weight


class BandJudge(Judge):
    """Of rms. Noise has its mean square in every member."""

    noisy = False

    def __init__(
        self, motion: ImageMotion, metric: Metric, stretch: tuple[float, float], effort: float
    ):
        super().__init__(motion, metric, stretch, effort)
        self.slow = motion.signal.mean_square_above(metric.above, *stretch)  # (c, c)

    @property
    def slow_mean_square(self) -> float:
        """Of the signal alone, in this metric."""
        return float(np.trace(self.slow))

    def average(self, phases: Phases) -> float:
        """Root mean square over windows and members."""
        return self.root_mean_square(phases)

    def quantile(
        self,
        confidence: float,
        turns: np.ndarray,
        which: np.ndarray | slice = ALL,
        _: int = ANGLES,
    ) -> float:
        """Of the metric in windows ``which`` for members (n or 1, rotor), all together."""
        return float(np.quantile(in_parts(self._values, turns, which), confidence))

    def _values(self, turns: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        z = self.phasors(turns, which)
        share = weight(self.metric, self.f)
        lines = 0.5 * np.einsum("g,ngc->n", share, np.abs(z) ** 2)
        return np.sqrt(self.slow_mean_square + np.sum(self.noise_powers) + lines)

    def over_time(self, members: np.ndarray, _: np.ndarray) -> np.ndarray:
        """Largest value (n,) at any time for members (n, rotor)."""
        each = [self._values(members, np.full(len(members), k)) for k in self.looks(4 * LOOKS)]
        return np.max(each, axis=0)

    def largest_noise(self, chance: np.ndarray) -> np.ndarray:
        """None beyond its mean square."""
        return np.zeros(len(chance))
