"""Linearisation of the equations of motion about a slow motion, element by element.

All matrices are derivatives, by automatic differentiation, of the elements' own balance, so that a
new element needs no line here. All vectors are along the bus axes of the slow motion at the instant
looked at.
"""

import itertools
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.closed_loop import evaluate
from quietbus.dynamics.equations import Moving, rates_of
from quietbus.dynamics.state import State
from quietbus.model.alike import of_each
from quietbus.model.element import AbstractElement, Around, Rates
from quietbus.model.satellite import BUS, Satellite


class SlowMotion(eqx.Module):
    """The slow motion at one instant, along the bus axes of that instant."""

    state: State
    now: Moving
    rates: dict[str, Rates]
    u_rate: Float[Array, " n"]  # [m/s^2, rad/s^2] of all speeds


def slow_motion(averaged: Satellite, t: Float[Array, ""], state: State) -> SlowMotion:
    """The slow motion at time t [s], of ``Satellite.averaged()``."""
    found = evaluate(averaged, t, state)
    u_rate = found.now.layout.turned(found.now.motions[BUS].R_AX.T, found.u_rate)
    return SlowMotion(state, found.now.along(BUS), found.rates, u_rate)


class Seen(eqx.Module):
    """Deviations of a quantity by those of poses, speeds and memory."""

    by_pose: Float[Array, "*k n"]
    by_speed: Float[Array, "*k n"]
    by_z: Float[Array, "*k z"]


class Coefficients(eqx.Module):
    """``M du/dt = by_pose xi + by_speed u + by_z z``: deviations about a slow motion.

    xi are displacements and rotation vectors of bodies, and own coordinates.
    """

    M: Float[Array, "n n"]
    by_pose: Float[Array, "n n"]
    by_speed: Float[Array, "n n"]
    by_z: Float[Array, "n z"]
    force: Float[Array, " n"]  # f - M du/dt of the slow motion
    seen: dict[str, Seen]  # quantities that the element tells, by name


def coefficients(elements: Sequence[AbstractElement], slow: SlowMotion) -> list[Coefficients]:
    """What elements contribute, each in its own order of hosts and own coordinates."""
    return of_each(
        _coefficients,
        elements,
        map(slow.now.around, elements),
        (rates_of(slow.rates, e) for e in elements),
        (slow.now.layout.gathered(e, slow.u_rate) for e in elements),
    )


def _coefficients(
    element: AbstractElement, around: Around, rates: Rates, u_rate: Array
) -> Coefficients:
    own, hosts = around.own, around.hosts

    def at(hosts, q, u, z):
        mine = eqx.tree_at(lambda o: (o.q, o.u, o.z), own, (q, u, z))
        moved = eqx.tree_at(lambda a: (a.hosts, a.own), around, (hosts, mine))
        told = {
            quantity.name: value
            for quantity, value in element.report(moved, rates, u_rate)
            if quantity.vibrates
        }
        return element.balance(moved, rates, u_rate), told

    # relative positions and velocities alone matter: the first host's follow from the others'
    free, q, z = len(hosts) - 1, len(own.q), len(own.z)
    cuts = _ends([12 * free, 6, q, q, z])

    def tangent(way):
        others, first, q_, u_, z_ = jnp.split(way, cuts)
        theta, w = first.reshape(2, 3)
        moved = [hosts[0].shifted(jnp.zeros(3), theta, jnp.zeros(3), w)]
        for host, part in zip(hosts[1:], others.reshape(free, 4, 3), strict=True):
            moved.append(host.shifted(part[0], part[1], part[2], part[3]))
        return tuple(moved), q_, u_, z_

    (held, _), push = jax.linearize(at, hosts, own.q, own.u, own.z)
    ways = jnp.eye(12 * free + 6 + 2 * q + z)
    balance, told = jax.vmap(lambda way: push(*tangent(way)), out_axes=-1)(ways)

    def sorted_(columns):
        others, first, q_, u_, z_ = jnp.split(columns, cuts, axis=-1)
        others = others.reshape(*columns.shape[:-1], free, 4, 3)
        theta, w = first[..., :3], first[..., 3:]
        r, v = -jnp.sum(others[..., 0, :], axis=-2), -jnp.sum(others[..., 2, :], axis=-2)
        pose, speed = [r, theta], [v, w]
        for k in range(free):
            pose += [others[..., k, 0, :], others[..., k, 1, :]]
            speed += [others[..., k, 2, :], others[..., k, 3, :]]
        return jnp.concatenate([*pose, q_], axis=-1), jnp.concatenate([*speed, u_], axis=-1), z_

    by_pose, by_speed, by_z = sorted_(balance)
    seen = {name: Seen(*sorted_(columns)) for name, columns in told.items()}
    return Coefficients(element.mass(around), by_pose, by_speed, by_z, held, seen)


def _ends(sizes: list[int]) -> list[int]:
    return list(itertools.accumulate(sizes[:-1]))
