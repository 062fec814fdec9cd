"""The scenario's control: PID, steering, target, and the loads that disturb it."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Discriminator, StrictBool, Tag, model_validator

from quietbus.scenario.base import (
    ZERO,
    Angle,
    AngularVelocity,
    DerivativeGain,
    Duration,
    Force,
    IntegralGain,
    Length,
    Name,
    NonNegativeNumber,
    Number,
    Part,
    PositiveAngularAcceleration,
    PositiveAngularJerk,
    PositiveAngularVelocity,
    PositiveTorque,
    ProportionalGain,
    Series,
    StartTime,
    Time,
    Torque,
    Vector,
    Zero,
    listing,
)
from quietbus.scenario.errors import Findings
from quietbus.scenario.units import expected


class PIDGains(Part):
    """Gains of `-(kp e + ki ∫e + kd w)`, the same about every axis."""

    kp: ProportionalGain
    ki: IntegralGain
    kd: DerivativeGain


class PIDZeros(Part):
    """The controller `K (s + tp)(s + tq) / s` of the angle error."""

    gain: DerivativeGain  # K
    zeros: Annotated[tuple[Zero, Zero], listing(2, "numbers")]  # tp, tq

    @property
    def kp(self) -> float:
        """Proportional gain [N m/rad]."""
        return self.gain * (self.zeros[0] + self.zeros[1])

    @property
    def ki(self) -> float:
        """Integral gain [N m/(rad s)]."""
        return self.gain * self.zeros[0] * self.zeros[1]

    @property
    def kd(self) -> float:
        """Derivative gain [N m s/rad]."""
        return self.gain


def _pid_form(value: Any) -> str:
    by_zeros = isinstance(value, PIDZeros) or (
        isinstance(value, dict) and not value.keys().isdisjoint({"gain", "zeros"})
    )
    return "<zeros>" if by_zeros else "<gains>"


PID = Annotated[
    Annotated[PIDGains, Tag("<gains>")] | Annotated[PIDZeros, Tag("<zeros>")],
    Discriminator(_pid_form),
]


class NoSteering(Part):
    """Gimbals held."""

    law: Literal["none"]


class PseudoInverse(Part):
    """Moore-Penrose pseudo-inverse; it has no parameters."""

    law: Literal["pseudo_inverse"]


class SingularityRobust(Part):
    """Robust pseudo-inverse with `lambda = lambda0 exp(-mu det(A A^T))`."""

    law: Literal["singularity_robust"]
    lambda0: NonNegativeNumber = 0.01
    mu: NonNegativeNumber = 10.0


class GeneralizedSingularityRobust(Part):
    """Wie's generalised robust inverse, off-diagonal terms `epsilon0 sin(frequency t + phase)`."""

    law: Literal["generalized_singularity_robust"]
    lambda0: NonNegativeNumber = 0.01
    mu: NonNegativeNumber = 10.0
    epsilon0: NonNegativeNumber = 0.01
    frequency: AngularVelocity = 0.5 * np.pi
    phases: Vector[Angle] = (0.0, 0.5 * np.pi, np.pi)


LAWS = ("singularity_robust", "generalized_singularity_robust", "pseudo_inverse", "none")


def _known_law(value: Any) -> Any:
    if isinstance(value, Part):
        return value
    if not isinstance(value, dict):
        raise expected("a mapping with the key law", value)
    findings = Findings()
    if value.get("law") not in LAWS:
        error = expected(f"one of {', '.join(LAWS)}", value.get("law"))
        findings.add("law", error.message())
    findings.raise_any()
    return value


Steering = Annotated[
    Annotated[NoSteering, Tag("<none>")]
    | Annotated[PseudoInverse, Tag("<pseudo_inverse>")]
    | Annotated[SingularityRobust, Tag("<singularity_robust>")]
    | Annotated[GeneralizedSingularityRobust, Tag("<generalized_singularity_robust>")],
    Discriminator(lambda value: f"<{value['law'] if isinstance(value, dict) else value.law}>"),
    BeforeValidator(_known_law),
]


class Control(Part):
    """Attitude control: the torque asked for, and the gimbal rates that give it."""

    pid: PID
    torque_limit: PositiveTorque | None = None
    feedforward: bool = True  # of the inertia torque of a slew
    steering: Steering = SingularityRobust(law="singularity_robust")


class Initial(Part):
    """Attitude and rate of the whole satellite at the start.

    ``steady``: these are the slow motion's, and the rotors' steady jitter comes on top, so that
    the imbalance causes no transient. Otherwise all parts start with exactly these.
    """

    attitude: Vector[Angle] = ZERO  # [roll, pitch, yaw]
    rate: Vector[AngularVelocity] = ZERO  # bus frame
    steady: StrictBool = False

    @model_validator(mode="before")
    @classmethod
    def _steady_word(cls, data: Any) -> Any:
        return {"steady": True} if data == "steady" else data


class EigenaxisSlew(Part):
    """Smooth rest-to-rest turn about one axis."""

    max_rate: PositiveAngularVelocity
    max_acceleration: PositiveAngularAcceleration
    max_jerk: PositiveAngularJerk
    start: StartTime = 0.0


def _guidance_form(value: Any) -> str:
    return "<slew>" if isinstance(value, dict | EigenaxisSlew) else "<step>"


def _step_or_mapping(what: str, word: str) -> BeforeValidator:
    """Let only one word or a mapping through."""

    def check(value: Any) -> Any:
        if value == word or isinstance(value, dict | Part):
            return value
        raise expected(f"{word} or {what}", value)

    return BeforeValidator(check)


class Target(Part):
    """Attitude that the control is to reach, and how."""

    attitude: Vector[Angle] = ZERO  # [roll, pitch, yaw]
    guidance: Annotated[
        Annotated[Literal["step"], Tag("<step>")] | Annotated[EigenaxisSlew, Tag("<slew>")],
        Discriminator(_guidance_form),
        _step_or_mapping("a mapping with max_rate, max_acceleration, max_jerk", "step"),
    ] = "step"


class Step(Part):
    """1 from `start` to `end`, otherwise 0."""

    start: Time
    end: Time | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        if self.end is not None and self.end <= self.start:
            findings.add("end", f"expected a time after start ({self.start:g} s), got {self.end:g}")
        findings.raise_any()
        return self


class HalfSine(Part):
    """Half a period of a sine."""

    start: Time
    duration: Duration


class Table(Part):
    """Linear between points; the first and last values hold outside them."""

    times: Series[Time]
    values: Series[Number]

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        if len(self.values) != len(self.times):
            findings.add(
                "values",
                f"expected {len(self.times)} numbers, one for each time, got {len(self.values)}",
            )
        for i in range(1, len(self.times)):
            if self.times[i] <= self.times[i - 1]:
                findings.add(
                    ("times", i),
                    f"expected a time after {self.times[i - 1]:g} s, the one before, "
                    f"got {self.times[i]:g}",
                )
        findings.raise_any()
        return self


class Profile(Part):
    """A factor over time: exactly one of the three."""

    step: Step | None = None
    half_sine: HalfSine | None = None
    table: Table | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        given = [key for key in type(self).model_fields if getattr(self, key) is not None]
        if len(given) != 1:
            got = " and ".join(given) or "neither"
            findings.add((), f"expected constant, or one of step, half_sine, table; got {got}")
        findings.raise_any()
        return self


def _profile_form(value: Any) -> str:
    return "<shaped>" if isinstance(value, dict | Profile) else "<constant>"


class Load(Part):
    """An external force and torque on one body."""

    body: Name  # bus, plate, or the name of another body
    frame: Literal["body", "inertial"] = "body"  # of force and torque
    force: Vector[Force] = ZERO
    torque: Vector[Torque] = ZERO
    point: Vector[Length] = ZERO  # where the force acts, body frame
    profile: Annotated[
        Annotated[Literal["constant"], Tag("<constant>")] | Annotated[Profile, Tag("<shaped>")],
        Discriminator(_profile_form),
        _step_or_mapping("a mapping with one of step, half_sine, table", "constant"),
    ] = "constant"
