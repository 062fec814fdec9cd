"""Ripple and steps of gimbal motors against closed forms."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import (
    awkward_satellite,
    paper_satellite,
    uncontrolled,
    with_cluster,
    with_units,
)
from quietbus.build import build_satellite
from quietbus.dynamics.closed_loop import evaluate, initial_state
from quietbus.model.gimbal_motor import GimbalMotor, gimbal_inertia
from quietbus.model.load import Constant, Load
from quietbus.model.unit import ControlMomentGyro
from quietbus.scenario import load_scenario, per_cmg_scenarios


def motor(
    per_turn=(),
    torque=(),
    phase=(),
    holding=5.0,
    steps=1,
    harmonics=0,
    frequency=1e6,
    step_phase=0.0,
):
    harmonic = 1 + np.arange(harmonics)
    return GimbalMotor(
        *(jnp.array(values, float) for values in (per_turn, torque, phase, holding)),
        jnp.array(harmonic * steps, float),
        jnp.array(2.0 / (harmonic * steps)),
        jnp.array(harmonic * step_phase),
        jnp.array(float(frequency)),
        jnp.array(0.5),
    )


def test_ripple_reacts_on_a_free_body_like_a_torque():
    """Rigid mount, rotors at rest: the motors' reaction is a torque -I_g a about each axis."""
    satellite = with_units(paper_satellite("rigid", imbalance=0.0), rotor_speed=jnp.zeros(4))
    satellite = uncontrolled(satellite)
    angle, rate = jnp.array([0.3, -0.2, 0.9, 1.4]), jnp.array([0.5, -0.3, 0.2, 0.0])
    state = initial_state(satellite, jnp.array([1.0, 0, 0, 0]), jnp.zeros(3), angle)
    state = eqx.tree_at(lambda s: s.own["cluster"].y_rate, state, rate)
    ripple = motor((24.0,), (1e-3,), (0.4,), holding=2.0)
    omega = 24.0 * np.asarray(rate)
    torque = 1e-3 * omega**2 / (omega**2 + 4.0) * np.cos(24.0 * np.asarray(angle) + 0.4)
    # by the motors, in plate axes, which are the bus's here
    reaction = jnp.array(-torque @ np.asarray(satellite.clusters[0].units.R_PG0)[:, :, 2])

    @jax.jit
    def turn(torque, load):
        push = Load("push", ("bus",), "body", jnp.zeros(3), load, jnp.zeros(3), Constant())
        shaken = with_cluster(satellite, motor=replace(ripple, torque=torque))
        found = evaluate(replace(shaken, others=(push,)), jnp.zeros(()), state)
        return found.u_rate[found.now.layout.rows("bus")][3:]

    quiet = turn(0.0 * ripple.torque, jnp.zeros(3))
    found = turn(ripple.torque, jnp.zeros(3)) - quiet
    expected = turn(0.0 * ripple.torque, reaction) - quiet
    assert np.max(np.abs(expected)) > 1e-8
    assert np.asarray(found) == pytest.approx(np.asarray(expected), rel=1e-9, abs=1e-18)


def test_gimbals_at_rest_are_not_moved():
    cluster = paper_satellite().clusters[0].units
    rough = motor((24.0,), (1.0,), (0.4,), steps=200, harmonics=3)
    at_rest = rough.acceleration(cluster, jnp.ones(4), jnp.zeros(4))
    assert np.all(np.asarray(at_rest) == 0.0)


def test_gimbal_inertia_is_that_of_the_moments():
    """H about the gimbal axis per gimbal rate, from the whole unit, averaged over a turn."""
    cluster = awkward_satellite(imbalance=0.0).clusters[0].units
    found = np.asarray(gimbal_inertia(cluster))
    for j in range(4):
        unit = jax.tree.map(lambda leaf, j=j: leaf[j], cluster)
        # about its own gimbal axis: the unit at the plate's origin, axes along the plate's
        unit = replace(unit, p_PC_P=jnp.zeros(3), R_PG0=jnp.eye(3))
        turns = jnp.arange(8) * np.pi / 4

        def momentum(phi, rate, unit=unit):
            return ControlMomentGyro.carried(unit, 0.0, phi, rate).H[2]

        mean = np.mean([momentum(phi, 1.0) - momentum(phi, 0.0) for phi in turns])
        assert found[j] == pytest.approx(mean, rel=1e-9)


def test_steps_of_a_stiff_motor_are_a_staircase():
    """Twice integrated, the acceleration is the field's staircase less the mean turn."""
    steps, rate = 50, 0.8
    stiff = motor(steps=steps, harmonics=400, frequency=1e9)
    cluster = paper_satellite().clusters[0].units
    amplitude = np.asarray(stiff.amplitudes(cluster, jnp.full(4, rate)))[0]
    order = np.asarray(stiff.order)
    turn = amplitude / (1j * order * rate) ** 2
    gamma = 2 * np.pi / steps * np.array([0.13, 0.5, 0.9, 1.2, 7.7])
    found = (turn * np.exp(1j * order * gamma[:, None])).real.sum(axis=1)
    x = gamma * steps / (2 * np.pi)
    staircase = 2 * np.pi / steps * (np.floor(x) + 0.5 - x)
    assert found == pytest.approx(staircase, abs=2e-3 * 2 * np.pi / steps)


def test_steps_near_the_oscillation_are_amplified_like_an_oscillator():
    slow = motor(steps=50, harmonics=1, frequency=40.0)
    cluster = paper_satellite().clusters[0].units
    found = abs(np.asarray(slow.amplitudes(cluster, jnp.full(4, 0.8)))[0, 0])  # at 40 rad/s
    assert found == pytest.approx(2 / 50 * 40.0**2 / (2 * 0.5))


def test_steps_with_a_phase_are_the_same_staircase_elsewhere():
    """A phase b of the steps is a turn of b / N of the gimbal, for every harmonic."""
    cluster, rates = paper_satellite().clusters[0].units, jnp.array([0.8, -0.3, 0.1, 1.2])
    steps, shift = 50, 0.7
    plain, shifted = (
        motor(steps=steps, harmonics=6, frequency=60.0, step_phase=b) for b in (0.0, shift)
    )
    gamma = jnp.array([0.1, 2.3, -0.7, 0.01])
    found = shifted.acceleration(cluster, gamma, rates)
    expected = plain.acceleration(cluster, gamma + shift / steps, rates)
    assert np.asarray(found) == pytest.approx(np.asarray(expected), rel=1e-9)


def test_phases_left_out_are_each_units_own_and_go_with_it_to_its_own_platform():
    lines = [{"per_turn": 300, "torque": 1e-4}, {"per_turn": 30, "torque": 1e-4, "phase": 0.2}]
    rough = {
        "ripple": lines,
        "stepping": {"steps_per_turn": 200, "frequency": 20.0, "damping": 0.1},
    }
    scenario = load_scenario("zhang2012").with_overrides({"cluster.gimbal_motor": rough})
    whole = build_satellite(scenario).clusters[0].motor
    assert len(np.unique(np.round(whole.phase[:, 0], 9))) == 4
    assert np.asarray(whole.phase[:, 1]) == pytest.approx([0.2] * 4)
    first = np.asarray(whole.step_phase[:, 0])
    assert len(np.unique(np.round(first, 9))) == 4
    assert np.asarray(whole.step_phase) == pytest.approx(np.outer(first, np.arange(1, 6)))
    for j, part in enumerate(per_cmg_scenarios(scenario)):
        own = build_satellite(part).clusters[0].motor
        assert np.asarray(own.phase[0]) == pytest.approx(np.asarray(whole.phase[j]))
        assert np.asarray(own.step_phase[0]) == pytest.approx(np.asarray(whole.step_phase[j]))
