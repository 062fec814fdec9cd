"""Modes between a rotor and what measures it: as many as the lines' powers support.

A line of the order h has the amplitude C_h Omega^2 |T|, T the product of the transmissions of the
modes, which lie in series. Each new mode is started from the best of a grid, all are fitted
together by nonlinear least squares of the powers over their deviations, and one is taken where it
lowers the Bayesian information criterion by far, at several speeds and not by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import gammaincc

from quietbus.analysis.signals.waterfall.rays import MODEL, Ray

MOST_MODES = 4
LIKELY = 1e-3  # chance below which a misfit is none of the averaging's scatter
_STARTS = 6  # of a new mode's fit, the best of a grid
_ROUGH = 15  # evaluations after which the nearest starts are kept
_KEPT = 2
_BETTER = 10.0  # of the information criterion: very strong evidence (Kass and Raftery 1995)
_WILD = 3.0  # deviations from which a point counts less
_DAMPING = (1e-4, 1.0)
_SPLIT = (0.02, 2.0)
_BEYOND = 1.2  # times the highest frequency of any line: no mode is told from afar
_ALONE = 3  # points that bring the most for a mode, and without which it must stand
_AWAY = 0.5  # of the mode's stiffness that is left where a line comes nearest, at most
_TOLD = 0.3  # relative deviation of a mode's frequency, at most


@dataclass(frozen=True)
class Mode:
    """One mode."""

    w0: float  # [rad/s] undamped, rotor still
    damping: float  # [-] over critical
    split: float  # [-] spin over transverse inertia; 0: it does not split


def transmission(
    order: np.ndarray | float,
    speed: np.ndarray,
    w0: np.ndarray | float,
    damping: np.ndarray | float,
    split: np.ndarray | float,
) -> np.ndarray:
    """Magnitude of T: what passes from the rotor to its mount at order times speed [rad/s]."""
    w = order * speed
    damper = 2j * damping * w / w0
    return np.abs((1.0 + damper) / (1.0 + damper - (w / w0) ** 2 + split * speed * w / w0**2))


def passed(
    modes: Sequence[Mode], order: np.ndarray | float, speed: np.ndarray, whirl: np.ndarray | float
) -> np.ndarray:
    """Magnitude of what all modes let pass; ``whirl``: 1 or -1, against the rotor."""
    through = np.ones(np.broadcast(order, speed, whirl).shape)
    for mode in modes:
        split = whirl * mode.split
        through = through * transmission(order, speed, mode.w0, mode.damping, split)
    return through


def noise_passed(modes: Sequence[Mode], speed: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Power (n, m) of noise at the rotor that reaches the mount: half of it turns either way."""
    turns = np.maximum(speed[:, None], 1e-9)
    h = 2.0 * np.pi * frequency / turns
    ways = [passed(modes, h, turns, sign) ** 2 for sign in (1.0, -1.0)]
    return 0.5 * (ways[0] + ways[1])


@dataclass(frozen=True, eq=False)
class LineFit:
    """Coefficients and modes of all lines."""

    coefficients: np.ndarray  # (h,)
    modes: tuple[Mode, ...]
    whirl: np.ndarray  # (h,) 1 or -1
    deviations: np.ndarray  # relative, of the logarithms: coefficients, then each mode's numbers
    misfit: float  # root of chi-square over its degrees of freedom
    chance: float  # that chi-square is so large if the model is right
    cost: float  # robust chi-square
    errors: np.ndarray  # (points,) of the powers over their deviations
    free: int  # degrees of freedom
    pattern: float  # [deviations] by which neighbouring errors have the same sign too often

    @property
    def fits(self) -> bool:
        """No more is left than the averaging's scatter makes likely."""
        return self.chance > LIKELY


class LinePowers:
    """Powers of all lines as one row of points, and their fit."""

    def __init__(self, rays: Sequence[Ray], speed: np.ndarray, rocks: bool) -> None:
        self.rays, self.rocks = rays, rocks
        self.line = np.repeat(np.arange(len(rays)), [len(ray.at) for ray in rays])
        self.order = np.array([ray.order for ray in rays])[self.line]
        self.speed = np.concatenate([speed[ray.at] for ray in rays])
        self.power = np.concatenate([ray.power for ray in rays])
        self.noise = np.concatenate([ray.noise for ray in rays])
        self.variance = np.concatenate([ray.variance for ray in rays])
        self.sigma = self._deviations(self.power)

    def _deviations(self, expected: np.ndarray) -> np.ndarray:
        """Of the powers, if a model expects these; of what is measured if it is far off."""
        alone = np.sqrt(self.variance[:, 0])
        seen = np.maximum(self.power, 0.0)
        near = np.clip(expected, 0.5 * seen, 2.0 * seen + 2.0 * alone)
        of_lines = self.variance[:, 1] * np.maximum(near, 0.0)
        model = (MODEL * np.maximum(near, seen)) ** 2
        return np.sqrt(self.variance[:, 0] + of_lines + model) + 1e-9 * np.max(seen)

    def fitted(self) -> LineFit:
        """The fit with as many modes as the points support."""
        best = last = self._solved((), np.ones(len(self.rays)))
        # one mode of two may gain little: while the model does not fit, two are tried
        while len(last.modes) < min(MOST_MODES, len(best.modes) + (1 if best.fits else 2)):
            rough = [
                self._solved((*last.modes, mode), whirl, (_ROUGH,))
                for mode, whirl in self._starts(last)
            ]
            nearest = sorted(rough, key=lambda each: each.cost)[:_KEPT]
            tries = [self._settled(each.modes, each.whirl) for each in nearest]
            last = min(tries, key=lambda each: each.cost)
            if self._supported(best, last) and self._told(last):
                best = last
        return best

    def settled(self, found: LineFit) -> LineFit:
        """A fit once more, of powers that were measured anew."""
        return self._settled(found.modes, found.whirl)

    def _supported(self, poorer: LineFit, richer: LineFit) -> bool:
        """A mode is needed by several points, more than the scatter about the richer model."""
        scale = max(richer.cost / richer.free, 1.0)
        gains = (_robust(poorer.errors) - _robust(richer.errors)) / scale
        more = len(richer.deviations) - len(poorer.deviations)
        least = _BETTER + more * np.log(len(gains))
        return bool(gains.sum() > least and np.sort(gains)[:-_ALONE].sum() > 0.3 * least)

    def _told(self, found: LineFit) -> bool:
        """Each mode's frequency is told, and lines come as near to it as to tell."""
        if not np.all(np.isfinite(found.deviations)):
            return False
        at = len(self.rays)
        w = self.order * self.speed
        for mode in found.modes:
            if found.deviations[at] > _TOLD:
                return False
            if mode.split == 0.0 and not np.min(w) < mode.w0 < _BEYOND * np.max(w):
                return False
            bend = mode.split * self.speed * w
            away = np.abs(w**2 - mode.w0**2 + np.multiply.outer([1.0, -1.0], bend))
            if np.min(away) > _AWAY * mode.w0**2:
                return False
            at += 3 if mode.split else 2
        return True

    def _starts(self, found: LineFit) -> list[tuple[Mode, np.ndarray]]:
        """One more mode near the best, from a grid, and the lines' whirl with it."""
        w = self.order * self.speed
        w0 = np.geomspace(0.9 * np.min(w), _BEYOND * np.max(w), 120)
        splits = np.append(0.0, np.linspace(0.2, 2.0, 10)) if self.rocks else np.zeros(1)
        grid = np.meshgrid(w0, np.geomspace(0.003, 0.3, 5), splits, indexing="ij")
        w0, damping, split = (axis.reshape(-1, 1) for axis in grid)
        costs = []
        ways = (1.0, -1.0) if self.rocks else (1.0,)
        for way in ways:
            new = transmission(self.order, self.speed, w0, damping, way * split)
            costs.append(self._misfits(self._shape(found.modes, way) * new))
        by_line = np.array(costs)  # (way, grid, line)
        total = by_line.min(axis=0).sum(axis=1)
        whirls = np.where(np.argmin(by_line, axis=0) == 0, 1.0, -1.0)
        per_frequency = total.reshape(120, -1)
        best = per_frequency.argmin(axis=1) + np.arange(120) * per_frequency.shape[1]
        best = best[np.argsort(total[best])][:_STARTS]
        return [
            (Mode(float(w0[i, 0]), float(damping[i, 0]), float(split[i, 0])), whirls[i])
            for i in best
        ]

    def _misfits(self, through: np.ndarray) -> np.ndarray:
        """How far lines' powers are from shapes (g, points), whatever the coefficients (g, h)."""
        good = self.power > 0.0
        power = np.where(good, self.power, 1.0)
        difference = 0.5 * np.log(power) - np.log(through)
        weight = good / (0.05**2 + (self.sigma / power) ** 2)
        found = np.zeros((len(through), len(self.rays)))
        for k in range(len(self.rays)):
            own = (self.line == k) & good
            if own.any():
                d, w = difference[:, own], weight[own]
                middle = (d @ w / w.sum())[:, None]
                # a few wild points, such as near another ray, do not decide
                found[:, k] = np.minimum(w * (d - middle) ** 2, 400.0).sum(axis=1)
        return found

    def _settled(self, modes: Sequence[Mode], whirl: np.ndarray) -> LineFit:
        """The fit from a start, its lines turning the way that fits better."""
        found = self._solved(modes, whirl)
        for _ in range(2):
            if not any(mode.split for mode in found.modes):
                break
            shapes = [self._shape(found.modes, way)[None] for way in (1.0, -1.0)]
            forward, backward = (self._misfits(shape)[0] for shape in shapes)
            turned = np.where(forward <= backward, 1.0, -1.0)
            if np.array_equal(turned, found.whirl):
                break
            found = self._solved(found.modes, turned)
        return found

    def _shape(self, modes: Sequence[Mode], way: np.ndarray | float) -> np.ndarray:
        """Amplitude of all points (points,) of unit coefficients."""
        return self.speed**2 * passed(modes, self.order, self.speed, way)

    def _solved(
        self, modes: Sequence[Mode], whirl: np.ndarray, steps: Sequence[int] = (60, 60, 60)
    ) -> LineFit:
        """Least squares of powers over their deviations.

        Args:
            steps: evaluations at most, by deviations that are wide first, then the model's.
        """
        ways, count = whirl[self.line], len(self.rays)
        splits = [mode.split > 0.0 for mode in modes]

        def modes_at(x: np.ndarray) -> list[Mode]:
            at, found = count, []
            for splitting in splits:
                w0, damping = np.exp(x[at : at + 2])
                found.append(Mode(w0, damping, np.exp(x[at + 2]) if splitting else 0.0))
                at += 3 if splitting else 2
            return found

        def powers(x: np.ndarray) -> np.ndarray:
            return 0.5 * (np.exp(x[self.line]) * self._shape(modes_at(x), ways)) ** 2

        unit = 0.5 * self._shape(modes, ways) ** 2
        weight = 1.0 / (self.sigma + 0.1 * np.maximum(self.power, 0.0)) ** 2
        above = np.bincount(self.line, weight * unit * self.power, count)
        ratio = above / np.bincount(self.line, weight * unit**2, count)
        least = (
            1e-3 * np.bincount(self.line, self.sigma, count) / np.bincount(self.line, unit, count)
        )
        start = list(0.5 * np.log(np.maximum(ratio, least)))
        low, high = [-np.inf] * count, [np.inf] * count
        w = self.order * self.speed
        for mode, splitting in zip(modes, splits, strict=True):
            numbers = (mode.w0, mode.damping, mode.split)[: 3 if splitting else 2]
            within = ((0.5 * np.min(w), 2.0 * np.max(w)), _DAMPING, _SPLIT)
            start += [np.log(value) for value in numbers]
            low += [np.log(ends[0]) for ends in within[: len(numbers)]]
            high += [np.log(ends[1]) for ends in within[: len(numbers)]]
        x = np.clip(start, np.array(low) + 1e-6, np.array(high) - 1e-6)

        sigma = np.hypot(self.sigma, 0.1 * np.maximum(self.power, 0.0))
        for evaluations in steps:
            scale = sigma

            def errors(x: np.ndarray, scale: np.ndarray = scale) -> np.ndarray:
                return (powers(x) - self.power) / scale

            solved = least_squares(
                errors,
                x,
                bounds=(low, high),
                loss="soft_l1",
                f_scale=_WILD,
                x_scale="jac",
                max_nfev=evaluations,
            )
            x = solved.x
            sigma = self._deviations(powers(x))
        error = (powers(x) - self.power) / self.sigma
        free = max(len(error) - len(x), 1)
        chi2 = float(np.sum(((powers(x) - self.power) / sigma) ** 2))
        misfit = np.sqrt(chi2 / free)
        covariance = np.linalg.pinv(solved.jac.T @ solved.jac)
        relative = np.sqrt(np.maximum(np.diag(covariance), 0.0)) * max(misfit, 1.0)
        return LineFit(
            np.exp(x[:count]),
            tuple(Mode(*map(float, (m.w0, m.damping, m.split))) for m in modes_at(x)),
            whirl,
            relative,
            float(misfit),
            float(gammaincc(0.5 * free, 0.5 * chi2)),
            float(np.sum(_robust(error))),
            error,
            free,
            self._pattern(error),
        )

    def _pattern(self, error: np.ndarray) -> float:
        """Errors of independent points change sign from speed to speed every other time."""
        same = np.sign(error[1:]) * np.sign(error[:-1])
        same = same[self.line[1:] == self.line[:-1]]
        return float(np.sum(same) / np.sqrt(max(len(same), 1)))


def _robust(error: np.ndarray) -> np.ndarray:
    """Chi-square by point, in which wild ones count less (soft L1)."""
    return 2.0 * _WILD**2 * (np.sqrt(1.0 + (error / _WILD) ** 2) - 1.0)
