"""Nyquist's counts of a loop, and from them the gains at which it is stable.

A closed-loop pole lies on the imaginary axis exactly at those gains K at which the loop crosses
the negative real axis at -1; between two of them the number of unstable poles is constant and is
counted once: by the closed loop's poles, or with a delay by Nyquist's criterion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from quietbus.analysis.control.crossings import Crossing, phase_crossings
from quietbus.analysis.control.loop import Loop
from quietbus.analysis.control.stability import MARGINAL, count_unstable


@dataclass(frozen=True)
class Nyquist:
    """Counts of the Nyquist criterion over positive frequencies, as the paper has them.

    Crossings are those of the real axis left of -1, arcs around poles on the imaginary axis
    included; one that starts or ends on the axis counts one half.
    """

    P: int  # open-loop poles in the right half-plane
    N1: float  # positive crossings: phase rises, the plot comes from above
    N2: float  # negative crossings
    N: float  # N1 - N2, anticlockwise turns around -1
    Z: float  # P - 2 N, closed-loop poles in the right half-plane


def nyquist_counts(loop: Loop, gain: float | None = None) -> Nyquist | None:
    """Nyquist counts at gain K (the chosen one by default); None if the plot meets -1."""
    if loop.is_zero:
        return Nyquist(loop.open_loop_unstable, 0, 0, 0, loop.open_loop_unstable)
    return count_at(loop, phase_crossings(loop), 1.0 if gain is None else gain / loop.gain)


def count_at(loop: Loop, crossings: list[Crossing], scale: float) -> Nyquist | None:
    """Counts with the loop's gain scaled; None if it meets -1 then."""
    threshold = -math.log(scale)
    if any(not abs(c.log_gain - threshold) >= MARGINAL for c in crossings):  # NaN too
        return None
    outside = [crossing.halves for crossing in crossings if crossing.log_gain > threshold]
    positive = sum(h for h in outside if h > 0)
    negative = -sum(h for h in outside if h < 0)
    n = positive - negative

    def half(count: int) -> float:
        return count // 2 if count % 2 == 0 else count / 2

    unstable = loop.open_loop_unstable
    return Nyquist(unstable, half(positive), half(negative), half(n), unstable - n)


def _is_stable(loop: Loop, crossings: list[Crossing], scale: float) -> bool:
    if loop.delay:
        counts = count_at(loop, crossings, scale)
        return counts is not None and counts.Z == 0
    return count_unstable(loop.closed_loop_poles(scale * loop.gain)) == (0, False)


def ranges_between(loop: Loop, crossings: list[Crossing]) -> tuple[tuple[float, float | None], ...]:
    """Stable ranges of K, whose ends are gains at which the loop crosses at -1."""
    if loop.is_zero or loop.hidden_integrators:
        return ()
    limits = sorted({math.exp(-c.log_gain) for c in crossings if math.isfinite(c.log_gain)})
    ends = [0.0, *limits, math.inf]
    ranges: list[tuple[float, float | None]] = []
    for low, high in pairwise(ends):
        if high == math.inf:
            inside = 2.0 * low if low else 1.0
            # a delay turns for ever: beyond the last limit found there are only worse ones
            stable = not loop.delay and _is_stable(loop, crossings, inside)
        else:
            inside = math.sqrt(low * high) if low else high / 2.0
            stable = _is_stable(loop, crossings, inside)
        if not stable:
            continue
        top = None if high == math.inf else high * loop.gain
        if ranges and ranges[-1][1] == low * loop.gain:
            ranges[-1] = (ranges[-1][0], top)
        else:
            ranges.append((low * loop.gain, top))
    return tuple(ranges)


def stable_gain_range(loop: Loop) -> tuple[tuple[float, float | None], ...]:
    """All intervals (low, high) of K > 0 with a stable closed loop; high None: no upper end."""
    return () if loop.is_zero else ranges_between(loop, phase_crossings(loop))
