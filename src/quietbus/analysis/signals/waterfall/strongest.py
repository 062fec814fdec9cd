"""The line that stands out most in a measured map, and how much it differs from a shape."""

import functools

import numpy as np
from scipy.optimize import minimize_scalar

from quietbus.analysis.signals.waterfall.lineshape import (
    LineShape,
    segment_size,
)
from quietbus.analysis.signals.waterfall.measured import Waterfall

_REACH = 8  # [bins] from a line that are compared
_STRONG = 30.0  # power of a line over that of its background in a bin
_LEAST_ROWS = 4
_RIDGE = 0.5  # of its speeds at which a line is the highest of its neighbourhood
_TABLE = 512  # samples of a window that is tried: near a line more make little difference
_NULLS = 0.02  # of the side lobes: what may fill their nulls
_CHUNK = 4096


def strongest_line(measured: Waterfall) -> "Line | None":
    """The strongest order's line, if it is a ridge."""
    line = Line(measured, strongest_order(measured))
    return line if line.is_ridge else None


def strongest_order(measured: Waterfall) -> float:
    """The ray that is farthest above the rest of its rows, whatever the window; 0 if none is."""
    turns, step, first = measured.turns, measured.bin, measured.frequency[0]
    logs = np.log(measured.positive)
    logs = logs - np.median(logs, axis=0)
    highest = measured.frequency[-1] / np.quantile(turns, 0.3)
    lowest = (max(first, 2.0 * step) + 2.0 * step) / np.quantile(turns, 0.5)
    candidates = np.arange(lowest, highest, 0.25 * step / turns[-1])
    best, order = 0.0, 0.0
    for part in np.split(candidates, range(_CHUNK, len(candidates), _CHUNK)):
        if not len(part):
            continue
        bins = np.rint((np.multiply.outer(part, turns) - first) / step).astype(int)
        inside = (bins >= 0) & (bins < len(measured.frequency))
        values = np.where(inside, logs[np.arange(len(turns)), np.where(inside, bins, 0)], 0.0)
        count = inside.sum(axis=1)
        enough = count >= np.maximum(6, 0.3 * len(turns))
        score = np.where(enough, values.sum(axis=1) / np.maximum(count, 1), -np.inf)
        k = int(np.argmax(score))
        if score[k] > best:
            best, order = float(score[k]), float(part[k])
    return order


@functools.lru_cache(maxsize=100)
def _shape(window: str, size: int) -> LineShape:
    return LineShape(window, size)


class Line:
    """The strongest order's line in the rows where it is strong."""

    def __init__(self, measured: Waterfall, order: float) -> None:
        self.measured = measured
        self.floor = np.quantile(measured.positive, 0.2, axis=0)  # (m,)
        self.order = order
        for _ in range(2):
            self._take_rows()
            if len(self.rows) < _LEAST_ROWS:
                return
            self.order += self._peak_offset()
        self._take_rows()

    def _take_rows(self) -> None:
        m = self.measured
        k = self.order * m.turns / m.bin - m.bins[0]
        inside = (k > _REACH + 1 + max(4.0 - m.bins[0], 0.0)) & (k < len(m.bins) - 2 - _REACH)
        rows = np.flatnonzero(inside)
        self._possible = len(rows)
        columns = np.rint(k[rows]).astype(int)[:, None] + np.arange(-_REACH, _REACH + 1)
        near = m.positive[rows[:, None], columns]
        peak = near[:, _REACH - 1 : _REACH + 2].max(axis=1)
        strong = (peak > _STRONG * np.median(self.floor[columns], axis=1)) & (
            peak >= near.max(axis=1)
        )
        self.rows, self.columns, self.power = rows[strong], columns[strong], near[strong]

    @property
    def per_bin(self) -> float:
        """[Hz] of rotor speed for a bin of this line."""
        return self.measured.bin / self.order

    @property
    def is_ridge(self) -> bool:
        """It is the highest of its neighbourhood at most speeds."""
        return len(self.rows) >= max(_LEAST_ROWS, _RIDGE * self._possible)

    def _peak_offset(self) -> float:
        """Of the order, from the parabola of the logarithm about each row's peak."""
        m = self.measured
        top = self.power[:, _REACH - 1 : _REACH + 2].argmax(axis=1) + _REACH - 1
        i = np.arange(len(self.rows))
        low, mid, high = (np.log(self.power[i, top + step]) for step in (-1, 0, 1))
        bend = np.minimum(low - 2.0 * mid + high, -1e-9)
        peak = m.bins[self.columns[i, top]] + np.clip(0.5 * (low - high) / bend, -0.5, 0.5)
        turns = m.turns[self.rows]
        return float(np.sum(peak * m.bin * turns) / np.sum(turns**2)) - self.order

    def difference(
        self, window: str, smear: float = 0.0, longest: int = _TABLE, fine: bool = True
    ) -> float:
        """Mean |log| of measured over shape, the order placed by the shape itself.

        Args:
            smear: [bins] of this line.
            longest: samples of the window at most.
            fine: place the order as well as can be; else to a twentieth of a bin.
        """
        size = segment_size(self.measured.frequency, self.measured.sample_rate)
        shape = _shape(window, min(longest, size))
        offsets = np.linspace(-0.3, 0.3, 13)
        tries = [self._differs(offset, shape, smear) for offset in offsets]
        if not fine:
            return float(min(tries))
        near = offsets[int(np.argmin(tries))]
        found = minimize_scalar(
            self._differs,
            bounds=(near - 0.05, near + 0.05),
            args=(shape, smear),
            method="bounded",
            options={"xatol": 1e-4},
        )
        return float(min(found.fun, *tries))

    def _differs(self, offset: float, shape: LineShape, smear: float) -> float:
        m = self.measured
        turns = m.turns[self.rows]
        at = self.order * turns / m.bin + offset * turns / m.turns[-1]
        off = m.bins[self.columns] - at[:, None]
        share, widest = shape.power(off, smear), shape.envelope(off, smear)
        floor = self.floor[self.columns]
        excess = np.maximum(self.power - floor, 0.0)
        line = (excess * share).sum(axis=1) / (share**2).sum(axis=1)
        little = _NULLS * line[:, None] * widest
        log = np.log((self.power + little) / (floor + line[:, None] * share + little))
        told = np.maximum(self.power, line[:, None] * widest) > 3.0 * floor
        weight = told.sum()
        return float(np.sum(np.minimum(np.abs(log), 2.0) * told) / weight) if weight else 0.0
