"""Where a loop's phase passes -180 degrees and its gain passes 1.

There polynomials in w^2 have roots; the points between neighbouring roots bracket every crossing,
and Brent's method finishes it. (With a delay the brackets come from a grid that resolves every
zero, pole and turn of the delay.)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.polynomial import polynomial as P
from scipy.optimize import brentq

from quietbus.analysis.control.loop import Loop
from quietbus.analysis.control.rational import Array, even_odd, positive_roots, squared_gain
from quietbus.analysis.control.stability import between


@dataclass(frozen=True)
class Crossing:
    """Passage of L through the negative real axis."""

    omega: float  # [rad/s]
    log_gain: float  # inf on the arc around poles on the imaginary axis
    halves: int  # +2 with rising phase (positive crossing), -2 with falling; 1 starts on the axis


def _half_turns(phase: float) -> int:
    """Twice the number of odd multiples of pi below `phase`; one on an odd multiple itself."""
    level = phase / (2.0 * math.pi) + 0.5
    near = round(level)
    if abs(level - near) < 1e-12:
        return 2 * near
    return 2 * math.floor(level) + 1


def _phase_samples(loop: Loop) -> Array:
    """Frequencies [rad/s] between which the phase passes -180 degrees at most once."""
    if loop.delay:
        return frequency_grid(loop, until_delay_turns=3.0)
    n_even, n_odd = even_odd(loop.numerator)
    d_even, d_odd = even_odd(loop.denominator)
    imaginary = P.polysub(P.polymul(n_odd, d_even), P.polymul(n_even, d_odd))
    return between(np.sqrt(positive_roots(imaginary)))  # poles on the axis are roots of it too


def phase_crossings(loop: Loop) -> list[Crossing]:
    """All passages through the negative real axis from s = 0, over the arc, up to j infinity.

    The arc around poles at the origin leads from the real axis, at infinity, clockwise through
    90 degrees per integrator. Half passages start or end on the axis.
    """
    found = []
    log_g, sign = loop.origin
    size = math.inf if loop.integrators > 0 else -math.inf if loop.integrators < 0 else log_g
    real_axis = 0.0 if sign > 0 else -math.pi
    halves = _half_turns(loop.start_phase) - _half_turns(real_axis)
    if halves:
        found.append(Crossing(0.0, size, halves))

    omega = _phase_samples(loop)
    phases = loop.phase(omega)
    turns = [_half_turns(phase) for phase in phases]
    departure = turns[0] - _half_turns(loop.start_phase)
    if abs(departure) == 1:
        found.append(Crossing(0.0, size, departure))
    elif turns[0] % 2 == 0:  # the plot lies on the negative real axis, -1 included
        return [Crossing(0.0, math.nan, 0)]
    for i in range(omega.size - 1):
        change = turns[i + 1] - turns[i]
        if change == 0:
            continue
        lower = min(phases[i], phases[i + 1])
        target = (2 * math.ceil((lower / math.pi - 1.0) / 2.0) + 1) * math.pi
        at = _solve(partial(_phase_beyond, loop, target), omega[i], omega[i + 1])
        size = float(loop.log_gain(at))
        if abs(float(loop.phase(at)) - target) > 1e-3:  # a jump: pole or zero on the axis
            size = math.copysign(math.inf, size)
        found.append(Crossing(at, size, change))
    return found


def _phase_beyond(loop: Loop, target: float, omega: float) -> Array:
    return loop.phase(omega) - target


def _solve(function: Callable[[Any], Any], low: float, high: float) -> float:
    return float(brentq(lambda w: float(function(w)), low, high, xtol=1e-15 * low, rtol=1e-15))


def gain_crossings(loop: Loop) -> list[tuple[float, bool]]:
    """Frequencies [rad/s] at which abs(L) passes 1, and whether it falls there."""
    difference = P.polysub(squared_gain(loop.numerator), squared_gain(loop.denominator))
    omega = between(np.sqrt(positive_roots(difference)))
    above = loop.log_gain(omega) > 0
    return [
        (_solve(loop.log_gain, omega[i], omega[i + 1]), bool(above[i]))
        for i in range(omega.size - 1)
        if above[i] != above[i + 1]
    ]


def frequency_grid(loop: Loop, points: int = 400, until_delay_turns: float = 0.0) -> Array:
    """Angular frequencies [rad/s] fit for pictures: even in log, dense around each resonance.

    Args:
        loop: the loop.
        points: of the even part.
        until_delay_turns: reach to where the delay alone turns the phase this often.
    """
    roots = np.concatenate([loop.zeros, loop.poles])
    roots = roots[roots != 0]
    sizes = np.abs(roots) if roots.size else np.ones(1)
    low, high = sizes.min() / 30.0, sizes.max() * 30.0
    parts = []
    if until_delay_turns and loop.delay:
        high = max(high, 2.0 * math.pi * until_delay_turns / loop.delay)
        parts.append(np.arange(low, high, 0.5 / loop.delay))  # half a radian of delay a step
    parts.append(np.geomspace(low, high, max(points, int(100 * math.log10(high / low)))))
    widths = np.concatenate([-np.geomspace(0.05, 5.0, 12), [0.0], np.geomspace(0.05, 5.0, 12)])
    for root in roots[roots.imag > 0]:
        parts.append(root.imag + max(abs(root.real), 1e-6 * abs(root)) * widths)
    omega = np.unique(np.concatenate(parts))
    return omega[(omega >= low) & (omega <= high)]
