"""The main values of a scenario in usual units: what was read of the file."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from quietbus.scenario.blocks import Block
from quietbus.scenario.hardware import Cluster, Legs, Unit
from quietbus.scenario.plausibility import DEG, RPM, plain
from quietbus.scenario.schema import Scenario
from quietbus.scenario.sites import BUS
from quietbus.scenario.wheels import Wheel


def as_read(scenario: Scenario) -> list[tuple[str, str]]:
    """Names of parts, each with its main values as text."""
    bus, many = scenario.bus, len(scenario.sites) > 1
    rows = [("bus", f"{plain(bus.mass)} kg, inertia {_each(np.diag(bus.inertia))} kg m^2")]
    first = 0
    for site in scenario.sites:
        isolator = site.isolator
        base = "" if site.on == BUS else f" on {site.on}"
        rows += [
            (
                site.name if many else "platform",
                f"{isolator.mount}, base at {_vector(isolator.offset)} m{base}, plate "
                f"{plain(isolator.separation)} m above it, {plain(site.plate.mass)} kg",
            ),
            ("struts", f"{isolator.legs.count} of {_struts(isolator.legs)}"),
        ]
        for block in site.blocks:
            rows += _units(block, first)
            first += block.count
    rows += [
        *_actuators(scenario),
        *_control(scenario),
    ]
    start = scenario.initial
    if scenario.loads:
        rows.append(("loads", f"{len(scenario.loads)}"))
    rows.append(
        (
            "start",
            f"{_vector(np.multiply(start.attitude, DEG))} deg, turning at "
            f"{_vector(np.multiply(start.rate, DEG))} deg/s",
        )
    )
    run = scenario.simulation
    rows.append(
        ("run", f"{plain(run.duration)} s; direct runs write at {plain(run.output_rate)} Hz")
    )
    return rows


def _units(cluster: Block, first: int) -> list[tuple[str, str]]:
    units: tuple[Unit | Wheel, ...] = cluster.placed()
    rotors = [unit.rotor for unit in units if unit.rotor]
    kind = "CMGs" if isinstance(cluster, Cluster) else "wheels"
    spin = np.array([rotor.inertia[0, 0] for rotor in rotors])
    speed = np.array([rotor.speed for rotor in rotors])
    placed = "placed one by one"
    if cluster.pyramid:
        skew, radius = DEG * cluster.pyramid.skew, cluster.pyramid.radius
        placed = f"skew {plain(skew)} deg, radius {plain(radius)} m"
    rows = [
        (
            f"{len(units)} {kind}",
            f"{_spread(np.abs(spin * speed))} N m s at {_spread(RPM * speed)} rpm, rotor "
            f"{_spread(rotor.mass for rotor in rotors)} kg, {placed}",
        )
    ]
    imbalance = (
        f"static {_spread(1e5 * rotor.static_imbalance for rotor in rotors)} g cm, "
        f"dynamic {_spread(1e7 * rotor.dynamic_imbalance for rotor in rotors)} g cm^2"
    )
    tables = [rotor.disturbance for rotor in rotors if rotor.disturbance]
    lines = max((len(table.orders or ()) for table in tables), default=0)
    imbalance += f", tables of {lines} lines" if lines else ""
    imbalance += ", noise" if any(table.broadband.given() for table in tables) else ""
    phases = _each(np.multiply(cluster.phases(first), DEG))
    drawn = "random, " if cluster.rotor_phases == "random" else ""
    rows += [("imbalance", imbalance), ("rotor phases", f"{drawn}{phases} deg")]
    if isinstance(cluster, Cluster):
        angles = cluster.gimbal_angles or (0.0,) * len(units)
        rate, gathering = cluster.gimbal_rate_limit, cluster.gimbal_acceleration_limit
        rows.append(
            (
                "gimbals",
                f"at {_each(np.multiply(angles, DEG))} deg, servo "
                f"{plain(cluster.gimbal_bandwidth)} rad/s, limits {_limit(rate, DEG, 'deg/s')}, "
                f"{_limit(gathering, DEG, 'deg/s^2')}",
            )
        )
    else:
        motor = cluster.motor
        limits = (_limit(motor.torque_limit, 1.0, "N m"), _limit(motor.speed_limit, RPM, "rpm"))
        rows.append(("motors", f"limits {', '.join(limits)}"))
    return rows


def _control(scenario: Scenario) -> list[tuple[str, str]]:
    control, target = scenario.control, scenario.target
    if control is None:
        return [("control", "none")]
    pid = control.pid
    to = f"{_vector(np.multiply(target.attitude, DEG))} deg in one step"
    if not isinstance(target.guidance, str):
        guidance = target.guidance
        to = (
            f"{_vector(np.multiply(target.attitude, DEG))} deg, at most "
            f"{plain(DEG * guidance.max_rate)} deg/s and {plain(DEG * guidance.max_acceleration)} "
            "deg/s^2"
        )
    return [
        (
            "control",
            f"kp {plain(pid.kp)} N m/rad, ki {plain(pid.ki)} N m/(rad s), kd {plain(pid.kd)} "
            f"N m s/rad, limit {_limit(control.torque_limit, 1.0, 'N m')}, {control.steering.law}",
        ),
        ("target", to),
    ]


def _limit(value: float | None, scale: float, unit: str) -> str:
    return "none" if value is None else f"{plain(scale * value)} {unit}"


def _each(values: Iterable[float]) -> str:
    """All of them, or one if they are the same."""
    shown = [plain(float(value)) for value in values]
    return shown[0] if len(set(shown)) == 1 else ", ".join(shown)


def _vector(values: Iterable[float]) -> str:
    return f"[{', '.join(plain(float(value)) for value in values)}]"


def _spread(values: Iterable[float]) -> str:
    """One value, or from the least to the largest."""
    found = [float(value) for value in values]
    least, most = plain(min(found)), plain(max(found))
    return least if least == most else f"{least} to {most}"


def _struts(legs: Legs) -> str:
    both = legs.law.spring_and_damper()
    if both is None:
        return f"type {legs.law.type}"
    stiffness, damping = map(np.ravel, both)
    return f"{_spread(stiffness / 1e3)} kN/m and {_spread(damping)} N s/m"


def _actuators(scenario: Scenario) -> list[tuple[str, str]]:
    each = [f"{name} ({actuator.type})" for name, actuator in scenario.actuators.items()]
    return [("actuators", ", ".join(each))] if each else []
