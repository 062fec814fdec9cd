"""The attitude loop closed on the whole linearised satellite, all axes at once.

What the paper's per-axis analysis leaves out is in: the free bus, the platform's place on it,
products of inertia, legs with mass, joint friction, rotor momentum, the gimbal servo.
"""

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize, minimize_scalar

from quietbus.analysis.control.channels import json_ready
from quietbus.analysis.control.loop import PID, between, count_unstable, gain_verdict
from quietbus.dynamics.linearize import LinearModel

REACH = 1e6  # [-] gains further than this factor from the chosen one are taken for rounding


@dataclass(frozen=True)
class ControlledSatellite:
    """Loop ``u = -(Kp theta + Ki q + Kd w)``, ``dq/dt = theta`` around a linear satellite.

    K scales the whole controller: Kd, or Kp without Kd, as in the analysis per axis.

    Only states that something depends on are kept: position, velocity and, at rest, gimbal angles
    are integrals that act on nothing.
    """

    A: np.ndarray  # (n, n) satellite and integral of the error, loop open
    B: np.ndarray  # (n, 3) by control torque [N m]
    F: np.ndarray  # (3, n) feedback at unit gain K
    gain: float  # the chosen K [N m s/rad]

    def closed(self, gain: float | np.ndarray) -> np.ndarray:
        """System matrix (..., n, n) of the closed loop at gain K."""
        gain = np.asarray(gain, dtype=float)[..., None, None]
        return self.A - gain * (self.B @ self.F)

    def poles(self, gain: float | None = None) -> np.ndarray:
        """Closed-loop poles [rad/s] at gain K, by default the chosen one."""
        return np.linalg.eigvals(self.closed(self.gain if gain is None else gain))

    def abscissa(self, gain: float | np.ndarray) -> np.ndarray:
        """Largest real part of the closed-loop poles [1/s]; negative where stable."""
        return np.max(np.linalg.eigvals(self.closed(gain)).real, axis=-1)

    def loop(self, omega: np.ndarray) -> np.ndarray:
        """Loop transfer matrix (frequency, 3, 3) at the actuator, at frequencies [rad/s]."""
        s = 1j * np.atleast_1d(omega)[:, None, None]
        resolvent = np.linalg.solve(s * np.eye(len(self.A)) - self.A, self.B.astype(complex))
        return self.gain * (self.F @ resolvent)

    def axis_loops(self, omega: np.ndarray) -> np.ndarray:
        """Loop of each axis (frequency, 3) with the other two closed, at frequencies [rad/s]."""
        L = self.loop(omega)
        columns = []
        for i in range(3):
            others = [j for j in range(3) if j != i]
            closed = np.eye(2) + L[:, others][:, :, others]
            through = np.linalg.solve(closed, L[:, others, i, None])[..., 0]
            columns.append(L[:, i, i] - np.einsum("fj,fj->f", L[:, i, others], through))
        return np.stack(columns, axis=1)


def controlled(model: LinearModel, pid: PID) -> ControlledSatellite:
    """Attitude control around a linear satellite.

    Args:
        model: with input ``control_torque`` and outputs ``bus_attitude``, ``bus_rate``.
        pid: gains, of which at least one is not zero.

    Raises:
        ValueError: all gains are zero, so that there is no loop.
    """
    if not pid.gain:
        raise ValueError("pid: expected a gain that is not zero; without control there is no loop")
    plant = model.select(["control_torque"], ["bus_attitude", "bus_rate"])
    kept = _states_that_matter(plant)
    A, B, C = plant.A[np.ix_(kept, kept)], plant.B[kept], plant.C[:, kept]
    attitude, rate = C[:3], C[3:]
    F = (pid.kp * attitude + pid.kd * rate) / pid.gain
    if pid.ki:  # without it the integral acts on nothing
        n, zero = len(A), np.zeros((3, 3))
        A = np.block([[A, np.zeros((n, 3))], [attitude, zero]])
        B = np.vstack([B, zero])
        F = np.hstack([F, pid.ki / pid.gain * np.eye(3)])
    return ControlledSatellite(A, B, F, pid.gain)


def _states_that_matter(model: LinearModel) -> np.ndarray:
    """Indices of the states on which an output depends, directly or through other states."""
    linked = (np.abs(model.A) > 1e-12 * np.abs(model.A).max()).astype(int)
    matter = np.any(model.C != 0.0, axis=0)
    while True:
        grown = matter | (matter @ linked > 0)
        if np.array_equal(grown, matter):
            return np.flatnonzero(matter)
        matter = grown


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


def disk_margin(system: ControlledSatellite) -> float:
    """Symmetric disk margin alpha with independent changes in the three axes.

    ``alpha = 1 / max_w mu(S - I/2)``, S the sensitivity at the actuator. For three scalar blocks
    the structured singular value mu is the least over scalings D of the largest singular value of
    D M D^-1, exactly (Packard and Doyle 1993). Each axis may be multiplied by any complex number
    in the disk through (2-alpha)/(2+alpha) and its inverse before the loop becomes unstable.
    """
    poles = system.poles()
    sizes, widths = np.abs(poles[np.abs(poles) > 1e-9]), np.linspace(-4.0, 4.0, 17)
    grid = np.geomspace(sizes.min() / 10.0, sizes.max() * 10.0, 200)
    peaks = poles[poles.imag > 0.0]
    around = (peaks.imag + np.abs(peaks.real) * widths[:, None]).ravel()
    omega = np.unique(np.concatenate([grid, around[around > grid[0]]]))
    upper = np.linalg.norm(_balanced(_symmetric(system, omega)), 2, axis=(1, 2))

    def mu(log_omega: float) -> float:
        return _mu(_symmetric(system, np.exp([log_omega]))[0])

    best = 0.0
    for i in np.argsort(upper)[::-1]:  # the bound is tight enough to leave few to refine
        if upper[i] <= best * (1.0 + 1e-9):
            break
        low, high = np.log(omega[[max(i - 1, 0), min(i + 1, len(omega) - 1)]])
        found = minimize_scalar(
            lambda x: -mu(x), bounds=(low, high), method="bounded", options={"xatol": 1e-5}
        )
        best = max(best, -float(found.fun), mu(float(np.log(omega[i]))))
    return 1.0 / best


def _symmetric(system: ControlledSatellite, omega: np.ndarray) -> np.ndarray:
    identity = np.eye(3)
    return np.linalg.inv(identity + system.loop(omega)) - 0.5 * identity


def _balanced(M: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) scaled by diagonals so that rows and columns weigh alike (Osborne)."""
    M = M.copy()
    for _ in range(8):
        for i in range(3):
            others = [j for j in range(3) if j != i]
            row = np.linalg.norm(M[:, i, others], axis=1)
            column = np.linalg.norm(M[:, others, i], axis=1)
            scale = np.sqrt(np.maximum(column, 1e-300) / np.maximum(row, 1e-300))
            M[:, i, :] *= scale[:, None]
            M[:, :, i] /= scale[:, None]
    return M


def _mu(M: np.ndarray) -> float:
    """Structured singular value of a 3 x 3 matrix for three complex scalars."""
    M = _balanced(M[None])[0]

    def norm(logs: np.ndarray) -> tuple[float, np.ndarray]:
        """Largest singular value of D M D^-1, and its slopes by the logarithms of D."""
        d = np.exp(np.append(logs, 0.0))
        left, sizes, right = np.linalg.svd(d[:, None] * M / d)
        slopes = np.abs(left[:, 0]) ** 2 - np.abs(right[0]) ** 2
        return float(sizes[0]), sizes[0] * slopes[:2]

    smooth = minimize(norm, np.zeros(2), jac=True, method="BFGS", options={"gtol": 1e-8})
    if np.max(np.abs(smooth.jac)) < 1e-7 * smooth.fun:
        return float(smooth.fun)
    # two singular values meet at the least one, which then has an edge
    edge = {"xatol": 1e-9, "fatol": 1e-12}
    return float(minimize(lambda x: norm(x)[0], smooth.x, method="Nelder-Mead", options=edge).fun)
