"""quietbus's equations of motion against MuJoCo's, at instants."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import (
    awkward_satellite,
    paper_satellite,
    with_run_up,
    with_wheels,
)
from quietbus.dynamics.equations import accelerations
from quietbus.validate.reference import Reference
from quietbus.validate.states import random_state, random_wrench
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


def _largest_error(satellite, count):
    """Of each acceleration vector, relative to that vector."""
    rng = np.random.default_rng(7)
    reference = Reference(satellite, random_state(satellite, rng))
    ours = eqx.filter_jit(accelerations)
    errors = []
    swing = 0.0 if satellite.cluster.wheels else 5.0
    for _ in range(count):
        arguments = (
            random_state(satellite, rng),
            jnp.asarray(rng.uniform(0.0, 2.0 * np.pi, 4)),
            jnp.asarray(rng.uniform(-swing, swing, 4)),
            random_wrench(satellite, rng),
        )
        spin_up = None
        if satellite.cluster.drive is not None:
            spin_up = jnp.asarray(rng.uniform(-50.0, 50.0, 4))
        pairs = zip(
            jax.tree.leaves(reference.accelerations(*arguments, spin_up)),
            jax.tree.leaves(ours(satellite, *arguments, None, spin_up)),
            strict=True,
        )
        errors += [np.linalg.norm(a - b) / np.linalg.norm(a) for a, b in pairs]
    return np.max(errors)
