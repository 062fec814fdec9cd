"""Rotor speed from rest to its maximum: modes, critical speeds and the map of the jitter.

All rotors turn at one common factor times their own speeds. Modes are those of the free satellite
with its gimbals held (the attitude loop left out), as in the linear analysis. The jitter is that of
the controlled satellite.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import eig, eigvals
from scipy.optimize import brentq

from quietbus.analysis.control.modes import Mode, mode_of
from quietbus.dynamics.vibration import Vibration
from quietbus.model.satellite import BUS, Satellite

SEARCHED_SPEEDS = 400  # where modes are computed to bracket the crossings
SAME_SPEED = 1e-9  # relative: rotors closer than this turn at one speed
ROUNDING = 1e-9  # of the largest amplitude: an order below it excites nothing
_PROPORTIONAL = 1e-9  # relative error up to which the matrices follow the speed's factor
_TURNING = 1e-6  # of the largest frequency: slower is no oscillation


@dataclass(frozen=True, eq=False)
class SpinningModes:
    """Small vibration of the satellite at rest, gimbals held, for any speed of its rotors.

    ``M x'' + (C + f G) x' + (K + f L) x = 0`` at the factor f: the rotors' momentum is all that
    depends on their speed, and it is proportional to it.
    """

    M: np.ndarray  # (n, n)
    C: np.ndarray  # (n, n) with the rotors still
    G: np.ndarray  # (n, n) skew: what the rotors' momentum does at f = 1
    K: np.ndarray  # (n, n)
    L: np.ndarray  # (n, n) zero at rest
    shapes: Mapping[str, np.ndarray]  # by body: (12, n) its motion and that of the bus by x

    @classmethod
    def between(cls, small: Vibration, factor: np.ndarray) -> "SpinningModes":
        """From the equations at some factors, the first of which is 0.

        Args:
            small: with a leading axis of factors; control is left out.
            factor: (n,) ascending.

        Raises:
            ValueError: the matrices are not proportional to the factor.
        """
        M, C, K = (np.asarray(matrix) for matrix in (small.M, small.C, small.K))
        span = factor[-1] - factor[0]
        G, L = ((matrix[-1] - matrix[0]) / span for matrix in (C, K))
        for matrix, slope in ((M, 0.0 * G), (C, G), (K, L)):
            line = matrix[0] + np.multiply.outer(factor, slope)
            size = np.max(np.abs(matrix)) + np.max(np.abs(M))  # K is none on a rigid mount
            if np.max(np.abs(matrix - line)) > _PROPORTIONAL * size:
                raise ValueError("the satellite's vibration does not follow the rotors' speed")
        layout, T = small.slow.now.layout, np.asarray(small.projection)[0]
        bodies = [name for name in small.free.names if name != BUS] or layout.names[1:2] or (BUS,)
        bus = T[layout.rows(BUS)]
        shapes = {name: np.concatenate([T[layout.rows(name)], bus]) for name in bodies}
        return cls(M[0], C[0], G, K[0], L, shapes)

    def state_matrix(self, factor: float) -> np.ndarray:
        """A of dx/dt = A x; x: displacements and their rates."""
        n = len(self.M)
        pull = np.linalg.solve(self.M, -(self.K + factor * self.L))
        damp = np.linalg.solve(self.M, -(self.C + factor * self.G))
        return np.block([[np.zeros((n, n)), np.eye(n)], [pull, damp]])

    def frequencies(self, factor: float) -> np.ndarray:
        """Damped frequencies (n,) [rad/s], ascending; zeros for motions that do not oscillate.

        As a list in this order they are continuous functions of the factor.
        """
        return self._ascending(eigvals(self.state_matrix(factor)))[0]

    def modes(self, factor: float) -> list[Mode | None]:
        """The modes of ``frequencies``; None where nothing oscillates."""
        poles, vectors = eig(self.state_matrix(factor))
        _, which = self._ascending(poles)
        moved = {body: by @ vectors[: len(self.M)] for body, by in self.shapes.items()}
        return [
            None if i is None else mode_of(poles[i], {body: by[:, i] for body, by in moved.items()})
            for i in which
        ]

    def _ascending(self, poles: np.ndarray) -> tuple[np.ndarray, list[int | None]]:
        least = _TURNING * np.max(np.abs(poles))
        turning = [i for i in np.argsort(poles.imag, kind="stable") if poles[i].imag > least]
        missing = len(self.M) - len(turning)
        frequency = np.append(np.zeros(missing), poles[turning].imag)
        return frequency, [*[None] * missing, *map(int, turning)]


@dataclass(frozen=True)
class CriticalSpeed:
    """A speed at which an order of some rotors has the frequency of a mode."""

    factor: float  # of all rotors' own speeds
    speed: float  # [rad/s] of these rotors, positive
    order: float
    cmgs: tuple[int, ...]  # the rotors that turn at this speed
    mode: Mode  # damped frequency: the order's

    @property
    def amplification(self) -> float:
        """Quality factor 1 / (2 damping) [-]: resonance over quasi-static; inf if undamped."""
        return 1.0 / (2.0 * self.mode.damping) if self.mode.damping > 0.0 else np.inf


def critical_speeds(
    modes: SpinningModes, speed: np.ndarray, orders: Sequence[float], most: float
) -> tuple[CriticalSpeed, ...]:
    """Crossings of the orders' rays with the modes' damped frequencies, by rising speed.

    Bracketed on a grid of factors, then found as roots of the eigenvalue problem itself.

    Args:
        speed: (cmg,) [rad/s] at factor 1.
        most: largest factor.
    """
    half = SEARCHED_SPEEDS // 2
    factors = np.unique(np.append(np.geomspace(1e-4, 1.0, half), np.linspace(0, 1, half)[1:]))
    factors *= most
    frequency = np.array([modes.frequencies(factor) for factor in factors])
    found = []
    for cmgs in _of_one_speed(speed):
        for order in orders:
            slope = abs(order * speed[cmgs[0]])
            above = frequency > slope * factors[:, None]
            for i, k in np.argwhere(above[1:] != above[:-1]):
                root = brentq(
                    lambda f, k=k, slope=slope: modes.frequencies(f)[k] - slope * f,
                    factors[i],
                    factors[i + 1],
                    xtol=1e-14 * most,
                    rtol=1e-13,
                )
                mode = modes.modes(root)[k]
                if mode is not None:
                    at = abs(root * speed[cmgs[0]])
                    found.append(CriticalSpeed(root, at, float(order), cmgs, mode))
    return tuple(sorted(found, key=lambda critical: critical.factor))


def _of_one_speed(speed: np.ndarray) -> list[tuple[int, ...]]:
    """Rotors that turn, by speed."""
    groups: list[list[int]] = []
    for j in np.argsort(-np.abs(speed), kind="stable"):
        if speed[j] == 0.0:
            continue
        first = groups[-1][0] if groups else None
        if first is not None and abs(abs(speed[first]) - abs(speed[j])) < SAME_SPEED * abs(
            speed[j]
        ):
            groups[-1].append(int(j))
        else:
            groups.append([int(j)])
    return [tuple(sorted(group)) for group in groups]


@dataclass(frozen=True, eq=False)
class BearingMode:
    """A mode of some rotors on their bearings, the gimbal held; rocking splits with speed."""

    name: str  # radial, axial or rocking
    cmgs: tuple[int, ...]  # rotors that are alike in this
    vibration: SpinningModes

    def whirl(self, branch: int) -> str:
        """Its name with the way in which a branch of the frequencies turns."""
        return f"{self.name}, {('backward', 'forward')[branch]}" if self.splits else self.name

    @property
    def splits(self) -> bool:
        """Whether it has two branches."""
        return len(self.vibration.M) == 2


_CHANNELS = {"radial": ((0, 1),), "axial": ((2,),), "rocking": ((4,), (3,))}  # of each branch


def bearing_modes(satellite: Satellite) -> tuple[BearingMode, ...]:
    """Internal modes of the rotors, from the scenario's ``disturbance.resonances``."""
    period, damping, inertia, speed = (
        np.concatenate([np.asarray(of(cluster)) for cluster in satellite.clusters])
        for of in (
            lambda c: c.disturbance.bearings()[0],
            lambda c: c.disturbance.bearings()[1],
            lambda c: c.units.I_RRcm_R,
            lambda c: c.units.rotor_speed,
        )
    )
    alike: dict[tuple[int, float, float, float, float], list[int]] = {}
    for m, name in enumerate(_CHANNELS):
        for j in np.flatnonzero(period[:, m] > 0.0):
            across = 0.5 * (inertia[j, 1, 1] + inertia[j, 2, 2])
            gyro = inertia[j, 0, 0] / across * abs(speed[j]) if name == "rocking" else 0.0
            key = (m, 1.0 / period[j, m], damping[j, m], gyro, abs(speed[j]))
            alike.setdefault(key, []).append(int(j))
    found = []
    for (kind, w0, ratio, gyro, _), cmgs in alike.items():
        name = list(_CHANNELS)[kind]
        unit = np.eye(2 if name == "rocking" else 1)
        turning = gyro * np.array([[0.0, 1.0], [-1.0, 0.0]]) if name == "rocking" else 0.0 * unit
        shapes = {name: np.eye(12, len(unit))}
        vibration = SpinningModes(
            unit, 2.0 * ratio * w0 * unit, turning, w0**2 * unit, 0.0 * unit, shapes
        )
        found.append(BearingMode(name, tuple(cmgs), vibration))
    return tuple(found)


def bearing_critical_speeds(
    satellite: Satellite, orders: Sequence[float], most: float
) -> tuple[CriticalSpeed, ...]:
    """Speeds at which a line of a rotor's table meets the mode that it excites."""
    speed, found = np.asarray(satellite.rotor_speed), []
    tables = np.concatenate(
        [np.asarray(c.disturbance.coefficients(tuple(orders))) for c in satellite.clusters]
    )
    for bearing in bearing_modes(satellite):
        cmgs = list(bearing.cmgs)
        coefficient = tables[cmgs]  # (cmg, order, channel)
        for critical in critical_speeds(bearing.vibration, speed[cmgs[:1]], orders, most):
            frequency = bearing.vibration.frequencies(critical.factor)
            branch = int(np.argmin(np.abs(frequency - critical.order * critical.speed)))
            channels = list(_CHANNELS[bearing.name][branch])
            if coefficient[:, list(orders).index(critical.order), channels].any():
                mode = replace(
                    critical.mode, name=f"rotor, {bearing.whirl(branch)}", shape=np.zeros(12)
                )
                found.append(replace(critical, cmgs=bearing.cmgs, mode=mode))
    return tuple(sorted(found, key=lambda critical: critical.factor))


@dataclass(frozen=True, eq=False)
class SpeedSweep:
    """Jitter and modes of a satellite at rest, over the speed of its rotors.

    Mounts: "isolated" and "rigid".
    """

    factor: np.ndarray  # (n,) from 0, of all rotors' own speeds
    rotor_speed: np.ndarray  # (cmg,) [rad/s] at factor 1
    rotor_phase: np.ndarray  # (cmg,) [rad]
    orders: tuple[float, ...]
    bus_rate: dict[str, np.ndarray]  # by mount: (n, cmg, order, axis) complex [rad/s]
    modes: dict[str, SpinningModes]  # by mount
    critical: dict[str, tuple[CriticalSpeed, ...]]  # by mount
    bearings: tuple[BearingMode, ...] = ()  # of rotors with internal modes
    bearing_critical: tuple[CriticalSpeed, ...] = ()
    gimbal_angle: tuple[float, ...] = ()  # (cmg,) [rad] at which gimbals are held; of wheels none

    @property
    def speed(self) -> np.ndarray:
        """Speed of the fastest rotor (n,) [rad/s]."""
        return self.factor * np.max(np.abs(self.rotor_speed))

    @property
    def frequency(self) -> np.ndarray:
        """Of every line (n, cmg, order) [rad/s], positive."""
        return np.abs(np.multiply.outer(self.factor, np.outer(self.rotor_speed, self.orders)))

    def by_order(self, mount: str) -> np.ndarray:
        """Sum of the rotors' amplitudes (n, order, axis) [rad/s]: any phases."""
        return np.sum(np.abs(self.bus_rate[mount]), axis=1)

    def together(self, mount: str) -> np.ndarray:
        """Complex amplitudes (n, order, axis) [rad/s] of rotors of one speed, phases as given.

        Raises:
            ValueError: the rotors turn at different speeds.
        """
        if len(_of_one_speed(self.rotor_speed)) != 1:
            raise ValueError("expected rotors of one speed; these beat against each other")
        turned = self.bus_rate[mount] * np.exp(
            1j * np.outer(self.rotor_phase, self.orders)[..., None]
        )
        backwards = (self.rotor_speed < 0.0)[:, None, None]
        return np.sum(np.where(backwards, turned.conj(), turned), axis=1)

    def excited(self, mount: str) -> np.ndarray:
        """Which orders (order,) shake the bus by more than rounding."""
        largest = self.by_order(mount).max(axis=(0, 2), initial=0.0)
        return largest > ROUNDING * max(largest.max(initial=0.0), 1e-300)

    def amplitude_at(self, critical: CriticalSpeed, mount: str) -> np.ndarray:
        """Sum of the amplitudes (axis,) [rad/s] of this order and these rotors, there."""
        i = int(np.argmin(np.abs(self.factor - critical.factor)))
        lines = self.bus_rate[mount][i, list(critical.cmgs), self.orders.index(critical.order)]
        return np.sum(np.abs(lines), axis=0)

    def to_dict(self) -> dict[str, Any]:
        """Numbers and lists, for JSON; see docs/jitter.md."""
        rpm = 30.0 / np.pi
        return {
            "speed_rpm": rpm * self.speed,
            "nominal_speed_rpm": rpm * np.max(np.abs(self.rotor_speed)),
            "orders": list(self.orders),
            **{
                mount: {
                    "bus_rate_amplitude_deg_s": np.rad2deg(
                        np.moveaxis(self.by_order(mount), 0, -1)
                    ),
                    "critical_speeds": [
                        self._critical_dict(critical, mount) for critical in self.critical[mount]
                    ],
                    "bearing_critical_speeds": [
                        self._critical_dict(critical, mount) for critical in self.bearing_critical
                    ],
                }
                for mount in self.bus_rate
            },
        }

    def _critical_dict(self, critical: CriticalSpeed, mount: str) -> dict[str, Any]:
        return {
            "speed_rpm": 30.0 / np.pi * critical.speed,
            "factor": critical.factor,
            "order": critical.order,
            "cmgs": critical.cmgs,
            "frequency_hz": critical.mode.damped_frequency_hz,
            "damping": critical.mode.damping,
            "amplification": critical.amplification,
            "mode": critical.mode.name,
            "bus_rate_amplitude_deg_s": np.rad2deg(self.amplitude_at(critical, mount)),
            "excited": bool(self.excited(mount)[self.orders.index(critical.order)]),
        }
