"""Jitter: what is left in an exposure window of motion about its mean and slope."""

import numpy as np

from quietbus.analysis.pointing.chi_square import MeanSquare, joined, quantile
from quietbus.analysis.pointing.judges.base import (
    ALL,
    LOOKS,
    SMOOTH_DRAWS,
    TRIED_IN_NOISE,
    Judge,
    in_parts,
    parts,
)
from quietbus.analysis.pointing.judges.inside import Inside
from quietbus.analysis.pointing.motion import ImageMotion
from quietbus.analysis.pointing.noise import ANGLES
from quietbus.analysis.pointing.statistic import Phases
from quietbus.analysis.pointing.window_noise import WindowNoise
from quietbus.analysis.pointing.windows import Metric


class JitterJudge(Judge):
    """What is known for each member is its mean square in a window."""

    noisy = False

    def __init__(
        self, motion: ImageMotion, metric: Metric, stretch: tuple[float, float], effort: float
    ):
        super().__init__(motion, metric, stretch, effort)
        slow = motion.signal.windows(self.centers, metric.window)
        self.inside = Inside(slow, metric.window, self.f)

    @property
    def slow_mean_square(self) -> float:
        """Of the signal alone, in this metric."""
        return float(np.mean(np.trace(self.inside.slow.about_line, axis1=1, axis2=2)))

    def average(self, phases: Phases) -> float:
        """Root mean square over windows and members."""
        return self.root_mean_square(phases)

    def known(self, z: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        """Mean square (n,) in windows of slow motion and lines with phasors (n, group, c)."""
        return np.trace(self.inside.covariance(z, which), axis1=1, axis2=2)

    def largest_noise(self, chance: np.ndarray) -> np.ndarray:
        """None: it is in ``over_time``."""
        return np.zeros(len(chance))


class QuietJitterJudge(JitterJudge):
    """Without noise."""

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
        return np.sqrt(np.maximum(self.known(self.phasors(turns, which), which), 0.0))

    def over_time(self, members: np.ndarray, _: np.ndarray) -> np.ndarray:
        """Largest value (n,) at any time for members (n, rotor)."""
        each = [self._values(members, np.full(len(members), k)) for k in self.looks(4 * LOOKS)]
        return np.max(each, axis=0)


class NoisyJitterJudge(JitterJudge):
    """With noise, which makes the mean square a sum of chi-squares."""

    noisy = True
    tried = TRIED_IN_NOISE
    drawn = SMOOTH_DRAWS

    def __init__(
        self, motion: ImageMotion, metric: Metric, stretch: tuple[float, float], effort: float
    ):
        super().__init__(motion, metric, stretch, effort)
        slow = self.inside.slow.coefficients
        self.within = WindowNoise(self.noise, metric.window, self.centers, self.f, slow)

    def quantile(
        self,
        confidence: float,
        turns: np.ndarray,
        which: np.ndarray | slice = ALL,
        angles: int = ANGLES,
    ) -> float:
        """Of the metric in windows ``which`` for members (n or 1, rotor), all together."""
        some = parts(turns, which)
        each = [self._mean_squares(*part, angles // len(some)) for part in some]
        wholes, rests, known = zip(*each, strict=True)
        found = quantile(confidence, joined(wholes), joined(rests), np.concatenate(known))
        return float(np.sqrt(found))

    def _mean_squares(
        self, turns: np.ndarray, which: np.ndarray | slice, draws: int
    ) -> tuple[MeanSquare, MeanSquare, np.ndarray]:
        """As ``chi_square.quantile`` takes them."""
        z = self.phasors(turns, which)
        whole = self.within.mean_squares(self.known(z, which), z, which)
        return whole, *self.within.conditioned(whole, z, which, draws)

    def over_time(self, members: np.ndarray, chance: np.ndarray) -> np.ndarray:
        """Largest value (n,) at any time for members (n, rotor), looked at in some windows.

        All members' noise is at its largest in each of them: an upper bound.
        """
        one, largest = self.within.largest(chance, self.duration), np.zeros(len(members))
        for k in self.looks(4 * LOOKS):
            which = np.full(len(members), k)
            z = self.phasors(members, which)
            square = self.within.mean_squares(self.known(z, which), z, which).each(one)
            largest = np.maximum(largest, np.sqrt(square))
        return largest
