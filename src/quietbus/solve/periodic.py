"""Motions that start without a transient: the steady jitter added to a state, or taken off it."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.dynamics.closed_loop import evaluate
from quietbus.dynamics.rotor_response import orders_of, rotor_speeds
from quietbus.dynamics.state import BodyState, State
from quietbus.dynamics.vibration import Vibration
from quietbus.model.element import Own
from quietbus.model.moments import ORDERS
from quietbus.model.satellite import BUS, Satellite
from quietbus.programs import compiled
from quietbus.solve.along import at_one
from quietbus.solve.validity import refuse_resonance
from quietbus.spatial.rotation import (
    quaternion_multiply,
    quaternion_to_matrix,
    rotation_vector_to_quaternion,
)
from quietbus.spatial.vector import cross

TURNS = 16  # angles at least over which products of orders, up to 2 here, are averaged


class Deviation(eqx.Module):
    """A small motion of the free bodies, drives and memories, along bus axes."""

    xi: Float[Array, " m"]  # displacements and turns, own coordinates
    xi_rate: Float[Array, " m"]  # their time derivatives, of vectors as the inertial frame sees it
    y: Float[Array, " y"]
    y_rate: Float[Array, " y"]
    z: Float[Array, " z"]

    def __add__(self, other: "Deviation") -> "Deviation":
        return jax.tree.map(jnp.add, self, other)

    def __neg__(self) -> "Deviation":
        return jax.tree.map(jnp.negative, self)


def on_periodic_solution(satellite: Satellite, state: State) -> State:
    """The state at t = 0 with the steady jitter added, so that a direct run has no transient.

    To second order: the jitter's square has a mean, which moves the equilibrium, and multiples of
    rotor speed, which move the satellite too (docs/theory.md, section 14).
    """
    small, xi = _jitter_at(satellite, state)
    speed, phase = rotors_at_start(satellite, state)
    moved = _deviation(satellite, small, xi, phase)
    speeds = np.abs(np.asarray(speed))
    orders = np.array(orders_of(satellite))
    for one in np.unique(speeds[speeds > 0.0]):
        for base, together in _periods(orders):
            turns = max(TURNS, 4 * round(np.max(orders[together]) / base) + 4)
            chosen = (speeds == one)[:, None] & together
            square = _jitter_squared(satellite, state, small, xi, chosen, jnp.asarray(base), turns)
            moved = moved + _answer_to_square(small, square, base * one)
    return displaced(state, small, moved)


def without_jitter(satellite: Satellite, state: State) -> State:
    """The slow motion's state at t = 0, from the true one."""
    small, xi = _jitter_at(satellite, state)
    return _moved_by(satellite, state, small, -xi)


def steady_speeds(satellite: Satellite, state: State) -> np.ndarray:
    """Amplitudes (cmg, order, 6) of the bus's velocity [m/s] and rate [rad/s] at t = 0."""
    small, xi = at_one(satellite, state)
    speed, _ = rotors_at_start(satellite, state)
    omega = np.abs(np.outer(np.asarray(speed), orders_of(satellite)))
    return omega[..., None] * np.abs(xi[..., small.free.rows(BUS)])


def rotors_at_start(
    satellite: Satellite, state: State
) -> tuple[Float[Array, " cmg"], Float[Array, " cmg"]]:
    """Speeds [rad/s] and angles [rad] of all rotors at t = 0."""
    rotors = [c.at(jnp.zeros(()), state.own).rotor for c in satellite.clusters]
    return jnp.concatenate([r.rate for r in rotors]), jnp.concatenate([r.angle for r in rotors])


def _periods(orders: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Orders that have a common period, by that of the group: the whole ones, each of the others.

    Products of lines of different groups have no mean and are left out.
    """
    whole = orders == np.round(orders)
    return [(1.0, whole), *((float(h), orders == h) for h in orders[~whole])]


def _answer_to_square(small: Vibration, square: Sequence[np.ndarray], speed: float) -> Deviation:
    """Motion at t = 0 that the jitter's square causes at multiples of speed.

    Args:
        square: over a turn's angles, accelerations of the free bodies, rates of y and of z.
    """
    turns = len(square[0])
    u_rate, y_second, z_rate = (np.fft.rfft(part, axis=0) / turns for part in square)
    m, ny, nz = u_rate.shape[1], y_second.shape[1], z_rate.shape[1]
    A, turn = small.state_matrix(), np.asarray(small.turn)
    sums = [np.zeros(m), np.zeros(m), np.zeros(ny), np.zeros(ny), np.zeros(nz)]
    for k in range(turns // 2):
        b = np.concatenate([np.zeros(m), u_rate[k], np.zeros(ny), y_second[k], z_rate[k]])
        if k == 0:  # A is singular where nothing holds the satellite
            x = np.linalg.lstsq(A, -b.real, rcond=1e-13)[0]
        else:
            x = 2.0 * np.linalg.solve(1j * k * speed * np.eye(len(A)) - A, b)
        parts = np.split(x, np.cumsum([m, m, ny, ny]))
        parts[1] = parts[1] + turn @ parts[0]
        sums = [before + part.real for before, part in zip(sums, parts, strict=True)]
    return Deviation(*map(jnp.asarray, sums))


@compiled
def _moved_by(satellite, state, small, xi):
    moved = _deviation(satellite, small, xi, rotors_at_start(satellite, state)[1])
    return displaced(state, small, moved)


def _jitter_at(satellite: Satellite, state: State) -> tuple[Vibration, np.ndarray]:
    """Equations of small vibration at t = 0 and xi (cmg, order, m) of the free bodies."""
    small, xi = at_one(satellite, state)
    modes = np.linalg.eigvals(small.state_matrix())
    refuse_resonance(
        satellite, "at t = 0 s", modes, np.asarray(rotors_at_start(satellite, state)[0])
    )
    return small, xi


@compiled
def _deviation(satellite, small, xi, phase):
    """Jitter xi (cmg, order, m) at rotor angles."""
    ny = small.memory.layout.driven

    def one(h, speed, phase, xi):
        s, now = 1j * h * speed, xi * jnp.exp(1j * h * phase)
        m = small.remembered(jnp.where(speed == 0.0, 1j, s), now)
        return Deviation(now, s * now + small.turn @ now, m[:ny], s * m[:ny], m[ny:])

    over_orders = jax.vmap(one, (0, None, None, 0))
    moved = jax.vmap(over_orders, (None, 0, 0, 0))(
        jnp.array(orders_of(satellite)), rotor_speeds(satellite, small), phase, xi
    )
    return jax.tree.map(lambda part: jnp.sum(part.real, axis=(0, 1)), moved)


@compiled
def _jitter_squared(satellite, state, small, xi, chosen, base, turns):
    """What rates have beyond first order in some lines, at equally spaced angles of a turn.

    Lines without a common period have no steady product, so that rotors of each speed, and groups
    of their orders, are taken by themselves. Accelerations, of the free bodies, are along bus axes.

    Args:
        chosen: (cmg, order) which lines.
        base: the order whose turn it is.
        turns: number of angles.
    """
    orders, layout = orders_of(satellite), small.memory.layout
    averaged = satellite.averaged()
    shaking = _with_lines(satellite, orders, chosen)
    speed, phase = rotors_at_start(satellite, state)
    xi = jnp.where(chosen[..., None], xi, 0.0)
    s = 1j * speed[:, None] * jnp.array(orders)
    spin = lambda xi: s[..., None] * xi + xi @ small.turn.T  # noqa: E731
    xi_second = spin(spin(xi))

    def rates(satellite, state):
        found = evaluate(satellite, jnp.zeros(()), state)
        every = found.now.layout
        u_rate = every.turned(found.now.motions[BUS].R_AX.T, found.u_rate)
        parts = [u_rate[every.rows(name)] for name, _ in small.free.parts]
        y = [found.rates[name].y for name, _ in layout.y]
        z = [found.rates[name].z for name, _ in layout.z]
        return tuple(jnp.concatenate([jnp.zeros(0), *each]) for each in (parts, y, z))

    def beyond(turn):
        phi = phase + turn / base * jnp.sign(speed)
        now = _deviation(satellite, small, xi, phi)
        turned, at = _turned(shaking, state, phi)
        true = rates(turned, displaced(at, small, now))
        still = rates(*_turned(averaged, state, phi))
        # first order: time derivatives of the motion
        line = jnp.exp(1j * phi[:, None] * jnp.array(orders))[..., None]
        accelerations = jnp.sum((xi_second * line).real, axis=(0, 1))
        changing = _deviation(satellite, small, xi * s[..., None], phi)
        known = (accelerations, changing.y_rate, changing.z)
        return tuple(t - still_ - k for t, still_, k in zip(true, still, known, strict=True))

    return jax.vmap(beyond)(2.0 * jnp.pi / turns * jnp.arange(turns))


def _turned(satellite: Satellite, state: State, phi) -> tuple[Satellite, State]:
    """Satellite and state with the rotors at other angles at t = 0."""
    own, clusters = dict(state.own), []
    for cluster, some in satellite.numbered():
        turned, mine = cluster.turned(state.own, phi[some])
        clusters.append(turned)
        own |= mine
    return replace(satellite, clusters=tuple(clusters)), State(state.bodies, own)


def _with_lines(satellite: Satellite, orders: tuple[float, ...], chosen) -> Satellite:
    """The satellite with some lines of its rotors only, without noise."""
    clusters = []
    for cluster, some in satellite.numbered():
        mine = chosen[some]
        of_imbalance = mine[:, orders.index(ORDERS[0])]  # order 2 is in the group of order 1
        columns = np.array([orders.index(h) for h in cluster.disturbance.orders])
        clusters.append(cluster.with_lines(of_imbalance, mine[:, columns]))
    return replace(satellite, clusters=tuple(clusters))


def displaced(state: State, small: Vibration, moved: Deviation) -> State:
    """The state moved by a small deviation along bus axes, to second order in turns."""
    R_NB = quaternion_to_matrix(state.bus.q_NX)
    bodies, own = {}, dict(state.own)
    for name in small.free.names:
        body, rows = state.bodies[name], small.free.rows(name)
        r, theta = moved.xi[rows].reshape(2, 3)
        v, theta_rate = moved.xi_rate[rows].reshape(2, 3)
        R = quaternion_to_matrix(body.q_NX).T @ R_NB
        # body axes turn with theta, so that to second order half a vector product comes off
        rate = theta_rate - 0.5 * cross(theta, theta_rate)
        bodies[name] = BodyState(
            body.p_NX_N + R_NB @ r,
            quaternion_multiply(body.q_NX, rotation_vector_to_quaternion(R @ theta)),
            body.v_NX_N + R_NB @ v,
            body.w_NX_X + R @ rate,
        )
    for name in own:
        rows, mine = small.free.own(name), own[name]
        own[name] = Own(
            mine.q + moved.xi[rows],
            mine.u + moved.xi_rate[rows],
            _added(mine.y, small.memory.layout.y, name, moved.y),
            _added(mine.y_rate, small.memory.layout.y, name, moved.y_rate),
            _added(mine.z, small.memory.layout.z, name, moved.z),
        )
    return State(bodies, own)


def _added(value: Array, parts: tuple[tuple[str, int], ...], name: str, moved: Array) -> Array:
    """A value moved by its owner's rows of a deviation, if it has any there."""
    first = 0
    for owner, size in parts:
        if owner == name:
            return value + moved[first : first + size]
        first += size
    return value
