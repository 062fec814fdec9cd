"""What a scenario says that physics allows and no satellite has: most often a unit left out.

A bare number is SI: 6000 for 6000 rpm is read as 57 300 rpm, 30 for 30 deg as 1719 deg. Such values
are used as they are, and a note says how they were read. Bounds are wide on purpose: they are a
factor of three or more beyond what has flown.
"""

from __future__ import annotations

import functools
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.scenario.base import Part
from quietbus.scenario.blocks import Block
from quietbus.scenario.checks import listed
from quietbus.scenario.errors import Path, dotted
from quietbus.scenario.hardware import Cluster, Rotor
from quietbus.scenario.schema import Scenario
from quietbus.scenario.units import Quantity

DEG, RPM = 180.0 / np.pi, 30.0 / np.pi
MOST_TURN = 30.0 / DEG  # [rad] of a step of attitude
SAME_PLACE = 1e-3  # [m] between bases of isolators, of which no two are so close
RADII = 20.0  # of gyration of the bus, the farthest that anything on it is from anything else


@dataclass(frozen=True)
class _Limit:
    """Largest size of the numbers at some paths, in SI, and how to say it."""

    paths: tuple[str, ...]  # dotted, without indices; * for anything
    most: float
    unit: str
    scale: float  # of ``unit`` by SI
    why: str

    def note(self, value: float, unit: str) -> str:
        """What is not likely about a value in SI, or nothing."""
        if abs(value) <= self.most * (1.0 + 1e-9):
            return ""
        return f"{value:.4g} {unit}, {plain(self.scale * value)} {self.unit}: {self.why}"


_ROTOR_SPEED = _Limit(
    ("cluster*.rotor.speed", "cluster*.run_up.*_speed", "cluster*.motor.speed_limit"),
    20_000.0 / RPM,
    "rpm",
    RPM,
    "rotors of CMGs and wheels turn at less than 20000 rpm; a bare number is in rad/s",
)
_LIMITS = (
    _ROTOR_SPEED,
    _Limit(
        ("initial.rate", "target.guidance.max_rate"),
        20.0 / DEG,
        "deg/s",
        DEG,
        "satellites turn at less than 20 deg/s; a bare number is in rad/s",
    ),
    _Limit(
        ("cluster*.gimbal_rate_limit",),
        10.0,
        "deg/s",
        DEG,
        "gimbals of CMGs turn at less than 570 deg/s; a bare number is in rad/s",
    ),
    _Limit(
        ("target.guidance.max_acceleration",),
        30.0 / DEG,
        "deg/s^2",
        DEG,
        "satellites gather speed at less than 30 deg/s^2; a bare number is in rad/s^2",
    ),
    _Limit(
        ("cluster*.installation_error.*",),
        0.1,
        "deg",
        DEG,
        "bearings are mounted to a small part of a degree, and the model is one of small angles",
    ),
    _Limit(
        ("requirements.at_most",),
        1.0 / DEG,
        "deg",
        DEG,
        "pointing is asked for to arcseconds; a bare number is in rad",
    ),
)


def implausible(scenario: Scenario) -> list[str]:
    """Notes, one for each field: its name, what was read in usual units, why it is not likely."""
    notes: dict[str, str] = {}
    told: set[tuple[Any, ...]] = set()
    for path, value, quantity in quantities(scenario):
        plain = dotted(tuple(key for key in path if not isinstance(key, int)))
        note = _beyond(scenario, plain, value, quantity)
        # what units have in common with their cluster, or one row with the next, is told once
        key = (plain.rpartition("units.")[2].removeprefix("cluster."), note)
        if note and key not in told:
            told.add(key)
            notes.setdefault(plain, f"{dotted(path)}: read as {note}")
    for where, note in _derived(scenario):
        notes.setdefault(where, f"{where}: read as {note}")
    return list(notes.values())


def unlikely_speed(value: float) -> str:
    """A note on a rotor's speed [rad/s], or nothing."""
    return _ROTOR_SPEED.note(value, "rad/s")


def quantities(part: Part, above: Path = ()) -> Iterator[tuple[Path, float, Quantity]]:
    """All numbers with a dimension that a part holds, with their paths."""
    for key, quantity in _quantities(type(part)).items():
        yield from _numbers(getattr(part, key), (*above, key), quantity)


def _numbers(
    value: Any, path: Path, quantity: Quantity | None
) -> Iterator[tuple[Path, float, Quantity]]:
    if isinstance(value, Part):
        yield from quantities(value, path)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _numbers(inner, (*path, key), quantity)
    elif isinstance(value, tuple | list):
        for i, inner in enumerate(value):
            yield from _numbers(inner, (*path, i), quantity)
    elif isinstance(value, float) and quantity is not None:
        yield path, value, quantity


@functools.cache
def _quantities(kind: type[Part]) -> dict[str, Quantity | None]:
    return {
        key: next(_of((field.annotation, *field.metadata)), None)
        for key, field in kind.model_fields.items()
    }


def _of(parts: tuple[Any, ...]) -> Iterator[Quantity]:
    """Quantities in a type with annotations."""
    for part in parts:
        if isinstance(part, Quantity):
            yield part
        elif not isinstance(part, type) or typing.get_args(part):
            yield from _of((*typing.get_args(part), *getattr(part, "__metadata__", ())))


def _beyond(scenario: Scenario, path: str, value: float, quantity: Quantity) -> str:
    """Why a number by itself is not likely, or nothing."""
    size = abs(value)
    for limit in _LIMITS:
        if quantity.unit and any(fnmatchcase(path, pattern) for pattern in limit.paths):
            return limit.note(value, quantity.unit)
    if quantity.unit == "rad" and size > 2.0 * np.pi * (1.0 + 1e-9):
        return (
            f"{value:.4g} rad, {plain(DEG * value)} deg: more than a whole turn; "
            "a bare number is in rad"
        )
    if quantity.unit == "m" and size > RADII * _radius(scenario.bus.mass, scenario.bus.inertia):
        radius = _radius(scenario.bus.mass, scenario.bus.inertia)
        return (
            f"{value:.4g} m: more than {RADII:g} times the radius of gyration of the bus "
            f"({radius:.3g} m); a bare number is in m"
        )
    return ""


def plain(value: float) -> str:
    """Four digits, without an exponent up to a million."""
    return f"{float(f'{value:.4g}'):.7g}"


def _radius(mass: float, inertia: Any) -> float:
    """Radius of gyration [m], root mean square over directions."""
    return float(np.sqrt(np.trace(np.asarray(inertia)) / (3.0 * mass)))


def _derived(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Paths and notes on what follows from several numbers."""
    yield from _bodies(scenario)
    yield from _places(scenario)
    yield from _rotors(scenario)
    yield from _suspension(scenario)
    yield from _attitudes(scenario)
    control = scenario.control
    if control is not None:
        fastest = control.pid.kd / float(np.min(np.linalg.eigvalsh(scenario.bus.inertia)))
        if fastest > 2.0 * np.pi * 10.0:
            yield (
                "control.pid",
                f"a rate gain of {control.pid.kd:.4g} N m s/rad: on this bus a bandwidth of some "
                f"{fastest / (2.0 * np.pi):.3g} Hz, beyond the 10 Hz that attitude control reaches",
            )


def _bodies(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Inertias that do not go with their masses."""
    bus = scenario.bus
    bodies = [("bus", bus.mass, bus.inertia)]
    bodies += [(site.plate_at, site.plate.mass, site.plate.inertia) for site in scenario.sites]
    for where, mass, inertia in bodies:
        radius = _radius(mass, inertia)
        if not 0.01 < radius < 30.0:
            yield (
                f"{where}.inertia",
                f"{np.diag(inertia).max():.4g} kg m^2 with a mass of {mass:.4g} kg: a radius of "
                f"gyration of {radius:.3g} m, where bodies of satellites have 0.01 m to 30 m",
            )
    for where, block in _blocks(scenario):
        name = "gimbal_body" if isinstance(block, Cluster) else "housing"
        body = getattr(block, name)
        radius = _radius(body.mass, np.diag(body.inertia))
        if not 0.005 < radius < 2.0:
            yield (
                f"{where}.{name}.inertia",
                f"{max(body.inertia):.4g} kg m^2 with a mass of {body.mass:.4g} kg: a radius of "
                f"gyration of {radius:.3g} m, where units have 5 mm to 2 m",
            )


def _places(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Isolators whose bases are at one and the same place of a body."""
    sites = scenario.sites
    for k, site in enumerate(sites):
        offset = site.isolator.offset
        for other in sites[:k]:
            apart = np.linalg.norm(np.subtract(offset, other.isolator.offset))
            if site.on == other.on and apart < SAME_PLACE:
                where = dotted((*site.path, "isolator", "offset"))
                yield where, f"{listed(offset)} m on the {site.on}, where {other.name} stands too"
                break


def _blocks(scenario: Scenario) -> list[tuple[str, Block]]:
    """All blocks of units with their paths."""
    return [each for site in scenario.sites for each in site.blocks_at]


def _rotors(scenario: Scenario) -> Iterator[tuple[str, str]]:
    told: set[Rotor] = set()
    quiet = True
    for at, block in _blocks(scenario):
        placed: tuple[Any, ...] = block.placed()
        for j, unit in enumerate(placed):
            rotor = unit.rotor
            if rotor is None:
                continue
            quiet = quiet and not _shakes(rotor)
            if rotor in told:
                continue
            where = f"{at}.rotor" if rotor == block.rotor else f"{at}.units[{j}].rotor"
            told.add(rotor)
            yield from ((f"{where}.{key}", note) for key, note in _rotor(rotor))
    if quiet:
        yield (
            f"{_blocks(scenario)[0][0]}.rotor",
            "balanced exactly, without orders or noise: nothing shakes, so that all jitter is zero",
        )


def _shakes(rotor: Rotor) -> bool:
    errors = rotor.installation_error
    return bool(
        rotor.static_imbalance
        or rotor.dynamic_imbalance
        or any((errors.alpha, errors.beta, errors.chi))
        or (rotor.disturbance and (rotor.disturbance.orders or rotor.disturbance.broadband.given()))
    )


ECCENTRIC = 1e-4  # [m] of the mass centre from the axis
TILTED = 5e-3  # [rad] of the principal axis against the axis


def _rotor(rotor: Rotor) -> Iterator[tuple[str, str]]:
    spin = rotor.inertia[0, 0]
    radius = np.sqrt(spin / rotor.mass)
    if not 0.005 < radius < 1.0:
        key = "momentum" if rotor.momentum is not None else "spin_inertia"
        said = (
            f"{rotor.momentum:.4g} N m s at {RPM * rotor.speed:.4g} rpm"
            if key == "momentum"
            else ""
        )
        yield (
            key,
            f"{said or f'{spin:.4g} kg m^2'} with a mass of {rotor.mass:.4g} kg: a radius of "
            f"gyration of {radius:.3g} m, where rotors have 5 mm to 1 m",
        )
    off = rotor.static_imbalance / rotor.mass
    if off > ECCENTRIC:
        yield (
            "static_imbalance",
            f"{plain(1e5 * rotor.static_imbalance)} g cm: a mass centre {1e3 * off:.3g} mm off the "
            "axis, where balanced rotors have micrometres; a bare number is in kg m",
        )
    tilt = rotor.dynamic_imbalance / max(abs(spin - rotor.transverse_inertia), 1e-3 * spin)
    if tilt > TILTED:
        yield (
            "dynamic_imbalance",
            f"{plain(1e7 * rotor.dynamic_imbalance)} g cm^2: a principal axis {DEG * tilt:.3g} deg "
            "off the spin axis, where balanced rotors have thousandths; a bare number is in kg m^2",
        )
    table = rotor.disturbance.orders if rotor.disturbance else None
    for i, line in enumerate(table or ()):
        force = max(line.radial_force, line.axial_force)
        if force > ECCENTRIC * rotor.mass:
            yield (
                f"disturbance.orders[{i}]",
                f"a force coefficient of {plain(1e5 * force)} g cm: as of a mass centre "
                f"{1e3 * force / rotor.mass:.3g} mm off the axis; a bare number is in kg m",
            )
        torque = max(line.radial_torque, line.axial_torque)
        if torque > TILTED * spin:
            yield (
                f"disturbance.orders[{i}]",
                f"a torque coefficient of {plain(1e7 * torque)} g cm^2, "
                f"{100 * torque / spin:.3g} % of the spin inertia; a bare number is in kg m^2",
            )


def _suspension(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Struts that are too soft, too hard or too damped for what they carry."""
    for site in scenario.sites:
        legs = site.isolator.legs
        lower, upper = site.isolator.joints()
        along = (upper - lower) / np.linalg.norm(upper - lower, axis=1, keepdims=True)
        both = legs.law.spring_and_damper()
        if both is None:
            continue
        where = site.legs_at if legs.strut is None else f"{site.legs_at}.strut"
        units = (unit for block in site.blocks for unit in block.placed())
        carried = site.plate.mass + sum(
            (unit.gimbal_body.mass if unit.gimbal_body else 0.0)
            + (unit.rotor.mass if unit.rotor else 0.0)
            for unit in units
        )
        stiffness, damping = (np.broadcast_to(each, legs.count) for each in both)
        k, c = (np.trace((along.T * each) @ along) / 3.0 for each in (stiffness, damping))
        hertz = np.sqrt(k / carried) / (2.0 * np.pi)
        if not 0.2 < hertz < 500.0:
            yield (
                f"{where}.stiffness",
                f"{stiffness.max():.4g} N/m: {carried:.4g} kg on these struts swing at some "
                f"{hertz:.3g} Hz, where isolators have 0.2 Hz to 500 Hz; a bare number is in N/m",
            )
        ratio = c / (2.0 * np.sqrt(k * carried))
        if ratio > 5.0:
            yield (
                f"{where}.damping",
                f"{damping.max():.4g} N s/m: {ratio:.3g} times critical damping, which lets all "
                "vibration pass; a bare number is in N s/m",
            )


def _attitudes(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """A step of attitude that no control is asked for, or a turn that looks like degrees."""
    initial, target = scenario.initial.attitude, scenario.target.attitude
    start, end = (Rotation.from_euler("ZYX", a[::-1]) for a in (initial, target))
    turn = float((start.inv() * end).magnitude())
    step = scenario.target.guidance == "step" and scenario.control is not None
    for where, attitude in (("initial.attitude", initial), ("target.attitude", target)):
        shown = ", ".join(f"{DEG * angle:.4g}" for angle in attitude)
        own = float(Rotation.from_euler("ZYX", attitude[::-1]).magnitude())
        if step and turn > MOST_TURN and own > 0.5 * turn:
            yield (
                where,
                f"[{shown}] deg: the control has to take {DEG * turn:.3g} deg in one step; a bare "
                "number is in rad, and guidance with limits makes a smooth turn of it",
            )
        elif any(_like_degrees(angle) for angle in attitude):
            yield where, f"[{shown}] deg: a bare number is in rad; were degrees meant?"


def _like_degrees(angle: float) -> bool:
    """A large angle whose number of radians is round, and that of degrees is not."""
    is_round = lambda value: abs(value - round(value, 2)) < 1e-9  # noqa: E731
    return abs(angle) >= 1.0 and is_round(angle) and not is_round(DEG * angle)
