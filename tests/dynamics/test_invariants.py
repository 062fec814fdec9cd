"""Momentum and energy, summed over the bodies, against the equations of motion."""

from dataclasses import replace

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import awkward_satellite, paper_satellite
from quietbus.dynamics.closed_loop import (
    external_wrench,
    initial_state,
    rotor_angles,
    state_rate,
)
from quietbus.dynamics.equations import Wrench, plate_motion
from quietbus.dynamics.invariants import (
    angular_momentum_N,
    dissipated_power,
    kinetic_energy,
    linear_momentum_N,
    strut_energy,
)
from quietbus.spatial.rotation import quaternion_to_matrix
from quietbus.validate.flight import over_time
from quietbus.validate.states import kicked_state, random_state, random_wrench
from quietbus.validate.trajectory import fly, held_gimbals, lossless

TIMES = np.linspace(0.0, 10.0, 11)
MOUNTS = ["isolated", "rigid"]


def _start(satellite, kick=True):
    q_NB = jnp.array([0.99, 0.02, -0.03, 0.02])
    state = initial_state(satellite, q_NB / jnp.linalg.norm(q_NB), jnp.zeros(3), jnp.zeros(4))
    return kicked_state(satellite, state, np.random.default_rng(5)) if kick else state


def _rate_over_time(quantity, satellite, state):
    """Time derivative of a function of (satellite, rotor angles, state) along the motion."""

    @eqx.filter_jit
    def rate(satellite, t, state):
        def at(t, state):
            return quantity(satellite, rotor_angles(satellite, t, state), state)

        return jax.jvp(at, (t, state), (jnp.ones(()), state_rate(satellite, t, state)))[1]

    return rate(satellite, jnp.asarray(0.3), state)


def _momentum(*arguments):
    return jnp.stack([linear_momentum_N(*arguments), angular_momentum_N(*arguments)])


def _total_energy(satellite, rotor_angle, state):
    return kinetic_energy(satellite, rotor_angle, state) + strut_energy(satellite, state)


@pytest.mark.slow
@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("make", [paper_satellite, awkward_satellite])
def test_momentum_is_conserved_under_control(make, mount):
    """Controller on, gimbals moving, rotors unbalanced, ten seconds."""
    satellite = make(mount, imbalance=10.0)
    states = fly(satellite, _start(satellite), jnp.asarray(TIMES), 1e-10)
    assert np.ptp(states.gimbal_angle, axis=0).min() > 0.01
    values = over_time(_momentum, satellite, TIMES, states)
    drift = np.linalg.norm(values - values[0], axis=2).max(axis=0)
    assert (drift <= 1e-9 * np.linalg.norm(values[0], axis=1)).all()


@pytest.mark.parametrize("mount", MOUNTS)
def test_energy_is_conserved_without_damping_friction_and_motors(mount):
    satellite = lossless(awkward_satellite(mount))
    state = replace(_start(satellite), gimbal_rate=jnp.zeros(4))
    states = fly(satellite, state, jnp.asarray(TIMES))

    def energies(satellite, rotor_angle, state):
        strain = strut_energy(satellite, state)
        return jnp.stack([kinetic_energy(satellite, rotor_angle, state) + strain, strain])

    energy, strain = over_time(energies, satellite, TIMES, states).T
    if mount == "isolated":
        assert np.ptp(strain) > 0.1 * energy[0]  # it does swing
    assert np.abs(energy - energy[0]).max() <= 1e-9 * energy[0]


def test_energy_lost_is_the_work_of_dampers_and_joints():
    """CMGs locked; the dissipated power is integrated along with the motion."""
    satellite = _stopped(held_gimbals(awkward_satellite(), Wrench.zero()))
    state = replace(_start(satellite), gimbal_rate=jnp.zeros(4))

    def rate(t, y, _):
        return state_rate(satellite, jnp.asarray(t), y[0]), dissipated_power(satellite, y[0])

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
    phi = satellite.cluster.rotor_phase
    lost = _total_energy(satellite, phi, state) - _total_energy(satellite, phi, end)
    assert lost > 1.0
    assert float(lost) == pytest.approx(float(work), rel=1e-9)


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("seed", range(3))
def test_momentum_changes_by_the_external_loads_alone(seed, mount):
    """dp/dt = F and dH/dt = T at random states of the controlled satellite, spinning fast."""
    satellite, state, wrench = _loaded(mount, seed)
    torque = (
        wrench.torque_P
        + wrench.torque_B
        + jnp.cross(state.p_NP_N, wrench.force_P)
        + jnp.cross(state.p_NB_N, wrench.force_B)
    )
    rate = _rate_over_time(_momentum, satellite, state)
    np.testing.assert_allclose(rate[0], wrench.force_P + wrench.force_B, rtol=0, atol=1e-8)
    np.testing.assert_allclose(rate[1], torque, rtol=0, atol=1e-8)


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("seed", range(3))
def test_power_of_loads_is_what_energy_gains_and_struts_and_joints_take(seed, mount):
    satellite, state, wrench = _loaded(mount, seed)
    satellite = held_gimbals(_stopped(satellite), wrench)
    state = replace(state, gimbal_rate=jnp.zeros(4))
    R_NB, R_NP = quaternion_to_matrix(state.q_NB), quaternion_to_matrix(state.q_NP)
    power = (
        wrench.force_P @ state.v_NP_N
        + wrench.torque_P @ (R_NP @ state.w_NP_P)
        + wrench.force_B @ state.v_NB_N
        + wrench.torque_B @ (R_NB @ state.w_NB_B)
    )
    taken = dissipated_power(satellite, state)
    gained = _rate_over_time(_total_energy, satellite, state)
    assert float(taken) > 1.0 or mount == "rigid"
    assert float(gained) == pytest.approx(float(power - taken), rel=1e-9)


def _loaded(mount, seed):
    """Controlled satellite under constant loads, a random state, and the loads."""
    rng = np.random.default_rng(seed)
    satellite = awkward_satellite(mount, imbalance=100.0)
    wrench = random_wrench(satellite, rng)
    satellite = replace(satellite, loads=held_gimbals(satellite, wrench).loads)
    state = random_state(satellite, rng)
    given = jax.tree.leaves(external_wrench(satellite, jnp.zeros(()), plate_motion(state)))
    np.testing.assert_allclose(given, jax.tree.leaves(wrench), atol=1e-12)
    return satellite, state, wrench


def _stopped(satellite):
    cluster = replace(satellite.cluster, rotor_speed=jnp.zeros(4))
    return replace(satellite, cluster=cluster)
