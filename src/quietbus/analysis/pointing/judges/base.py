"""How any metric of an image motion is judged: its windows, and members of the ensemble."""

import abc
from collections.abc import Callable
from functools import cached_property

import numpy as np
from scipy.optimize import minimize

from quietbus.analysis.pointing.directions import half_circle
from quietbus.analysis.pointing.motion import ImageMotion
from quietbus.analysis.pointing.noise import ANGLES
from quietbus.analysis.pointing.statistic import Phases
from quietbus.analysis.pointing.windows import Metric, weight

SEED = 20081115  # of everything that is drawn, so that a result comes out the same each time
WINDOWS = 16384  # at most, looked at in a stretch
AT_ONCE = 2**14  # of these, looked at in one go
DRAWS = 2**17  # of member and window together (mixed)
SMOOTH_DRAWS = 2**15  # the same where noise makes the distribution smooth
MEMBERS = 2000  # at least (ensemble)
MOST_MEMBERS = 20_000  # (ensemble); rarer ones are bounded by the worst member
TAIL = 20  # members or more beyond the level (ensemble)
TRIED = 2048  # windows in which the worst member is sought (temporal)
TRIED_IN_NOISE = 512  # the same where noise makes the distribution smooth
FEWER_ANGLES = 2**12  # of noise, in that search
STARTS, SWEEPS = 3, 4  # of that search
TURN = 2.0 * np.pi
LOOKS = 16  # windows over which lines' amplitudes change (ensemble)
ALL = slice(None)


class Judge(abc.ABC):
    """One metric of one motion: what its windows hold, and values for members of the ensemble."""

    noisy: bool  # whether the noise, too, makes members of the ensemble
    tried = TRIED  # windows in which the worst member is sought
    drawn = DRAWS  # of member and window together

    def __init__(
        self, motion: ImageMotion, metric: Metric, stretch: tuple[float, float], effort: float
    ):
        self.motion, self.metric, self.effort = motion, metric, effort
        self.lines, self.noise = motion.known_lines, motion.known_noise
        signal, (start, end) = motion.signal, stretch
        self.rng = np.random.default_rng(SEED)
        count = signal.how_many(metric.window or 1.0 / signal.rate, int(effort * WINDOWS))
        part = (np.arange(count) + self.rng.random(count)) / count
        self.duration = max(0.0, end - start - metric.span)
        self.centers = start + 0.5 * metric.span + self.duration * part
        self.at = self.rng.random(count) - 0.5  # of an RPE's instant in its window
        self.base = motion.phasors(self.centers)
        self.rotors = int(np.max(self.lines.rotor, initial=-1)) + 1
        self.f = self.lines.frequency_hz

    @property
    @abc.abstractmethod
    def slow_mean_square(self) -> float:
        """Of the signal alone, in this metric."""

    @abc.abstractmethod
    def average(self, phases: Phases) -> float:
        """Root mean square over windows and members; of MTF_loss the mean."""

    @abc.abstractmethod
    def quantile(
        self,
        confidence: float,
        turns: np.ndarray,
        which: np.ndarray | slice = ALL,
        angles: int = ANGLES,
    ) -> float:
        """Of the metric in windows ``which`` for members (n or 1, rotor), all together."""

    @abc.abstractmethod
    def over_time(self, members: np.ndarray, chance: np.ndarray) -> np.ndarray:
        """Largest value (n,) at any time for members (n, rotor), each with its noise's chance."""

    @abc.abstractmethod
    def largest_noise(self, chance: np.ndarray) -> np.ndarray:
        """What noise adds (n,) to ``over_time`` with a chance, as far as it is not in there."""

    def alone(self, phases: Phases) -> bool:
        """Whether the rotors' phases are as given, as in a direct run they are."""
        return phases == "given" or not self.motion.apart

    @cached_property
    def noise_powers(self) -> np.ndarray:
        """Mean square (part,) of each of the noise's contributors, in this metric."""
        share = lambda f: weight(self.metric, f)  # noqa: E731
        found = np.trace(self.noise.weighted(self.metric, share), axis1=2, axis2=3)
        return np.asarray(np.mean(self.noise.at(self.centers, found), axis=0))

    def phasors(self, turns: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        """Phasors (n, group, c) in windows ``which`` for members' turns (n or 1, rotor)."""
        shift = np.exp(1j * self.lines.order * turns[:, self.lines.rotor])
        return self.lines.together(self.base[which] * shift[..., None])

    def root_mean_square(self, phases: Phases) -> float:
        """Over windows and members."""
        f, z = np.abs(self.lines.frequency) / TURN, self.base
        if phases == "given":
            f, z = self.f, self.lines.together(self.base)
        power = np.mean(np.sum(0.5 * np.abs(z) ** 2, axis=2), axis=0)
        total = self.slow_mean_square + float(np.sum(self.noise_powers))
        return float(np.sqrt(total + float(weight(self.metric, f) @ power)))

    def draws(self) -> tuple[np.ndarray, np.ndarray]:
        """Members (n, rotor) and windows (n,) drawn together, each independent of the others."""
        n = int(self.effort * self.drawn)
        which = self.rng.integers(len(self.centers), size=n)
        return self.rng.uniform(0, TURN, (n, self.rotors)), which

    def worst_member(self, confidence: float) -> float:
        """Largest quantile over time that any member has, as far as the search finds.

        Members that reach far are tried in some windows; the best is improved there, and judged
        with the runners-up in all windows.
        """
        less = 4 if self.effort < 1.0 else 1
        most, angles = self.tried // less, FEWER_ANGLES // less
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
        if not self.rotors:
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
        count = int(self.effort * max(MEMBERS, np.ceil(TAIL / (1.0 - confidence))))
        if alone and not self.noisy:
            members, chance = np.zeros((1, self.rotors)), np.ones(1)
        elif count > self.effort * MOST_MEMBERS:
            members = np.zeros((1, self.rotors)) if alone else self.far_reaching()
            chance = np.full(len(members), confidence)
            confidence = 1.0
        else:
            members = self.rng.uniform(0, 2 * np.pi, (count, self.rotors))
            members = members * (not alone)
            chance = (np.arange(count) + 0.5) / count
            if self.noisy:
                chance = self.rng.permutation(chance)
        parts = [
            self.over_time(members[i : i + 500], chance[i : i + 500])
            for i in range(0, len(members), 500)
        ]
        largest = np.concatenate(parts) + self.largest_noise(chance)
        return float(np.quantile(largest, confidence, method="higher"))

    def looks(self, count: int) -> np.ndarray:
        """Some windows, evenly over the stretch."""
        return np.unique(np.linspace(0, len(self.centers) - 1, count).astype(int))


def in_parts(
    found: Callable[[np.ndarray, np.ndarray | slice], np.ndarray],
    turns: np.ndarray,
    which: np.ndarray | slice,
) -> np.ndarray:
    """Values (n, ...) of members and windows, some at a time."""
    return np.concatenate([found(*part) for part in parts(turns, which)])


def parts(
    turns: np.ndarray, which: np.ndarray | slice
) -> list[tuple[np.ndarray, np.ndarray | slice]]:
    """Members and windows, some at a time."""
    if isinstance(which, slice) or len(which) <= AT_ONCE:
        return [(turns, which)]
    count = int(np.ceil(len(which) / AT_ONCE))
    own = np.array_split(which, count)
    members = [turns] * count if len(turns) == 1 else np.array_split(turns, count)
    return list(zip(members, own, strict=True))
