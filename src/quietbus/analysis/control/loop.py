"""The open attitude loop of one axis, closed through the isolator (Zhang & Xu 2012, eq. 34-37).

    L(s) = PID(s) G(s) servo(s) / (I s^2) e^(-tau s)

PID(s) = (kd s^2 + kp s + ki)/s, G the channel (`channels`), I the satellite's inertia about the
axis, servo a first-order lag of the gimbals, tau the delay. A sampled controller with a zero
order hold counts as half a sample of extra delay: good to about 1 % of gain and to the hold's
own phase exactly, as long as crossovers stay below a tenth of the sampling rate (the notes of
`margins` say when they do not).

On the imaginary axis gain and phase are sums over zeros and poles,
    log|L| = log|g| + sum log|j w - z| - sum log|j w - p|,    arg L likewise,
so the phase needs no unwrapping, and a delay is exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quietbus.analysis.control.pid import PID
from quietbus.analysis.control.rational import Array, Coefficients
from quietbus.analysis.control.stability import MARGINAL


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
    def origin(self) -> tuple[float, float]:
        """g of L ~ g/s^integrators at the origin: log|g| and sign."""
        zeros, poles = self.zeros[self.zeros != 0], self.poles[self.poles != 0]
        lead = self.numerator[0] / self.denominator[0]
        sign = np.prod(np.exp(1j * np.angle(-zeros))) / np.prod(np.exp(1j * np.angle(-poles)))
        size = math.log(abs(lead)) + np.log(np.abs(zeros)).sum() - np.log(np.abs(poles)).sum()
        return float(size), math.copysign(1.0, lead * sign.real)

    @property
    def start_phase(self) -> float:
        """Phase [rad] as the frequency goes to zero: 0 or -pi, less pi/2 per integrator."""
        return (0.0 if self.origin[1] > 0 else -math.pi) - self.integrators * math.pi / 2.0

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
