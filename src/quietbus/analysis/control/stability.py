"""Stable or not: poles counted, ranges of the gain, and both in words."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from quietbus.analysis.control.rational import Array

MARGINAL = 1e-9
"""[-] A pole's real part this small, relative to the pole, counts as on the imaginary axis."""


def between(marks: Array) -> Array:
    """Points below, between and above the marks; one point if there are no marks."""
    marks = np.unique(marks)
    if marks.size == 0:
        return np.ones(1)
    marks = marks[np.append(True, np.diff(marks) > 1e-9 * marks[1:])]
    return np.concatenate([[marks[0] / 2.0], np.sqrt(marks[:-1] * marks[1:]), [2.0 * marks[-1]]])


def count_unstable(poles: NDArray[np.complex128]) -> tuple[int, bool]:
    """Number of poles in the right half-plane, and whether some lie on the imaginary axis."""
    tolerance = MARGINAL * np.abs(poles) + 1e-14 * np.abs(poles).max(initial=0.0)
    unstable = poles.real > tolerance
    return int(unstable.sum()), bool(np.any(~unstable & (poles.real >= -tolerance)))


def _range_text(ranges: tuple[tuple[float, float | None], ...]) -> str:
    return " or ".join(
        f"K > {low:.4g}" if high is None else f"{low:.4g} < K < {high:.4g}" for low, high in ranges
    )


def gain_verdict(
    gain: float,
    stable: bool,
    unstable_poles: int,
    ranges: tuple[tuple[float, float | None], ...],
) -> str:
    """Whether a loop is stable at the chosen gain K, and at which others, in words."""
    where = (
        f"Stable for {_range_text(ranges)}."
        if ranges
        else "No gain K makes it stable; the PID's zeros or the isolator must change."
    )
    if unstable_poles:
        return (
            f"Unstable at K = {gain:.4g}: {unstable_poles} poles in the right half-plane. {where}"
        )
    if not stable:
        return f"On the limit of stability at K = {gain:.4g}. {where}"
    conditional = nearest_range(ranges, gain)[0] > 0
    kind = " (conditionally: too small a gain is unstable too)" if conditional else ""
    return f"Stable at K = {gain:.4g}{kind}. {where}"


def nearest_range(
    ranges: tuple[tuple[float, float | None], ...], gain: float
) -> tuple[float, float]:
    """The stable range that holds `gain` or else is the nearest; inf for no upper end, NaN if none.

    Near is meant in decibels.
    """
    if not ranges:
        return math.nan, math.nan
    closed = [(low, math.inf if high is None else high) for low, high in ranges]

    def distance(ends: tuple[float, float]) -> float:
        return max(ends[0] / gain, gain / ends[1], 1.0)

    return min(closed, key=distance)
