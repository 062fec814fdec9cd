"""Loss of contrast (modulation transfer function, MTF) by the motion during an exposure."""

import abc
from functools import cached_property

import numpy as np
from scipy.special import ndtri

from quietbus.analysis.pointing.directions import half_circle
from quietbus.analysis.pointing.image_quality import mtf_loss
from quietbus.analysis.pointing.judges.base import ALL, LOOKS, Judge, parts
from quietbus.analysis.pointing.judges.inside import Inside
from quietbus.analysis.pointing.motion import ImageMotion
from quietbus.analysis.pointing.noise import ANGLES
from quietbus.analysis.pointing.statistic import Phases
from quietbus.analysis.pointing.window_noise import Fortune, WindowNoise
from quietbus.analysis.pointing.windows import Metric

SIDES = 4  # directions in which the largest loss with noise is sought


class LossJudge(Judge):
    """In the worst direction."""

    def __init__(
        self, motion: ImageMotion, metric: Metric, stretch: tuple[float, float], effort: float
    ):
        super().__init__(motion, metric, stretch, effort)
        slow = motion.signal.windows(self.centers, metric.window)
        self.inside = Inside(slow, metric.window, self.f)

    @property
    def slow_mean_square(self) -> float:
        """Of the signal alone, smear and jitter."""
        return float(np.mean(np.trace(self.inside.slow.about_mean, axis1=1, axis2=2)))

    def average(self, phases: Phases) -> float:
        """Mean over windows and members."""
        if self.alone(phases):
            return float(np.mean(self.values(np.zeros((1, self.rotors)), ALL)))
        return float(np.mean(self.values(*self.draws())))

    def quantile(
        self,
        confidence: float,
        turns: np.ndarray,
        which: np.ndarray | slice = ALL,
        _: int = ANGLES,
    ) -> float:
        """Of the metric in windows ``which`` for members (n or 1, rotor), all together."""
        return float(np.quantile(self.values(turns, which), confidence))

    def values(self, turns: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        """Losses (n,) in windows ``which`` for members (n or 1, rotor)."""
        fresh = len(turns) > 1
        return np.concatenate([self._values(*part, fresh) for part in parts(turns, which)])

    def _values(self, turns: np.ndarray, which: np.ndarray | slice, fresh: bool) -> np.ndarray:
        z = self.phasors(turns, which)
        moved = self.inside.covariance(z, which), self.inside.smear(z, which)
        covariance, smear = self.with_noise(*moved, z, which, fresh)
        return mtf_loss(covariance, smear, self.metric.spatial_frequency, half_circle(z.shape[2]))

    @abc.abstractmethod
    def with_noise(
        self,
        covariance: np.ndarray,
        smear: np.ndarray,
        z: np.ndarray,
        which: np.ndarray | slice,
        fresh: bool,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Covariance of jitter (n, c, c), and smear (n, c), with noise.

        Args:
            fresh: noise takes its chances for each value, not once for each window.
        """

    def largest_noise(self, chance: np.ndarray) -> np.ndarray:
        """None: it is in ``over_time``."""
        return np.zeros(len(chance))


class QuietLossJudge(LossJudge):
    """Without noise."""

    noisy = False

    def with_noise(
        self,
        covariance: np.ndarray,
        smear: np.ndarray,
        _z: np.ndarray,
        _which: np.ndarray | slice,
        _fresh: bool,
    ) -> tuple[np.ndarray, np.ndarray]:
        """As it is."""
        return covariance, smear

    def over_time(self, members: np.ndarray, _: np.ndarray) -> np.ndarray:
        """Largest value (n,) at any time for members (n, rotor)."""
        each = [self.values(members, np.full(len(members), k)) for k in self.looks(4 * LOOKS)]
        return np.max(each, axis=0)


class NoisyLossJudge(LossJudge):
    """With noise, drawn."""

    noisy = True

    def __init__(
        self, motion: ImageMotion, metric: Metric, stretch: tuple[float, float], effort: float
    ):
        super().__init__(motion, metric, stretch, effort)
        slow = self.inside.slow.coefficients
        self.within = WindowNoise(self.noise, metric.window, self.centers, self.f, slow)

    @cached_property
    def fortune(self) -> Fortune:
        """Of noise in the windows, the same for all members."""
        return self.within.fortune(self.rng, len(self.centers))

    def with_noise(
        self,
        covariance: np.ndarray,
        smear: np.ndarray,
        z: np.ndarray,
        which: np.ndarray | slice,
        fresh: bool,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Noise takes its chances in the windows."""
        fortune = self.within.fortune(self.rng, len(z)) if fresh else self.fortune.of(which)
        return self.within.drawn(covariance, smear, z, which, fortune)

    def over_time(self, members: np.ndarray, chance: np.ndarray) -> np.ndarray:
        """Largest value (n,) at any time for members (n, rotor), looked at in some windows.

        All members' noise is at its largest in each of them, and jitter and smear along a
        direction together: an upper bound.
        """
        sides = half_circle(self.within.components)
        sides = sides[:: max(1, len(sides) // SIDES)]
        one = self.within.largest(chance, self.duration)
        one = one if len(sides) == 1 else np.sqrt(one)  # of either component, all around
        unit, nu = np.ones((1, 1)), self.metric.spatial_frequency
        largest = np.zeros(len(members))
        for side in sides:
            along = self.within.along(side)
            for k in self.looks(LOOKS // 2):
                which = np.full(len(members), k)
                z = self.phasors(members, which)
                known = np.einsum("a,nab,b->n", side, self.inside.covariance(z, which), side)
                jitter = along.mean_squares(known, (z @ side)[..., None], which).each(one)
                spread = np.sqrt(along.drift[which, 0, 0])
                drift = np.abs(self.inside.smear(z, which) @ side)
                smear = drift + ndtri(0.5 + 0.5 * one) * spread
                found = mtf_loss(jitter[:, None, None], smear[:, None], nu, unit)
                largest = np.maximum(largest, found)
        return largest
