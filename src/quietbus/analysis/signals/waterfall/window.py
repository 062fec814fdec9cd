"""Which window a map's spectra have, by the shape of its strongest line."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from quietbus.analysis.signals.waterfall.lineshape import (
    ONE_BIN,
    known_windows,
    window_name,
)
from quietbus.analysis.signals.waterfall.measured import FitError, Waterfall
from quietbus.analysis.signals.waterfall.strongest import Line, strongest_line

_LONGEST = 8192  # of the declared one
_FITS = 0.15  # mean difference of logarithms of measured and shape: no more is the shape
_CLOSE = 0.05  # so near, no more is looked for
_MUCH_BETTER = 0.6  # of the difference: what a change of speed in the rows must bring
_NEAREST = 6  # windows that are compared in full
_BETTER = 0.1  # by so much another window must be nearer
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
    line = strongest_line(measured)
    if measured.window is None:
        if line is None:
            return SeenWindow("hann", "assumed", False, None, 0.0, None)
        return _found(line)
    declared = window_name(measured.window)
    if line is None:
        return SeenWindow(declared, "declared", False, None, 0.0, None)
    return _tested(line, declared)


def _found(line: Line) -> SeenWindow:
    """The window of a line, none being declared."""
    found, name = _nearest(line, known_windows())
    each, smear, widened = _smeared(line, _SMEARED, found)
    if smear > 0.0:
        name, found = each, widened
    if found > 3.0 * _FITS:
        raise FitError(
            "window: expected the name of the spectra's window, got none, and lines have the "
            f"shape of none that is known (nearest: '{name}', measured over shape differ by "
            f"{_percent(found)} near order {line.order:.4g})"
        )
    return SeenWindow(name, "lines", True, found, smear * line.per_bin, line.order)


def _tested(line: Line, declared: str) -> SeenWindow:
    """The declared window, if the line may have its shape."""
    own = line.difference(declared, longest=_LONGEST)
    _, smear, widened = _smeared(line, [declared], own)
    if widened > _FITS:
        others = [name for name in known_windows() if name != declared]
        found, name = _nearest(line, others)
        own_is_near = own <= found + _BETTER or own <= 2.0 * found
        _, smear, widened = _smeared(line, [declared], own if own_is_near else found)
        if not own_is_near and smear == 0.0:
            raise FitError(
                f"window: '{declared}' is declared, but lines have the shape of '{name}' (measured "
                f"over shape differ by {_percent(own)} near the strongest line, order "
                f"{line.order:.4g}, with '{name}' by {_percent(found)}); declare the window of the "
                "spectra, or none and it is found"
            )
    return SeenWindow(declared, "declared", True, widened, smear * line.per_bin, line.order)


def _nearest(line: Line, windows: Sequence[str]) -> tuple[float, str]:
    """The least difference, and the window that has it."""
    rough = {name: line.difference(name, fine=False) for name in windows}
    near = sorted(windows, key=lambda each: rough[each])[:_NEAREST]
    return min((line.difference(name), name) for name in near)


def _smeared(line: Line, windows: Sequence[str], narrow: float) -> tuple[str, float, float]:
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
