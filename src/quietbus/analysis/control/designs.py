"""Many isolator designs at once, and the paper's rule for a single one."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quietbus.analysis.control.loop import attitude_loop
from quietbus.analysis.control.margins import analyze_loop
from quietbus.analysis.control.pid import PID
from quietbus.analysis.control.rational import Array, peak
from quietbus.analysis.control.stability import nearest_range
from quietbus.analysis.control.symbolic import SymbolicChannel
from quietbus.plain import json_ready

ABOUT_A_DECADE = 5.0
"""[-] Least corner over bandwidth that passes the design rule; the paper's own is 6.7."""


@dataclass(frozen=True, eq=False)
class DesignMap:
    """Loop and isolator figures of m isolator designs (k, c); NaN where there is none."""

    stiffness: Array  # (m,) [N/m]
    damping: Array  # (m,) [N s/m]
    stable: NDArray[np.bool_]  # (m,) at the chosen gain
    gain_low: Array  # (m,) K, of the stable range that holds or is nearest to the chosen gain
    gain_high: Array  # (m,) K, inf for no upper end
    gain_margin_db: Array  # (m,) [dB] from the chosen gain up to `gain_high`
    phase_margin_deg: Array  # (m,) [deg]
    crossover_hz: Array  # (m,) [Hz]
    peak_frequency_hz: Array  # (m,) [Hz] of the channel
    peak_gain: Array  # (m,) [-] of the channel


def map_designs(
    channel: SymbolicChannel,
    stiffness: ArrayLike,
    damping: ArrayLike,
    inertia: float,
    pid: PID,
    *,
    servo_bandwidth: float | None = None,
    delay: float = 0.0,
    sampling_period: float | None = None,
) -> DesignMap:
    """Gain range, margins and isolation peak for many isolator designs.

    Args:
        channel: the channel with k and c as symbols.
        stiffness, damping: leg k [N/m] and c [N s/m], broadcast against each other.
        inertia, pid, servo_bandwidth, delay, sampling_period: as in `attitude_loop`.

    Raises:
        ValueError: all gains of the PID are zero, or what `attitude_loop` refuses.
    """
    if not pid.gain:
        raise ValueError("pid: expected a gain that is not zero; without control there is no map")
    k, c = (np.ravel(a) for a in np.broadcast_arrays(stiffness, damping))
    rows = []
    for k_i, c_i in zip(k.tolist(), c.tolist(), strict=True):
        numerator, denominator = channel.coefficients(k_i, c_i)
        result = analyze_loop(
            attitude_loop(
                numerator,
                denominator,
                inertia,
                pid,
                servo_bandwidth=servo_bandwidth,
                delay=delay,
                sampling_period=sampling_period,
            )
        )
        low, high = nearest_range(result.stable_gain_range, pid.gain)
        peak_frequency, peak_gain = peak(numerator, denominator)
        rows.append(
            (
                result.stable,
                low,
                high,
                20.0 * math.log10(high / pid.gain) if high > 0 else math.nan,
                math.nan if result.phase_margin_deg is None else result.phase_margin_deg,
                math.nan if result.crossover_hz is None else result.crossover_hz,
                peak_frequency / (2.0 * math.pi),
                peak_gain,
            )
        )
    columns = np.array(rows, float).reshape(-1, 8).T
    return DesignMap(
        np.asarray(k, float), np.asarray(c, float), columns[0].astype(bool), *columns[1:]
    )


@dataclass(frozen=True)
class DesignRule:
    """The paper's rule: the isolator's corner about one decade above the control bandwidth."""

    ratio: float | None  # [-] peak frequency of the channel over bandwidth; None: no bandwidth
    passed: bool
    words: str

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return json_ready(dataclasses.asdict(self))


def corner_rule(peak_frequency_hz: float, bandwidth_hz: float | None) -> DesignRule:
    """Check the isolator's corner against the bandwidth of the attitude control.

    Args:
        peak_frequency_hz: of the channel [Hz].
        bandwidth_hz: of the loop [Hz], None if it has none.
    """
    if bandwidth_hz is None:
        return DesignRule(None, False, "The loop has no crossover, so there is nothing to compare.")
    ratio = peak_frequency_hz / bandwidth_hz
    passed = ratio >= ABOUT_A_DECADE
    judgement = "about a decade or more, as it should be" if passed else "too near"
    words = (
        f"The isolator's corner ({peak_frequency_hz:.3g} Hz) is {ratio:.1f} times the control "
        f"bandwidth ({bandwidth_hz:.3g} Hz): {judgement} (rule: about 10, at least "
        f"{ABOUT_A_DECADE:g})."
    )
    return DesignRule(ratio, passed, words)
