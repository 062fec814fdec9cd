"""The user's verdict."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import paper_satellite
from quietbus.dynamics.closed_loop import initial_state
from quietbus.validate import Check, checks, validate

pytest.importorskip("mujoco")


@pytest.mark.parametrize("mount", ["isolated", "rigid"])
def test_the_papers_satellite_passes(mount):
    satellite, said = paper_satellite(mount), []
    state = initial_state(satellite, jnp.array([1.0, 0, 0, 0]), jnp.zeros(3), jnp.zeros(4))
    found = validate(satellite, state, random_states=3, duration=0.1, progress=said.append)
    assert [check.name.split(" (")[0] for check in found] == [
        "accelerations",
        "trajectory",
        "linear momentum",
        "angular momentum",
        "energy",
    ]
    assert all(check.passed for check in found), found
    assert said == ["accelerations", "trajectory", "momentum", "energy"]


def test_a_slight_error_in_the_equations_is_found(monkeypatch):
    right = checks.accelerations

    def wrong(*arguments):
        return jax.tree.map(lambda a: a * (1.0 + 1e-8), right(*arguments))

    monkeypatch.setattr(checks, "accelerations", wrong)
    satellite = paper_satellite()
    check = checks.check_accelerations(satellite, 2, np.random.default_rng(0))
    assert not check.passed
    assert check.error == pytest.approx(1e-8, rel=1e-3)


def test_an_error_that_is_no_number_fails():
    assert not Check("x", "y", float("nan"), 1.0).passed


def test_a_flight_that_diverges_fails():
    """A quantity that is no number is never overlooked among the others."""
    satellite = paper_satellite()
    state = initial_state(satellite, jnp.array([1.0, 0, 0, 0]), jnp.zeros(3), jnp.zeros(4))
    broken = replace(state, w_NB_B=jnp.full(3, jnp.nan))
    error = checks.largest_difference(_twice(state), _twice(broken))
    assert not Check("x", "y", error, 1.0).passed


def _twice(state):
    return jax.tree.map(lambda x: jnp.stack([x, x]), state)
