"""Momentum and energy, summed over the bodies, against the equations of motion."""

from dataclasses import replace

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import awkward_satellite, paper_satellite, with_units
from oracles.two_bodies import changed
from quietbus.dynamics.closed_loop import attitudes, initial_state, state_rate
from quietbus.dynamics.equations import moving
from quietbus.dynamics.invariants import (
    angular_momentum_N,
    energy,
    kinetic_energy,
    linear_momentum_N,
)
from quietbus.spatial.rotation import quaternion_to_matrix
from quietbus.validate.flight import over_time
from quietbus.validate.states import kicked_state, random_state, random_wrenches
from quietbus.validate.trajectory import fly, held_gimbals, lossless

TIMES = np.linspace(0.0, 10.0, 11)
MOUNTS = ["isolated", "rigid"]


def _start(satellite, kick=True):
    q_NB = jnp.array([0.99, 0.02, -0.03, 0.02])
    state = initial_state(satellite, q_NB / jnp.linalg.norm(q_NB), jnp.zeros(3), jnp.zeros(4))
    return kicked_state(satellite, state, np.random.default_rng(5)) if kick else state


def _rate_over_time(quantity, satellite, state):
    """Time derivative of a function of (satellite, time, state) along the motion."""

    @eqx.filter_jit
    def rate(satellite, t, state):
        def at(t, state):
            return quantity(satellite, t, state)

        return jax.jvp(at, (t, state), (jnp.ones(()), state_rate(satellite, t, state)))[1]

    return rate(satellite, jnp.asarray(0.3), state)


def _momentum(*arguments):
    return jnp.stack([linear_momentum_N(*arguments), angular_momentum_N(*arguments)])


def _total_energy(satellite, t, state):
    return kinetic_energy(satellite, t, state) + energy(satellite, t, state).stored


@pytest.mark.slow
@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("make", [paper_satellite, awkward_satellite])
def test_momentum_is_conserved_under_control(make, mount):
    """Controller on, gimbals moving, rotors unbalanced, ten seconds."""
    satellite = make(mount, imbalance=10.0)
    states = fly(satellite, _start(satellite), jnp.asarray(TIMES), 1e-10)
    assert np.ptp(states.own["cluster"].y, axis=0).min() > 0.01
    values = over_time(_momentum, satellite, TIMES, states)
    drift = np.linalg.norm(values - values[0], axis=2).max(axis=0)
    assert (drift <= 1e-9 * np.linalg.norm(values[0], axis=1)).all()


@pytest.mark.parametrize("mount", MOUNTS)
def test_energy_is_conserved_without_damping_friction_and_motors(mount):
    satellite = lossless(awkward_satellite(mount))
    state = changed(_start(satellite), gimbal_rate=jnp.zeros(4))
    states = fly(satellite, state, jnp.asarray(TIMES))

    def energies(satellite, t, state):
        strain = energy(satellite, t, state).stored
        return jnp.stack([kinetic_energy(satellite, t, state) + strain, strain])

    whole, strain = over_time(energies, satellite, TIMES, states).T
    if mount == "isolated":
        assert np.ptp(strain) > 0.1 * whole[0]  # it does swing
    assert np.abs(whole - whole[0]).max() <= 1e-9 * whole[0]


def test_energy_lost_is_the_work_of_dampers_and_joints():
    """CMGs locked; the dissipated power is integrated along with the motion."""
    satellite = _stopped(held_gimbals(awkward_satellite()))
    state = changed(_start(satellite), gimbal_rate=jnp.zeros(4))

    def rate(t, y, _):
        t = jnp.asarray(t)
        return state_rate(satellite, t, y[0]), energy(satellite, t, y[0]).dissipated

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate),
        diffrax.Dopri8(),
        0.0,
        1.0,
        None,
        (state, jnp.zeros(())),
        stepsize_controller=diffrax.PIDController(rtol=1e-12, atol=1e-13),
        max_steps=100_000,
    )
    end, work = jax.tree.map(lambda leaf: leaf[-1], solution.ys)
    t = jnp.zeros(())
    lost = _total_energy(satellite, t, state) - _total_energy(satellite, t, end)
    assert lost > 1.0
    assert float(lost) == pytest.approx(float(work), rel=1e-9)


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("seed", range(3))
def test_momentum_changes_by_the_external_loads_alone(seed, mount):
    """dp/dt = F and dH/dt = T at random states of the controlled satellite, spinning fast."""
    satellite, state, wrenches, bodies = _loaded(mount, seed)
    force, torque = wrenches.sum(axis=0)
    torque = torque + sum(np.cross(p, F) for (p, *_), (F, _) in zip(bodies, wrenches, strict=True))
    rate = _rate_over_time(_momentum, satellite, state)
    np.testing.assert_allclose(rate[0], force, rtol=0, atol=1e-8)
    np.testing.assert_allclose(rate[1], torque, rtol=0, atol=1e-8)


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("seed", range(3))
def test_power_of_loads_is_what_energy_gains_and_struts_and_joints_take(seed, mount):
    satellite, state, wrenches, bodies = _loaded(mount, seed)
    satellite = held_gimbals(_stopped(satellite), wrenches)
    state = changed(state, gimbal_rate=jnp.zeros(4))
    pairs = zip(bodies, wrenches, strict=True)
    power = sum(F @ v + T @ w for (_, v, w), (F, T) in pairs)
    taken = energy(satellite, jnp.zeros(()), state).dissipated
    gained = _rate_over_time(_total_energy, satellite, state)
    assert float(taken) > 1.0 or mount == "rigid"
    assert float(gained) == pytest.approx(float(power - taken), rel=1e-9)


def _loaded(mount, seed):
    """Controlled satellite under constant loads, a random state, the loads on bus and plate.

    Also position, velocity and rate of both, inertial.
    """
    rng = np.random.default_rng(seed)
    satellite = awkward_satellite(mount, imbalance=100.0)
    wrenches = random_wrenches(satellite, rng)
    satellite = replace(satellite, others=held_gimbals(satellite, wrenches).others)
    state = random_state(satellite, rng)
    now, turns = moving(satellite, jnp.zeros(()), state), attitudes(satellite, state)
    bodies = []
    for name in ("bus", "plate"):
        motion, R = now.motions[name], quaternion_to_matrix(turns[name])
        np.testing.assert_allclose(motion.R_AX, R, atol=1e-12)
        bodies.append(tuple(np.asarray(part) for part in (motion.p, motion.v, motion.w)))
    return satellite, state, wrenches, bodies


def _stopped(satellite):
    return with_units(satellite, rotor_speed=jnp.zeros(4))
