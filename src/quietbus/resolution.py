"""Whether a direct run can show what its scenario declares: every order, noise, ripple."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from quietbus.analysis.residual import RESOLVING, shows
from quietbus.scenario import Problem, Scenario, ScenarioError
from quietbus.scenario.hardware import Unit
from quietbus.scenario.wheels import Wheel
from quietbus.solve.harmonic import steady_speeds

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


def _declared(scenario: Scenario) -> Iterator[tuple[float, str]]:
    """Highest frequency [Hz] and name of what each rotor's disturbance holds."""
    units: tuple[Unit | Wheel, ...] = scenario.cluster.placed()
    for j, unit in enumerate(units):
        rotor = unit.rotor
        if rotor is None or rotor.disturbance is None:
            continue
        for line in rotor.disturbance.orders or ():
            if line.acts and rotor.speed:
                frequency = line.order * abs(rotor.speed) / (2.0 * np.pi)
                yield frequency, f"order {line.order:g} of rotor {j}"
        for name, spectrum in rotor.disturbance.broadband.given().items():
            words = name.replace("_", " ")
            yield spectrum.frequency[-1], f"the end of the broadband {words} of rotor {j}"


def refuse_coarse_tolerance(scenario: Scenario, satellite: Satellite, state: State) -> None:
    """Raise ScenarioError where the absolute tolerance hides a declared order.

    The criterion: the order's steady amplitude, at the start, of the bus's rate [rad/s] or
    velocity [m/s] is to be no less than the absolute tolerance of one step (SI units). Amplitudes
    then come out to about 1e-3 or better.
    """
    if satellite.disturbance is None:
        return
    size = steady_speeds(satellite, state).max(axis=-1)
    there = np.any(np.asarray(satellite.disturbance.coefficient) > 0.0, axis=-1)
    there &= np.asarray(satellite.cluster.rotor_speed)[:, None] != 0.0
    tolerance = scenario.simulation.tolerances.absolute
    hidden = there & (size < tolerance)
    if not hidden.any():
        return
    j, k = (int(i) for i in np.unravel_index(np.argmin(np.where(hidden, size, np.inf)), size.shape))
    text = (
        f"expected at most {size[j, k]:.2g}, the amplitude of the bus's motion (rad/s or m/s) by "
        f"order {scenario.cluster.orders[k]:g} of rotor {j}, the least of "
        f"{int(hidden.sum())} that the tolerance hides; got {tolerance:g}. "
        "A harmonic run needs no such tolerance"
    )
    raise ScenarioError(scenario.name, [Problem(text, ("simulation", "tolerances", "absolute"))])


def ripple_unseen(scenario: Scenario, gimbal_rate: np.ndarray) -> str:
    """Why the output rate could not show the gimbal motors' lines, or an empty text.

    Args:
        gimbal_rate: (n, cmg) of the run [rad/s].
    """
    motor = scenario.cluster.gimbal_motor
    if motor is None or not gimbal_rate.size:
        return ""
    frequency = max(motor.lines) * float(np.max(np.abs(gimbal_rate))) / (2.0 * np.pi)
    rate = scenario.simulation.output_rate
    if shows(rate, frequency):
        return ""
    return (
        f"simulation.output_rate: expected at least {RESOLVING * frequency:.4g} Hz to show "
        f"the gimbal motors' line {max(motor.lines)} in a turn, at {frequency:.4g} Hz when the "
        f"gimbals are fastest; got {rate:g} Hz. The run was integrated with it, but its output is "
        f"aliased; {INSTEAD}"
    )
