"""What is to be known of one loop at its chosen gain: stability, margins, bandwidth."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from quietbus.analysis.control.crossings import gain_crossings, phase_crossings
from quietbus.analysis.control.loop import Loop
from quietbus.analysis.control.nyquist import Nyquist, count_at, nyquist_counts, ranges_between
from quietbus.analysis.control.rational import Array
from quietbus.analysis.control.stability import count_unstable, gain_verdict
from quietbus.plain import json_ready


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


def analyze_loop(loop: Loop) -> LoopAnalysis:
    """Stability, gain range, margins and Nyquist counts of a loop. Unstable loops are welcome."""
    if loop.is_zero:
        return _no_control(loop)
    crossings = phase_crossings(loop)
    ranges = ranges_between(loop, crossings)
    counts = count_at(loop, crossings, 1.0)
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
