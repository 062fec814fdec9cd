"""Guidance, controller and steering."""

from functools import singledispatch
from typing import Any

import numpy as np

from quietbus.build.arrays import array, limit, quaternion, rotation
from quietbus.model.controller import AbstractController, PIDController
from quietbus.model.guidance import EigenaxisSlew, Guidance, StepGuidance
from quietbus.model.steering import (
    GeneralizedSingularityRobust,
    NoSteering,
    PseudoInverse,
    SingularityRobust,
    Steering,
)
from quietbus.scenario import Scenario
from quietbus.scenario import control as said


@singledispatch
def steering_of(law: Any) -> Steering:
    """A steering law, by its type."""
    raise TypeError(f"no steering law is registered for {type(law).__name__}")


@steering_of.register
def _(_law: said.NoSteering) -> Steering:
    return NoSteering()


@steering_of.register
def _(_law: said.PseudoInverse) -> Steering:
    return PseudoInverse()


@steering_of.register
def _(law: said.SingularityRobust) -> Steering:
    return SingularityRobust(array(law.lambda0), array(law.mu))


@steering_of.register
def _(law: said.GeneralizedSingularityRobust) -> Steering:
    numbers = (law.lambda0, law.mu, law.epsilon0, law.frequency, law.phases)
    return GeneralizedSingularityRobust(*map(array, numbers))


def controller_of(control: said.Control, J_B: np.ndarray) -> AbstractController:
    kp, ki, kd = control.pid.kp, control.pid.ki, control.pid.kd
    return PIDController(
        kp=array(kp),
        ki=array(ki),
        kd=array(kd),
        J_feedforward_B=array(J_B if control.feedforward else np.zeros((3, 3))),
        # 1/(Ki Tt) with the tracking time Tt = sqrt(Kd/Ki)
        unwinding=array(1.0 / np.sqrt(ki * kd) if ki * kd > 0.0 else 0.0),
        torque_limit=limit(control.torque_limit),
    )


def guidance_of(scenario: Scenario) -> Guidance:
    target = rotation(scenario.target.attitude)
    guidance = scenario.target.guidance
    if guidance == "step":
        return StepGuidance(array(quaternion(target)))
    start = rotation(scenario.initial.attitude)
    return EigenaxisSlew.plan(
        quaternion(start),
        (start.inv() * target).as_rotvec(),
        max_rate=guidance.max_rate,
        max_acceleration=guidance.max_acceleration,
        max_jerk=guidance.max_jerk,
        start=guidance.start,
    )
