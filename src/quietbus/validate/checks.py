"""A user's satellite against MuJoCo and against the conservation laws.

Every check runs on the satellite that it is given, from its initial state with the plate pushed,
turned and moving, so that every term of the equations of motion is at work.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from quietbus.dynamics.closed_loop import rotor_angles
from quietbus.dynamics.equations import Wrench, accelerations
from quietbus.dynamics.invariants import (
    angular_momentum_N,
    kinetic_energy,
    linear_momentum_N,
    strut_energy,
)
from quietbus.dynamics.state import State
from quietbus.model.satellite import Satellite
from quietbus.model.variants import without_disturbance, without_friction, without_rotation
from quietbus.validate.reference import Reference
from quietbus.validate.states import kicked_state, random_state, random_wrench
from quietbus.validate.trajectory import (
    fly,
    fly_mujoco_to,
    held_gimbals,
    largest_difference,
    massless_legs,
)


@dataclass(frozen=True)
class Check:
    """One comparison and its verdict."""

    name: str
    compares: str  # what is compared, for people
    error: float  # [-] relative
    bound: float  # [-]

    @property
    def passed(self) -> bool:
        """Whether the error is within the bound; an error that is no number is not."""
        return self.error <= self.bound


def validate(
    satellite: Satellite,
    state: State,
    random_states: int = 20,
    duration: float = 0.5,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> list[Check]:
    """Check a satellite; needs MuJoCo (``pip install 'quietbus[validate]'``).

    Disturbances beyond imbalance are left out: as external forces they keep no momentum.

    Args:
        state: initial state of the scenario.
        random_states: how many states to compare accelerations at.
        duration: of the flights [s].
        seed: of the random states.
        progress: called with the name of each check before it runs.

    Raises:
        ImportError: MuJoCo is not installed.
    """
    satellite = without_disturbance(satellite)
    rng = np.random.default_rng(seed)
    kicked = kicked_state(satellite, state, rng)
    times = np.linspace(0.0, duration, 21)
    steps: list[tuple[str, Callable[[], list[Check]]]] = [
        ("accelerations", lambda: [check_accelerations(satellite, random_states, rng)]),
        (
            "trajectory",
            lambda: [check_trajectory(satellite, kicked, random_wrench(satellite, rng), times)],
        ),
        ("momentum", lambda: check_momentum(satellite, kicked, times)),
        ("energy", lambda: [check_energy(satellite, kicked, times)]),
    ]
    checks = []
    for name, run in steps:
        if progress is not None:
            progress(name)
        checks += run()
    return checks


def check_accelerations(satellite: Satellite, count: int, rng: np.random.Generator) -> Check:
    """Accelerations at random states, gimbal accelerations and loads, legs with their mass.

    The error of each acceleration vector (plate and bus, linear and angular) is relative to that
    vector; the largest counts.
    """
    reference = Reference(satellite, random_state(satellite, rng))
    cmgs = len(satellite.cluster.rotor_speed)
    ours = eqx.filter_jit(accelerations)
    errors = [0.0]
    for _ in range(count):
        state, wrench = random_state(satellite, rng), random_wrench(satellite, rng)
        rotor_angle = jnp.asarray(rng.uniform(0.0, 2.0 * np.pi, cmgs))
        gimbal_acceleration = jnp.asarray(rng.uniform(-5.0, 5.0, cmgs))
        arguments = (state, rotor_angle, gimbal_acceleration, wrench)
        theirs = jax.tree.leaves(reference.accelerations(*arguments))
        for a, b in zip(theirs, jax.tree.leaves(ours(satellite, *arguments)), strict=True):
            errors.append(float(np.linalg.norm(a - b) / np.linalg.norm(a)))
    return Check(
        "accelerations",
        f"{count} random states against MuJoCo: legs with mass and joint friction, gimbals "
        "accelerating, external loads",
        float(np.max(errors)),
        1e-9,
    )


def check_trajectory(
    satellite: Satellite, state: State, wrench: Wrench, times: np.ndarray
) -> Check:
    """A flight with the gimbals turning at constant rate, under a constant load."""
    bound = 1e-8
    struts = massless_legs(satellite)
    ours = fly(held_gimbals(struts, wrench), state, jnp.asarray(times))
    theirs, own_error = fly_mujoco_to(0.1 * bound, struts, state, wrench, times)
    return Check(
        "trajectory (legs without mass)",
        f"{times[-1] - times[0]:g} s against MuJoCo: legs set massless and joints frictionless, "
        f"no control, constant loads; MuJoCo's own error {own_error:.0e}",
        largest_difference(theirs, ours),
        bound,
    )


def check_momentum(satellite: Satellite, state: State, times: np.ndarray) -> list[Check]:
    """Linear and angular momentum of a flight under control, without loads."""
    free = replace(satellite, loads=())
    states = fly(free, state, jnp.asarray(times))

    def both(*arguments):
        return jnp.stack([linear_momentum_N(*arguments), angular_momentum_N(*arguments)])

    values = over_time(both, free, times, states)
    drift = np.max(np.linalg.norm(values - values[0], axis=2), axis=0)
    relative = drift / np.linalg.norm(values[0], axis=1)
    compares = (
        f"sum over all bodies in {times[-1] - times[0]:g} s, control as in the scenario, no loads"
    )
    return [
        Check(name, compares, float(error), 1e-9)
        for name, error in zip(("linear momentum", "angular momentum"), relative, strict=True)
    ]


def check_energy(satellite: Satellite, state: State, times: np.ndarray) -> Check:
    """Energy of a flight without damping, friction, rotor and gimbal motion."""
    locked, at_rest = (
        lossless(satellite),
        replace(state, gimbal_rate=jnp.zeros_like(state.gimbal_rate)),
    )
    states = fly(locked, at_rest, jnp.asarray(times))
    energy = over_time(kinetic_energy, locked, times, states)
    energy = energy + jax.vmap(strut_energy, in_axes=(None, 0))(locked, states)
    return Check(
        "energy (damping and friction off, CMGs locked)",
        f"sum over all bodies and springs in {times[-1] - times[0]:g} s, no loads",
        float(np.max(np.abs(energy - energy[0])) / energy[0]),
        1e-9,
    )


def lossless(satellite: Satellite) -> Satellite:
    """The satellite without damping, friction, loads and control, its rotors stopped."""
    undamped = replace(satellite.legs, damping=jnp.zeros_like(satellite.legs.damping))
    still = without_rotation(without_friction(replace(satellite, legs=undamped)))
    return held_gimbals(still, Wrench.zero())


def over_time(
    quantity: Callable[[Satellite, Array, State], Array],
    satellite: Satellite,
    times: np.ndarray,
    states: State,
) -> np.ndarray:
    """A function of satellite, rotor angles and state at every time of a flight."""

    def at(t, state):
        return quantity(satellite, rotor_angles(satellite, t), state)

    return np.asarray(jax.jit(jax.vmap(at))(jnp.asarray(times), states))
