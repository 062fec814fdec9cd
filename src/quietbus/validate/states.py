"""Arbitrary motions of a satellite to compare programs at."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.dynamics.closed_loop import initial_state
from quietbus.dynamics.state import BodyState, State
from quietbus.model.element import Own, Rates
from quietbus.model.satellite import BUS, Satellite
from quietbus.spatial.rotation import (
    quaternion_multiply,
    quaternion_to_matrix,
    rotation_vector_to_quaternion,
)

Box = Float[Array, "3"]
# displacement [m], rotation vector [rad], velocity [m/s] and angular velocity [rad/s]
Place = tuple[Box, Box, Box, Box]


def random_state(satellite: Satellite, rng: np.random.Generator) -> State:
    """Tumbling bus, bodies on struts displaced and moving, gimbals at any angle and turning.

    Wheels under control have any speed up to 600 rad/s.
    Velocities are up to 1 m/s and 1 rad/s per axis. Relative to their nominal poses bodies on
    struts are displaced by up to 5 % of the shortest leg and turned by up to 0.05 rad per axis.
    """
    q_NB = rng.normal(size=4)
    bus = BodyState(
        _box(rng, 3, 1.0),
        jnp.asarray(q_NB / np.linalg.norm(q_NB)),
        _box(rng, 3, 1.0),
        _box(rng, 3, 1.0),
    )
    own = initial_state(satellite, bus.q_NX, bus.w_NX_X, jnp.zeros(satellite.count)).own
    for cluster in satellite.clusters:
        if cluster.driven:
            gimbals, rotors = cluster.cut, cluster.driven - cluster.cut
            own[cluster.name] = Own.of(
                y=jnp.concatenate([_box(rng, gimbals, np.pi), _box(rng, rotors, np.pi)]),
                y_rate=jnp.concatenate([_box(rng, gimbals, 1.0), _box(rng, rotors, 600.0)]),
            )
    bounds = (0.05 * shortest_leg(satellite), 0.05, 1.0, 1.0)
    return displaced(satellite, State({BUS: bus}, own), lambda _: _place(rng, bounds))


def kicked_state(satellite: Satellite, state: State, rng: np.random.Generator) -> State:
    """The state with the bus turning, gimbals moving and bodies on struts out of their places.

    The bus turns by up to 0.05 rad/s per axis more, the gimbals by up to 0.3 rad/s. Bodies move by
    up to 1 % of the shortest leg and 0.01 rad per axis, and at ten times that a second.
    """
    before = state.bus
    bus = BodyState(
        before.p_NX_N,
        before.q_NX,
        before.v_NX_N + _box(rng, 3, 0.01),
        before.w_NX_X + _box(rng, 3, 0.05),
    )
    own = dict(state.own)
    for cluster in satellite.clusters:
        if cluster.cut:
            mine = own[cluster.name]
            swing = _box(rng, cluster.cut, 0.3)
            y_rate = jnp.concatenate([swing, mine.y_rate[cluster.cut :]])
            own[cluster.name] = Own(mine.q, mine.u, mine.y, y_rate, mine.z)
    shift = 0.01 * shortest_leg(satellite)
    bounds = (shift, 0.01, 10.0 * shift, 0.1)
    return displaced(satellite, State({BUS: bus}, own), lambda _: _place(rng, bounds))


def displaced(satellite: Satellite, state: State, off: Callable[[str], Place]) -> State:
    """The state with the motion of all free bodies but the bus set relative to their bases.

    Args:
        off: how far a body is off its nominal pose, and how it moves, as seen from its base and
            along the base's axes.
    """
    found, nowhere = {BUS: state.bus}, (jnp.zeros(3),) * 4
    for mount in satellite.mounts:
        base = found[mount.base]
        r, theta, v, w = nowhere if mount.welded else off(mount.body)
        R_NB = quaternion_to_matrix(base.q_NX)
        q_BX = quaternion_multiply(rotation_vector_to_quaternion(theta), mount.q_BX)
        p_BX_B = mount.p_BX_B + r
        found[mount.body] = BodyState(
            base.p_NX_N + R_NB @ p_BX_B,
            quaternion_multiply(base.q_NX, q_BX),
            base.v_NX_N + R_NB @ (jnp.cross(base.w_NX_X, p_BX_B) + v),
            quaternion_to_matrix(q_BX).T @ (base.w_NX_X + w),
        )
    return State({name: found[name] for name in satellite.free}, state.own)


def random_rates(
    satellite: Satellite, rng: np.random.Generator, gimbals: float = 5.0, rotors: float = 50.0
) -> dict[str, Rates]:
    """Accelerations [rad/s^2] of all gimbals and rotors that follow commands, up to these."""
    return {
        c.name: Rates(
            jnp.concatenate([_box(rng, c.cut, gimbals), _box(rng, c.driven - c.cut, rotors)]),
            jnp.zeros(0),
        )
        for c in satellite.clusters
        if c.driven
    }


def random_wrenches(satellite: Satellite, rng: np.random.Generator) -> np.ndarray:
    """Loads on all bodies that press struts little.

    Per axis up to the weight of the bus in a hundredth of Earth's gravity, but no more than what
    presses all struts of a body by 0.2 % of the shortest leg; torques have the shortest leg as
    their arm.

    Returns:
        (body, 2, 3) forces [N] and torques [N m] about the bodies' origins, inertial.
    """
    arm = shortest_leg(satellite)
    force = 0.1 * float(satellite.bus.mass_X)
    for legs in satellite.hexapods:
        stiffness = legs.tangent.stiffness
        force = min(force, 0.002 * arm * float(jnp.sum(stiffness)))
    scale = force * np.array([1.0, arm])
    return scale[:, None] * rng.uniform(-1.0, 1.0, (len(satellite.bodies), 2, 3))


def shortest_leg(satellite: Satellite) -> float:
    """Nominal length [m] of the shortest leg; a metre where there is none."""
    legs = [float(jnp.min(each.geometry.nominal_length)) for each in satellite.hexapods]
    return min(legs, default=1.0)


def _place(rng: np.random.Generator, bounds: tuple[float, float, float, float]) -> Place:
    displacement, turn, velocity, rate = (_box(rng, 3, bound) for bound in bounds)
    return displacement, turn, velocity, rate


def _box(rng: np.random.Generator, n: int, half: float) -> Float[Array, " n"]:
    return jnp.asarray(rng.uniform(-half, half, n))
