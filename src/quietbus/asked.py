"""What a caller asks for: a scenario with other values, gimbal angles, a task; checked by name."""

import warnings
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from quietbus.arguments import array, choice, positive, vector
from quietbus.methods import Method
from quietbus.processes import start_computing
from quietbus.results.task import Task, parts_file_of
from quietbus.scenario import LineOfSight, Scenario, load_scenario
from quietbus.scenario.plausibility import implausible
from quietbus.studies.resolution import refuse_coarse_output

Mount = Literal["isolated", "rigid"]


class QuietbusWarning(UserWarning):
    """Something in a run that the user should know before trusting its numbers."""


class ImplausibleValue(QuietbusWarning):
    """A value of a scenario that no satellite has; most often its unit was left out."""


def tell_implausible(scenario: Scenario) -> None:
    """Warn of values that no satellite has, where the caller of the caller is."""
    for note in implausible(scenario):
        warnings.warn(note, ImplausibleValue, stacklevel=3)


def scenario_asked(
    scenario: Scenario | str,
    mount: Mount | None = None,
    duration: float | None = None,
    output_rate: float | None = None,
) -> Scenario:
    """The scenario with what the caller asks for instead of its own values."""
    found = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    start_computing()
    wanted = {
        "simulation.duration": duration,
        "simulation.output_rate": output_rate,
    }
    changes = {path: _checked(path, value) for path, value in wanted.items() if value is not None}
    if mount is not None:
        found = found.with_mount(choice("mount", mount, ("isolated", "rigid")))
    return found.with_overrides(changes) if changes else found


def _checked(path: str, value: Any) -> Any:
    name = path.rpartition(".")[2]
    return value if isinstance(value, str) else positive(name, value)  # a text may have a unit


def angles_asked(scenario: Scenario, angles: ArrayLike | None) -> np.ndarray:
    """(cmg,) gimbal angles [rad], the scenario's own unless given."""
    count = scenario.units.count
    if angles is not None and not scenario.units.gimbals_turn:
        raise ValueError("gimbal angles: expected none, since reaction wheels have no gimbals")
    own = scenario.units.gimbal_angles
    return vector("gimbal angles", own if angles is None else angles, count)


def task_asked(
    scenario: Scenario,
    method: Method,
    joint_forces: bool = False,
    points: Mapping[str, ArrayLike] | None = None,
    lines_of_sight: Mapping[str, ArrayLike] | None = None,
) -> Task:
    """A task that its method can solve and whose output shows what the scenario declares.

    Raises:
        ScenarioError: the output rate is too coarse.
        ValueError: something that the method or the mount does not have.
    """
    points, lines_of_sight = points or {}, lines_of_sight or {}
    if joint_forces and method.jitter_apart:
        raise ValueError("joint_forces needs method 'direct'")
    if joint_forces and scenario.mount == "rigid":
        raise ValueError(
            "joint_forces needs mount 'isolated': on a rigid mount the legs' forces are not "
            "determined, since the plate is held by the mount and not by the legs"
        )
    if not method.jitter_apart:
        if points or lines_of_sight:
            raise ValueError("points and lines_of_sight need method 'harmonic'")
        refuse_coarse_output(scenario)
        return Task(scenario, method, joint_forces, parts_file=parts_file_of(scenario))
    at = {name: vector(f"points[{name!r}]", p, 3) for name, p in points.items()}
    own = {name: scenario.sight(name).matrix() for name in scenario.lines_of_sight}
    lines = {
        name: _sensitivity(f"lines_of_sight[{name!r}]", each)
        for name, each in (own | dict(lines_of_sight)).items()
    }
    return Task(scenario, method, False, at, lines, parts_file_of(scenario))


def _sensitivity(name: str, given: ArrayLike) -> np.ndarray:
    """(3, 12) of a direction, or of a matrix with zero rows for what it does not have."""
    values = array(name, given, "3 numbers, or one to three rows of 12")
    if values.ndim < 2:
        direction = vector(name, given, 3)
        if not np.any(direction):
            raise ValueError(f"{name}: expected a direction, got zero")
        return LineOfSight(direction=tuple(direction / np.linalg.norm(direction))).matrix()
    if values.ndim != 2 or not 1 <= len(values) <= 3 or values.shape[1] != 12:
        raise ValueError(f"{name}: expected one to three rows of 12 numbers, got {values.shape}")
    if not np.any(values):
        raise ValueError(f"{name}: expected a matrix that is not zero")
    return np.pad(values, ((0, 3 - len(values)), (0, 0)))
