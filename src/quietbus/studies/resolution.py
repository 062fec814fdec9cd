"""Whether a direct run can show what its scenario declares: every order, noise, ripple."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from quietbus.analysis.signals.residual import RESOLVING, shows
from quietbus.dynamics.rotor_response import orders_of
from quietbus.scenario import Problem, Scenario, ScenarioError
from quietbus.solve.periodic import steady_speeds

if TYPE_CHECKING:
    from collections.abc import Iterator

    from quietbus.dynamics.state import State
    from quietbus.model.satellite import Satellite

INSTEAD = "a harmonic run needs no such rate"


def refuse_coarse_output(scenario: Scenario) -> None:
    """Raise ScenarioError where the output rate cannot show a declared order or noise."""
    rate = scenario.simulation.output_rate
    unseen = [(f, what) for f, what in _declared(scenario) if not shows(rate, f)]
    if not unseen:
        return
    frequency, what = max(unseen)
    others = f" and {len(unseen) - 1} more below it" if len(unseen) > 1 else ""
    text = (
        f"expected at least {RESOLVING * frequency:.4g} Hz to show {what} at "
        f"{frequency:.4g} Hz{others} ({10 * frequency:.4g} Hz shows it well), got {rate:g} Hz; "
        f"{INSTEAD}"
    )
    raise ScenarioError(scenario.name, [Problem(text, ("simulation", "output_rate"))])


def _declared(scenario: Scenario, speed: np.ndarray | None = None) -> Iterator[tuple[float, str]]:
    """Highest frequency [Hz] and name of what each rotor's disturbance holds.

    Args:
        speed: (cmg,) [rad/s] that rotors have reached, if that is more than the scenario says.
    """
    units: tuple[Any, ...] = scenario.units.placed()
    fastest = scenario.units.fastest
    if speed is not None:
        fastest = np.maximum(fastest, speed)
    for j, unit in enumerate(units):
        rotor = unit.rotor
        if rotor is None or rotor.disturbance is None:
            continue
        for line in rotor.disturbance.orders or ():
            if line.acts and fastest[j]:
                frequency = line.order * float(fastest[j]) / (2.0 * np.pi)
                yield frequency, f"order {line.order:g} of rotor {j}"
        for name, spectrum in rotor.disturbance.broadband.given().items():
            words = name.replace("_", " ")
            yield spectrum.frequency[-1], f"the end of the broadband {words} of rotor {j}"


def refuse_coarse_tolerance(
    scenario: Scenario, satellite: Satellite, state: State, tolerance: float
) -> None:
    """Raise ScenarioError where the absolute tolerance hides a declared order.

    The criterion: the order's steady amplitude, at the start, of the bus's rate [rad/s] or
    velocity [m/s] is to be no less than the absolute tolerance of one step (SI units). Amplitudes
    then come out to about 1e-3 or better.

    Args:
        tolerance: absolute, of one step.
    """
    orders = orders_of(satellite)
    tables = [np.asarray(c.disturbance.coefficients(orders)) for c in satellite.clusters]
    there = np.any(np.concatenate(tables) > 0.0, axis=-1)
    there &= np.asarray(satellite.rotor_speed)[:, None] != 0.0
    if not there.any():
        return
    size = steady_speeds(satellite, state).max(axis=-1)
    hidden = there & (size < tolerance)
    if not hidden.any():
        return
    j, k = (int(i) for i in np.unravel_index(np.argmin(np.where(hidden, size, np.inf)), size.shape))
    text = (
        f"expected at most {size[j, k]:.2g}, the amplitude of the bus's motion (rad/s or m/s) by "
        f"order {orders[k]:g} of rotor {j}, the least of "
        f"{int(hidden.sum())} that the tolerance hides; got {tolerance:g}. "
        "A harmonic run needs no such tolerance"
    )
    raise ScenarioError(scenario.name, [Problem(text, ("simulation", "tolerances", "absolute"))])


def unseen(scenario: Scenario, gimbal_rate: np.ndarray, rotor_speed: np.ndarray) -> str:
    """Why the output rate could not show lines whose frequency only the run tells, or nothing.

    Args:
        gimbal_rate: (n, cmg) of the run [rad/s].
        rotor_speed: (n, cmg) of the run [rad/s].
    """
    found: list[tuple[float, str]] = []
    if rotor_speed.size:
        found += _declared(scenario, np.max(np.abs(rotor_speed), axis=0))
    highest = max(scenario.units.ripple, default=0)
    if highest and gimbal_rate.size:
        frequency = highest * float(np.max(np.abs(gimbal_rate))) / (2.0 * np.pi)
        found.append((frequency, f"the gimbal motors' line {highest} in a turn"))
    rate = scenario.simulation.output_rate
    frequency, what = max(found, default=(0.0, ""))
    if shows(rate, frequency):
        return ""
    return (
        f"simulation.output_rate: expected at least {RESOLVING * frequency:.4g} Hz to show {what}, "
        f"at {frequency:.4g} Hz when it is fastest; got {rate:g} Hz. The run was integrated "
        f"with it, but its output is aliased; {INSTEAD}"
    )
