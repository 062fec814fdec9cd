"""What a run was made from: its scenario, and what that says of the rotors."""

from typing import Any

import numpy as np
import xarray as xr

from quietbus.scenario import Scenario
from quietbus.scenario.wheels import WheelCluster
from quietbus.words import shown


def refuse_no_run(run: Any) -> None:
    """Refuse what is not a run: TypeError for no Dataset, ValueError for one without a scenario."""
    if not isinstance(run, xr.Dataset):
        raise TypeError(f"run: expected a run, as simulate and load_run give it, got {shown(run)}")
    if not isinstance(run.attrs.get("scenario"), str):
        raise ValueError("run: expected a run of quietbus, got a Dataset without a scenario")


def scenario_of(run: xr.Dataset) -> Scenario:
    """The scenario that a run was made from.

    Raises:
        TypeError: not a Dataset.
        ValueError: a Dataset that is not a run; ScenarioError, if its scenario is not valid.
    """
    refuse_no_run(run)
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
