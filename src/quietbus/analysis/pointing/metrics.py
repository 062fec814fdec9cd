"""Pointing metrics of image motion, with statistics at a stated confidence level.

What varies is the instant (or window) within the stretch that is judged, and the member of the
ensemble: the rotors' phases, which nobody controls, and the noise. ECSS-E-ST-60-10C has three
interpretations of "within the limit with probability p":

- ensemble: for a share p of the members, at all times;
- temporal: for the worst member, a share p of the time;
- mixed: a share p of all members and times together.

The functions return the smallest limit that is met so (docs/theory.md, section 16).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.optimize import brentq, minimize
from scipy.special import ndtri
from scipy.stats import norm

from quietbus.analysis.pointing.chi_square import MeanSquare, joined, quantile
from quietbus.analysis.pointing.image_quality import mtf_loss
from quietbus.analysis.pointing.judged_noise import DeviationNoise
from quietbus.analysis.pointing.motion import ImageMotion, SampledSignal, WindowParts
from quietbus.analysis.pointing.noise import ANGLES
from quietbus.analysis.pointing.window_noise import Fortune, WindowNoise, of_lines
from quietbus.analysis.pointing.windows import DRIFTS, LINEAR, Metric, gain, left_over, weight

Interpretation = Literal["ensemble", "temporal", "mixed"]
Phases = Literal["random", "given"]
INTERPRETATIONS = ("ensemble", "temporal", "mixed")
SEED = 20081115  # of everything that is drawn, so that a result comes out the same each time
WINDOWS = 16384  # at most, looked at in a stretch
AT_ONCE = 2**14  # of these, looked at in one go
DRAWS = 2**17  # of member and window together (mixed)
MEMBERS = 2000  # at least (ensemble)
MOST_MEMBERS = 20_000  # (ensemble); rarer ones are bounded by the worst member
TAIL = 20  # members or more beyond the level (ensemble)
TRIED = 2048  # windows in which the worst member is sought (temporal)
TRIED_IN_NOISE = 512  # the same where noise makes the distribution smooth
FEWER_ANGLES = 2**12  # of noise, in that search
SMOOTH_DRAWS = 2**15  # in place of DRAWS, the same way
SIDES = 4  # directions in which the largest MTF_loss with noise is sought
STARTS, SWEEPS = 3, 4  # of that search
TURN = 2.0 * np.pi
DIRECTIONS = 120  # around the circle
LOOKS = 16  # windows over which lines' amplitudes change (ensemble)


@dataclass(frozen=True)
class Statistic:
    """What number of a metric is wanted.

    Raises:
        ValueError: a confidence level outside (0, 1), or an unknown word.
    """

    confidence: float | None = None  # None: root mean square (mean, of MTF_loss) over all
    interpretation: Interpretation = "temporal"
    phases: Phases = "random"  # of the rotors; given: those of the run are the only member

    def __post_init__(self) -> None:
        if self.confidence is not None and not 0.0 < self.confidence < 1.0:
            raise ValueError(f"expected a confidence level between 0 and 1, got {self.confidence}")
        if self.interpretation not in INTERPRETATIONS:
            known = ", ".join(INTERPRETATIONS)
            raise ValueError(f"interpretation: expected one of {known}; got {self.interpretation}")
        if self.phases not in ("random", "given"):
            raise ValueError(f"phases: expected random or given, got {self.phases}")


def evaluate(
    motion: ImageMotion,
    metric: Metric,
    stretch: tuple[float, float],
    wanted: Statistic,
    effort: float = 1.0,
) -> float:
    """A metric of image motion: [rad], or [-] of ``MTF_loss``.

    Of motion with two components it is that of the distance, of ``MTF_loss`` the worst direction.

    Args:
        stretch: from, to [s]; windows lie within.
        effort: share of the usual windows and members that are looked at.

    Raises:
        ValueError: a stretch outside the samples, or a window (and tau) longer than the stretch.
    """
    judge = _Judge(motion, metric, stretch, effort)
    if wanted.confidence is None:
        return judge.average(wanted.phases)
    alone = motion.lines is None or wanted.phases == "given"
    match wanted.interpretation, alone:
        case "ensemble", _:
            return judge.ensemble(wanted.confidence, alone)
        case _, True:
            return judge.quantile(wanted.confidence, np.zeros((1, judge.rotors)))
        case "temporal", False:
            return judge.worst_member(wanted.confidence)
        case _:
            return judge.quantile(wanted.confidence, *judge.draws())


def contributions(
    motion: ImageMotion, metric: Metric, stretch: tuple[float, float]
) -> dict[str, float]:
    """Root mean square that slow motion, each line and noise alone have in a metric [rad].

    Of ``MTF_loss`` it is that of smear and jitter, the motion within the window. Independent
    phases: the squares add up to that of all.
    """
    judge = _Judge(motion, metric, stretch)
    parts = {"slow motion" if motion.lines is not None else "motion": judge.slow_mean_square}
    if motion.lines is not None:
        share = weight(metric, np.abs(motion.lines.frequency) / (2.0 * np.pi))
        power = share * np.mean(np.sum(0.5 * np.abs(judge.base) ** 2, axis=2), axis=0)
        parts |= dict(zip(motion.lines.names, power.tolist(), strict=True))
    if motion.noise is not None:
        parts |= dict(zip(motion.noise.names, judge.noise_powers.tolist(), strict=True))
    return {name: float(np.sqrt(value)) for name, value in parts.items()}


class _Judge:
    """One metric of one motion: what its windows hold, and values for members of the ensemble."""

    def __init__(
        self,
        motion: ImageMotion,
        metric: Metric,
        stretch: tuple[float, float],
        effort: float = 1.0,
    ):
        self.metric, self.lines, self.effort = metric, motion.lines, effort
        self.noise = motion.noise
        signal, (start, end) = motion.signal, stretch
        check_stretch(float(signal.time[0]), float(signal.time[-1]), metric, stretch)
        self.rng = np.random.default_rng(SEED)
        count = signal.how_many(metric.window or 1.0 / signal.rate, int(effort * WINDOWS))
        part = (np.arange(count) + self.rng.random(count)) / count
        low = start + 0.5 * metric.span
        self.centers = low + max(0.0, end - start - metric.span) * part
        self.at = self.rng.random(count) - 0.5  # of an RPE's instant in its window
        self.base = np.zeros((count, 0, signal.values.shape[1]), complex)
        self.rotors, self.f = 0, np.zeros(0)
        if self.lines is not None and len(self.lines.frequency):
            self.base = motion.phasors(self.centers)
            self.rotors = int(np.max(self.lines.rotor)) + 1
            self.f = self.lines.frequency_hz
            u = np.pi * self.f * metric.window
            self.same, self.other = (left_over(u[:, None], side, 2) for side in (u, -u))
        self.slow = _slow(signal, metric, self.centers, self.at)
        self.deviating: DeviationNoise | None = None
        self.within: WindowNoise | None = None
        self.duration = max(0.0, end - start - metric.span)
        if self.noise is not None and metric.name in LINEAR:
            self.deviating = DeviationNoise(self.noise, metric, self.centers, self.at, stretch)
        elif self.noise is not None and isinstance(self.slow, WindowParts):
            self.within = WindowNoise(
                self.noise, metric.window, self.centers, self.f, self.slow.coefficients
            )
        self.band = (
            signal.mean_square_above(metric.above, start, end) if metric.name == "rms" else None
        )

    @property
    def slow_mean_square(self) -> float:
        """Of the signal alone, in this metric."""
        match self.metric.name:
            case "rms":
                assert self.band is not None
                return float(np.trace(self.band))
            case "jitter":
                assert isinstance(self.slow, WindowParts)
                return float(np.mean(np.trace(self.slow.about_line, axis1=1, axis2=2)))
            case "MTF_loss":
                assert isinstance(self.slow, WindowParts)
                return float(np.mean(np.trace(self.slow.about_mean, axis1=1, axis2=2)))
            case _:
                assert isinstance(self.slow, np.ndarray)
                return float(np.mean(np.sum(self.slow**2, axis=1)))

    @cached_property
    def noise_powers(self) -> np.ndarray:
        """Mean square (part,) of each of the noise's contributors, in this metric."""
        if self.noise is None:
            return np.zeros(0)
        share = lambda f: weight(self.metric, f)  # noqa: E731
        found = np.trace(self.noise.weighted(self.metric, share), axis1=2, axis2=3)
        return np.asarray(np.mean(self.noise.at(self.centers, found), axis=0))

    def phasors(self, turns: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        """Phasors (n, group, c) in windows ``which`` for members' turns (n or 1, rotor)."""
        if self.lines is None or not self.rotors:
            return self.base[which]
        shift = np.exp(1j * self.lines.order * turns[:, self.lines.rotor])
        return self.lines.together(self.base[which] * shift[..., None])

    @cached_property
    def fortune(self) -> Fortune:
        """Of noise in the windows, the same for all members."""
        assert self.within is not None
        return self.within.fortune(self.rng, len(self.centers))

    def quantile(
        self,
        confidence: float,
        turns: np.ndarray,
        which: np.ndarray | slice = slice(None),
        angles: int = ANGLES,
    ) -> float:
        """Of the metric in windows ``which`` for members (n or 1, rotor), all together."""
        if self.deviating is not None:
            return self.deviating.quantile(confidence, self.deviations(turns, which), which, angles)
        if self.within is not None and self.metric.name == "jitter":
            whole, rest, known = self.mean_squares(turns, which, angles)
            return float(np.sqrt(quantile(confidence, whole, rest, known)))
        return float(np.quantile(self.values(turns, which, fresh=len(turns) > 1), confidence))

    def deviations(self, turns: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        """A linear metric (n, c) as a vector, without its noise."""
        if isinstance(which, np.ndarray) and len(which) > AT_ONCE:
            return np.concatenate([self.deviations(*part) for part in _parts(turns, which)])
        z = self.phasors(turns, which)
        assert isinstance(self.slow, np.ndarray)
        moved = self.slow[which]
        if self.rotors:
            g = gain(self.metric, self.f, self.at[which][:, None])
            g = np.broadcast_to(g, z.shape[:2])[..., None]
            moved = moved + np.sum(g * z, axis=1).real
        return moved

    def mean_squares(
        self, turns: np.ndarray, which: np.ndarray | slice, draws: int
    ) -> tuple[MeanSquare, MeanSquare, np.ndarray]:
        """The jitter's mean square with noise in it, as ``quantile`` takes it."""
        assert self.within is not None
        if isinstance(which, np.ndarray) and len(which) > AT_ONCE:
            share = draws * AT_ONCE // len(which)
            each = [self.mean_squares(*part, share) for part in _parts(turns, which)]
            wholes, rests, known = zip(*each, strict=True)
            return joined(wholes), joined(rests), np.concatenate(known)
        z = self.phasors(turns, which)
        whole = self.within.mean_squares(
            np.trace(self._covariance(z, which), axis1=1, axis2=2), z, which
        )
        return whole, *self.within.conditioned(whole, z, which, draws)

    def values(
        self, turns: np.ndarray, which: np.ndarray | slice = slice(None), fresh: bool = False
    ) -> np.ndarray:
        """The metric (n,) in windows ``which`` for members (n or 1, rotor).

        A linear one, and jitter, without noise. In ``MTF_loss`` noise takes its chances in the
        windows.

        Args:
            fresh: noise is drawn for each value, not once for each window.
        """
        if self.metric.name in LINEAR:
            return np.linalg.norm(self.deviations(turns, which), axis=1)
        if isinstance(which, np.ndarray) and len(which) > AT_ONCE:
            return np.concatenate([self.values(*part, fresh) for part in _parts(turns, which)])
        z = self.phasors(turns, which)
        if self.metric.name == "rms":
            return self._band(z)
        covariance = self._covariance(z, which)
        if self.metric.name == "jitter":
            return np.sqrt(np.maximum(np.trace(covariance, axis1=1, axis2=2), 0.0))
        smear = self._smear(z, which)
        if self.within is not None:
            fortune = self.within.fortune(self.rng, len(z)) if fresh else self.fortune.of(which)
            covariance, smear = self.within.drawn(covariance, smear, z, which, fortune)
        return mtf_loss(covariance, smear, self.metric.spatial_frequency, half_circle(z.shape[2]))

    def _band(self, z: np.ndarray) -> np.ndarray:
        assert self.band is not None
        total = np.full(len(z), np.trace(self.band) + np.sum(self.noise_powers))
        if self.rotors:
            share = weight(self.metric, self.f)
            total = total + 0.5 * np.einsum("g,ngc->n", share, np.abs(z) ** 2)
        return np.sqrt(total)

    def _smear(self, z: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        """(n, c) of slow motion and lines."""
        assert isinstance(self.slow, WindowParts)
        smear = self.slow.smear[which]
        if self.rotors:
            drift = Metric("smear", self.metric.window)
            smear = smear + np.sum(gain(drift, self.f)[:, None] * z, axis=1).real
        return smear

    def _covariance(self, z: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        """(n, c, c) of jitter, of slow motion and lines together."""
        assert isinstance(self.slow, WindowParts)
        covariance = self.slow.about_line[which]
        if not self.rotors:
            return covariance
        slow = self.slow.coefficients[which][:, 1:]
        lines = self.coefficients_of_lines[1 : slow.shape[1] + 1]
        mixed = slow.swapaxes(1, 2) @ np.einsum("mg,nga->nma", lines, z).real
        return covariance + self._jitter_of_lines(z) + mixed + mixed.swapaxes(1, 2)

    @cached_property
    def coefficients_of_lines(self) -> np.ndarray:
        """(order, group) as ``of_lines``."""
        return of_lines(self.f, self.metric.window)

    def _jitter_of_lines(self, z: np.ndarray) -> np.ndarray:
        """(n, c, c) of coherent lines z about their mean and slope, exactly."""
        mixed = self.same @ z.conj() + self.other @ z
        return np.asarray(0.5 * (z.swapaxes(1, 2) @ mixed).real)

    def average(self, phases: Phases) -> float:
        """Root mean square over windows and members; of MTF_loss the mean."""
        if self.metric.name == "MTF_loss":
            if self.lines is None or phases == "given":
                return float(np.mean(self.values(np.zeros((1, self.rotors)))))
            return float(np.mean(self.values(*self.draws(), fresh=True)))
        total = self.slow_mean_square + float(np.sum(self.noise_powers))
        if self.rotors and self.lines is not None:
            if phases == "random":
                f, z = np.abs(self.lines.frequency) / (2.0 * np.pi), self.base
            else:
                f, z = self.f, self.lines.together(self.base)
            power = np.mean(np.sum(0.5 * np.abs(z) ** 2, axis=2), axis=0)
            total += float(weight(self.metric, f) @ power)
        return float(np.sqrt(total))

    def draws(self) -> tuple[np.ndarray, np.ndarray]:
        """Members (n, rotor) and windows (n,) drawn together, each independent of the others."""
        smooth = self.within is not None and self.metric.name == "jitter"
        n = int(self.effort * (SMOOTH_DRAWS if smooth else DRAWS))
        which = self.rng.integers(len(self.centers), size=n)
        return self.rng.uniform(0, 2 * np.pi, (n, self.rotors)), which

    def worst_member(self, confidence: float) -> float:
        """Largest quantile over time that any member has, as far as the search finds.

        Members that reach far are tried in some windows; the best is improved there, and judged
        with the runners-up in all windows.
        """
        smooth = self.deviating is not None or self.within is not None
        most = TRIED_IN_NOISE if smooth and self.metric.name != "MTF_loss" else TRIED
        most, angles = (most // 4, FEWER_ANGLES // 4) if self.effort < 1.0 else (most, FEWER_ANGLES)
        some = np.linspace(0, len(self.centers) - 1, min(most, len(self.centers))).astype(int)

        def quantile(turns: np.ndarray) -> float:
            return self.quantile(confidence, turns[None], some, angles)

        tried = self.far_reaching()
        first = np.array([quantile(turns) for turns in tried])
        best = tried[np.argsort(-first)[:3]]
        improved = minimize(
            lambda turns: -quantile(turns) / (np.max(first) or 1.0),
            best[0],
            method="Nelder-Mead",
            options={"maxfev": 25 * self.rotors, "xatol": 1e-2, "fatol": 1e-4},
        )
        return max(self.quantile(confidence, turns[None]) for turns in (*best, improved.x))

    def far_reaching(self) -> np.ndarray:
        """Members (n, rotor) whose lines together reach far along some direction, each.

        For each direction the sum over frequencies of what the lines reach is raised by turning
        one rotor after the other, from several starts.
        """
        if self.lines is None or not self.rotors:
            return np.zeros((1, 0))
        middle = self.base[len(self.base) // 2]
        backwards = self.lines.frequency < 0.0
        folded = np.where(backwards[:, None], middle.conj(), middle)
        order = np.where(backwards, -1.0, 1.0) * self.lines.order
        share = np.sqrt(np.maximum(weight(self.metric, np.abs(self.lines.frequency) / TURN), 0.0))
        along = np.repeat(share * (half_circle(middle.shape[1])[::6] @ folded.T), STARTS, axis=0)
        turns = self.rng.uniform(0.0, TURN, (len(along), self.rotors))
        member = (self.lines.groups[:, None] == np.arange(self.lines.count)).astype(float)
        steps = TURN * np.arange(96) / 96
        for _ in range(SWEEPS):
            for j in range(self.rotors):
                own = self.lines.rotor == j
                z = along * np.exp(1j * order * turns[:, self.lines.rotor])
                rest = (z * ~own) @ member
                turned = along[:, None] * own * np.exp(1j * order * steps[:, None])
                reach = np.sum(np.abs(rest[:, None] + turned @ member), axis=2)
                turns[:, j] = steps[np.argmax(reach, axis=1)]
        return turns

    def ensemble(self, confidence: float, alone: bool) -> float:
        """Quantile over members of the largest value at any time.

        Noise makes members, too. In a linear metric its largest value and that of the rest are
        taken to meet.

        Args:
            alone: the rotors' phases are as given.
        """
        noisy = self.deviating is not None or self.within is not None
        count = int(self.effort * max(MEMBERS, np.ceil(TAIL / (1.0 - confidence))))
        if alone and not noisy:
            members, chance = np.zeros((1, self.rotors)), np.ones(1)
        elif count > self.effort * MOST_MEMBERS:
            members = np.zeros((1, self.rotors)) if alone else self.far_reaching()
            chance = np.full(len(members), confidence)
            confidence = 1.0
        else:
            members = self.rng.uniform(0, 2 * np.pi, (count, self.rotors))
            members = members * (not alone)
            chance = (np.arange(count) + 0.5) / count
            if noisy:
                chance = self.rng.permutation(chance)
        parts = [
            self.over_time(members[i : i + 500], chance[i : i + 500])
            for i in range(0, len(members), 500)
        ]
        largest = np.concatenate(parts)
        if self.deviating is not None:
            largest = largest + self.deviating.largest(chance)
        return float(np.quantile(largest, confidence, method="higher"))

    def over_time(self, members: np.ndarray, chance: np.ndarray) -> np.ndarray:
        """Largest value (n,) at any time for members (n, rotor), a linear metric's without noise.

        Lines of different frequency beat, so that sooner or later all of them peak together: an
        upper bound where they are few turns of a beat or multiples of one speed.
        """
        looks = np.unique(np.linspace(0, len(self.centers) - 1, LOOKS).astype(int))
        if self.metric.name not in LINEAR:
            return self._over_looks(members, chance)
        assert isinstance(self.slow, np.ndarray)
        if not self.rotors:
            return np.full(len(members), np.max(np.linalg.norm(self.slow, axis=1)))
        around = full_circle(self.base.shape[2])
        at = np.linspace(-0.5, 0.5, 33)[:, None] if self.metric.name == "RPE" else np.zeros((1, 1))
        most = np.max(np.abs(np.atleast_2d(gain(self.metric, self.f, at))), axis=0)
        stretches = np.array_split(np.arange(len(self.centers)), len(looks))
        largest = np.zeros(len(members))
        for look, these in zip(looks, stretches, strict=True):
            z = self.phasors(members, np.full(len(members), look))
            reach = np.abs(np.einsum("ngc,dc->ngd", z, around))
            slow = np.max(self.slow[these] @ around.T, axis=0)
            total = np.max(np.einsum("g,ngd->nd", most, reach) + slow, axis=1)
            largest = np.maximum(largest, total)
        # the true direction lies half a step at most from those looked at
        return largest / (np.cos(np.pi / DIRECTIONS) if len(around) > 2 else 1.0)

    def _over_looks(self, members: np.ndarray, chance: np.ndarray) -> np.ndarray:
        """Largest value (n,) of a metric that is not linear, looked at in some windows.

        All members' noise is at its largest in each of them, and of ``MTF_loss`` jitter and smear
        along a direction together: an upper bound.
        """
        sides, count = np.ones((1, 1)), 4 * LOOKS
        noise, loss = self.within, self.metric.name == "MTF_loss"
        if noise is not None and loss:
            sides = half_circle(noise.components)
            sides, count = sides[:: max(1, len(sides) // SIDES)], LOOKS // 2
        looks = np.unique(np.linspace(0, len(self.centers) - 1, count).astype(int))
        largest = np.zeros(len(members))
        alone = noise.largest(chance, self.duration) if noise is not None else chance
        for side in sides:
            along = noise.along(side) if noise is not None and loss else noise
            # chances of either component, all around
            one = alone if len(sides) == 1 else np.sqrt(alone)
            for k in looks:
                which = np.full(len(members), k)
                if along is None:
                    largest = np.maximum(largest, self.values(members, which))
                    continue
                z = self.phasors(members, which)
                covariance = self._covariance(z, which)
                if not loss:
                    known = np.trace(covariance, axis1=1, axis2=2)
                    found = np.sqrt(along.mean_squares(known, z, which).each(one))
                else:
                    known = np.einsum("a,nab,b->n", side, covariance, side)
                    jitter = along.mean_squares(known, (z @ side)[..., None], which).each(one)
                    spread = np.sqrt(along.drift[which, 0, 0])
                    smear = np.abs(self._smear(z, which) @ side) + ndtri(0.5 + 0.5 * one) * spread
                    unit, nu = np.ones((1, 1)), self.metric.spatial_frequency
                    found = mtf_loss(jitter[:, None, None], smear[:, None], nu, unit)
                largest = np.maximum(largest, found)
        return largest


def _parts(turns: np.ndarray, which: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Members and windows, some at a time."""
    count = int(np.ceil(len(which) / AT_ONCE))
    if len(turns) == 1:
        return ((turns, part) for part in np.array_split(which, count))
    return zip(np.array_split(turns, count), np.array_split(which, count), strict=True)


def check_stretch(first: float, last: float, metric: Metric, stretch: tuple[float, float]) -> None:
    """Refuse a stretch outside a run from first to last [s], and a window longer than the stretch.

    Raises:
        ValueError: says which.
    """
    start, end = stretch
    slack = 1e-9 * max(1.0, last)
    if not (first - slack <= start < end <= last + slack):
        raise ValueError(
            f"expected a stretch within the run, {first:g} s to {last:g} s; got {start:g} s to "
            f"{end:g} s"
        )
    if metric.span > (end - start) * (1.0 + 1e-9):
        what = {"stability": "a tau"}.get(metric.name, "a window")
        what = "window and tau together" if metric.name in DRIFTS and metric.window else what
        raise ValueError(
            f"expected {what} of at most {end - start:g} s, the stretch judged ({start:g} s to "
            f"{end:g} s); got {metric.span:g} s"
        )


def _slow(
    signal: SampledSignal, metric: Metric, centers: np.ndarray, at: np.ndarray
) -> np.ndarray | WindowParts:
    """What the signal's windows hold, as far as the metric asks: deviations (n, c), or all."""
    if metric.name in ("APE", "rms"):
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
        case "RPE":
            return signal.at(centers + at * metric.window) - parts.mean
        case _:
            return parts


def half_circle(components: int) -> np.ndarray:
    """Directions (d, c) of which each opposite pair has one."""
    return full_circle(components)[: max(1, DIRECTIONS // 2)] if components > 1 else np.ones((1, 1))


def full_circle(components: int) -> np.ndarray:
    """Unit vectors (d, c) all around, of one or two components."""
    if components == 1:
        return np.array([[1.0], [-1.0]])
    if components != 2:
        raise ValueError(f"image motion has one or two components, got {components}")
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return np.column_stack([np.cos(angle), np.sin(angle)])


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
