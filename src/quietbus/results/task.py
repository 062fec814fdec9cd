"""What is asked of a run: all that its numbers depend on."""

import hashlib
import os
import pathlib
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import jax.numpy as jnp
import numpy as np

from quietbus.dynamics.views import View
from quietbus.methods import METHODS, Method
from quietbus.results.origin import scenario_from, text_of
from quietbus.scenario import Scenario
from quietbus.scenario.schema import Tolerances


@dataclass(frozen=True)
class Task:
    """What a run was asked for."""

    scenario: Scenario  # as it is run, mount and output rate included
    method: Method
    joint_forces: bool = False
    points: Mapping[str, np.ndarray] = field(default_factory=dict)  # (3,) [m] by name
    lines_of_sight: Mapping[str, np.ndarray] = field(default_factory=dict)  # (3, 12) by name
    parts_file: str = ""  # digest of the files that register the scenario's own kinds of parts

    @property
    def tolerances(self) -> Tolerances:
        """Of the integrator."""
        return self.method.tolerances(self.scenario)

    def view(self) -> View:
        """Points and lines of sight of a harmonic run."""
        points = np.array(list(self.points.values())).reshape(-1, 3)
        lines = np.array(list(self.lines_of_sight.values())).reshape(-1, 3, 12)
        own = self.scenario.lines_of_sight
        on = [
            self.scenario.seen_from(name if name in own else None) for name in self.lines_of_sight
        ]
        bodies = tuple((body, self.scenario.seen_with(body)) for body in on)
        return View(jnp.asarray(points), jnp.asarray(lines), bodies)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        named = lambda arrays: {name: np.asarray(a).tolist() for name, a in arrays.items()}  # noqa: E731
        return {
            "scenario": text_of(self.scenario),
            "method": self.method.word,
            "relative_tolerance": self.tolerances.relative,
            "absolute_tolerance": self.tolerances.absolute,
            "joint_forces": self.joint_forces,
            "points": named(self.points),
            "lines_of_sight": named(self.lines_of_sight),
            "parts_file": self.parts_file,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """What ``to_dict`` gave."""
        named = lambda lists: {name: np.array(given) for name, given in lists.items()}  # noqa: E731
        return cls(
            scenario_from(data["scenario"], "the checkpoint's scenario"),
            METHODS[data["method"]](data.get("relative_tolerance"), data.get("absolute_tolerance")),
            data["joint_forces"],
            named(data["points"]),
            named(data["lines_of_sight"]),
            data.get("parts_file", ""),
        )


def parts_file_of(scenario: Scenario) -> str:
    """Digest of the files of users in which kinds of parts of the scenario are; empty of none."""
    parts = [*(site.isolator.legs.law for site in scenario.sites), *scenario.actuators.values()]
    modules = {type(part).__module__ for part in parts}
    files = {
        str(getattr(sys.modules.get(name), "__file__", None) or "")
        for name in modules
        if name.partition(".")[0] != "quietbus"
    }
    texts = [pathlib.Path(file).read_bytes() for file in sorted(files) if os.path.isfile(file)]
    return hashlib.sha256(b"\0".join(texts)).hexdigest() if texts else ""


def differences(one: Task, other: Task) -> list[str]:
    """In what two tasks differ, in words; the scenario's fields by their paths."""
    a, b = one.to_dict(), other.to_dict()
    found = [name for name in a if name != "scenario" and a[name] != b[name]]
    if a["scenario"] != b["scenario"]:
        fields = _differing(one.scenario.to_dict(), other.scenario.to_dict())
        found += list(fields)[:5] or ["the scenario"]
    return found


def _differing(one: Any, other: Any, path: str = "") -> Iterator[str]:
    if isinstance(one, dict) and isinstance(other, dict):
        for key in one.keys() | other.keys():
            yield from _differing(one.get(key), other.get(key), f"{path}.{key}".lstrip("."))
    elif one != other:
        yield path
