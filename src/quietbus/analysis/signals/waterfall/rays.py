"""Rays of orders in a map: looked for, placed, and how much power their lines have."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from quietbus.analysis.signals.waterfall.floor import Floor
from quietbus.analysis.signals.waterfall.lineshape import LineShape
from quietbus.analysis.signals.waterfall.measured import Waterfall

LEAK = 0.3  # of a line's leakage, nulls filled: what the shape leaves unexplained at most
MODEL = 1e-3  # relative error that is granted to the power of every line
_CAP = 3.0  # of the logarithm of line over floor: no single resonance makes a ray
_STANDS_OUT = 0.5  # mean of that logarithm along a ray
_SIGMAS = 6.0
_SHARE = 0.35  # of a ray's speeds that must be its own, not other rays'
_LEAST_ROWS = 6  # speeds of a ray
_ABOVE = 0.5  # of a ray's height that it must have over the bins beside it
_CHUNK = 4096  # candidates at a time
_OFFSETS = np.linspace(-0.6, 0.6, 25)  # [bins] of a line from its ray
_LEAST_STRAY = 0.003  # [bins]


@dataclass
class Ray:
    """One order's line."""

    order: float
    deviation: float  # of the order
    smear: float  # [bins] that the line passes during the averaging
    at: np.ndarray  # rows (i,) in which it stands alone
    power: np.ndarray  # (i,) A^2 / 2
    noise: np.ndarray  # (i,) power of all else in one bin at the line
    variance: np.ndarray  # (i, 2) of the power: a constant, and a factor of the line's power


class Rays:
    """Lines found so far in a map, and what they make of it."""

    def __init__(self, measured: Waterfall, shape: LineShape, smear: float) -> None:
        """``smear``: change of speed [Hz] during the averaging of a row."""
        self.measured, self.shape, self.smear = measured, shape, smear
        self.orders: list[float] = []
        self.deviations: list[float] = []
        self._shares: list[np.ndarray] = []
        self._widest: list[np.ndarray] = []
        self.free = np.ones(measured.psd.shape, dtype=bool)  # bins outside all main lobes
        self.power = np.zeros((len(measured.speed), 0))
        self.leak = np.zeros(measured.psd.shape)  # of all lines into all bins
        self.tolerance = np.zeros(measured.psd.shape)  # the same, nulls filled

    def bins_of(self, order: float) -> float:
        """[bins] that the line of an order passes during the averaging."""
        return order * self.smear / self.measured.bin

    def half(self, order: float) -> int:
        """Half width of a line [bins]."""
        return self.shape.half + int(np.ceil(0.5 * self.bins_of(order)))

    def positions(self, order: float) -> np.ndarray:
        """Of an order's line (n,) [bins from 0 Hz]."""
        return order * self.measured.turns / self.measured.bin

    def _columns(self, order: float) -> tuple[np.ndarray, np.ndarray]:
        """Bins (i, k) about an order's line, and the rows (i,) in which all of them are there."""
        first, count = self.measured.bins[0], len(self.measured.bins)
        half = self.half(order)
        k = self.positions(order) - first
        # next to 0 Hz a line meets its own negative frequency and what detrending took
        lowest = max(half + 1.0, self.shape.half + half - first)
        rows = np.flatnonzero((k >= lowest) & (k <= count - 2 - half))
        return np.rint(k[rows]).astype(int)[:, None] + np.arange(-half, half + 1), rows

    def next_order(self, floor: Floor, refused: list[float]) -> float | None:
        """The ray that stands out most of floor and leakage, if any does."""
        m = self.measured
        turns, step, first = m.turns, m.bin, m.frequency[0]
        half = self.shape.half
        highest = m.frequency[-1] / np.quantile(turns, 0.3)
        start = (first + (half + 1) * step) / turns[-1]
        candidates = np.arange(start, highest, 0.25 * step / turns[-1])
        for order in refused:
            candidates = candidates[np.abs(candidates - order) * turns[-1] > half * step]
        above = np.log(m.positive / self.background(floor))
        scores, powers = [], []
        for part in np.split(candidates, range(_CHUNK, len(candidates), _CHUNK)):
            where = np.multiply.outer(part, turns)
            bins = np.rint((where - first) / step).astype(int)
            inside = (bins >= 0) & (bins < len(m.frequency)) & (where > first + half * step)
            inside &= where > half * step
            bins = np.where(inside, bins, 0)
            own = inside & self.free[np.arange(len(turns)), bins]
            ratio = above[np.arange(len(turns)), bins]
            ratio = np.where(own, np.clip(ratio, -1.0, _CAP), 0.0)
            count, possible = own.sum(axis=1), inside.sum(axis=1)
            enough = (count >= _LEAST_ROWS) & (count >= _SHARE * possible)
            enough &= possible >= 0.3 * len(turns)
            score = np.where(enough, ratio.sum(axis=1) / np.maximum(count, 1), -np.inf)
            limit = _SIGMAS * floor.scatter / np.sqrt(np.maximum(count, 1))
            scores.append(np.where(score > np.maximum(_STANDS_OUT, limit), score, -np.inf))
            psd = np.where(own, m.psd[np.arange(len(turns)), bins], 0.0)
            powers.append(psd.sum(axis=1))
        score, power = np.concatenate(scores), np.concatenate(powers)
        if not np.any(np.isfinite(score)):
            return None
        # among rays that stand out as far, the one with most power
        best = score > np.max(score) - 0.3
        return float(candidates[np.argmax(np.where(best, power, -1.0))])

    def background(self, floor: Floor) -> np.ndarray:
        """Floor and leakage (n, m), and as much more as the leakage may be wrong by."""
        return floor.at_bins + self.leak + LEAK * self.tolerance

    def is_ridge(self, order: float, floor: Floor) -> bool:
        """A line is above the bins beside it, not only above the floor."""
        m, half = self.measured, self.half(order)
        columns, rows = self._columns(order)
        if len(rows) < _LEAST_ROWS:
            return False
        above = np.log(m.positive / self.background(floor))
        centre = above[rows[:, None], columns[:, half - 1 : half + 2]].max(axis=1)
        sides = []
        for step in (-1, 1):
            k = columns[:, half] + step * (half + 1)
            beside = np.clip(k[:, None] + step * np.arange(3), 0, len(m.bins) - 1)
            own = self.free[rows[:, None], beside]
            values = np.where(own, above[rows[:, None], beside], np.nan)
            known = np.isfinite(values).any(axis=1)
            if known.sum() >= 3:
                sides.append(float(np.mean(np.nanmean(values[known], axis=1))))
        return not sides or np.mean(centre) - max(sides) > _ABOVE * np.mean(centre)

    def placed(self, order: float, floor: Floor) -> tuple[float, float]:
        """An order and its deviation from where its lines are."""
        step = self.measured.bin / self.measured.turns[-1]
        deviation = 0.25 * step
        for _ in range(3):
            found = self._placed(order, floor)
            if found is None:
                break
            moved, deviation = found
            if abs(moved - order) > step:
                break
            order = moved
        return order, deviation

    def _placed(self, order: float, floor: Floor) -> tuple[float, float] | None:
        m = self.measured
        columns, rows = self._columns(order)
        if not len(rows):
            return None
        background = (floor.at_bins + self.leak)[rows[:, None], columns]
        excess = m.psd[rows[:, None], columns] - background
        base = background.mean(axis=1)
        clear = excess.max(axis=1) > 6.0 * base
        clear &= self.free[rows[:, None], columns].mean(axis=1) > 0.7
        if clear.sum() < 3:
            return None
        columns, rows, excess = columns[clear], rows[clear], excess[clear]
        offset, error = self._offsets(order, columns, rows, excess, base[clear])
        turns = m.turns[rows]
        centres = order * turns + offset * m.bin
        weight = 1.0 / (error * m.bin) ** 2
        total = float(np.sum(weight * turns**2))
        moved = float(np.sum(weight * centres * turns) / total)
        scatter = np.sqrt(np.mean(((centres - moved * turns) / (error * m.bin)) ** 2))
        return moved, float(max(scatter, 0.1) / np.sqrt(total))

    def _offsets(
        self,
        order: float,
        columns: np.ndarray,
        rows: np.ndarray,
        excess: np.ndarray,
        base: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where lines are, off their ray [bins], each by its own shape, and their errors."""
        m, smear = self.measured, self.bins_of(order)
        ratio = np.sqrt(base / np.maximum(excess.sum(axis=1), 1e-300))
        if self.shape.window == "none":
            total = excess.sum(axis=1)
            centre = (excess * m.bins[columns]).sum(axis=1) / total - self.positions(order)[rows]
            return centre, 0.3 + ratio
        off = m.bins[columns] - self.positions(order)[rows][:, None]  # (i, k)
        shares = self.shape.power(off - _OFFSETS[:, None, None], smear)  # (offset, i, k)
        # roots, so that the side lobes count too
        root = np.sqrt(np.maximum(excess, 0.0))
        shares = np.sqrt(shares)
        fitted = (shares * root).sum(axis=2) ** 2 / (shares**2).sum(axis=2)
        left = np.sum(root**2, axis=1) - fitted  # (offset, i)
        best = np.clip(np.argmin(left, axis=0), 1, len(_OFFSETS) - 2)
        i = np.arange(len(rows))
        low, mid, high = left[best - 1, i], left[best, i], left[best + 1, i]
        bend = np.maximum(low - 2.0 * mid + high, 1e-300)
        step = _OFFSETS[1] - _OFFSETS[0]
        offset = _OFFSETS[best] + step * np.clip(0.5 * (low - high) / bend, -1.0, 1.0)
        return offset, 0.01 + ratio

    def add(self, order: float, deviation: float) -> None:
        """Take a ray: its main lobes are no longer free."""
        m = self.measured
        at, smear = self.positions(order), self.bins_of(order)
        self.orders.append(order)
        self.deviations.append(deviation)
        self._shares.append(self.shape.line(m.bins, at, smear).astype(np.float32))
        self._widest.append(self.shape.tolerance(m.bins, at, smear).astype(np.float32))
        self.free &= np.abs(m.bins - at[:, None]) > self.half(order)

    def measure(self, floor: Floor) -> None:
        """Powers of all lines in every row, each by its main lobe, and their leakage."""
        m = self.measured
        count = len(self.orders)
        self.power = np.zeros((len(m.speed), count))
        sums = np.zeros((len(m.speed), count))
        there = np.zeros((len(m.speed), count), dtype=bool)
        mixed = np.zeros((len(m.speed), count, count))
        excess = m.psd - floor.expected
        for k, order in enumerate(self.orders):
            columns, rows = self._columns(order)
            there[rows, k] = True
            sums[rows, k] = excess[rows[:, None], columns].sum(axis=1) * m.bin
            for j in range(count):
                mixed[rows, k, j] = self._shares[j][rows[:, None], columns].sum(axis=1)
        for i in range(len(m.speed)):
            seen = np.flatnonzero(there[i])
            if len(seen):
                least = np.maximum(sums[i, seen], 0.0)
                scale = max(float(least.max()), 1e-300)
                self.power[i, seen] = scale * nnls(mixed[i][np.ix_(seen, seen)], least / scale)[0]
        self._sums, self._mixed, self._there = sums, mixed, there
        self._extrapolate(there)
        self.leak = np.zeros(m.psd.shape)
        self.tolerance = np.zeros(m.psd.shape)
        for k, (share, widest) in enumerate(zip(self._shares, self._widest, strict=True)):
            density = self.power[:, k : k + 1] / m.bin
            self.leak += density * share
            self.tolerance += density * widest

    def _extrapolate(self, there: np.ndarray) -> None:
        """Lines beyond the map leak into it: taken to grow as the fourth power of speed."""
        speed = self.measured.speed
        for k in range(len(self.orders)):
            seen = np.flatnonzero(there[:, k])
            if len(seen):
                for rows, nearest in ((slice(seen[-1] + 1, None), seen[-1]),
                                      (slice(0, seen[0]), seen[0])):  # fmt: skip
                    ratio = (speed[rows] / speed[nearest]) ** 4
                    self.power[rows, k] = self.power[nearest, k] * ratio

    def lines(self, floor: Floor) -> list[Ray]:
        """Every order's line where it stands alone, by order; powers may be below zero there."""
        m = self.measured
        found = []
        for k in np.argsort(self.orders):
            order = self.orders[k]
            columns, rows = self._columns(order)
            alone = np.ones(len(rows), dtype=bool)
            for j, other in enumerate(self.orders):
                if j != k:
                    apart = np.abs(self.positions(other) - self.positions(order))[rows]
                    alone &= apart > self.half(order) + self.half(other) + 1
            rows, columns = rows[alone], columns[alone]
            others = self.leak - self.power[:, k : k + 1] / m.bin * self._shares[k]
            foreign = others[rows[:, None], columns]
            captured = self._mixed[rows, k, k]
            power = (self._sums[rows, k] - foreign.sum(axis=1) * m.bin) / captured
            widest = self.tolerance - self.power[:, k : k + 1] / m.bin * self._widest[k]
            wrong = LEAK * widest[rows[:, None], columns].sum(axis=1) * m.bin
            base = floor.at_bins[rows[:, None], columns].mean(axis=1) * m.bin
            noise = base + np.maximum(foreign, 0.0).mean(axis=1) * m.bin
            variance = np.zeros((len(rows), 2))
            off = m.bins[columns] - self.positions(order)[rows][:, None]
            for i in range(len(rows)):
                alone_sum, cross = self.shape.sum_variances(off[i])
                variance[i, 0] = alone_sum * noise[i] ** 2 / floor.averages
                variance[i, 1] = cross * noise[i] / floor.averages
            unknown = (floor.at_bins - floor.expected)[rows[:, None], columns].sum(axis=1) * m.bin
            variance[:, 0] += wrong**2 + unknown**2
            variance /= captured[:, None] ** 2
            found.append(
                Ray(order, self.deviations[k], self.bins_of(order), rows, power, noise, variance)
            )
        return found
