"""The base of every part of a scenario, and the types that its fields are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, NoReturn, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    GetCoreSchemaHandler,
    Tag,
    ValidationError,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from quietbus.scenario.checks import inertia_defect, listed
from quietbus.scenario.errors import ScenarioError, UnknownKey, found
from quietbus.scenario.limits import MOST_UNITS
from quietbus.scenario.units import Quantity, expected
from quietbus.words import visible

T = TypeVar("T")
ZERO = (0.0, 0.0, 0.0)
LONGEST_NAME = 100  # [letters] so that the names of files made of it have room for more


_UNCHANGED = "a scenario and its parts do not change; Scenario.with_overrides gives a changed copy"


class FrozenDict(dict[str, T]):
    """A dict that does not change, as a tuple is a list that does not."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError(_UNCHANGED)

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:  # a dict's own way sets item after item
        return type(self), (dict(self),)


class Part(BaseModel):
    """A mapping of the scenario: its keys are known, its values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def __init__(self, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise ScenarioError(type(self).__name__, found(error)) from None

    # tells pydantic that parts within parts need not be made by this, so that all that is wrong
    # is found at once
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise TypeError(_UNCHANGED)

    def __delattr__(self, name: str) -> NoReturn:
        raise TypeError(_UNCHANGED)

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, data: Any) -> Any:
        """Mark unknown keys, and let a missing field's own type say what it expects."""
        if isinstance(data, cls):
            return data
        fields = cls.model_fields
        if not isinstance(data, dict):
            raise expected(f"a mapping with keys among {', '.join(fields)}", data)
        required = {key: None for key, field in fields.items() if field.is_required()}
        given = {
            str(key): value if key in fields else UnknownKey(str(key), fields)
            for key, value in data.items()
        }
        return required | given


def listing(length: int | None, what: str, least: int = 1) -> BeforeValidator:
    """Check that a value is a list of ``length``, or any from ``least`` on, before its items."""
    wanted = f"a list of {length or ('one or more' if least else 'any number of')} {what}"

    def check(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, list | tuple):
            raise expected(wanted, value)
        if len(value) < least if length is None else len(value) != length:
            raise expected(wanted, value, f"{len(value)} of them")
        return value

    return BeforeValidator(check)


Vector = Annotated[tuple[T, T, T], listing(3, "numbers")]
Matrix = Annotated[tuple[Vector[T], Vector[T], Vector[T]], listing(3, "rows")]
Vectors = Annotated[tuple[Vector[T], ...], listing(None, "rows of 3 numbers")]
Series = Annotated[tuple[T, ...], listing(None, "numbers")]


# one value for all legs, or a list with a value for each
PerLeg = Annotated[
    Annotated[T, Tag("<all>")] | Annotated[tuple[T, ...], Tag("<each>")],
    Discriminator(lambda value: "<each>" if isinstance(value, list | tuple) else "<all>"),
]


@dataclass(frozen=True)
class Count:
    """Type annotation of a whole number from 1 to ``most``."""

    most: int = 10**9

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def read(self, value: Any) -> int:
        """The number; a PydanticCustomError says what was expected and what came."""
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            raise expected("a count of at least 1", value)
        if value > self.most:
            raise expected(f"a count of at most {self.most:,}", value)
        return value


def name_defect(value: Any) -> str | None:
    """Why a value cannot be a name, or None if it can.

    Names stand in tables, pictures, pages and file names: one line of letters that have a glyph.
    """
    if not isinstance(value, str):
        return "not a text"
    if not value or value != value.strip():
        return "a name neither is empty nor starts or ends with a space" if value else "it is empty"
    if len(value) > LONGEST_NAME:
        return f"{len(value)} letters"
    if value != visible(value):
        return "control letters, line ends, and letters that turn the direction of writing"
    return None


def bad_name(value: Any, defect: str) -> PydanticCustomError:
    """The error of a value that cannot be a name."""
    why = defect if isinstance(value, str) else ""
    return expected(f"a name of 1 to {LONGEST_NAME} printable letters", value, why)


def _name(value: Any) -> str:
    defect = name_defect(value)
    if defect is not None:
        raise bad_name(value, defect)
    return str(value)


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise expected("a text", value)
    return value


def _unit_vector(value: tuple[float, float, float]) -> tuple[float, float, float]:
    norm = float(np.linalg.norm(value))
    if norm == 0.0:
        raise expected("a unit vector", value, "its length is zero")
    x, y, z = (component / norm for component in value)
    if abs(norm - 1.0) > 1e-3:
        offer = f"its length is {norm:.6g}; normalised: {listed((x, y, z), digits=10)}"
        raise expected("a unit vector", value, offer)
    # a vector that is normalised already stays as it is, so that reading it twice changes nothing
    return value if abs(norm - 1.0) < 1e-15 else (x, y, z)


def _inertia(
    value: tuple[tuple[float, float, float], ...],
) -> tuple[tuple[float, float, float], ...]:
    defect = inertia_defect(value)
    if defect is not None:
        text = f"expected the inertia matrix of a rigid body in kg*m^2, but {defect}"
        raise PydanticCustomError("scenario", "{text}", {"text": text})
    return value


Number = Annotated[float, Quantity("a plain number", "")]
PositiveNumber = Annotated[float, Quantity("a plain number", "", above=0.0)]
NonNegativeNumber = Annotated[float, Quantity("a plain number", "", least=0.0)]
PositiveMass = Annotated[float, Quantity("a mass", "kg", above=0.0)]
Mass = Annotated[float, Quantity("a mass", "kg", least=0.0)]
Length = Annotated[float, Quantity("a length", "m")]
Distance = Annotated[float, Quantity("a length", "m", least=0.0)]
PositiveLength = Annotated[float, Quantity("a length", "m", above=0.0)]
Time = Annotated[float, Quantity("a time", "s")]
StartTime = Annotated[float, Quantity("a time", "s", least=0.0)]
Duration = Annotated[float, Quantity("a time", "s", above=0.0)]
Frequency = Annotated[float, Quantity("a frequency", "Hz", above=0.0)]
Angle = Annotated[float, Quantity("an angle", "rad")]
AngularVelocity = Annotated[float, Quantity("an angular velocity", "rad/s")]
PositiveAngularVelocity = Annotated[float, Quantity("an angular velocity", "rad/s", above=0.0)]
PositiveAngularAcceleration = Annotated[
    float, Quantity("an angular acceleration", "rad/s^2", above=0.0)
]
PositiveAngularJerk = Annotated[float, Quantity("an angular jerk", "rad/s^3", above=0.0)]
Force = Annotated[float, Quantity("a force", "N")]
Torque = Annotated[float, Quantity("a torque", "N*m")]
PositiveTorque = Annotated[float, Quantity("a torque", "N*m", above=0.0)]
Stiffness = Annotated[float, Quantity("a stiffness", "N/m", above=0.0)]
Damping = Annotated[float, Quantity("a damping", "N*s/m", least=0.0)]
JointFriction = Annotated[float, Quantity("a joint friction", "N*m*s/rad", least=0.0)]
Momentum = Annotated[float, Quantity("an angular momentum", "N*m*s")]
Inertia = Annotated[float, Quantity("a moment of inertia", "kg*m^2")]
MomentOfInertia = Annotated[float, Quantity("a moment of inertia", "kg*m^2", least=0.0)]
PositiveInertia = Annotated[float, Quantity("a moment of inertia", "kg*m^2", above=0.0)]
StaticImbalance = Annotated[float, Quantity("a static imbalance", "kg*m", least=0.0)]
DynamicImbalance = Annotated[float, Quantity("a dynamic imbalance", "kg*m^2", least=0.0)]
ProportionalGain = Annotated[float, Quantity("a proportional gain", "N*m/rad", least=0.0)]
IntegralGain = Annotated[float, Quantity("an integral gain", "N*m/(rad*s)", least=0.0)]
DerivativeGain = Annotated[float, Quantity("a derivative gain", "N*m*s/rad", least=0.0)]
Zero = Annotated[float, Quantity("a zero of the controller", "1/s", least=0.0)]
UnitCount = Annotated[int, Count(MOST_UNITS)]
UnitVector = Annotated[Vector[Number], AfterValidator(_unit_vector)]
UnitVectors = Annotated[tuple[UnitVector, ...], listing(None, "unit vectors")]
InertiaMatrix = Annotated[Matrix[Inertia], AfterValidator(_inertia)]
Text = Annotated[str, BeforeValidator(_text)]
Name = Annotated[str, BeforeValidator(_name)]
