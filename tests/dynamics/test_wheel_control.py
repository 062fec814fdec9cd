"""How wheels are asked for torque, and what their limits leave of it."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import paper_satellite, with_cluster, with_units, with_wheels
from quietbus.dynamics.closed_loop import decide, initial_state
from quietbus.model.rotors import WheelMotors
from quietbus.spatial.rotation import rotation_vector_to_quaternion

signals = eqx.filter_jit(decide)
TURN = jnp.array([0.01, -0.02, 0.015])


def _decide(limit=None, top=None, speed=None, tilted=False):
    """Signals, torque of each motor and spin axes along bus axes, of a satellite at rest, turned.

    Limits are always arrays, so that all cases share one program.
    """
    satellite = with_wheels(paper_satellite())
    if tilted:
        q_BP = rotation_vector_to_quaternion(jnp.array([0.3, -0.2, 0.5]))
        (mount,) = satellite.mounts
        satellite = replace(satellite, mounts=(replace(mount, q_BX=q_BP),))
    limits = jnp.full(4, 1e6) if limit is None else jnp.asarray(limit, float)
    tops = jnp.full(4, 1e6) if top is None else jnp.asarray(top, float)
    satellite = with_cluster(satellite, rotors=WheelMotors(limits, tops))
    speeds = jnp.asarray(speed or [90.0, -110.0, 70.0, 0.0], float)
    satellite = with_units(satellite, rotor_speed=speeds)
    q_NB = rotation_vector_to_quaternion(TURN)
    state = initial_state(satellite, q_NB, jnp.zeros(3), jnp.zeros(4))
    found = signals(satellite, jnp.zeros(()), state)
    torque = np.asarray(found.commands[0])
    w, v = satellite.mounts[0].q_BX[0], np.asarray(satellite.mounts[0].q_BX[1:])
    axes = np.asarray(satellite.clusters[0].units.R_PG0[:, :, 0])
    turned = axes + 2.0 * np.cross(v, np.cross(v, axes) + w * axes)
    return found, torque, turned


@pytest.mark.parametrize("tilted", [False, True])
def test_reaction_of_the_motors_is_the_torque_that_the_control_asks_for(tilted):
    """-(sum of motor torques along the spin axes); of least norm among all that give it."""
    found, torque, axes = _decide(tilted=tilted)
    asked = -200.0 * 2.0 * np.sin(0.5 * np.linalg.norm(TURN)) * TURN / np.linalg.norm(TURN)
    np.testing.assert_allclose(found.torque_B, asked, rtol=1e-9)
    np.testing.assert_allclose(-torque @ axes, asked, rtol=1e-9)
    np.testing.assert_allclose(torque, np.linalg.lstsq(axes.T, -asked, rcond=None)[0], rtol=1e-9)


def test_wheels_of_unlike_torque_limits_share_by_them():
    """Least sum of (torque / limit)^2 among all that give the torque."""
    limit = np.array([20.0, 40.0, 60.0, 80.0])
    found, torque, axes = _decide(limit=limit)
    np.testing.assert_allclose(-torque @ axes, found.torque_B, rtol=1e-9)
    null = np.linalg.svd(axes.T)[2][-1]
    assert abs((torque / limit**2) @ null) < 1e-12
    assert float(found.torque_share) == pytest.approx(1.0, rel=1e-12)


def test_torque_limit_cuts_all_wheels_alike_and_the_integrator_knows():
    _, whole, _ = _decide()
    limit = 0.25 * np.abs(whole).max()
    found, torque, axes = _decide(limit=[limit] * 4)
    assert float(found.torque_share) == pytest.approx(0.25, rel=1e-9)
    np.testing.assert_allclose(torque, 0.25 * whole, rtol=1e-9)
    missing = np.asarray(found.torque_B) + torque @ axes
    unwound = np.asarray(found.error_B) + missing / (0.1 * np.sqrt(2500.0 / 0.1))
    np.testing.assert_allclose(found.memory_rate, unwound, rtol=1e-9)


def test_wheel_at_its_speed_limit_gives_only_torque_that_slows_it():
    _, whole, axes = _decide()
    outward = (100.0 * np.sign(whole)).tolist()
    found, torque, _ = _decide(top=[100.0] * 4, speed=[outward[0], -outward[1], 0.0, 50.0])
    np.testing.assert_allclose(torque, [0.0, *whole[1:]], rtol=1e-9)
    asked, delivered = np.asarray(found.torque_B), -torque @ axes
    missing = asked - delivered
    assert np.linalg.norm(missing) > 0.1
    assert float(found.torque_share) == pytest.approx(delivered @ asked / (asked @ asked))
    unwound = np.asarray(found.error_B) + missing / (0.1 * np.sqrt(2500.0 / 0.1))
    np.testing.assert_allclose(found.memory_rate, unwound, rtol=1e-9)
