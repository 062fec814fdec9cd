"""Arbitrary motions of a satellite to compare programs at."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.dynamics.equations import Wrench
from quietbus.dynamics.state import State
from quietbus.model.rotor import RotorState
from quietbus.model.satellite import Satellite
from quietbus.spatial.rotation import (
    quaternion_multiply,
    quaternion_to_matrix,
    rotation_vector_to_quaternion,
)


def random_state(satellite: Satellite, rng: np.random.Generator) -> State:
    """Tumbling bus, displaced and moving plate, gimbals at any angle and turning.

    Rotors whose speeds change have any speed up to 600 rad/s.
    Velocities are up to 1 m/s and 1 rad/s per axis. Relative to its nominal pose an isolated plate
    is displaced by up to 5 % of the shortest leg and turned by up to 0.05 rad per axis.
    """
    cmgs = len(satellite.cluster.rotor_speed)
    swing = 0.0 if satellite.cluster.wheels else 1.0
    q_NB = rng.normal(size=4)
    free = satellite.mount == "isolated"
    shift = 0.05 * free * float(np.min(satellite.legs.nominal_length))
    return with_plate(
        satellite,
        State(
            p_NB_N=_box(rng, 3, 1.0),
            q_NB=jnp.asarray(q_NB / np.linalg.norm(q_NB)),
            p_NP_N=jnp.zeros(3),
            q_NP=jnp.zeros(4),
            v_NB_N=_box(rng, 3, 1.0),
            w_NB_B=_box(rng, 3, 1.0),
            v_NP_N=jnp.zeros(3),
            w_NP_P=jnp.zeros(3),
            gimbal_angle=_box(rng, cmgs, np.pi * swing),
            gimbal_rate=_box(rng, cmgs, swing),
            error_integral=jnp.zeros(3),
            rotor=_random_rotors(satellite, rng),
        ),
        _box(rng, 3, shift),
        _box(rng, 3, 0.05 * free),
        _box(rng, 3, 1.0 * free),
        _box(rng, 3, 1.0 * free),
    )


def kicked_state(satellite: Satellite, state: State, rng: np.random.Generator) -> State:
    """The state with the bus turning, the gimbals moving and an isolated plate out of its place.

    The bus turns by up to 0.05 rad/s per axis more, the gimbals by up to 0.3 rad/s. The plate moves
    by up to 1 % of the shortest leg and 0.01 rad per axis, and at ten times that a second.
    """
    free = satellite.mount == "isolated"
    shift = 0.01 * free * float(np.min(satellite.legs.nominal_length))
    cmgs = len(satellite.cluster.rotor_speed)
    moving = replace(
        state,
        v_NB_N=state.v_NB_N + _box(rng, 3, 0.01),
        w_NB_B=state.w_NB_B + _box(rng, 3, 0.05),
        gimbal_rate=_box(rng, cmgs, 0.0 if satellite.cluster.wheels else 0.3),
    )
    return with_plate(
        satellite,
        moving,
        _box(rng, 3, shift),
        _box(rng, 3, 0.01 * free),
        _box(rng, 3, 10.0 * shift),
        _box(rng, 3, 0.1 * free),
    )


def with_plate(
    satellite: Satellite,
    state: State,
    displacement_B: Float[Array, "3"],
    turn_B: Float[Array, "3"],
    velocity_B: Float[Array, "3"],
    rate_B: Float[Array, "3"],
) -> State:
    """The state with the plate's motion set relative to the bus.

    Args:
        displacement_B, turn_B: (3,) from the nominal pose [m], rotation vector [rad].
        velocity_B, rate_B: (3,) of the plate's origin [m/s] and angular [rad/s], seen from the bus.
    """
    R_NB = quaternion_to_matrix(state.q_NB)
    turn = rotation_vector_to_quaternion(turn_B)
    q_BP = quaternion_multiply(turn, satellite.q_BP)
    p_BP_B = satellite.p_BP_B + displacement_B
    w_NP_B = state.w_NB_B + rate_B
    return replace(
        state,
        p_NP_N=state.p_NB_N + R_NB @ p_BP_B,
        q_NP=quaternion_multiply(state.q_NB, q_BP),
        v_NP_N=state.v_NB_N + R_NB @ (jnp.cross(state.w_NB_B, p_BP_B) + velocity_B),
        w_NP_P=quaternion_to_matrix(q_BP).T @ w_NP_B,
    )


def random_wrench(satellite: Satellite, rng: np.random.Generator) -> Wrench:
    """Loads on both bodies that move the plate little.

    Per axis up to the weight of the bus in a hundredth of Earth's gravity, but no more than what
    presses all struts by 0.2 % of the shortest leg; torques have the shortest leg as their arm.
    """
    arm = float(np.min(satellite.legs.nominal_length))
    force = min(
        0.1 * float(satellite.bus.mass),
        0.002 * arm * float(np.sum(satellite.legs.stiffness)),
    )
    scale = force * jnp.array([[1.0], [arm], [1.0], [arm]])
    return Wrench(*(scale * _box(rng, 12, 1.0).reshape(4, 3)))


def _random_rotors(satellite: Satellite, rng: np.random.Generator) -> RotorState | None:
    if satellite.cluster.drive is None:
        return None
    count = len(satellite.cluster.rotor_speed)
    return RotorState(_box(rng, count, np.pi), _box(rng, count, 600.0))


def _box(rng: np.random.Generator, n: int, half: float) -> Float[Array, " n"]:
    return jnp.asarray(rng.uniform(-half, half, n))
