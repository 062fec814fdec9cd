"""The scenario as a whole: checked, unchangeable, in SI units."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, ValidationError, model_validator

from quietbus.scenario.base import (
    Duration,
    Frequency,
    FrozenDict,
    Name,
    Part,
    PositiveNumber,
    listing,
)
from quietbus.scenario.checks import listed
from quietbus.scenario.control import Control, Initial, Load, NoSteering, PseudoInverse, Target
from quietbus.scenario.errors import Findings, Path, Problem, ScenarioError, dotted, found
from quietbus.scenario.hardware import Bus, Cluster, Isolator
from quietbus.scenario.limits import MOST_SAMPLES, Oversize, plain
from quietbus.scenario.pointing import LinesOfSight, Requirements, unknown_lines
from quietbus.scenario.sites import Site
from quietbus.scenario.text import read_yaml, write_yaml
from quietbus.scenario.units import expected, whole_number
from quietbus.scenario.wheels import AnyCluster, WheelCluster, cluster_type
from quietbus.words import shown


class Tolerances(Part):
    """Error control of the integrator."""

    relative: PositiveNumber = 1e-8
    absolute: PositiveNumber = 1e-10

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        for name, least in (("relative", 1e-13), ("absolute", 1e-16)):
            value = getattr(self, name)
            if not least <= value <= 1e-2:
                findings.add(name, f"expected a number from {least:g} to 0.01, got {value:g}")
        findings.raise_any()
        return self


class Simulation(Part):
    """Length of a run and how finely it is kept."""

    duration: Duration = 100.0
    output_rate: Frequency = 1000.0
    tolerances: Tolerances = Tolerances()

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        samples = self.duration * self.output_rate
        if samples > MOST_SAMPLES:
            findings.add(
                "output_rate",
                f"expected at most {MOST_SAMPLES / self.duration:.4g} Hz for {self.duration:g} s, "
                f"since {MOST_SAMPLES:g} samples fill 8 GiB; got {self.output_rate:g} Hz, "
                f"{samples:.3g} samples",
            )
        findings.raise_any()
        return self


def _none_word(value: Any) -> Any:
    if value is None or value is False:  # a forgotten value; YAML reads "off" as false
        raise expected("none, or a mapping with keys among pid, steering, ...", value)
    return None if value == "none" else value


@functools.lru_cache(maxsize=64)
def _yaml_text(data: str) -> str:
    """YAML of a scenario's JSON; kept, since writing it takes long beside a harmonic run."""
    return write_yaml(json.loads(data))


def _keys(path: str) -> list[str | int]:
    """A dotted path as keys and indices."""
    if not isinstance(path, str):
        raise TypeError(f"path: expected a text such as 'bus.mass', got {shown(path)}")
    parts = re.findall(r"[^.\[\]]+", path) or [""]
    return [int(key) if whole_number(key) else key for key in parts]


def _without_nulls(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _without_nulls(value) for key, value in data.items() if value is not None}
    return [_without_nulls(item) for item in data] if isinstance(data, list) else data


class Scenario(Part):
    """Everything that a run depends on; all values SI.

    Made from YAML by ``from_yaml`` or ``quietbus.load_scenario``, from Python data by
    ``from_dict``. Scenarios compare by value and do not change; ``with_overrides`` gives a
    changed copy.
    """

    name: Name
    bus: Bus
    isolator: Isolator
    cluster: AnyCluster
    control: Annotated[Control | None, BeforeValidator(_none_word)] = None
    initial: Initial = Initial()
    target: Target = Target()
    loads: Annotated[tuple[Load, ...], listing(None, "loads", least=0)] = ()
    lines_of_sight: LinesOfSight = FrozenDict()
    requirements: Requirements = ()
    simulation: Simulation = Simulation()

    def __hash__(self) -> int:
        return hash(json.dumps(self.to_dict(), sort_keys=True))

    @property
    def sites(self) -> tuple[Site, ...]:
        """What stands on the bus; one site named ``platform`` for ``isolator`` and ``cluster``."""
        return (Site("platform", self.isolator, (self.cluster,)),)

    @model_validator(mode="after")
    def _check_requirements(self) -> Self:
        unknown_lines(self.requirements, self.lines_of_sight).raise_any()
        return self

    @model_validator(mode="before")
    @classmethod
    def _steering_of_wheels(cls, data: Any) -> Any:
        """Wheels are steered by the pseudo-inverse unless the scenario says otherwise."""
        if not isinstance(data, dict) or not isinstance(data.get("control"), dict):
            return data
        if cluster_type(data.get("cluster")) == "<wheel>":
            return data | {"control": {"steering": {"law": "pseudo_inverse"}} | data["control"]}
        return data

    @model_validator(mode="after")
    def _check_steering(self) -> Self:
        findings = Findings()
        law = self.control and self.control.steering
        if isinstance(self.cluster, WheelCluster):
            _check_wheels(self, findings)
        elif isinstance(law, PseudoInverse) and self.cluster.count < 3:
            findings.add(
                ("control", "steering", "law"),
                "expected singularity_robust or none for fewer than three CMGs, got "
                f"pseudo_inverse, which {self.cluster.count} leave without an inverse",
            )
        _check_run_up(self, findings)
        findings.raise_any()
        return self

    @classmethod
    def from_yaml(cls, text: str, source: str = "<text>", folder: str = ".") -> Self:
        """Scenario from YAML text; ScenarioError lists all problems, with lines of ``source``.

        Files that it names are looked for in ``folder``, and have to be there or in the folders
        that the environment variable QUIETBUS_TABLE_FOLDERS lists.
        """
        if not isinstance(text, str):
            raise TypeError(f"text: expected the YAML text of a scenario, got {shown(text)}")
        data, line_of = read_yaml(text, source)
        return cls._checked(data, source, line_of, folder)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], source: str = "<data>") -> Self:
        """Scenario from nested dicts and lists as the YAML file has them."""
        try:
            return cls._checked(plain(data), source)
        except Oversize as error:
            raise ScenarioError(source, [Problem(str(error))]) from None

    @classmethod
    def _checked(
        cls,
        data: Any,
        source: str,
        line_of: Callable[[Path], int | None] | None = None,
        folder: str | None = None,
    ) -> Self:
        try:
            return cls.model_validate(data, context={"folder": folder})
        except ValidationError as error:
            raise ScenarioError(source, found(error, line_of)) from None

    def to_dict(self) -> dict[str, Any]:
        """Nested dicts and lists, SI numbers; all values are there, also the defaults."""
        data = self.model_dump(mode="json")
        data["control"] = data["control"] or "none"
        return _without_nulls(data)

    def to_yaml(self) -> str:
        """YAML text in SI units that gives this scenario again."""
        return _yaml_text(json.dumps(self.to_dict()))

    def with_overrides(self, overrides: Mapping[str, Any]) -> Self:
        """A checked copy with some fields changed.

        Args:
            overrides: values by dotted path, with units if wanted:
                ``{"isolator.mount": "rigid", "cluster.units[2].rotor.speed": "5900 rpm"}``.
        """
        if not isinstance(overrides, Mapping):
            what = "a mapping such as {'isolator.mount': 'rigid'}"
            raise TypeError(f"overrides: expected {what}, got {shown(overrides)}")
        data = self.to_dict()
        for path, value in overrides.items():
            self._set(data, path, value)
        return self.from_dict(data, source=f"{self.name} with overrides")

    def number(self, path: str) -> float:
        """The number [SI] at a dotted path, as of ``with_overrides``.

        Raises:
            ScenarioError: the scenario has no such entry, or it is not one number.
        """
        value: Any = self.to_dict()
        for key in _keys(path):
            try:
                value = value[key]
            except (KeyError, IndexError, TypeError):
                value = None
                break
        if isinstance(value, bool) or not isinstance(value, int | float):
            said = "is not in the scenario" if value is None else "is not one number"
            raise ScenarioError(self.name, [Problem(said, tuple(_keys(path)))])
        return float(value)

    def _set(self, data: Any, path: str, value: Any) -> None:
        keys = _keys(path)
        for depth, key in enumerate(keys):
            inner = isinstance(data, dict) and isinstance(key, str)
            if not inner and not (isinstance(data, list) and key in range(len(data))):
                above = dotted(tuple(keys[:depth])) or "the scenario"
                problem = Problem(f"cannot be set, because {above} has no such entry", tuple(keys))
                raise ScenarioError(f"{self.name} with overrides", [problem])
            if depth == len(keys) - 1:
                data[key] = value
            else:
                data = data.setdefault(key, {}) if isinstance(data, dict) else data[key]


def _check_wheels(scenario: Scenario, findings: Findings) -> None:
    """Steering that wheels can follow."""
    path = ("control", "steering", "law")
    law = None if scenario.control is None else scenario.control.steering
    if law is None or isinstance(law, NoSteering):
        return
    axes = np.array([wheel.spin_axis for wheel in scenario.cluster.placed()])
    strength = np.linalg.svd(axes)
    if not isinstance(law, PseudoInverse):
        findings.add(path, f"expected pseudo_inverse or none for reaction wheels, got {law.law}")
    elif len(axes) < 3 or strength.S[2] < 1e-3:
        findings.add(
            path,
            "expected none, or wheels whose spin axes span all directions; these "
            f"{len(axes)} give no torque about {listed(strength.Vh[-1])} (plate frame)",
        )
    if scenario.cluster.run_up is not None:
        findings.add(
            path,
            f"expected none while cluster.run_up prescribes the wheels' speeds, got {law.law}",
        )


def _check_run_up(scenario: Scenario, findings: Findings) -> None:
    """A run-up that leaves the rest of the scenario its meaning."""
    cluster = scenario.cluster
    steering = None if scenario.control is None else scenario.control.steering
    if cluster.run_up is None:
        return
    if scenario.initial.steady:
        findings.add(
            ("initial", "steady"),
            "expected false with cluster.run_up: rotors that change speed have no steady jitter",
        )
    nominal = tuple(unit.rotor.speed for unit in cluster.placed() if unit.rotor)
    speeds = zip(*cluster.run_up.speeds(nominal), strict=True)
    steered = steering is not None and not isinstance(steering, NoSteering)
    if steered and isinstance(cluster, Cluster) and any(a * b <= 0.0 for a, b in speeds):
        findings.add(
            ("cluster", "run_up"),
            "expected control: none or steering: {law: none} for rotors that run up from, down to "
            "or through rest: without momentum gimbals give no torque",
        )
