"""quietbus's equations of motion against MuJoCo's, at instants."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import (
    awkward_satellite,
    paper_satellite,
    with_run_up,
    with_wheels,
)
from quietbus.dynamics.equations import accelerations, moving
from quietbus.validate.reference import Reference
from quietbus.validate.states import random_rates, random_state, random_wrenches
from quietbus.validate.trajectory import massless_legs

pytest.importorskip("mujoco")


@pytest.mark.parametrize("mount", ["isolated", "rigid"])
@pytest.mark.parametrize("imbalance", [1.0, 1000.0])
@pytest.mark.parametrize("make", [paper_satellite, awkward_satellite])
def test_accelerations_agree_with_mujoco_at_100_random_states(make, imbalance, mount):
    """Legs with mass and friction, tumbling bus, spinning rotors, accelerating gimbals, loads."""
    satellite = make(mount, imbalance)
    assert _largest_error(satellite, 100) <= 1e-9


def test_accelerations_agree_with_mujoco_for_legs_without_mass():
    assert _largest_error(massless_legs(awkward_satellite()), 20) <= 1e-9


@pytest.mark.parametrize("turned_by", [with_run_up, with_wheels])
def test_accelerations_with_rotors_that_change_speed_agree_with_mujoco(turned_by):
    """Of CMGs whose gimbals accelerate as well, and of wheels; rotors 1000 times unbalanced."""
    assert _largest_error(turned_by(awkward_satellite(imbalance=1000.0)), 20) <= 1e-9


@eqx.filter_jit
def _ours(satellite, t, state, rates, wrenches):
    now = moving(satellite, t, state)
    return accelerations(satellite, now, rates, jnp.ravel(wrenches))


def _largest_error(satellite, count):
    """Of each acceleration vector, relative to that vector; rotors turn far in a second."""
    rng = np.random.default_rng(7)
    reference = Reference(satellite, random_state(satellite, rng))
    errors = []
    for _ in range(count):
        t, state = rng.uniform(0.0, 1.0), random_state(satellite, rng)
        rates, wrenches = random_rates(satellite, rng), random_wrenches(satellite, rng)
        theirs = reference.accelerations(t, state, rates, wrenches)
        ours = np.asarray(_ours(satellite, jnp.asarray(t), state, rates, wrenches))
        off = np.linalg.norm(theirs - ours.reshape(theirs.shape), axis=2)
        errors.append(np.max(off / np.linalg.norm(theirs, axis=2)))
    return np.max(errors)
