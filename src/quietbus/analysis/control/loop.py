"""The attitude loop of one axis, closed through the isolator (Zhang & Xu 2012, eq. 34-37).

    L(s) = PID(s) G(s) servo(s) / (I s^2) e^(-tau s)

PID(s) = (kd s^2 + kp s + ki)/s, G the channel (`channels`), I the satellite's inertia about the
axis, servo a first-order lag of the gimbals, tau the delay. A sampled controller with a zero
order hold counts as half a sample of extra delay: good to about 1 % of gain and to the hold's
own phase exactly, as long as crossovers stay below a tenth of the sampling rate (`notes` says
when they do not).

How the numbers are found. On the imaginary axis gain and phase are sums over zeros and poles,
    log|L| = log|g| + sum log|j w - z| - sum log|j w - p|,    arg L likewise,
so the phase needs no unwrapping, and a delay is exact. Where the phase passes -180 degrees or
the gain passes 1, polynomials in w^2 have roots; the points between neighbouring roots bracket
every crossing, and Brent's method finishes it. (With a delay the brackets come from a grid
that resolves every zero, pole and turn of the delay.) A closed-loop pole lies on the imaginary
axis exactly at those gains K; between two of them the number of unstable poles is constant and
is counted once: by the closed loop's poles, or with a delay by Nyquist's criterion.

K is the size of PID's leading gain: kd, or kp without kd, or ki without both. The others
scale with it, so the PID's zeros stay.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.polynomial import polynomial as P
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from quietbus.analysis.control.channels import json_ready
from quietbus.analysis.control.rational import (
    Array,
    Coefficients,
    even_odd,
    positive_roots,
    squared_gain,
)

MARGINAL = 1e-9
"""[-] A pole's real part this small, relative to the pole, counts as on the imaginary axis."""


# --- the loop ------------------------------------------------------------------------------


@dataclass(frozen=True)
class PID:
    """Attitude controller, torque = -(kp e + ki int e + kd de/dt)."""

    kp: float  # [N m/rad]
    ki: float  # [N m/(rad s)]
    kd: float  # [N m s/rad]

    @classmethod
    def from_gain_and_zeros(cls, gain: float, zeros: tuple[float, float]) -> PID:
        """PID(s) = K (s + tp)(s + tq)/s (eq. 34).

        Args:
            gain: K [N m s/rad].
            zeros: tp, tq [rad/s].
        """
        tp, tq = zeros
        return cls(kp=gain * (tp + tq), ki=gain * tp * tq, kd=gain)

    @property
    def zeros(self) -> tuple[complex, ...]:
        """Zeros of PID(s) [rad/s] away from the origin."""
        return tuple(root for root in np.roots([self.kd, self.kp, self.ki]).tolist() if root)

    @property
    def gain(self) -> float:
        """K: size of the leading gain kd, kp or ki, whichever is the first that is not zero."""
        return next((abs(g) for g in (self.kd, self.kp, self.ki) if g), 0.0)


@dataclass(frozen=True)
class Loop:
    """An open loop N(s)/D(s) e^(-delay s) with negative unity feedback.

    Raises:
        ValueError: not strictly proper, or a negative delay.
    """

    numerator: Coefficients  # descending powers of s, at the chosen gain
    denominator: Coefficients  # descending powers of s
    gain: float = 1.0  # K, the chosen gain, in the unit that ranges are to be given in
    delay: float = 0.0  # [s]
    sampling_period: float | None = None  # [s] its half is part of `delay` already
    hidden_integrators: int = 0  # poles at the origin that the control does not touch

    def __post_init__(self) -> None:
        numerator = np.trim_zeros(np.atleast_1d(np.asarray(self.numerator, float)), "f")
        denominator = np.trim_zeros(np.atleast_1d(np.asarray(self.denominator, float)), "f")
        if denominator.size <= numerator.size:
            raise ValueError(
                "loop: expected more poles than zeros (a strictly proper loop), got "
                f"{max(numerator.size - 1, 0)} zeros and {denominator.size - 1} poles"
            )
        if not (self.delay >= 0 and math.isfinite(self.delay)):
            raise ValueError(f"delay: expected a finite number of at least 0 s, got {self.delay}")
        object.__setattr__(self, "numerator", tuple(numerator.tolist()))
        object.__setattr__(self, "denominator", tuple(denominator.tolist()))

    @property
    def is_zero(self) -> bool:
        """Whether the loop does nothing at all."""
        return not self.numerator

    @cached_property
    def zeros(self) -> NDArray[np.complex128]:
        """Zeros of N [rad/s]."""
        return _roots(self.numerator)

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """Poles, roots of D [rad/s]."""
        return _roots(self.denominator)

    @cached_property
    def open_loop_unstable(self) -> int:
        """P: poles in the open right half-plane."""
        return int(np.sum(self.poles.real > MARGINAL * np.abs(self.poles)))

    @cached_property
    def integrators(self) -> int:
        """Poles less zeros at the origin."""
        return int(np.sum(self.poles == 0) - np.sum(self.zeros == 0))

    @cached_property
    def _origin(self) -> tuple[float, float]:
        """g of L ~ g/s^integrators at the origin: log|g| and sign."""
        zeros, poles = self.zeros[self.zeros != 0], self.poles[self.poles != 0]
        lead = self.numerator[0] / self.denominator[0]
        sign = np.prod(np.exp(1j * np.angle(-zeros))) / np.prod(np.exp(1j * np.angle(-poles)))
        size = math.log(abs(lead)) + np.log(np.abs(zeros)).sum() - np.log(np.abs(poles)).sum()
        return float(size), math.copysign(1.0, lead * sign.real)

    @property
    def start_phase(self) -> float:
        """Phase [rad] as the frequency goes to zero: 0 or -pi, less pi/2 per integrator."""
        return (0.0 if self._origin[1] > 0 else -math.pi) - self.integrators * math.pi / 2.0

    @cached_property
    def _phase_shift(self) -> float:
        return self.start_phase - float(self._raw_phase(np.zeros(1))[0])

    def log_gain(self, omega: ArrayLike) -> Array:
        """Natural logarithm of abs(L) at omega [rad/s], shape of `omega`."""
        s = 1j * np.asarray(omega, float)[..., None]
        lead = math.log(abs(self.numerator[0] / self.denominator[0]))
        with np.errstate(divide="ignore"):
            top = np.log(np.abs(s - self.zeros)).sum(-1)
            bottom = np.log(np.abs(s - self.poles)).sum(-1)
            return np.array(lead + top - bottom, dtype=np.float64)

    def phase(self, omega: ArrayLike) -> Array:
        """Phase of L [rad], continuous in omega > 0 from `start_phase`; no unwrapping."""
        omega = np.asarray(omega, float)
        return self._raw_phase(omega) + self._phase_shift - omega * self.delay

    def _raw_phase(self, omega: Array) -> Array:
        def angles(roots: NDArray[np.complex128]) -> Array:
            a, b = roots.real, omega[..., None] - roots.imag
            return np.where(a > 0, math.pi - np.arctan2(b, np.abs(a)), np.arctan2(b, -a)).sum(-1)

        at_origin = self.integrators * math.pi / 2.0
        return angles(self.zeros[self.zeros != 0]) - angles(self.poles[self.poles != 0]) - at_origin

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """L(j omega)."""
        if self.is_zero:
            return np.zeros(np.shape(omega), complex)
        return np.exp(self.log_gain(omega) + 1j * self.phase(omega))

    def closed_loop_polynomial(self, scale: float = 1.0) -> Array:
        """D + scale N, descending; without the delay."""
        top = scale * np.asarray(self.numerator or (0.0,))
        return np.asarray(np.polyadd(np.asarray(self.denominator), top), float)

    def closed_loop_poles(self, gain: float | None = None) -> NDArray[np.complex128]:
        """Closed-loop poles [rad/s] at gain K (the chosen one by default).

        Raises:
            ValueError: the loop has a delay, and so infinitely many poles.
        """
        if self.delay:
            raise ValueError("closed_loop_poles: a loop with a delay has infinitely many poles")
        scale = 1.0 if gain is None else gain / self.gain
        return np.roots(self.closed_loop_polynomial(scale)).astype(complex)


def _roots(polynomial: ArrayLike) -> NDArray[np.complex128]:
    """Roots; those on the imaginary axis but for rounding lie on it exactly."""
    roots = np.roots(polynomial).astype(complex)
    return np.where(np.abs(roots.real) <= 1e-12 * np.abs(roots), 1j * roots.imag, roots)


def attitude_loop(
    numerator: ArrayLike,
    denominator: ArrayLike,
    inertia: float,
    pid: PID,
    *,
    servo_bandwidth: float | None = None,
    delay: float = 0.0,
    sampling_period: float | None = None,
) -> Loop:
    """Loop of one axis: PID, channel N/D, satellite 1/(I s^2) (eq. 36).

    Args:
        numerator, denominator: the channel, descending powers of s; (1,), (1,) for a rigid mount.
        inertia: of the satellite about the axis [kg m^2].
        pid: the controller.
        servo_bandwidth: of the first-order gimbal servo [rad/s], None for ideal gimbals.
        delay: of computer, sensors and actuators together [s].
        sampling_period: of the controller [s], None for a continuous one.

    Raises:
        ValueError: inertia, servo bandwidth or sampling period not positive; negative delay.
    """
    for name, value in (
        ("inertia", inertia),
        ("servo_bandwidth", servo_bandwidth),
        ("sampling_period", sampling_period),
    ):
        if value is not None and not (value > 0 and math.isfinite(value)):
            raise ValueError(f"{name}: expected a finite positive number, got {value}")
    top = np.convolve([pid.kd, pid.kp, pid.ki], np.asarray(numerator, float))
    bottom = np.convolve([inertia, 0.0, 0.0, 0.0], np.asarray(denominator, float))
    if servo_bandwidth is not None:
        bottom = np.convolve(bottom, [1.0 / servo_bandwidth, 1.0])

    # Without ki the integrator's pole cancels, which is harmless: it is not there. Further common
    # factors s are attitude itself, left without control.
    common = next((i for i, value in enumerate(top[::-1]) if value), 0)
    if common:
        top, bottom = top[:-common], bottom[:-common]
    return Loop(
        numerator=tuple(np.atleast_1d(top).tolist()),
        denominator=tuple(bottom.tolist()),
        gain=pid.gain,
        delay=delay + (0.5 * sampling_period if sampling_period else 0.0),
        sampling_period=sampling_period,
        hidden_integrators=max(common - 1, 0),
    )


# --- crossings -----------------------------------------------------------------------------


@dataclass(frozen=True)
class _Crossing:
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


def between(marks: Array) -> Array:
    """Points below, between and above the marks; one point if there are no marks."""
    marks = np.unique(marks)
    if marks.size == 0:
        return np.ones(1)
    marks = marks[np.append(True, np.diff(marks) > 1e-9 * marks[1:])]
    return np.concatenate([[marks[0] / 2.0], np.sqrt(marks[:-1] * marks[1:]), [2.0 * marks[-1]]])


def phase_crossings(loop: Loop) -> list[_Crossing]:
    """All passages through the negative real axis from s = 0, over the arc, up to j infinity.

    The arc around poles at the origin leads from the real axis, at infinity, clockwise through
    90 degrees per integrator. Half passages start or end on the axis.
    """
    found = []
    log_g, sign = loop._origin
    size = math.inf if loop.integrators > 0 else -math.inf if loop.integrators < 0 else log_g
    real_axis = 0.0 if sign > 0 else -math.pi
    halves = _half_turns(loop.start_phase) - _half_turns(real_axis)
    if halves:
        found.append(_Crossing(0.0, size, halves))

    omega = _phase_samples(loop)
    phases = loop.phase(omega)
    turns = [_half_turns(phase) for phase in phases]
    departure = turns[0] - _half_turns(loop.start_phase)
    if abs(departure) == 1:
        found.append(_Crossing(0.0, size, departure))
    elif turns[0] % 2 == 0:  # the plot lies on the negative real axis, -1 included
        return [_Crossing(0.0, math.nan, 0)]
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
        found.append(_Crossing(at, size, change))
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


# --- results -------------------------------------------------------------------------------


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


@dataclass(frozen=True)
class LoopAnalysis:
    """What is to be known about one loop at its chosen gain. Empty or None where nothing is."""

    gain: float  # K, the chosen gain
    stable: bool
    unstable_poles: int  # closed-loop poles in the right half-plane
    verdict: str
    notes: tuple[str, ...] = ()
    stable_gain_range: tuple[tuple[float, float | None], ...] = ()  # K; None: no upper end
    gain_margins_db: tuple[float, ...] = ()  # [dB] each crossing of -180 degrees, by frequency
    gain_margin_frequencies_hz: tuple[float, ...] = ()  # [Hz]
    phase_margins_deg: tuple[float, ...] = ()  # [deg] in (-180, 180], read at each crossover
    crossovers_hz: tuple[float, ...] = ()  # [Hz] where abs(L) passes 1, rising
    phase_margin_deg: float | None = None  # [deg] the one nearest to zero; None if unstable
    crossover_hz: float | None = None  # [Hz] the crossover of the one nearest to zero
    bandwidth_hz: float | None = None  # [Hz] where abs(L) first falls below 1
    delay_margin_s: float | None = None  # [s] further delay that makes a stable loop unstable
    nyquist: Nyquist | None = None  # None: the plot passes through -1
    consistent: bool = True  # Nyquist's Z equals `unstable_poles`; with a delay it is that
    closed_loop_poles: tuple[complex, ...] = ()  # [rad/s] none listed with a delay

    def to_dict(self) -> dict[str, Any]:
        """For JSON: numbers, lists, None; a complex number is [real, imaginary]."""
        return json_ready(dataclasses.asdict(self))


def nyquist_counts(loop: Loop, gain: float | None = None) -> Nyquist | None:
    """Nyquist counts at gain K (the chosen one by default); None if the plot meets -1."""
    if loop.is_zero:
        return Nyquist(loop.open_loop_unstable, 0, 0, 0, loop.open_loop_unstable)
    return _count(loop, phase_crossings(loop), 1.0 if gain is None else gain / loop.gain)


def _count(loop: Loop, crossings: list[_Crossing], scale: float) -> Nyquist | None:
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


def count_unstable(poles: NDArray[np.complex128]) -> tuple[int, bool]:
    """Number of poles in the right half-plane, and whether some lie on the imaginary axis."""
    tolerance = MARGINAL * np.abs(poles) + 1e-14 * np.abs(poles).max(initial=0.0)
    unstable = poles.real > tolerance
    return int(unstable.sum()), bool(np.any(~unstable & (poles.real >= -tolerance)))


def _is_stable(loop: Loop, crossings: list[_Crossing], scale: float) -> bool:
    if loop.delay:
        counts = _count(loop, crossings, scale)
        return counts is not None and counts.Z == 0
    return count_unstable(loop.closed_loop_poles(scale * loop.gain)) == (0, False)


def _stable_ranges(
    loop: Loop, crossings: list[_Crossing]
) -> tuple[tuple[float, float | None], ...]:
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
    return () if loop.is_zero else _stable_ranges(loop, phase_crossings(loop))


def analyze_loop(loop: Loop) -> LoopAnalysis:
    """Stability, gain range, margins and Nyquist counts of a loop. Unstable loops are welcome."""
    if loop.is_zero:
        return _no_control(loop)
    crossings = phase_crossings(loop)
    ranges = _stable_ranges(loop, crossings)
    counts = _count(loop, crossings, 1.0)
    if loop.delay:
        poles = np.empty(0, complex)
        unstable = 0 if counts is None else int(counts.Z)
        marginal, consistent = counts is None, True
    else:
        poles = loop.closed_loop_poles()
        unstable, marginal = count_unstable(poles)
        consistent = marginal if counts is None else unstable == counts.Z
    marginal = marginal or loop.hidden_integrators > 0
    stable = unstable == 0 and not marginal

    finite = [c for c in crossings if math.isfinite(c.log_gain)]
    crossovers = gain_crossings(loop)
    omega_c = np.array([omega for omega, _ in crossovers])
    margins = _wrap_deg(np.degrees(loop.phase(omega_c)) + 180.0) if crossovers else np.empty(0)
    least = int(np.argmin(np.abs(margins))) if crossovers else None
    falling = [omega for omega, falls in crossovers if falls]
    hz = 1.0 / (2.0 * math.pi)
    return LoopAnalysis(
        gain=loop.gain,
        stable=stable,
        unstable_poles=unstable,
        stable_gain_range=ranges,
        gain_margins_db=tuple(-c.log_gain * 20.0 / math.log(10.0) for c in finite),
        gain_margin_frequencies_hz=tuple(c.omega * hz for c in finite),
        phase_margins_deg=tuple(margins.tolist()),
        crossovers_hz=tuple((omega_c * hz).tolist()),
        phase_margin_deg=float(margins[least]) if stable and least is not None else None,
        crossover_hz=None if least is None else float(omega_c[least] * hz),
        bandwidth_hz=falling[0] * hz if falling else None,
        delay_margin_s=(
            float(np.min(np.radians(margins % 360.0) / omega_c)) if stable and crossovers else None
        ),
        nyquist=counts,
        consistent=consistent,
        closed_loop_poles=tuple(poles.tolist()),
        verdict=(
            "Not stable: with rate feedback alone the attitude drifts. Give kp a value."
            if loop.hidden_integrators
            else gain_verdict(loop.gain, stable, unstable, ranges)
        ),
        notes=_notes(loop, crossovers, consistent),
    )


def _wrap_deg(angle: Array) -> Array:
    """Into (-180, 180]."""
    return 180.0 - (180.0 - angle) % 360.0


def _no_control(loop: Loop) -> LoopAnalysis:
    unstable, marginal = count_unstable(loop.poles)
    return LoopAnalysis(
        gain=loop.gain,
        stable=unstable == 0 and not marginal,
        unstable_poles=unstable,
        nyquist=nyquist_counts(loop),
        closed_loop_poles=tuple(loop.poles.tolist()),
        verdict="No control: all gains are zero, and the attitude is left to itself.",
    )


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


def _notes(loop: Loop, crossovers: list[tuple[float, bool]], consistent: bool) -> tuple[str, ...]:
    notes = []
    if not crossovers:
        notes.append("abs(L) never passes 1: no crossover, no bandwidth, no phase margin.")
    if not consistent:
        notes.append("Nyquist count and closed-loop poles disagree; do not trust this result.")
    fastest = max((omega for omega, _ in crossovers), default=0.0) / (2.0 * math.pi)
    if loop.sampling_period and fastest * loop.sampling_period > 0.1:
        notes.append(
            f"The crossover at {fastest:.3g} Hz lies above a tenth of the sampling rate; half a "
            "sample of delay is a rough model of sampling there."
        )
    return tuple(notes)


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
