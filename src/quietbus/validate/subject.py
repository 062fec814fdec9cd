"""What is checked: quietbus's satellite of a scenario, and the reference's."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from quietbus.build import build_initial_state, build_satellite
from quietbus.dynamics.state import State
from quietbus.model.satellite import Satellite
from quietbus.model.variants import without_noise
from quietbus.reference.satellite import ReferenceSatellite
from quietbus.scenario import Scenario


@dataclass(frozen=True)
class Check:
    """One comparison and its verdict."""

    name: str
    compares: str  # what is compared, for people
    error: float  # [-] relative
    bound: float  # [-]

    @property
    def passed(self) -> bool:
        """Whether the error is within the bound; an error that is no number is not."""
        return self.error <= self.bound


@dataclass(frozen=True)
class Subject:
    """Both programs' satellites. Noise, which has no one course, is left out of both."""

    scenario: Scenario  # what the reference is made from
    built_from: Scenario  # what quietbus's satellite is made from: the same, but in tests

    @cached_property
    def satellite(self) -> Satellite:
        """quietbus's satellite."""
        return without_noise(build_satellite(self.built_from))

    @cached_property
    def state(self) -> State:
        """quietbus's state at the start."""
        return build_initial_state(self.built_from, self.satellite)

    @cached_property
    def reference(self) -> ReferenceSatellite:
        """The reference's satellite; needs MuJoCo."""
        return ReferenceSatellite(self.scenario.to_dict())

    def changed(self, change: Callable[[dict[str, Any]], None]) -> "Subject":
        """With something changed in the data of both scenarios."""
        both = []
        for scenario in (self.scenario, self.built_from):
            data = scenario.to_dict()
            change(data)
            both.append(Scenario.from_dict(data, scenario.name))
        return Subject(*both)


def apart(theirs: Mapping[str, Any], ours: Mapping[str, Any], least: float = 1e-300) -> float:
    """Largest difference of quantities by name (n, ...), each relative to its own largest value.

    Vectors, along the last axis, count by their norm. Not a number if any value is none.

    Args:
        least: what counts as the largest value of a quantity that has none as large.
    """
    errors = []
    for name, a in theirs.items():
        a, b = np.asarray(a, dtype=float), np.asarray(ours[name], dtype=float)
        if a.shape != b.shape:
            raise ValueError(f"{name}: {a.shape} numbers against {b.shape}")
        size = lambda x: np.max(np.linalg.norm(np.atleast_1d(x), axis=-1))  # noqa: E731
        errors.append(size(a - b) / max(size(a), least))
    return float(np.max(errors))
