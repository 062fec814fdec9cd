"""Jitter and control of a satellite whose CMGs ride on several platforms."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from quietbus.analysis.control.coupled import CoupledAnalysis, analyze_coupled
from quietbus.analysis.control.pid import PID
from quietbus.analysis.jitter.combine import Combined, combine
from quietbus.analysis.jitter.lines import AT_REST
from quietbus.analysis.jitter.platforms import MOUNTS, Platforms
from quietbus.arguments import choice, vector
from quietbus.build import build_satellite
from quietbus.scenario import Problem, Scenario, ScenarioError
from quietbus.scenario.checks import listed
from quietbus.solve.noise import noise_at, noisy
from quietbus.solve.validity import refuse_resonance

SHARED = ("bus", "control")  # what is the satellite's and not a platform's


@dataclass(frozen=True)
class PlatformStudy:
    """Small vibration at rest of one bus with a platform for each of several scenarios.

    Each scenario describes the bus with one platform and its CMGs; bus and control must be the
    same in all. The control steers all CMGs as one cluster. Random phases are drawn for units
    counted through the scenarios in the order of their names. Parts are made when asked for; axes
    are those of the bus.

    Raises:
        ScenarioError: no scenario, one whose bus or control is another, or one with wheels.
        ValueError: the satellite cannot rest in the nominal pose (preloaded struts).
        ResonanceError: an order of a rotor lies on an undamped mode.
    """

    scenarios: tuple[Scenario, ...]
    gimbal_angles: tuple[np.ndarray, ...]  # (cmg,) [rad] of each platform

    def __post_init__(self) -> None:
        _check_shared(self.scenarios)
        for scenario in self.scenarios:
            if scenario.units.wheels:
                said = "expected cmg, since several platforms are for CMGs only; got wheel"
                raise ScenarioError(scenario.name, [Problem(said, ("cluster", "type"))])
        error = self.platforms.rest_error
        if error > AT_REST:
            raise ValueError(
                "jitter is analysed at rest in the nominal pose, which is no equilibrium here: a "
                f"platform accelerates by {error:.3g} (SI). Take the struts' preload away "
                "(isolator.legs.free_length)"
            )
        for mount in MOUNTS:
            modes = np.linalg.eigvals(self.platforms.small(mount).state_matrix())
            satellite = self.platforms.satellite
            where = f"with mount {mount} of all platforms"
            refuse_resonance(satellite, where, modes, np.asarray(satellite.rotor_speed))

    @cached_property
    def platforms(self) -> Platforms:
        """The equations."""
        satellites = [
            build_satellite(scenario, "isolated", first)
            for scenario, first in zip(self.scenarios, _first_units(self.scenarios), strict=True)
        ]
        return Platforms.assemble(satellites, self.gimbal_angles)

    def bus_attitude(self, mount: str) -> np.ndarray:
        """Complex amplitudes (cmg, order, axis) [rad], CMGs counted through all platforms."""
        return self.platforms.outputs(choice("mount", mount, MOUNTS))["bus_attitude"]

    def bus_rate(self, mount: str) -> np.ndarray:
        """Complex amplitudes (cmg, order, axis) [rad/s]."""
        return self.platforms.outputs(choice("mount", mount, MOUNTS))["bus_rate"]

    def leg_stroke(self) -> tuple[np.ndarray, ...]:
        """Complex amplitudes (cmg, order, leg) [m] of each platform's legs, by every CMG."""
        return self._by_platform(self.platforms.outputs("isolated")["leg_stroke"])

    def _by_platform(self, strokes: np.ndarray) -> tuple[np.ndarray, ...]:
        """What is of all legs (..., leg), by platform."""
        legs = [len(h.geometry.nominal_length) for h in self.platforms.satellite.hexapods]
        return tuple(np.split(strokes, np.cumsum(legs)[:-1], axis=-1))

    def combined(self, mount: str) -> Combined:
        """Bus rate of all rotors and orders together [rad/s]; noise is in the RMS alone."""
        angles = np.outer(self.platforms.satellite.rotor_phase, self.platforms.orders)
        combined = combine(self.bus_rate(mount), self.platforms.frequency, angles)
        return combined.with_noise(self._noise_square[mount])

    @cached_property
    def _noise_square(self) -> dict[str, np.ndarray]:
        """(axis,) mean square of the bus rate by noise, by mount [rad^2/s^2]."""
        found, satellite = {}, self.platforms.satellite
        for mount in MOUNTS:
            found[mount] = np.zeros(3)
            if noisy(satellite):
                noise = noise_at(self.platforms.mounted(mount), self.platforms.small(mount))
                found[mount] = noise.variance("bus_rate", 1)[0]
        return found

    def static_stroke(self, torque: ArrayLike) -> tuple[np.ndarray, ...]:
        """Strokes (leg,) [m] of each platform's legs as a control torque [N m] sets in."""
        return self._by_platform(self.platforms.strokes_by(vector("torque", torque, 3)))

    @property
    def pid(self) -> PID | None:
        """The controller; None without one, or if all its gains are zero."""
        control = self.scenarios[0].control
        pid = control and PID(control.pid.kp, control.pid.ki, control.pid.kd)
        return pid if pid and pid.gain else None

    @cached_property
    def coupled(self) -> CoupledAnalysis | None:
        """Gain range and margins of the attitude loop, all axes and platforms together."""
        if self.pid is None:
            return None
        steered = self.platforms.satellite.control.steering.acts
        return analyze_coupled(self.platforms.controlled(self.pid, "servo" if steered else "ideal"))


def _first_units(scenarios: Sequence[Scenario]) -> list[int]:
    """Number of each scenario's first unit, whatever the order in which scenarios are given."""
    first, found = 0, [0] * len(scenarios)
    for i in sorted(
        range(len(scenarios)), key=lambda i: (scenarios[i].name, scenarios[i].to_yaml())
    ):
        found[i] = first
        first += scenarios[i].units.count
    return found


def _check_shared(scenarios: Sequence[Scenario]) -> None:
    if not scenarios:
        raise ScenarioError("platforms", [Problem("expected at least one scenario, got none")])
    first = scenarios[0]
    for other in scenarios[1:]:
        problems = [
            Problem(
                f"expected the same as in '{first.name}', since all platforms stand on one "
                "satellite, got another",
                (key,),
            )
            for key in SHARED
            if getattr(other, key) != getattr(first, key)
        ]
        if other.units.orders != first.units.orders:
            problems.append(
                Problem(
                    f"expected the orders of '{first.name}', {listed(first.units.orders)}, for "
                    f"the rotors of every platform, got {listed(other.units.orders)}",
                    ("cluster", "rotor", "disturbance", "orders"),
                )
            )
        if problems:
            raise ScenarioError(other.name, problems)
