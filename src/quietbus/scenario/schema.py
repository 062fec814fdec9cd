"""The scenario as a whole: checked, unchangeable, in SI units."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, ValidationError, model_validator

from quietbus.scenario.actuators import Actuators
from quietbus.scenario.base import (
    Duration,
    Frequency,
    FrozenDict,
    Name,
    Part,
    PositiveNumber,
    listing,
)
from quietbus.scenario.blocks import Block, Blocks
from quietbus.scenario.checks import listed
from quietbus.scenario.control import Control, Initial, Load, NoSteering, PseudoInverse, Target
from quietbus.scenario.errors import Findings, Path, Problem, ScenarioError, dotted, found
from quietbus.scenario.hardware import Bus, Cluster, Isolator
from quietbus.scenario.limits import MOST_SAMPLES, MOST_UNITS, Oversize, plain
from quietbus.scenario.pointing import (
    LineOfSight,
    LinesOfSight,
    Requirements,
    unknown_lines,
)
from quietbus.scenario.sites import (
    BUS,
    PLATE,
    AnyBlocks,
    Payload,
    Platform,
    Site,
    check_name,
    check_names,
    platform_site,
)
from quietbus.scenario.text import read_yaml, write_yaml
from quietbus.scenario.units import expected, whole_number
from quietbus.scenario.wheels import WheelCluster, cluster_type, unit_count
from quietbus.words import shown

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


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


def _platforms(value: Any) -> Any:
    if not isinstance(value, list | tuple):
        raise expected("a list of one or more platforms, or isolator and cluster instead", value)
    return value


def _payload(value: Any) -> Any:
    if value is None:  # a forgotten value: without a payload there is no such key
        raise expected(f"a mapping with keys among {', '.join(Payload.model_fields)}", value)
    return value


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
    # these two, or instead of them several platforms
    isolator: Isolator = None  # type: ignore[assignment]
    cluster: AnyBlocks = None  # type: ignore[assignment]
    platforms: Annotated[tuple[Platform, ...], BeforeValidator(_platforms)] = ()
    payload: Annotated[Payload | None, BeforeValidator(_payload)] = None
    actuators: Actuators = FrozenDict()  # of users' own kinds
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
        """What stands on the bus; one named ``plate`` for ``isolator`` and ``cluster``."""
        found = []
        if self.isolator is not None:
            found.append(platform_site(PLATE, BUS, self.isolator, self.cluster, ()))
        for k, each in enumerate(self.platforms):
            path = ("platforms", k)
            found.append(platform_site(each.name, each.on, each.isolator, each.cluster, path))
        if self.payload is not None:
            bench = self.payload
            found.append(
                Site(bench.name, bench.on, bench.isolator, bench.body, (), ("payload",), ("body",))
            )
        return tuple(found)

    @property
    def units(self) -> Blocks:
        """All CMGs and wheels."""
        return Blocks(tuple(block for site in self.sites for block in site.blocks))

    @property
    def legs(self) -> int:
        """Number of all legs."""
        return sum(site.isolator.legs.count for site in self.sites)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of all bodies."""
        return (BUS, *(site.name for site in self.sites))

    @property
    def mount(self) -> str:
        """Word ``isolated`` or ``rigid`` where all bodies stand so, otherwise ``mixed``."""
        mounts = {site.isolator.mount for site in self.sites}
        return mounts.pop() if len(mounts) == 1 else "mixed"

    def with_mount(self, mount: str) -> Self:
        """A checked copy in which all bodies are mounted so."""
        paths = [(*site.path, "isolator", "mount") for site in self.sites]
        return self.with_overrides({dotted(path): mount for path in paths})

    @model_validator(mode="before")
    @classmethod
    def _one_form(cls, data: Any) -> Any:
        """Either one platform, or several; what is missing is told by its own type."""
        if not isinstance(data, dict):
            return data
        one = ("isolator", "cluster")
        if "platforms" in data and not any(key in data for key in one):
            return data | {"platforms": None} if data["platforms"] in ([], ()) else data
        if not data.get("platforms"):
            return dict.fromkeys(one) | data
        findings = Findings()
        for key in one:
            if data.get(key) is not None:
                said = "expected it within platforms, since several platforms are given; got both"
                findings.add(key, said)
        findings.raise_any()
        return data

    @model_validator(mode="after")
    def _check_bodies(self) -> Self:
        findings = Findings()
        check_names(self.sites, findings)
        known = ", ".join(self.bodies)
        for k, load in enumerate(self.loads):
            if load.body not in self.bodies:
                said = f"expected a body, one of {known}; got {load.body!r}"
                findings.add(("loads", k, "body"), said)
        on = {name: self.seen_from(name) for name in self.lines_of_sight}
        for name, body in on.items():
            if body not in self.bodies:
                said = f"expected a body, one of {known}; got {body!r}"
                findings.add(("lines_of_sight", name, "on"), said)
        for name, actuator in self.actuators.items():
            check_name(name, self.bodies, ("actuators", name), findings)
            if getattr(actuator, "on", BUS) not in self.bodies:
                said = f"expected a body, one of {known}; got {actuator.on!r}"
                findings.add(("actuators", name, "on"), said)
        if self.payload is not None and set(on.values()) <= set(self.bodies) - {self.payload.name}:
            got = f"those on {', '.join(dict.fromkeys(on.values()))} alone" if on else "none"
            said = f"expected lines_of_sight on it, since it carries the optics; got {got}"
            findings.add("payload", said)
        findings.raise_any()
        return self

    def place(self, body: str) -> tuple[np.ndarray, Rotation]:
        """Nominal origin [m] and attitude of a body in the bus."""
        from scipy.spatial.transform import Rotation  # takes as long to load as all else here

        if body == BUS:
            return np.zeros(3), Rotation.identity()
        site = next(site for site in self.sites if site.name == body)
        p, turn = self.place(site.on)
        own, base = site.isolator.pose()
        return p + turn.apply(own), turn * base

    def sight(self, line: str) -> LineOfSight:
        """A line of sight with its direction along bus axes."""
        said = self.lines_of_sight[line]
        if said.direction is None:
            return said
        turned = self.place(self.seen_from(line))[1].apply(said.direction)
        return said.model_copy(update={"direction": tuple(turned.tolist())})

    def seen_with(self, body: str) -> str:
        """The other body whose motion moves images of lines of sight on a body."""
        return next((site.name for site in self.sites if site.name != body), BUS)

    def seen_from(self, line: str | None = None) -> str:
        """The body that a line of sight is on: by default the payload, or else the bus."""
        default = BUS if self.payload is None else self.payload.name
        return default if line is None else self.lines_of_sight[line].on or default

    @model_validator(mode="after")
    def _check_requirements(self) -> Self:
        unknown_lines(self.requirements, self.lines_of_sight).raise_any()
        return self

    @model_validator(mode="before")
    @classmethod
    def _not_too_many(cls, data: Any) -> Any:
        """Refuse more units than there may be before each of them is looked at."""
        blocks = _blocks(data) if isinstance(data, dict) else []
        count = sum(map(unit_count, blocks))
        if len(blocks) > 1 and count > MOST_UNITS:
            findings = Findings()
            said = f"expected at most {MOST_UNITS:,} units in all blocks, got {count:,}"
            findings.add("platforms" if data.get("platforms") else "cluster", said)
            findings.raise_any()
        return data

    @model_validator(mode="before")
    @classmethod
    def _steering_of_wheels(cls, data: Any) -> Any:
        """Wheels are steered by the pseudo-inverse unless the scenario says otherwise."""
        if not isinstance(data, dict) or not isinstance(data.get("control"), dict):
            return data
        if all_wheels(data):
            return data | {"control": {"steering": {"law": "pseudo_inverse"}} | data["control"]}
        return data

    @model_validator(mode="after")
    def _check_steering(self) -> Self:
        findings = Findings()
        law, units = self.control and self.control.steering, self.units
        if len(units.wheels) == units.count:
            _check_wheels(self, findings)
        elif isinstance(law, PseudoInverse) and units.count < 3:
            findings.add(
                ("control", "steering", "law"),
                "expected singularity_robust or none for fewer than three CMGs, got "
                f"pseudo_inverse, which {units.count} leave without an inverse",
            )
        _check_run_up(self, findings)
        _check_limits(self, findings)
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
        of_other_form = {"isolator", "cluster"} if self.platforms else None
        data = self.model_dump(mode="json", exclude=of_other_form)
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
    axes = [
        scenario.place(site.name)[1].apply(wheel.spin_axis)
        for site in scenario.sites
        for block in site.blocks
        for wheel in block.placed()
        if block.run_up is None
    ]
    strength = np.linalg.svd(np.array(axes)) if axes else None
    if not isinstance(law, PseudoInverse):
        findings.add(path, f"expected pseudo_inverse or none for reaction wheels, got {law.law}")
    elif strength is None:
        findings.add(
            path,
            f"expected none while cluster.run_up prescribes the wheels' speeds, got {law.law}",
        )
    elif not scenario.actuators and (len(axes) < 3 or strength.S[2] < 1e-3):
        findings.add(
            path,
            "expected none, or wheels whose spin axes span all directions; these "
            f"{len(axes)} give no torque about {listed(strength.Vh[-1])} (bus frame)",
        )


def _check_limits(scenario: Scenario, findings: Findings) -> None:
    """Blocks of one kind that share a torque by their limits: all have one, or none."""
    steering = None if scenario.control is None else scenario.control.steering
    if steering is None or isinstance(steering, NoSteering):
        return
    for kind, key in ((Cluster, "gimbal_rate_limit"), (WheelCluster, "torque_limit")):
        blocks = [
            (path, block)
            for site in scenario.sites
            for path, block in site.blocks_by_path
            if isinstance(block, kind) and (kind is Cluster or block.run_up is None)
        ]
        without = [path for path, block in blocks if not _limited(block)]
        if 0 < len(without) < len(blocks):
            other = next(dotted(path) for path, _ in blocks if path not in without)
            within = () if kind is Cluster else ("motor",)
            findings.add(
                (*without[0], *within, key),
                f"expected a limit, since {other} has one and blocks share a torque by their "
                "limits; got none",
            )


def _limited(block: Block) -> bool:
    """Whether commands of a block's units have a limit."""
    if isinstance(block, Cluster):
        return block.gimbal_rate_limit is not None
    return all(wheel.motor and wheel.motor.torque_limit for wheel in block.placed())


def _check_run_up(scenario: Scenario, findings: Findings) -> None:
    """A run-up that leaves the rest of the scenario its meaning."""
    steering = None if scenario.control is None else scenario.control.steering
    if not scenario.units.run_up:
        return
    if scenario.initial.steady:
        findings.add(
            ("initial", "steady"),
            "expected false with cluster.run_up: rotors that change speed have no steady jitter",
        )
    if steering is None or isinstance(steering, NoSteering):
        return
    for site in scenario.sites:
        for path, block in site.blocks_by_path:
            if _through_rest(block):
                findings.add(
                    (*path, "run_up"),
                    "expected control: none or steering: {law: none} for rotors that run up from, "
                    "down to or through rest: without momentum gimbals give no torque",
                )


def _through_rest(block: Block) -> bool:
    """Whether CMGs run up from, down to or through rest."""
    if block.run_up is None or not isinstance(block, Cluster):
        return False
    nominal = tuple(unit.rotor.speed for unit in block.placed() if unit.rotor)
    return any(a * b <= 0.0 for a, b in zip(*block.run_up.speeds(nominal), strict=True))


def all_wheels(data: dict[str, Any]) -> bool:
    """Whether a scenario's data has reaction wheels alone."""
    return all(cluster_type(block) == "<wheel>" for block in _blocks(data))


def _blocks(data: dict[str, Any]) -> list[Any]:
    """All blocks of a scenario's data, or what stands in their place."""
    platforms = data.get("platforms") or [data]
    if not isinstance(platforms, list | tuple):
        return [None]
    clusters = [each.get("cluster") for each in platforms if isinstance(each, dict)]
    return [b for c in clusters for b in (c if isinstance(c, list | tuple) else (c,))]
