"""The attitude loop closed on the whole linearised satellite, all axes at once.

What the paper's per-axis analysis leaves out is in: the free bus, the platform's place on it,
products of inertia, legs with mass, joint friction, rotor momentum, the gimbal servo.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize, minimize_scalar

from quietbus.analysis.loop import PID
from quietbus.dynamics.linearize import LinearModel

DECADES = 5  # of gain searched on either side of the chosen one
POINTS_PER_DECADE = 16


@dataclass(frozen=True)
class ControlledSatellite:
    """Loop ``u = -K/Kd (Kp theta + Ki q + Kd w)``, ``dq/dt = theta`` around a linear satellite.

    Only states that something depends on are kept: position, velocity and, at rest, gimbal angles
    are integrals that act on nothing.
    """

    A: np.ndarray  # (n, n) satellite and integral of the error, loop open
    B: np.ndarray  # (n, 3) by control torque [N m]
    F: np.ndarray  # (3, n) feedback at unit gain K
    gain: float  # [N m s/rad] the chosen K = Kd

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


def controlled(model: LinearModel, pid: PID) -> ControlledSatellite:
    """Attitude control around a linear satellite.

    Args:
        model: with input ``control_torque`` and outputs ``bus_attitude``, ``bus_rate``.
        pid: gains [N m/rad, N m/(rad s), N m s/rad]; kd must not be zero.

    Raises:
        ValueError: kd is zero, so that K = Kd cannot scale the controller.
    """
    if pid.kd == 0.0:
        raise ValueError("the coupled analysis scales the controller by K = Kd, which is zero")
    plant = model.select(["control_torque"], ["bus_attitude", "bus_rate"])
    kept = _states_that_matter(plant)
    A, B, C = plant.A[np.ix_(kept, kept)], plant.B[kept], plant.C[:, kept]
    n, zero = len(A), np.zeros((3, 3))
    attitude, rate = C[:3], C[3:]
    return ControlledSatellite(
        A=np.block([[A, np.zeros((n, 3))], [attitude, zero]]),
        B=np.vstack([B, zero]),
        F=np.hstack([(pid.kp * attitude + pid.kd * rate) / pid.kd, pid.ki / pid.kd * np.eye(3)]),
        gain=pid.kd,
    )


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
    """Stability of the coupled loop; K scales the whole controller, K = Kd."""

    gain: float
    stable: bool
    stable_gain_range: tuple[tuple[float, float | None], ...]  # all found, ascending
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


def analyze_coupled(system: ControlledSatellite) -> CoupledAnalysis:
    """Stable gain range by eigenvalues, margins of all axes together."""
    ranges = stable_gain_range(system)
    stable = bool(system.abscissa(system.gain) < 0.0)
    here = [(low, high) for low, high in ranges if stable and low < system.gain]
    here = [(low, high) for low, high in here if high is None or system.gain < high]
    ends = [end for low_high in here for end in low_high if end]
    alpha = disk_margin(system) if stable else 0.0
    return CoupledAnalysis(
        gain=system.gain,
        stable=stable,
        stable_gain_range=ranges,
        gain_margins_db=tuple(float(20.0 * np.log10(end / system.gain)) for end in ends),
        disk_margin=alpha,
        disk_gain_margin_db=float(20.0 * np.log10((2.0 + alpha) / (2.0 - alpha)))
        if alpha < 2.0
        else float("inf"),
        disk_phase_margin_deg=float(np.degrees(2.0 * np.arctan(alpha / 2.0))),
        poles=system.poles(),
    )


def stable_gain_range(system: ControlledSatellite) -> tuple[tuple[float, float | None], ...]:
    """Intervals of K with all closed-loop poles in the left half plane.

    Sign changes of the spectral abscissa on a logarithmic grid around the chosen gain, each then
    solved for to rounding. None stands for no upper end within the search.
    """
    count = 2 * DECADES * POINTS_PER_DECADE + 1
    gains = abs(system.gain) * np.logspace(-DECADES, DECADES, count)
    values = system.abscissa(gains)
    changes = np.flatnonzero((values[:-1] < 0.0) != (values[1:] < 0.0))
    abscissa = lambda x: float(system.abscissa(np.exp(x)))  # noqa: E731
    logs = [brentq(abscissa, *np.log(gains[i : i + 2]), xtol=1e-15) for i in changes]
    ends = np.exp(logs).tolist()
    if values[0] < 0.0:
        ends.insert(0, 0.0)
    highs = [*ends[1::2], None] if len(ends) % 2 else ends[1::2]
    return tuple(zip(ends[::2], highs, strict=True))


def disk_margin(system: ControlledSatellite) -> float:
    """Symmetric disk margin alpha with independent changes in the three axes.

    ``alpha = 1 / max_w mu(S - I/2)``, S the sensitivity at the actuator. For three scalar blocks
    the structured singular value mu is the least over scalings D of the largest singular value of
    D M D^-1, exactly (Packard and Doyle 1993). Each axis may be multiplied by any complex number
    in the disk through (2-alpha)/(2+alpha) and its inverse before the loop becomes unstable.
    """
    poles = system.poles()
    features = np.abs(poles[np.abs(poles) > 1e-9])
    grid = np.geomspace(features.min() / 10.0, features.max() * 10.0, 200)
    omega = np.unique(np.concatenate([grid, np.outer(features, [0.9, 1.0, 1.1]).ravel()]))
    upper = np.linalg.norm(_balanced(_symmetric(system, omega)), 2, axis=(1, 2))

    def mu(log_omega: float) -> float:
        return _mu(_symmetric(system, np.exp([log_omega]))[0])

    best = 0.0
    for i in np.argsort(upper)[::-1]:  # the bound is tight enough to leave few to refine
        if upper[i] <= best * (1.0 + 1e-9):
            break
        low, high = np.log(omega[[max(i - 1, 0), min(i + 1, len(omega) - 1)]])
        found = minimize_scalar(
            lambda x: -mu(x), bounds=(low, high), method="bounded", options={"xatol": 1e-7}
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

    def norm(logs: np.ndarray) -> float:
        d = np.exp(np.append(logs, 0.0))
        return float(np.linalg.norm(d[:, None] * M / d, 2))

    return float(minimize(norm, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-9}).fun)
