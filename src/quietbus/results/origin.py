"""What a run was made from: its scenario, and what that says of the rotors."""

import numpy as np
import xarray as xr

from quietbus.scenario import Scenario
from quietbus.scenario.wheels import WheelCluster


def scenario_of(run: xr.Dataset) -> Scenario:
    """The scenario that a run was made from."""
    scenario = Scenario.from_yaml(run.attrs["scenario"], source="the run's scenario")
    if "rotor_phases" in scenario.cluster.model_fields_set:
        return scenario
    # a run now says them always; one made before they were random by default had zeros
    return scenario.with_overrides({"cluster.rotor_phases": [0.0] * scenario.cluster.count})


def has_gimbals(run: xr.Dataset) -> bool:
    """Whether the units of a run are CMGs, and not reaction wheels."""
    return not isinstance(scenario_of(run).cluster, WheelCluster)


def rotors(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [rad/s] and phases [rad] of the rotors; zero where a unit has no rotor."""
    units = scenario.cluster.placed()
    speed = np.array([unit.rotor.speed if unit.rotor else 0.0 for unit in units])
    phase = np.array(scenario.cluster.phases())
    return speed, phase
