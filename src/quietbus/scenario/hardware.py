"""The scenario's mechanical parts: bus, isolator and CMG cluster."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    SerializerFunctionWrapHandler,
    Tag,
    ValidationInfo,
    field_validator,
    model_serializer,
    model_validator,
)

from quietbus.scenario.base import (
    ZERO,
    Angle,
    AngularVelocity,
    Damping,
    Distance,
    DynamicImbalance,
    InertiaMatrix,
    JointFriction,
    Length,
    Mass,
    MomentOfInertia,
    Momentum,
    Part,
    PerLeg,
    PositiveAngularAcceleration,
    PositiveAngularVelocity,
    PositiveInertia,
    PositiveLength,
    PositiveMass,
    Series,
    StaticImbalance,
    Stiffness,
    UnitCount,
    UnitVector,
    UnitVectors,
    Vector,
    Vectors,
    listing,
)
from quietbus.scenario.checks import free_directions, inertia_defect, listed
from quietbus.scenario.disturbance import Disturbance, GimbalMotor
from quietbus.scenario.errors import Findings, Path
from quietbus.scenario.limits import MOST_LEGS, MOST_UNITS
from quietbus.scenario.run_up import RunUp
from quietbus.scenario.struts import AnyStrut, SpringDamperStrut
from quietbus.scenario.units import expected

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


class Bus(Part):
    """The satellite without its platform."""

    mass: PositiveMass
    inertia: InertiaMatrix  # about the mass centre, bus axes


class Plate(Part):
    """The upper plate without its CMGs."""

    mass: PositiveMass
    inertia: InertiaMatrix  # about its mass centre, upper-plate axes
    center_of_mass: Vector[Length] = ZERO  # upper-plate frame


class LegPart(Part):
    """The lower or the upper part of a leg; all zero for a massless one."""

    mass: Mass
    distance: Distance  # from the joint at this part's end to its mass centre
    transverse_inertia: MomentOfInertia
    axial_inertia: MomentOfInertia

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        if self.axial_inertia > 2.0 * self.transverse_inertia * (1.0 + 1e-6):
            findings.add(
                "axial_inertia",
                "expected at most twice the transverse inertia, "
                f"as every body has it, got {self.axial_inertia:g} kg*m^2",
            )
        findings.raise_any()
        return self


class Legs(Part):
    """The legs; what is not a matrix is one value for all legs or a list with one for each."""

    upper_joints: Vectors[Length]  # upper-plate frame
    lower_joints: Vectors[Length]  # base-plate frame
    universal_axes: UnitVectors  # base-plate frame
    strut: AnyStrut | None = None  # a law of any type, or instead of it the two
    stiffness: PerLeg[Stiffness] | None = Field(None, validate_default=True)
    damping: PerLeg[Damping] | None = Field(None, validate_default=True)
    free_length: PerLeg[PositiveLength] | None = None  # None: as the nominal pose has it
    upper_part: PerLeg[LegPart]
    lower_part: PerLeg[LegPart]
    spherical_friction: PerLeg[JointFriction] = 0.0
    universal_friction: PerLeg[JointFriction] = 0.0

    @property
    def count(self) -> int:
        """Number of legs."""
        return len(self.upper_joints)

    @property
    def law(self) -> Any:
        """The law of the struts, whichever form the file used."""
        if self.strut is not None:
            return self.strut
        return SpringDamperStrut(stiffness=self.stiffness, damping=self.damping)

    @field_validator("stiffness", "damping")
    @classmethod
    def _one_form(cls, value: Any, info: ValidationInfo) -> Any:
        """Beside all other fields, so that a missing one is told with what else is wrong."""
        if "strut" not in info.data:  # it is wrong, and told
            return value
        findings, strut = Findings(), info.data["strut"]
        if value is not None and strut is not None:
            findings.add((), "expected it in strut, since a strut is given there; got both")
        if value is None and strut is None:
            what = "a stiffness in N/m" if info.field_name == "stiffness" else "a damping in N*s/m"
            findings.add((), f"expected {what}, or a strut; got nothing")
        findings.raise_any()
        return value

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        if self.count < 3:
            findings.add("upper_joints", f"expected at least 3 legs, got {self.count}")
        if self.count > MOST_LEGS:
            findings.add("upper_joints", f"expected at most {MOST_LEGS} legs, got {self.count}")
        lists: dict[Path, Any] = {(key,): getattr(self, key) for key in type(self).model_fields}
        if self.strut is not None:
            try:
                lists |= {("strut", key): getattr(self.strut, key) for key in self.strut.per_leg()}
                self.strut.spring_and_damper()
            except Exception as error:  # of a user's own kind
                name, words = type(self.strut).__name__, f"{type(error).__name__}: {error}"
                findings.add("strut", f"{name}: per_leg or spring_and_damper raised {words}")
        for path, value in lists.items():
            if isinstance(value, tuple) and len(value) != self.count:
                findings.add(
                    path,
                    f"expected {self.count} entries, one for each of upper_joints, "
                    f"got {len(value)}",
                )
        findings.raise_any()
        return self


class Mounting(Part):
    """Legs on a base plate that is fixed to a body, and whether they are in use."""

    mount: Literal["isolated", "rigid"] = "isolated"
    offset: Vector[Length]  # base-plate centre in the bus frame
    orientation: Vector[Angle] = ZERO  # [roll, pitch, yaw] of the base plate in the bus
    separation: Length  # of the upper-plate frame above the base-plate frame, nominal pose
    legs: Legs

    def pose(self) -> tuple[np.ndarray, Rotation]:
        """Origin [m] and attitude of the upper-plate frame in what it stands on, nominal pose."""
        from scipy.spatial.transform import Rotation  # takes as long to load as all else here

        base = Rotation.from_euler("ZYX", self.orientation[::-1])
        return self.offset + base.apply([0.0, 0.0, self.separation]), base

    def joints(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper joints (n x 3) [m] in the base-plate frame, nominal pose."""
        lower, upper = np.array(self.legs.lower_joints), np.array(self.legs.upper_joints)
        return lower, upper + np.array([0.0, 0.0, self.separation])

    @model_validator(mode="after")
    def _check_geometry(self) -> Self:
        findings = Findings()
        lower, upper = self.joints()
        lengths = np.linalg.norm(upper - lower, axis=1)
        for leg in np.flatnonzero(lengths < 1e-9).tolist():
            findings.add(
                ("legs", "upper_joints", leg),
                f"leg {leg} has zero length: its joints coincide in the nominal pose",
            )
        findings.raise_any()
        directions = (upper - lower) / lengths[:, None]
        repeated = False
        for leg, (s, k) in enumerate(zip(directions, self.legs.universal_axes, strict=True)):
            if abs(s @ np.array(k)) > 0.999:
                findings.add(
                    ("legs", "universal_axes", leg),
                    f"expected an axis across the leg, got {listed(k)}, which is parallel to "
                    f"leg {leg} ({listed(s)}): the universal joint would lock",
                )
            for other in range(leg):
                same = [abs(ends[leg] - ends[other]).max() < 1e-9 for ends in (lower, upper)]
                if all(same):
                    repeated = True
                    findings.add(
                        ("legs", "upper_joints", leg),
                        f"leg {leg} is leg {other} again: upper and lower joint are the same",
                    )
        free = free_directions(lower, upper)
        if free and not repeated:  # a repeated leg is the likely cause, and is told
            few = "; a strut resists along its own line alone, so it takes six" * (len(lower) < 6)
            findings.add(
                ("legs",),
                f"expected legs that hold the plate in all six directions; these {len(lower)} "
                f"leave free: {'; '.join(free)} (base-plate frame){few}",
            )
        findings.raise_any()
        return self


class Isolator(Mounting):
    """The platform: base plate fixed to the bus, legs, upper plate."""

    plate: Plate


class GimbalBody(Part):
    """The gimbal without the rotor."""

    mass: PositiveMass
    inertia: Vector[PositiveInertia]  # about spin, transverse and gimbal axes, mass centre
    center_of_mass: Vector[Length] = ZERO  # from the unit's position; gimbal axes (s, t, g)

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        defect = inertia_defect(np.diag(self.inertia))
        if defect:
            findings.add("inertia", f"expected the principal inertia of a rigid body, but {defect}")
        findings.raise_any()
        return self


class InstallationError(Part):
    """Small turn of the rotor's bearing against the gimbal, about g, t and s."""

    alpha: Angle = 0.0
    beta: Angle = 0.0
    chi: Angle = 0.0


class Rotor(Part):
    """A rotor; exactly one of `momentum`, at its speed, and `spin_inertia` is given."""

    mass: PositiveMass
    momentum: Momentum | None = None
    spin_inertia: PositiveInertia | None = None
    speed: AngularVelocity
    transverse_inertia: PositiveInertia
    static_imbalance: StaticImbalance = 0.0
    dynamic_imbalance: DynamicImbalance = 0.0
    dynamic_imbalance_phase: Angle = 0.0  # in the rotor plane, from the static imbalance
    installation_error: InstallationError = InstallationError()
    offset: Vector[Length] = ZERO  # gimbal mass centre to rotor centre; gimbal axes (s, t, g)
    disturbance: Disturbance | None = None  # beyond the imbalance

    @property
    def inertia(self) -> np.ndarray:
        """Inertia [kg m^2] about the mass centre: x along spin, y along the static imbalance."""
        if self.spin_inertia is not None:
            spin = self.spin_inertia
        else:
            assert self.momentum is not None  # checked below
            spin = self.momentum / self.speed
        xy = self.dynamic_imbalance * np.cos(self.dynamic_imbalance_phase)
        xz = self.dynamic_imbalance * np.sin(self.dynamic_imbalance_phase)
        across = self.transverse_inertia
        return np.array([[spin, -xy, -xz], [-xy, across, 0.0], [-xz, 0.0, across]])

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        if (self.momentum is None) == (self.spin_inertia is None):
            got = "neither" if self.momentum is None else "both"
            findings.add((), f"expected exactly one of momentum and spin_inertia, got {got}")
        elif self.momentum is not None and self.momentum * self.speed <= 0.0:
            if self.speed == 0.0:
                findings.add(
                    "speed",
                    "expected a speed other than 0: a rotor at rest is described "
                    "by spin_inertia instead of momentum",
                )
            else:
                findings.add(
                    "momentum",
                    "expected a momentum with the sign of the speed "
                    f"({self.speed:g} rad/s), got {self.momentum:g} N*m*s",
                )
        findings.raise_any()
        defect = inertia_defect(self.inertia)
        if defect:
            balanced = inertia_defect(np.diag(np.diag(self.inertia)))
            findings.add(
                "transverse_inertia" if balanced else "dynamic_imbalance",
                f"expected, with the spin inertia {self.inertia[0, 0]:.6g} kg*m^2, the transverse "
                f"inertia {self.transverse_inertia:.6g} kg*m^2 and the dynamic imbalance "
                f"{self.dynamic_imbalance:.6g} kg*m^2 ({1e7 * self.dynamic_imbalance:.6g} g*cm^2), "
                f"the inertia of a rigid body, but {defect}",
            )
        findings.raise_any()
        return self


class Pyramid(Part):
    """Units around the plate's z axis, gimbal axes leaning outwards from it by `skew`.

    Of reaction wheels the spin axes.
    """

    skew: Angle
    radius: Distance
    height: Length = 0.0
    units: UnitCount = 4


class Unit(Part):
    """One CMG placed at will, upper-plate frame."""

    type: Literal["cmg"] | None = None  # None: the cluster's
    position: Vector[Length]
    gimbal_axis: UnitVector
    spin_axis: UnitVector  # at zero gimbal angle
    gimbal_body: GimbalBody | None = None  # None: the cluster's
    rotor: Rotor | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        g, s = np.array(self.gimbal_axis), np.array(self.spin_axis)
        across = s - (s @ g) * g
        if np.linalg.norm(across) < 1e-3:
            findings.add(
                "spin_axis",
                "expected an axis across the gimbal axis, got "
                f"{listed(s)}, which is parallel to it",
            )
        elif abs(s @ g) > 1e-3:
            across /= np.linalg.norm(across)
            findings.add(
                "spin_axis",
                "expected an axis at right angles to the gimbal axis, got "
                f"{listed(s)}; projected: {listed(across, digits=10)}",
            )
        findings.raise_any()
        return self


def _phases_form(value: Any) -> str:
    return "<random>" if isinstance(value, str) else "<each>"


def _phases(value: Any) -> Any:
    if value is None:
        return "random"
    if not isinstance(value, list | tuple | np.ndarray) and value != "random":
        raise expected("random, or a list of one or more angles", value)
    return value


RotorPhases = Annotated[
    Annotated[Literal["random"], Tag("<random>")] | Annotated[Series[Angle], Tag("<each>")],
    Discriminator(_phases_form),
    BeforeValidator(_phases),
]
ROTOR_PHASE = 2  # of the streams of random numbers of a rotor


class Placed(Part):
    """What clusters of CMGs and of reaction wheels have in common.

    A pyramid, or a list of units with what differs from the common parts.
    """

    COMMON: ClassVar[tuple[str, ...]]  # parts that a unit may override
    PER_UNIT: ClassVar[dict[str, str]] = {"rotor_phases": "angles"}
    NOUN: ClassVar[str]

    pyramid: Pyramid | None = None
    rotor: Rotor
    rotor_phases: RotorPhases = "random"  # rotor angles at the start
    run_up: RunUp | None = None  # None: speeds as the rotors have them

    @property
    def orders(self) -> tuple[float, ...]:
        """Multiples of rotor speed in the run: those of imbalance, 1 and 2, and of all tables."""
        rotors = (unit.rotor for unit in self.placed() if unit.rotor)
        tables = (rotor.disturbance.orders for rotor in rotors if rotor.disturbance)
        found = {line.order for table in tables for line in table or ()} | {1.0, 2.0}
        whole = all(order.is_integer() for order in found)
        return tuple(sorted(int(order) if whole else order for order in found))

    @property
    def seeds(self) -> tuple[int, ...]:
        """Of the rotors' random phases and noise."""
        rotors = (unit.rotor for unit in self.placed())
        return tuple(r.disturbance.seed if r and r.disturbance else 0 for r in rotors)

    def phases(self, first: int = 0) -> tuple[float, ...]:
        """Rotor angles at the start [rad]: as given, or drawn evenly from -pi to pi.

        What is drawn for a rotor depends on the seed of its disturbance and on its number alone.

        Args:
            first: number of the first unit, where others come before these.
        """
        if self.rotor_phases != "random":
            return self.rotor_phases
        return tuple(
            float(np.random.default_rng([seed, j, ROTOR_PHASE]).uniform(-np.pi, np.pi))
            for j, seed in enumerate(self.seeds, first)
        )

    def placed(self) -> tuple[Any, ...]:
        """All units, each with its parts."""
        raise NotImplementedError

    @property
    def count(self) -> int:
        """Number of units."""
        return self.pyramid.units if self.pyramid else len(getattr(self, "units", None) or ())

    def azimuths(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Of each unit of the pyramid: radial direction, position, axis that leans outwards.

        Unit j of n stands at the azimuth 2 pi j / n.
        """
        assert self.pyramid is not None
        z, found = np.array([0.0, 0.0, 1.0]), []
        for azimuth in 2.0 * np.pi * np.arange(self.count) / self.count:
            r = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            position = self.pyramid.radius * r + self.pyramid.height * z
            found.append(
                (r, position, np.sin(self.pyramid.skew) * r + np.cos(self.pyramid.skew) * z)
            )
        return found

    def completed(self) -> tuple[Any, ...]:
        """The listed units, each with all its parts."""
        common = {key: getattr(self, key) for key in self.COMMON}
        return tuple(
            unit.model_copy(update={key: getattr(unit, key) or common[key] for key in common})
            for unit in getattr(self, "units", None) or ()
        )

    @model_validator(mode="before")
    @classmethod
    def _complete_units(cls, data: Any) -> Any:
        """Merge what a unit says about its parts onto the common ones."""
        if not (isinstance(data, dict) and isinstance(data.get("units"), list | tuple)):
            return data
        return data | {"units": [_completed(unit, data, cls.COMMON) for unit in data["units"]]}

    @model_serializer(mode="wrap")
    def _shorten_units(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out what a unit has in common, so that an override of that reaches the unit."""
        data: dict[str, Any] = handler(self)
        for unit in data["units"] or ():
            for key in self.COMMON:
                if unit[key] is not None and data[key] is not None:
                    common = data[key]
                    unit[key] = {k: v for k, v in unit[key].items() if v != common[k]}
        return data

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        units = getattr(self, "units", None)
        if units is not None and len(units) > MOST_UNITS:
            findings.add("units", f"expected at most {MOST_UNITS:,} units, got {len(units):,}")
        if (self.pyramid is None) == (units is None):
            got = "neither" if units is None else "both"
            findings.add((), f"expected exactly one of pyramid and units, got {got}")
        findings.raise_any()
        lists: dict[tuple[str, ...], tuple[Any, str]] = {
            (key,): (getattr(self, key), what) for key, what in self.PER_UNIT.items()
        }
        for key in ("initial_speed", "final_speed"):
            lists["run_up", key] = (self.run_up and getattr(self.run_up, key), "speeds")
        for path, (values, what) in lists.items():
            if isinstance(values, tuple) and len(values) != self.count:
                findings.add(
                    path,
                    f"expected {self.count} {what}, one for each {self.NOUN}, got {len(values)}",
                )
        findings.raise_any()
        return self


class Cluster(Placed):
    """The CMGs."""

    COMMON = ("gimbal_body", "rotor")
    PER_UNIT: ClassVar[dict[str, str]] = {"rotor_phases": "angles", "gimbal_angles": "angles"}
    NOUN = "CMG"

    type: Literal["cmg"] = "cmg"
    units: Annotated[tuple[Unit, ...], listing(None, "units")] | None = None
    gimbal_body: GimbalBody
    gimbal_angles: Series[Angle] | None = None
    gimbal_bandwidth: PositiveAngularVelocity  # of the first-order rate servo
    gimbal_rate_limit: PositiveAngularVelocity | None = None
    gimbal_acceleration_limit: PositiveAngularAcceleration | None = None
    gimbal_motor: GimbalMotor | None = None  # None: turns the gimbal exactly as its servo says

    def placed(self) -> tuple[Unit, ...]:
        """All CMGs as units, each with its gimbal body and rotor."""
        if self.pyramid is None:
            return self.completed()
        z = np.array([0.0, 0.0, 1.0])
        return tuple(
            Unit(
                position=position,
                gimbal_axis=axis,
                spin_axis=np.cross(z, r),
                gimbal_body=self.gimbal_body,
                rotor=self.rotor,
            )
            for r, position, axis in self.azimuths()
        )


def _completed(unit: Any, cluster: dict[str, Any], keys: tuple[str, ...]) -> Any:
    """A unit's data with its partial overrides filled up from the cluster's."""
    if not isinstance(unit, dict):
        return unit
    whole = dict(unit)
    for key in keys:
        common, own = cluster.get(key), unit.get(key)
        if isinstance(own, dict) and isinstance(common, Part):
            common = common.model_dump(exclude_none=True)
        if isinstance(own, dict) and isinstance(common, dict):
            # momentum and spin inertia are two ways to say one thing: the unit's own one holds
            either = {"momentum", "spin_inertia"}
            replaced = either if own.keys() & either else set()
            whole[key] = {k: v for k, v in common.items() if k not in replaced} | own
    return whole
