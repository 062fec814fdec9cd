"""Rotors whose speed changes: conservation laws, and what the motors have to give."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import awkward_satellite, with_run_up, with_wheels
from oracles.two_bodies import changed
from quietbus.dynamics.closed_loop import evaluate, initial_state, state_rate
from quietbus.dynamics.invariants import (
    angular_momentum_N,
    energy,
    kinetic_energy,
    linear_momentum_N,
)
from quietbus.dynamics.outputs import joined, told
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
    assert np.ptp(states.own["cluster"].y_rate, axis=0).min() > 100.0
    values = over_time(_momentum, satellite, TIMES, states)
    drift = np.linalg.norm(values - values[0], axis=2).max(axis=0)
    assert (drift <= 1e-9 * np.linalg.norm(values[0], axis=1)).all()


@pytest.mark.parametrize("turned_by", [with_run_up, with_wheels])
def test_power_of_the_motors_is_what_energy_gains_and_struts_and_joints_take(turned_by):
    """At random states, gimbals held: sum of motor torque times rotor speed."""

    @eqx.filter_jit
    def balance(satellite, t, state):
        def whole(t, state):
            return kinetic_energy(satellite, t, state) + energy(satellite, t, state).stored

        rate = state_rate(satellite, t, state)
        gained = jax.jvp(whole, (t, state), (jnp.ones(()), rate))[1]
        found = joined(told(satellite, state, evaluate(satellite, t, state)))
        power = found["rotor_torque"] @ found["rotor_speed"]
        return gained, energy(satellite, t, state).dissipated, power

    satellite = turned_by(awkward_satellite(imbalance=1000.0))
    if satellite.steered:
        satellite = held_gimbals(satellite)
    for seed in range(3):
        state = random_state(satellite, np.random.default_rng(seed))
        if satellite.steered:
            state = changed(state, gimbal_rate=jnp.zeros(4))
        gained, taken, power = balance(satellite, jnp.asarray(0.3), state)
        assert abs(float(power)) > 1.0
        scale = abs(float(power)) + float(taken)
        assert float(gained + taken) == pytest.approx(float(power), abs=1e-9 * scale)
