"""The scenario's reaction wheels."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Discriminator, Tag, model_validator

from quietbus.scenario.base import (
    Length,
    Part,
    PositiveAngularVelocity,
    PositiveTorque,
    UnitVector,
    Vector,
    listing,
)
from quietbus.scenario.errors import Findings
from quietbus.scenario.hardware import Cluster, GimbalBody, Placed, Rotor
from quietbus.scenario.units import expected


class Motor(Part):
    """What a wheel's motor can do."""

    torque_limit: PositiveTorque | None = None
    speed_limit: PositiveAngularVelocity | None = None


class Wheel(Part):
    """One reaction wheel placed at will, upper-plate frame."""

    type: Literal["wheel"] | None = None  # None: the cluster's
    position: Vector[Length]
    spin_axis: UnitVector
    housing: GimbalBody | None = None  # None: the cluster's
    rotor: Rotor | None = None
    motor: Motor | None = None

    @property
    def gimbal_body(self) -> GimbalBody | None:
        """The housing, which the model takes for a gimbal body that is held."""
        return self.housing

    @property
    def gimbal_axis(self) -> tuple[float, float, float]:
        """The wheel's axis g: plate z, or x if the wheel spins about z, made square to the spin."""
        s = np.array(self.spin_axis)
        for reference in np.eye(3)[[2, 0]]:
            across = reference - (reference @ s) * s
            if np.linalg.norm(across) > 1e-3:
                break
        x, y, z = (across / np.linalg.norm(across)).tolist()
        return x, y, z


class WheelCluster(Placed):
    """Reaction wheels."""

    COMMON = ("housing", "rotor", "motor")
    NOUN: ClassVar[str] = "wheel"

    type: Literal["wheel"] = "wheel"
    units: Annotated[tuple[Wheel, ...], listing(None, "units")] | None = None
    housing: GimbalBody
    motor: Motor = Motor()

    @property
    def gimbal_angles(self) -> None:
        """None: wheels have no gimbals."""
        return

    @property
    def gimbal_motor(self) -> None:
        """None, likewise."""
        return

    def placed(self) -> tuple[Wheel, ...]:
        """All wheels as units, each with its housing, rotor and motor."""
        if self.pyramid is None:
            return self.completed()
        return tuple(
            Wheel(
                position=position,
                spin_axis=axis,
                housing=self.housing,
                rotor=self.rotor,
                motor=self.motor,
            )
            for _, position, axis in self.azimuths()
        )

    @model_validator(mode="after")
    def _check_speeds(self) -> Self:
        """Speeds at the start, and those of a run-up, are within the motors' limits."""
        findings = Findings()
        wheels = self.placed()
        without = [
            j for j, wheel in enumerate(wheels) if not (wheel.motor and wheel.motor.torque_limit)
        ]
        if 0 < len(without) < len(wheels):
            findings.add(
                ("units", without[0], "motor"),
                "expected a torque_limit, as other wheels have one: wheels share a torque by their "
                "limits",
            )
        nominal = tuple(wheel.rotor.speed for wheel in wheels if wheel.rotor)
        given = {"rotor": nominal}
        if self.run_up:
            initial, final = self.run_up.speeds(nominal)
            given = {"initial_speed": initial, "final_speed": final}
        for key, speeds in given.items():
            for j, (wheel, speed) in enumerate(zip(wheels, speeds, strict=True)):
                limit = wheel.motor and wheel.motor.speed_limit
                if limit and abs(speed) > limit:
                    own = ("units", j) if key == "rotor" and self.units else ()
                    path = (*own, "rotor", "speed") if key == "rotor" else ("run_up", key)
                    findings.add(
                        path,
                        f"expected at most the motor's speed limit ({limit:g} rad/s), got "
                        f"{abs(speed):g} rad/s for wheel {j}",
                    )
                    break
        findings.raise_any()
        return self


TYPES = ("cmg", "wheel")
CMG_KEYS = Cluster.model_fields.keys()


def _known_type(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    findings = Findings()
    units = value.get("units")
    of_units = [
        (("units", j, "type"), unit["type"])
        for j, unit in enumerate(units if isinstance(units, list | tuple) else ())
        if isinstance(unit, dict) and "type" in unit
    ]
    common = [(("type",), value["type"])] if "type" in value else []
    if not common and all(kind is None for _, kind in of_units):
        of_wheels = [key for key in value if key in WheelCluster.model_fields.keys() - CMG_KEYS]
        if of_wheels:
            what = f"wheel, as a block with {of_wheels[0]} has it (left out, it is cmg)"
            findings.add("type", expected(what, None).message())
    known: list[str] = []
    for path, kind in [*common, *of_units]:
        if kind not in TYPES and (kind is not None or path == ("type",)):
            findings.add(path, expected(f"one of {', '.join(TYPES)}", kind).message())
        elif known and kind not in (None, known[0]):
            what = f"{known[0]} as before, since one block cannot mix CMGs and reaction wheels (a "
            what += "list of blocks can)"
            findings.add(path, expected(what, kind).message())
        elif kind is not None:
            known.append(kind)
    findings.raise_any()
    return value


def cluster_type(value: Any) -> str:
    """The branch of the union, by the cluster's type or by that of a unit."""
    if not isinstance(value, dict):
        return "<wheel>" if isinstance(value, WheelCluster) else "<cmg>"
    units = value.get("units")
    said = [value.get("type")]
    if said == [None] and isinstance(units, list | tuple):
        said = [unit.get("type") for unit in units if isinstance(unit, dict)]
    return "<wheel>" if "wheel" in said else "<cmg>"


def unit_count(value: Any) -> int:
    """How many units a block's data asks for."""
    if isinstance(value, Placed):
        return value.count
    if not isinstance(value, dict):
        return 0
    units, pyramid = value.get("units"), value.get("pyramid")
    placed = len(units) if isinstance(units, list | tuple) else 0
    around = pyramid.get("units") if isinstance(pyramid, dict) else 0
    return placed + (around if isinstance(around, int) else 0)


AnyCluster = Annotated[
    Annotated[Cluster, Tag("<cmg>")] | Annotated[WheelCluster, Tag("<wheel>")],
    Discriminator(cluster_type),
    BeforeValidator(_known_type),
]
