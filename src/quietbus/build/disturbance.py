"""What rotors and gimbal motors do beyond imbalance."""

import numpy as np

from quietbus.build.arrays import array
from quietbus.model.disturbance import (
    CHANNELS,
    AbstractDisturbance,
    Disturbance,
    Spectra,
    Spectrum,
    quiet_rotors,
)
from quietbus.model.gimbal_motor import AbstractGimbalMotor, GimbalMotor, SmoothMotor
from quietbus.scenario import disturbance as said
from quietbus.scenario.blocks import Block
from quietbus.scenario.disturbance import COMPONENTS
from quietbus.scenario.hardware import Cluster, Unit
from quietbus.scenario.wheels import Wheel


def disturbance_of(block: Block, first_unit: int) -> AbstractDisturbance:
    """Of all rotors, at the orders of all tables."""
    placed: tuple[Unit | Wheel, ...] = block.placed()
    each = [unit.rotor.disturbance if unit.rotor else None for unit in placed]
    if not any(each):
        return quiet_rotors(len(each))
    orders = block.orders
    shape = (len(each), len(orders), len(CHANNELS))
    coefficient, phase = np.zeros(shape), np.zeros(shape)
    period, damping = np.zeros((2, len(each), 3))
    place = {order: k for k, order in enumerate(orders)}
    spectra: list[Spectra] = []
    for j, own in enumerate(each):
        spectra.append(_spectra(own))
        if own is None:
            continue
        phases = own.phases(first_unit + j)
        for line, given in zip(own.orders or (), phases, strict=True):
            k = place[line.order]
            for name in COMPONENTS:
                if getattr(line, name):
                    channel = line.channel_of(name)
                    coefficient[j, k, channel] += getattr(line, name)
                    phase[j, k, channel] = given[name]
        modes = own.resonances
        for m, mode in enumerate((modes.radial, modes.axial, modes.rocking)):
            if mode is not None:
                period[j, m], damping[j, m] = 0.5 / (np.pi * mode.frequency), mode.damping
    return Disturbance(
        orders=tuple(orders),
        coefficient=array(coefficient),
        phase=array(phase),
        period=array(period),
        damping=array(damping),
        broadband=tuple(spectra),
    )


def _spectra(disturbance: said.Disturbance | None) -> Spectra:
    """Spectra of one rotor by component."""
    given = disturbance.broadband.given() if disturbance else {}

    def spectrum(name: str) -> Spectrum | None:
        if name not in given:
            return None
        table = given[name]
        logarithmic = table.interpolation == "log"
        return Spectrum(array(table.frequency), array(table.psd), logarithmic)

    radial, axial, rocking, about = (spectrum(name) for name in COMPONENTS)
    return radial, axial, rocking, about


def motor_of(block: Cluster, first_unit: int) -> AbstractGimbalMotor:
    motor = block.gimbal_motor
    if motor is None:
        return SmoothMotor()
    ripple, stepping = motor.ripple or (), motor.stepping
    steps = stepping.steps_per_turn if stepping else 1
    harmonic = 1 + np.arange(stepping.harmonics if stepping else 0)
    holding = motor.holding_bandwidth
    phases = [motor.phases(seed, j) for j, seed in enumerate(block.seeds, first_unit)]
    return GimbalMotor(
        per_turn=array([line.per_turn for line in ripple]),
        torque=array([line.torque for line in ripple]),
        phase=array([own for own, _ in phases]),
        holding=array(0.1 * block.gimbal_bandwidth if holding is None else holding),
        step_per_turn=array(harmonic * steps),
        step_turn=array(2.0 / (harmonic * steps)),
        step_phase=array([harmonic * own for _, own in phases]),
        step_frequency=array(2.0 * np.pi * stepping.frequency if stepping else 1.0),
        step_damping=array(stepping.damping if stepping else 1.0),
    )
