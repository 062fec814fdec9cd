"""The linear model of a satellite with reaction wheels, against the nonlinear equations."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from dynamics.test_linearize import equilibrium, placed, rotation
from oracles.satellites import awkward_satellite, with_cluster, with_wheels
from oracles.two_bodies import accelerations_of, changed
from quietbus.dynamics.linearize import OperatingPoint, linearize
from quietbus.model.rotors import WheelMotors

REST = OperatingPoint(np.zeros(3), np.zeros(4))


@pytest.fixture(scope="module")
def satellite():
    limits = jnp.array([0.1, 0.2, 0.3, 0.4])
    satellite = with_wheels(awkward_satellite(imbalance=0.0))
    return with_cluster(satellite, rotors=WheelMotors(limits, jnp.full(4, jnp.inf)))


@pytest.fixture(scope="module")
def model(satellite):
    return linearize(satellite, REST)


@eqx.filter_jit
def _nonlinear(satellite, state, spin_up):
    return accelerations_of(satellite.averaged(), state, spin_up)


def test_matrices_are_derivatives_of_the_equations_of_motion(satellite, model):
    """Central differences along random directions of all states and motor torques."""
    pose = equilibrium(satellite)
    spin_inertia = np.asarray(satellite.clusters[0].units.I_RRcm_R[:, 0, 0])
    rng = np.random.default_rng(1)
    rows = [i for i, name in enumerate(model.states) if 9 <= i < 18]
    for _ in range(4):
        x, torque = 1e-5 * rng.normal(size=22), 1e-5 * rng.normal(size=4)
        x[18:] *= 1e3  # speeds of wheels, which matter little

        def at(side, x=x, torque=torque):
            whole = np.concatenate([side * x[:18], np.zeros(8), np.zeros(6)])
            speed = satellite.clusters[0].units.rotor_speed + side * x[18:]
            state = placed(pose, whole, np.zeros(4))
            state = changed(state, rotor_angle=jnp.zeros(4), rotor_speed=speed)
            a = _nonlinear(satellite, state, jnp.asarray(side * torque / spin_inertia))
            to_bus = rotation(state.bus.q_NX).as_matrix().T
            w_B, v_B, w_P, v_P = (np.array(part) for part in (a.w_B, a.v_B, a.w_P, a.v_P))
            return np.concatenate([to_bus @ w_B, v_P - v_B, w_P])

        commands = [f"rotor_torque_command_{j}" for j in range(4)]
        linear = model.A[:, :22] @ x + model.select(commands).B @ torque
        expected = 0.5 * (at(1.0) - at(-1.0))
        np.testing.assert_allclose(linear[rows], expected, atol=1e-7 * np.abs(expected).max())


def test_wheels_answer_a_control_torque_with_its_opposite(satellite, model):
    """Their torques, by weighted pseudo-inverse, and what that makes of their speeds."""
    axes = np.asarray(satellite.clusters[0].units.R_PG0[:, :, 0])
    R_BP = rotation(satellite.mounts[0].q_BX).as_matrix()
    rows = [model.states.index(f"rotor_speed_{j}") for j in range(4)]
    torque = (
        np.asarray(satellite.clusters[0].units.I_RRcm_R[:, 0, 0])[:, None]
        * model.select(["control_torque"]).B[rows]
    )
    np.testing.assert_allclose(R_BP @ axes.T @ torque, -np.eye(3), atol=1e-9)
    limits = np.array([0.1, 0.2, 0.3, 0.4])
    weighted = limits[:, None] * np.linalg.pinv(axes.T * limits) @ -R_BP.T
    np.testing.assert_allclose(torque, weighted, atol=1e-9)


def test_names_are_those_of_wheels(satellite, model):
    assert not any("gimbal" in name for name in (*model.states, *model.inputs, *model.outputs))
    assert "rotor_speed_3" in model.outputs
    ideal = linearize(satellite, REST, "ideal")
    assert not any(name.startswith("rotor") for name in ideal.states)
