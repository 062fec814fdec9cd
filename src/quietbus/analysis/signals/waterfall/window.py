"""Which window a map's spectra have, by the shape of its strongest line."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from quietbus.analysis.signals.waterfall.lineshape import (
    ONE_BIN,
    LineShape,
    known_windows,
    segment_size,
    window_name,
)
from quietbus.analysis.signals.waterfall.measured import FitError, Waterfall

_REACH = 8  # [bins] from a line that are compared
_STRONG = 30.0  # power of a line over that of its background in a bin
_LEAST_ROWS = 4
_RIDGE = 0.5  # of its speeds at which a line is the highest of its neighbourhood
_TABLE = 512  # samples of a window that is tried: near a line more make little difference
_LONGEST = 8192  # of the declared one
_FITS = 0.15  # mean difference of logarithms of measured and shape: no more is the shape
_CLOSE = 0.05  # so near, no more is looked for
_MUCH_BETTER = 0.6  # of the difference: what a change of speed in the rows must bring
_NEAREST = 6  # windows that are compared in full
_BETTER = 0.1  # by so much another window must be nearer
_NULLS = 0.02  # of the side lobes: what may fill their nulls
_SMEARS = (
    0.25,
    0.5,
    0.75,
    1.0,
    1.5,
    2.0,
    3.0,
    4.0,
    6.0,
    8.0,
)  # [bins] of that line
_SMEARED = ("hann", "boxcar", "hamming", "flattop", "blackman", "tukey 0.25")
_CHUNK = 4096


@dataclass(frozen=True)
class SeenWindow:
    """The window that a map is fitted with, and how that is known."""

    name: str
    source: str  # "declared" or "lines" or "assumed"
    tested: bool  # against the lines
    difference: float | None  # mean |log| of measured over shape near the strongest line
    smear: float  # [Hz] by which the speed changes during the averaging of a row
    order: float | None  # of the strongest line


def seen_window(measured: Waterfall) -> SeenWindow:
    """Test the declared window against the strongest line, or find the one that it has.

    Raises:
        FitError: the line has another window's shape than the declared one's, or no known one's.
    """
    declared = None if measured.window is None else window_name(measured.window)
    order = _strongest(measured)
    line = None if order is None else _Line(measured, order)
    if line is None or not line.is_ridge:
        if declared is None:
            return SeenWindow("hann", "assumed", False, None, 0.0, None)
        return SeenWindow(declared, "declared", False, None, 0.0, None)
    return _judged(line, declared)


def _judged(line: "_Line", declared: str | None) -> SeenWindow:
    per_bin = line.measured.bin / line.order
    own = np.inf
    if declared is not None:
        own = line.difference(declared, longest=_LONGEST)
        smear, widened = _smeared(line, [declared], own)[1:]
        if min(own, widened) <= _FITS:
            return SeenWindow(
                declared, "declared", True, min(own, widened), smear * per_bin, line.order
            )
    others = [name for name in known_windows() if name != declared]
    rough = {name: line.difference(name, fine=False) for name in others}
    others = sorted(others, key=lambda each: rough[each])[:_NEAREST]
    found, name = min((line.difference(name), name) for name in others)
    if declared is not None and (own <= found + _BETTER or own <= 2.0 * found):
        name, found = declared, own
    tried = [declared] if declared is not None else list(_SMEARED)
    each, smear, widened = _smeared(line, tried, found)
    if smear > 0.0:
        name, found = each, widened
    if declared is not None and name != declared:
        raise FitError(
            f"window: '{declared}' is declared, but lines have the shape of '{name}' (measured "
            f"over shape differ by {_percent(own)} near the strongest line, order "
            f"{line.order:.4g}, with '{name}' by {_percent(found)}); declare the window of the "
            "spectra, or none and it is found"
        )
    if declared is None and found > 3.0 * _FITS:
        raise FitError(
            "window: expected the name of the spectra's window, got none, and lines have the "
            f"shape of none that is known (nearest: '{name}', measured over shape differ by "
            f"{_percent(found)} near order {line.order:.4g})"
        )
    source = "declared" if declared is not None else "lines"
    return SeenWindow(name, source, True, found, smear * per_bin, line.order)


def _smeared(line: "_Line", windows: Sequence[str], narrow: float) -> tuple[str, float, float]:
    """The window, and the smear [bins], which fit better by far than any without; or no smear."""
    best = (windows[0], 0.0, narrow)
    if narrow <= _CLOSE:
        return best
    for name in windows:
        for bins in _SMEARS if name != ONE_BIN else ():
            difference = line.difference(name, bins)
            if difference < min(best[2], _MUCH_BETTER * narrow):
                best = (name, bins, difference)
    return best


def _percent(difference: float) -> str:
    return f"{100.0 * np.expm1(difference):.2g} %"


def _strongest(measured: Waterfall) -> float | None:
    """The ray that is farthest above the rest of its rows, whatever the window; if any is."""
    turns, step, first = measured.turns, measured.bin, measured.frequency[0]
    logs = np.log(measured.positive)
    logs = logs - np.median(logs, axis=0)
    highest = measured.frequency[-1] / np.quantile(turns, 0.3)
    lowest = (max(first, 2.0 * step) + 2.0 * step) / np.quantile(turns, 0.5)
    candidates = np.arange(lowest, highest, 0.25 * step / turns[-1])
    best, order = 0.0, None
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


class _Line:
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
