"""XLA compiles the integrator's loop as one function; else a flight takes four times as long."""

import jax
import jax.numpy as jnp
import pytest
from jax.flatten_util import ravel_pytree

import quietbus as qb
from quietbus.build import build_satellite
from quietbus.dynamics.closed_loop import initial_state, state_rate


def in_one_piece(rate, y):
    """Whether a loop of steps by a rate is; a call into a library in it, and it is not."""
    loop = jax.jit(lambda y: jax.lax.fori_loop(0, 10, lambda _, y: y + 1e-9 * rate(y), y))
    return "xla_cpu_small_call" in loop.lower(y).compile().as_text()


@pytest.mark.parametrize("name", ["zhang2012", "zhang2012-slew", "wheels-demo"])
def test_equations_of_motion_call_no_library(name):
    if not in_one_piece(jnp.sin, jnp.ones(3)):
        pytest.skip("this XLA does not say")
    satellite = build_satellite(qb.load_scenario(name)).prepared()
    start = jnp.array([1.0, 0.0, 0.0, 0.0]), jnp.zeros(3), jnp.zeros(satellite.count)
    y, unravel = ravel_pytree(initial_state(satellite, *start))
    assert in_one_piece(
        lambda y: ravel_pytree(state_rate(satellite, jnp.zeros(()), unravel(y)))[0], y
    )
