"""Metrics that are linear in the motion: a deviation with a direction, and its length."""

import numpy as np

from quietbus.analysis.pointing.directions import DIRECTIONS, full_circle
from quietbus.analysis.pointing.judged_noise import DeviationNoise, NoDeviationNoise
from quietbus.analysis.pointing.judges.base import (
    ALL,
    LOOKS,
    TRIED_IN_NOISE,
    Judge,
    in_parts,
)
from quietbus.analysis.pointing.motion import ImageMotion, SampledSignal
from quietbus.analysis.pointing.noise import ANGLES
from quietbus.analysis.pointing.statistic import Phases
from quietbus.analysis.pointing.windows import DRIFTS, Metric, gain


class LinearJudge(Judge):
    """Of APE, MPE, RPE, PDE, PRE, displacement, smear and stability."""

    def __init__(
        self, motion: ImageMotion, metric: Metric, stretch: tuple[float, float], effort: float
    ):
        super().__init__(motion, metric, stretch, effort)
        self.slow = _deviations(motion.signal, metric, self.centers, self.at)
        self.noisy = motion.noisy
        self.noise_on_it: DeviationNoise | NoDeviationNoise = NoDeviationNoise()
        if self.noisy:
            self.tried = TRIED_IN_NOISE
            self.noise_on_it = DeviationNoise(self.noise, metric, self.centers, self.at, stretch)

    @property
    def slow_mean_square(self) -> float:
        """Of the signal alone, in this metric."""
        return float(np.mean(np.sum(self.slow**2, axis=1)))

    def average(self, phases: Phases) -> float:
        """Root mean square over windows and members."""
        return self.root_mean_square(phases)

    def quantile(
        self,
        confidence: float,
        turns: np.ndarray,
        which: np.ndarray | slice = ALL,
        angles: int = ANGLES,
    ) -> float:
        """Of the metric in windows ``which`` for members (n or 1, rotor), all together."""
        deviations = in_parts(self._deviations, turns, which)
        return self.noise_on_it.quantile(confidence, deviations, which, angles)

    def _deviations(self, turns: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        """The metric (n, c) as a vector, without its noise."""
        z = self.phasors(turns, which)
        g = gain(self.metric, self.f, self.at[which][:, None])
        g = np.broadcast_to(g, z.shape[:2])[..., None]
        return self.slow[which] + np.sum(g * z, axis=1).real

    def over_time(self, members: np.ndarray, _: np.ndarray) -> np.ndarray:
        """Largest value (n,) at any time for members (n, rotor), without noise.

        Lines of different frequency beat, so that sooner or later all of them peak together: an
        upper bound where they are few turns of a beat or multiples of one speed.
        """
        if not self.rotors:
            return np.full(len(members), np.max(np.linalg.norm(self.slow, axis=1)))
        around = full_circle(self.base.shape[2])
        at = np.linspace(-0.5, 0.5, 33)[:, None] if self.metric.name == "RPE" else np.zeros((1, 1))
        most = np.max(np.abs(np.atleast_2d(gain(self.metric, self.f, at))), axis=0)
        looks, largest = self.looks(LOOKS), np.zeros(len(members))
        stretches = np.array_split(np.arange(len(self.centers)), len(looks))
        for look, these in zip(looks, stretches, strict=True):
            z = self.phasors(members, np.full(len(members), look))
            reach = np.abs(np.einsum("ngc,dc->ngd", z, around))
            slow = np.max(self.slow[these] @ around.T, axis=0)
            total = np.max(np.einsum("g,ngd->nd", most, reach) + slow, axis=1)
            largest = np.maximum(largest, total)
        # the true direction lies half a step at most from those looked at
        return largest / (np.cos(np.pi / DIRECTIONS) if len(around) > 2 else 1.0)

    def largest_noise(self, chance: np.ndarray) -> np.ndarray:
        """What noise adds (n,) with a chance: its largest length is taken to meet the rest's."""
        return self.noise_on_it.largest(chance)


def _deviations(
    signal: SampledSignal, metric: Metric, centers: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """Deviations (n, c) of the signal."""
    if metric.name == "APE":
        return signal.at(centers)
    if metric.name in DRIFTS:
        first, second = (
            signal.windows(t, metric.window).mean if metric.window else signal.at(t)
            for t in (centers - 0.5 * metric.tau, centers + 0.5 * metric.tau)
        )
        return second - first
    parts = signal.windows(centers, metric.window)
    match metric.name:
        case "MPE" | "displacement":
            return parts.mean
        case "smear":
            return parts.smear
        case _:  # RPE
            return signal.at(centers + at * metric.window) - parts.mean
