"""quietbus's flights against MuJoCo's own integrator: legs without mass, as spatial tendons."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import awkward_satellite, paper_satellite, with_run_up
from quietbus.dynamics.closed_loop import initial_state
from quietbus.model.variants import without_rotation
from quietbus.validate.states import kicked_state, random_wrenches
from quietbus.validate.trajectory import (
    differences,
    fly,
    fly_mujoco,
    fly_mujoco_to,
    held_gimbals,
    largest_difference,
    load_on,
    massless_legs,
    no_loads,
)
from quietbus.validate.translate import motion_of

pytest.importorskip("mujoco")

TIMES = np.linspace(0.0, 1.0, 21)


def _start(satellite):
    """Turned bus at rest, gimbals at unlike angles."""
    q_NB = jnp.array([0.9, 0.1, -0.3, 0.2])
    return initial_state(
        satellite, q_NB / jnp.linalg.norm(q_NB), jnp.zeros(3), jnp.array([0.1, -0.5, 1.0, 2.0])
    )


@pytest.mark.parametrize("mount", ["isolated", "rigid"])
@pytest.mark.parametrize("imbalance", [1.0, 1000.0])
@pytest.mark.parametrize("make", [paper_satellite, awkward_satellite])
def test_flight_with_spinning_unbalanced_rotors_agrees_with_mujoco(make, imbalance, mount):
    """Bus turning, plate kicked, gimbals turning, constant loads on both bodies; one second."""
    satellite = massless_legs(make(mount, imbalance))
    rng = np.random.default_rng(3)
    state = kicked_state(satellite, _start(satellite), rng)
    wrenches = random_wrenches(satellite, rng)
    ours = fly(held_gimbals(satellite, wrenches), state, jnp.asarray(TIMES))
    theirs, own_error = fly_mujoco_to(1e-9, satellite, state, wrenches, TIMES)
    assert own_error <= 1e-9
    assert largest_difference(theirs, ours) <= 1e-8


def test_flight_with_rotors_running_up_agrees_with_mujoco():
    """Constant motor accelerations, one rotor through rest; gimbals turning, 1000 x imbalance."""
    satellite = with_run_up(massless_legs(awkward_satellite(imbalance=1000.0)))
    rng = np.random.default_rng(3)
    state = kicked_state(satellite, _start(satellite), rng)
    wrenches = random_wrenches(satellite, rng)
    ours = fly(held_gimbals(satellite, wrenches), state, jnp.asarray(TIMES))
    theirs, own_error = fly_mujoco_to(1e-9, satellite, state, wrenches, TIMES)
    assert own_error <= 1e-9
    assert largest_difference(theirs, ours) <= 1e-8
    speed = motion_of(satellite, TIMES[-1], jax.tree.map(lambda x: x[-1], theirs)).rotor_speed
    np.testing.assert_allclose(speed, [100.0, 60.0, 20.0, 80.0], rtol=1e-9)


def test_load_case_of_the_paper_agrees_with_mujoco():
    """CMGs locked, 10 N along x and 30 N along z on the upper plate of the free satellite.

    The paper compares this case with ADAMS.
    """
    satellite = without_rotation(massless_legs(paper_satellite()))
    state = initial_state(satellite, jnp.array([1.0, 0, 0, 0]), jnp.zeros(3), jnp.zeros(4))
    wrenches = load_on(satellite, "plate", [10.0, 0.0, 30.0])
    ours = fly(held_gimbals(satellite, wrenches), state, jnp.asarray(TIMES))
    theirs, own_error = fly_mujoco_to(1e-9, satellite, state, wrenches, TIMES)
    assert own_error <= 1e-9
    assert largest_difference(theirs, ours) <= 1e-8
    # it flies as the whole mass says: the load is what moves it
    mass = 1000.0 + 6.8 + 4 * 19.0
    momentum = 1000.0 * ours.bus.v_NX_N[-1] + 82.8 * ours.bodies["plate"].v_NX_N[-1]
    assert mass == pytest.approx(1082.8)
    np.testing.assert_allclose(momentum, [10.0, 0.0, 30.0], atol=0.05)


def test_mujoco_converges_to_our_flight_with_the_fourth_order():
    """What remains between the two programs is MuJoCo's step error: 16 times less at half step."""
    satellite = massless_legs(paper_satellite(imbalance=1000.0))
    state, wrenches = _start(satellite), no_loads(satellite)
    ours = fly(held_gimbals(satellite, wrenches), state, jnp.asarray(TIMES))
    coarse, fine = (
        differences(ours, fly_mujoco(satellite, state, wrenches, TIMES, step))["bus rate"]
        for step in (4e-4, 2e-4)
    )
    assert coarse / fine == pytest.approx(16.0, rel=0.1)
