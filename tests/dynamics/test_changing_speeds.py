"""Rotors whose speed changes: conservation laws, and what the motors have to give."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import awkward_satellite, with_run_up, with_wheels
from quietbus.dynamics.closed_loop import evaluate, initial_state, rotor_angles, state_rate
from quietbus.dynamics.equations import Wrench
from quietbus.dynamics.invariants import (
    angular_momentum_N,
    dissipated_power,
    kinetic_energy,
    linear_momentum_N,
    strut_energy,
)
from quietbus.dynamics.rotor_torques import rotor_torques
from quietbus.validate.flight import over_time
from quietbus.validate.states import kicked_state, random_state
from quietbus.validate.trajectory import fly, held_gimbals

TIMES = np.linspace(0.0, 10.0, 11)


def _momentum(*arguments):
    return jnp.stack([linear_momentum_N(*arguments), angular_momentum_N(*arguments)])


def test_momentum_is_conserved_while_wheels_are_steered():
    """Controller on, wheels accelerating and unbalanced, one through rest; ten seconds."""
    satellite = with_wheels(awkward_satellite(imbalance=10.0))
    q_NB = jnp.array([0.99, 0.02, -0.03, 0.02])
    state = initial_state(satellite, q_NB / jnp.linalg.norm(q_NB), jnp.zeros(3), jnp.zeros(4))
    state = kicked_state(satellite, state, np.random.default_rng(5))
    states = fly(satellite, state, jnp.asarray(TIMES), 1e-10)
    assert np.ptp(states.rotor.speed, axis=0).min() > 100.0
    assert not np.any(states.gimbal_angle)
    values = over_time(_momentum, satellite, TIMES, states)
    drift = np.linalg.norm(values - values[0], axis=2).max(axis=0)
    assert (drift <= 1e-9 * np.linalg.norm(values[0], axis=1)).all()


@pytest.mark.parametrize("turned_by", [with_run_up, with_wheels])
def test_power_of_the_motors_is_what_energy_gains_and_struts_and_joints_take(turned_by):
    """At random states, gimbals held: sum of motor torque times rotor speed."""

    @eqx.filter_jit
    def balance(satellite, t, state):
        def energy(t, state):
            phi = rotor_angles(satellite, t, state)
            return kinetic_energy(satellite, phi, state) + strut_energy(satellite, state)

        rate = state_rate(satellite, t, state)
        gained = jax.jvp(energy, (t, state), (jnp.ones(()), rate))[1]
        torque = rotor_torques(satellite, state, *evaluate(satellite, t, state))
        return gained, dissipated_power(satellite, state), torque @ state.rotor.speed

    satellite = turned_by(awkward_satellite(imbalance=1000.0))
    if not satellite.cluster.wheels:
        satellite = held_gimbals(satellite, Wrench.zero())
    for seed in range(3):
        state = random_state(satellite, np.random.default_rng(seed))
        state = replace(state, gimbal_rate=jnp.zeros(4))
        gained, taken, power = balance(satellite, jnp.asarray(0.3), state)
        assert abs(float(power)) > 1.0
        scale = abs(float(power)) + float(taken)
        assert float(gained + taken) == pytest.approx(float(power), abs=1e-9 * scale)
