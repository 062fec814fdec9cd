"""The attitude loop closed on the whole linearised satellite, all axes at once.

What the paper's per-axis analysis leaves out is in: the free bus, the platform's place on it,
products of inertia, legs with mass, joint friction, rotor momentum, the gimbal servo.
"""

from dataclasses import dataclass

import numpy as np

from quietbus.analysis.control.pid import PID
from quietbus.dynamics.linear_model import LinearModel


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
