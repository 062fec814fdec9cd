"""The whole satellite as one pytree of parameters."""

from typing import Literal

import equinox as eqx
from jaxtyping import Array, Float

from quietbus.model.body import Bus, Plate
from quietbus.model.cmg import ControlMomentGyro
from quietbus.model.controller import GimbalServo, PIDController
from quietbus.model.disturbance import Disturbance
from quietbus.model.gimbal_motor import GimbalMotor
from quietbus.model.guidance import Guidance
from quietbus.model.hexapod import Hexapod
from quietbus.model.load import Load
from quietbus.model.steering import Steering


class Satellite(eqx.Module):
    """Parameters of bus, platform, CMGs and control; nothing in it changes during a run."""

    bus: Bus
    plate: Plate
    legs: Hexapod
    cluster: ControlMomentGyro  # every field with a leading axis of units
    p_BP_B: Float[Array, "3"]  # [m] origin of P in its nominal pose
    q_BP: Float[Array, "4"]  # [-] attitude of P in its nominal pose
    servo: GimbalServo
    guidance: Guidance
    controller: PIDController | None  # None: no control torque
    steering: Steering | None  # None: gimbals held
    loads: tuple[Load, ...]
    mount: Literal["isolated", "rigid"] = eqx.field(static=True)
    disturbance: Disturbance | None = None  # of the rotors, beyond their imbalance
    motor: GimbalMotor | None = None  # None: gimbals move exactly as their servos say
