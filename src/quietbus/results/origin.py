"""What a run was made from: its scenario, and what that says of the rotors.

A run carries its scenario as text, so that files and other programs can read it. Within a process
the Scenario is found again by that text: a slice or a copy of a run has the same, and whoever
writes another text into it has another scenario.
"""

import threading
from collections import OrderedDict
from typing import Any

import numpy as np
import xarray as xr

from quietbus.methods import METHODS, Method
from quietbus.scenario import Scenario
from quietbus.words import shown

MOST_LETTERS = 2_000_000  # of the texts whose scenarios are kept: of 800 ordinary ones, some 16 MB

_kept: OrderedDict[str, Scenario] = OrderedDict()  # by text, the one used last at the end
_lock = threading.Lock()


def text_of(scenario: Scenario) -> str:
    """The text by which a run carries its scenario."""
    text = scenario.to_yaml()
    _keep(text, scenario)
    return text


def scenario_from(text: str, source: str) -> Scenario:
    """The scenario whose text a run carries; it is parsed the first time alone.

    Raises:
        ScenarioError: the text is no valid scenario; ``source`` is named.
    """
    known = _kept.get(text)
    if known is None:
        known = Scenario.from_yaml(text, source)
        old = [b for b in known.units.blocks if "rotor_phases" not in b.model_fields_set]
        if old:
            # a run now says them always; one made before they were random by default had zeros
            zeros = [0.0] * known.units.count
            known = known.with_overrides({"cluster.rotor_phases": zeros})
    _keep(text, known)
    return known


def _keep(text: str, scenario: Scenario) -> None:
    with _lock:
        _kept[text] = scenario
        _kept.move_to_end(text)
        while len(_kept) > 1 and sum(map(len, _kept)) > MOST_LETTERS:
            _kept.popitem(last=False)


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
    return scenario_from(run.attrs["scenario"], "the run's scenario")


def method_of(run: xr.Dataset) -> type[Method]:
    """By which kind of method a run was made.

    Raises:
        ValueError: by none that is known.
    """
    word = str(run.attrs.get("method"))
    if word not in METHODS:
        raise ValueError(f"run: expected the method {' or '.join(METHODS)}, got {shown(word)}")
    return METHODS[word]


def has_gimbals(run: xr.Dataset) -> bool:
    """Whether the units of a run are CMGs, and not reaction wheels."""
    return scenario_of(run).units.gimbals_turn


def rotors(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [rad/s] and phases [rad] of the rotors; zero where a unit has no rotor."""
    return scenario.units.speeds, np.array(scenario.units.phases())
