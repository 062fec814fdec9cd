"""Blocks of CMGs or reaction wheels."""

from functools import singledispatch
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.build.arrays import array, limit
from quietbus.build.disturbance import disturbance_of, motor_of
from quietbus.model.cluster import Cluster as Units
from quietbus.model.gimbal_motor import SmoothMotor
from quietbus.model.gimbals import GimbalServos, HeldGimbals
from quietbus.model.rotors import AbstractRotors, ConstantSpeed, RunUp, WheelMotors
from quietbus.model.unit import ControlMomentGyro
from quietbus.scenario.blocks import Block
from quietbus.scenario.hardware import Cluster, Unit
from quietbus.scenario.wheels import Wheel, WheelCluster


@singledispatch
def cluster_of(block: Any, name: str, carrier: str, first_unit: int) -> Units:
    """A block of units on a body, by the block's type.

    Args:
        carrier: name of the body.
        first_unit: number of its first unit: random phases go by it.
    """
    raise TypeError(f"no cluster is registered for {type(block).__name__}")


@cluster_of.register
def _(block: Cluster, name: str, carrier: str, first_unit: int) -> Units:
    servos = GimbalServos(
        array(block.gimbal_bandwidth),
        limit(block.gimbal_rate_limit),
        limit(block.gimbal_acceleration_limit),
    )
    rotors = _run_up(block) if block.run_up else ConstantSpeed()
    motor = motor_of(block, first_unit)
    units, disturbance = _units(block, first_unit), disturbance_of(block, first_unit)
    return Units(name, (carrier,), units, servos, rotors, disturbance, motor)


@cluster_of.register
def _(block: WheelCluster, name: str, carrier: str, first_unit: int) -> Units:
    rotors = _run_up(block) if block.run_up else _wheel_motors(block)
    units, disturbance = _units(block, first_unit), disturbance_of(block, first_unit)
    held = HeldGimbals(array(np.zeros(block.count)))
    return Units(name, (carrier,), units, held, rotors, disturbance, SmoothMotor())


def _units(block: Block, first_unit: int) -> ControlMomentGyro:
    placed: tuple[Unit | Wheel, ...] = block.placed()
    phases = block.phases(first_unit)
    units = [unit_of(unit, phase) for unit, phase in zip(placed, phases, strict=True)]
    return jax.tree.map(lambda *each: array(np.stack(each)), *units)


def _run_up(block: Block) -> AbstractRotors:
    said, units = block.run_up, block.placed()
    assert said is not None
    initial, final = said.speeds(tuple(unit.rotor.speed for unit in units if unit.rotor))
    one = np.ones(len(units))
    times = array(said.start * one), array(said.duration * one)
    return RunUp(array(initial), array(final), times[0], times[1], said.shape)


def _wheel_motors(block: WheelCluster) -> AbstractRotors:
    motors = [wheel.motor or block.motor for wheel in block.placed()]
    return WheelMotors(
        jnp.stack([limit(motor.torque_limit) for motor in motors]),
        jnp.stack([limit(motor.speed_limit) for motor in motors]),
    )


def unit_of(unit: Unit | Wheel, phase: float) -> ControlMomentGyro:
    """One CMG, or a wheel with its housing as a gimbal body that is held."""
    body, rotor = unit.gimbal_body, unit.rotor
    assert body is not None  # Cluster.placed fills both in
    assert rotor is not None
    g, s = np.array(unit.gimbal_axis), np.array(unit.spin_axis)
    s -= (s @ g) * g  # at right angles to the last digit
    s /= np.linalg.norm(s)
    error = rotor.installation_error
    # A_fg of eq. 3 is, to first order, the transpose of this turn about (s, t, g)
    bearing = Rotation.from_rotvec([error.chi, error.beta, error.alpha])
    return ControlMomentGyro(
        p_PC_P=array(unit.position),
        R_PG0=array(np.stack([s, np.cross(g, s), g], axis=1)),
        gimbal_mass=array(body.mass),
        p_CGcm_G=array(body.center_of_mass),
        I_GGcm_G=array(np.diag(body.inertia)),
        rotor_mass=array(rotor.mass),
        p_CR_G=array(np.add(body.center_of_mass, rotor.offset)),
        R_GF=array(bearing.as_matrix()),
        I_RRcm_R=array(rotor.inertia),
        eccentricity=array(rotor.static_imbalance / rotor.mass),
        rotor_speed=array(rotor.speed),
        rotor_phase=array(phase),
    )
