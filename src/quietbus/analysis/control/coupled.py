"""Gain range and margins of the loop around the whole satellite, by its eigenvalues."""

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from quietbus.analysis.control.controlled import ControlledSatellite
from quietbus.analysis.control.disk_margin import disk_margin
from quietbus.analysis.control.stability import between, count_unstable, gain_verdict
from quietbus.plain import json_ready

REACH = 1e6  # [-] gains further than this factor from the chosen one are taken for rounding


@dataclass(frozen=True)
class CoupledAnalysis:
    """Stability of the coupled loop; K scales the whole controller."""

    gain: float
    stable: bool
    unstable_poles: int  # closed-loop poles in the right half-plane
    stable_gain_range: tuple[tuple[float, float | None], ...]  # all there are, ascending
    critical_gains: tuple[float, ...]  # K at which poles cross the imaginary axis, ascending
    gain_margins_db: tuple[float, ...]  # to the ends of the range that holds the chosen gain
    disk_margin: float  # [-] symmetric multi-loop disk margin alpha, 0 if unstable
    disk_gain_margin_db: float  # every axis at once may change by so much, up or down
    disk_phase_margin_deg: float
    poles: np.ndarray  # closed loop at the chosen gain [rad/s]

    @property
    def gain_margin_db(self) -> float | None:
        """Margin against more gain [dB]; None if the loop is unstable or no gain is too high."""
        upward = [margin for margin in self.gain_margins_db if margin > 0.0]
        return min(upward) if upward else None

    @property
    def verdict(self) -> str:
        """Whether the loop is stable, and for which gains, in words."""
        return gain_verdict(self.gain, self.stable, self.unstable_poles, self.stable_gain_range)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return json_ready(values | {"gain_margin_db": self.gain_margin_db, "verdict": self.verdict})


def analyze_coupled(system: ControlledSatellite) -> CoupledAnalysis:
    """Stable gain range by eigenvalues, margins of all axes together."""
    critical = critical_gains(system)
    ranges = stable_gain_range(system, critical)
    poles = system.poles()
    unstable, marginal = count_unstable(poles)
    stable = unstable == 0 and not marginal
    here = [(low, high) for low, high in ranges if stable and low < system.gain]
    here = [(low, high) for low, high in here if high is None or system.gain < high]
    ends = [end for low_high in here for end in low_high if end]
    alpha = disk_margin(system) if stable else 0.0
    return CoupledAnalysis(
        gain=system.gain,
        stable=stable,
        unstable_poles=unstable,
        stable_gain_range=ranges,
        critical_gains=tuple(critical.tolist()),
        gain_margins_db=tuple(float(20.0 * np.log10(end / system.gain)) for end in ends),
        disk_margin=alpha,
        disk_gain_margin_db=float(20.0 * np.log10((2.0 + alpha) / (2.0 - alpha)))
        if alpha < 2.0
        else float("inf"),
        disk_phase_margin_deg=float(np.degrees(2.0 * np.arctan(alpha / 2.0))),
        poles=poles,
    )


def critical_gains(system: ControlledSatellite) -> np.ndarray:
    """All K > 0 at which closed-loop poles may cross the imaginary axis, ascending.

    Poles on the axis are a pair with the sum zero, or one at zero. The sums of two poles of M are
    the eigenvalues of M's action on antisymmetric matrices, ``X -> M X + X M^T``. That operator is
    linear in K and, the torque being three numbers, changes by a matrix of rank 3 n at most:
    ``S(K) = S(K0) - (K - K0) U V`` is singular where 1/(K - K0) is an eigenvalue of
    ``V S(K0)^-1 U``, which is small. No gain is missed, as it could be on a grid; some found are
    harmless (real poles of opposite sign).
    """
    start = 0.9 * system.gain  # not the gain itself, which may be critical
    M, B, F = system.closed(start), system.B, system.F
    unit = np.eye(len(M))
    i, j = np.triu_indices(len(M), 1)

    def block(left: np.ndarray, right: np.ndarray, p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return left[np.ix_(i, p)] * right[np.ix_(j, q)]

    S = block(M, unit, i, j) - block(M, unit, j, i) + block(unit, M, i, j) - block(unit, M, j, i)
    U = B[i][:, :, None] * unit[j][:, None, :] - B[j][:, :, None] * unit[i][:, None, :]
    V = F[:, None, i] * unit[:, j] - F[:, None, j] * unit[:, i]
    U, V = U.reshape(len(i), -1), V.reshape(-1, len(i))
    try:
        inverses = np.concatenate(
            [
                np.linalg.eigvals(V @ np.linalg.solve(S, U)),
                np.linalg.eigvals(F @ np.linalg.solve(M, B)),
            ]
        )
    except np.linalg.LinAlgError:  # poles that no gain moves lie on the axis
        return np.empty(0)
    gains = start + 1.0 / inverses[np.abs(inverses) > 1.0 / (REACH * start)]
    real = np.abs(gains.imag) <= 1e-3 * np.abs(gains.real)  # two that coincide may look complex
    return np.sort(gains.real[real & (gains.real > start / REACH)])


def stable_gain_range(
    system: ControlledSatellite, critical: np.ndarray | None = None
) -> tuple[tuple[float, float | None], ...]:
    """All intervals of K > 0 with every pole in the left half-plane; None: no upper end.

    Args:
        critical: ``critical_gains(system)``, if known already.
    """
    critical = critical_gains(system) if critical is None else critical
    inside = system.gain * between(critical / system.gain)
    stable = [count_unstable(poles) == (0, False) for poles in map(system.poles, inside)]
    ends = [0.0] if stable[0] else []
    for k in np.flatnonzero(np.diff(stable)):
        ends.append(_limit(system, inside[k], inside[k + 1], critical))
    highs = [*ends[1::2], None] if len(ends) % 2 else ends[1::2]
    return tuple(zip(ends[::2], highs, strict=True))


def _limit(system: ControlledSatellite, low: float, high: float, critical: np.ndarray) -> float:
    """The K between low and high at which stability changes, as good as eigenvalues are."""
    abscissa = lambda x: float(system.abscissa(np.exp(x)))  # noqa: E731
    guess = critical[(critical > low) & (critical < high)]
    for ends in ((guess[0] * (1.0 - 1e-6), guess[0] * (1.0 + 1e-6)), (low, high)):
        a, b = np.log(ends)
        if (abscissa(a) < 0.0) != (abscissa(b) < 0.0):
            return float(np.exp(brentq(abscissa, a, b, xtol=1e-15)))
    return float(guess[0])  # on either side poles stay on the axis
