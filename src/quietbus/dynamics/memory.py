"""How drives and memories answer small deviations: gimbals, wheels, controllers, struts alike.

What has coordinates y that drives accelerate, or first-order memory z, is one vector m = (y, z),
which is solved for at each frequency. All derivatives are taken of the law itself, from the bus's
attitude through control and sharing to every drive.
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from quietbus.dynamics.closed_loop import decide, drives
from quietbus.dynamics.coefficients import Coefficients, SlowMotion
from quietbus.dynamics.equations import moving, rates_of
from quietbus.dynamics.layout import BODY, Layout
from quietbus.dynamics.state import BodyState, State
from quietbus.model.element import AbstractElement
from quietbus.model.satellite import BUS, CONTROL, Satellite
from quietbus.spatial.rotation import quaternion_multiply, quaternion_to_matrix
from quietbus.spatial.vector import solve_small


@dataclass(frozen=True)
class Answering:
    """Who has memory that answers deviations, and which rows are whose; static."""

    y: tuple[tuple[str, int], ...]
    z: tuple[tuple[str, int], ...]
    columns: tuple[int, ...]  # of the free speeds that it depends on
    touched: tuple[str, ...]  # the free bodies that these are of

    @classmethod
    def of(cls, satellite: Satellite, state: State, free: Layout) -> "Answering":
        """Where the control does not act, what it commands stays as it is."""
        acts, idle = satellite.control.acts, {CONTROL, *satellite.control.actuators}
        y, z = [], []
        touched = [BUS] if acts else []
        for name, own in state.own.items():
            if not acts and name in idle:
                continue
            y.append((name, len(own.y)))
            z.append((name, len(own.z)))
        base = {mount.body: mount.base for mount in satellite.mounts if mount.welded}
        for element in satellite.elements:
            if dict(z).get(element.name):
                for host in element.hosts:
                    while host in base:
                        host = base[host]
                    touched.append(host)
        touched = [name for name in free.names if name in touched]
        columns: list[int] = []
        for name in touched:
            rows = range(*free.rows(name).indices(free.size))
            columns += rows if len(touched) > 1 else rows[BODY // 2 :]  # turns of one alone
        some = lambda sizes: tuple((name, n) for name, n in sizes if n)  # noqa: E731
        return cls(some(y), some(z), tuple(columns), tuple(touched))

    @property
    def driven(self) -> int:
        """Number of driven coordinates."""
        return sum(n for _, n in self.y)

    @property
    def kept(self) -> int:
        """Number of first-order memories."""
        return sum(n for _, n in self.z)


class Memory(eqx.Module):
    """``d(second derivatives of y, rates of z)`` and what they do to the free speeds."""

    layout: Answering = eqx.field(static=True)
    by_pose: Float[Array, "m c"]  # of the bodies it depends on
    by_rate: Float[Array, "m c"]  # of these poses' time derivatives, in the inertial frame
    by_y: Float[Array, "m y"]
    by_y_rate: Float[Array, "m y"]
    by_z: Float[Array, "m z"]
    reaction: Float[Array, "3 n y"]  # force on the speeds by y, its rate and second derivative
    push: Float[Array, "n z"]  # by z

    def fed_back(self, s: Complex[Array, ""]) -> Complex[Array, "m m"]:
        """What m does to itself, for exp(st)."""
        return jnp.concatenate([self.by_y + s * self.by_y_rate, self.by_z], axis=1)

    def answer(self, s: Complex[Array, ""], given: Complex[Array, "m k"]) -> Complex[Array, "m k"]:
        """m for what is given beside its own feedback, exp(st)."""
        ny, nz = self.layout.driven, self.layout.kept
        own = jnp.concatenate([jnp.full(ny, s**2), jnp.full(nz, s)])
        return solve_small(jnp.diag(own) - self.fed_back(s), given)

    def force(self, s: Complex[Array, ""], m: Complex[Array, "m k"]) -> Complex[Array, "n k"]:
        """What m does to the speeds."""
        ny = self.layout.driven
        angles = jnp.stack([m[:ny], s * m[:ny], s**2 * m[:ny]])
        return jnp.einsum("kia,kab->ib", self.reaction, angles) + self.push @ m[ny:]

    def of(self, element: str, m: Array, kind: str = "y") -> Array:
        """The rows of an element in m (m, ...): its driven coordinates, or its memory z."""
        parts = self.layout.y if kind == "y" else self.layout.z
        first = 0 if kind == "y" else self.layout.driven
        for name, n in parts:
            if name == element:
                return m[first : first + n]
            first += n
        return m[:0]


def memory(
    satellite: Satellite,
    slow: SlowMotion,
    answering: Answering,
    shares: list[tuple[AbstractElement, Coefficients]],
) -> Memory:
    """Derivatives of what control, drives and memories do, and their reaction on all speeds.

    Args:
        satellite: as of ``Satellite.averaged``.
        shares: of all elements.
    """
    state, now = slow.state, slow.now
    R_NB = quaternion_to_matrix(state.bus.q_NX)

    def rates(state):
        found = drives(satellite, moving(satellite, now.t, state), decide(satellite, now.t, state))
        parts = [found[name].y for name, _ in answering.y]
        parts += [found[name].z for name, _ in answering.z]
        return jnp.concatenate([jnp.zeros(0), *parts])

    still = jax.tree.map(jnp.zeros_like, state)
    c, ny, nz = len(answering.columns), answering.driven, answering.kept
    alone = len(answering.touched) == 1

    def tangent(way):
        pose, rate, y, y_rate, z = jnp.split(way, [c, 2 * c, 2 * c + ny, 2 * c + 2 * ny])
        moved = still
        for k, name in enumerate(answering.touched):
            size = BODY // 2 if alone else BODY
            at = slice(k * size, (k + 1) * size)
            nothing = jnp.zeros(BODY - size)
            x, x_rate = (jnp.concatenate([nothing, part[at]]) for part in (pose, rate))
            bodies = {**moved.bodies, name: body_tangent(state.bodies[name], R_NB, x, x_rate)}
            moved = State(bodies, moved.own)
        own = dict(moved.own)
        first = 0
        for name, n in answering.y:
            where = lambda o: (o.y, o.y_rate)  # noqa: E731
            new = (y[first : first + n], y_rate[first : first + n])
            own[name] = eqx.tree_at(where, own[name], new)
            first += n
        first = 0
        for name, n in answering.z:
            own[name] = eqx.tree_at(lambda o: o.z, own[name], z[first : first + n])
            first += n
        return State(moved.bodies, own)

    ways = jnp.eye(2 * c + 2 * ny + nz)
    _, push = jax.linearize(rates, state)
    columns = jax.vmap(lambda way: push(tangent(way)), out_axes=1)(ways)
    by = jnp.split(columns, [c, 2 * c, 2 * c + ny, 2 * c + 2 * ny], axis=1)
    return Memory(answering, *by, *_reactions(slow, answering, shares))


def _reactions(slow: SlowMotion, answering: Answering, shares):
    """Forces on all speeds by driven coordinates (3, n, y), and by memory (n, z)."""
    layout = slow.now.layout
    elements = {element.name: (element, share) for element, share in shares}
    reaction, push = [jnp.zeros((3, layout.size, 0))], [jnp.zeros((layout.size, 0))]
    for name, _ in answering.y:
        element, _ = elements[name]
        u_rate = layout.gathered(element, slow.u_rate)
        each = element.answer(slow.now.around(element), rates_of(slow.rates, element), u_rate)
        reaction.append(jnp.stack([layout.vector([(element, part)]) for part in each]))
    for name, n in answering.z:
        if name in elements:
            element, share = elements[name]
            push.append(layout.vector([(element, share.by_z)]))
        else:  # of the control, which pushes through its actuators alone
            push.append(jnp.zeros((layout.size, n)))
    return jnp.concatenate(reaction, axis=2), jnp.concatenate(push, axis=1)


def body_tangent(
    body: BodyState, R_NB: Float[Array, "3 3"], x: Float[Array, "6"], x_rate: Float[Array, "6"]
) -> BodyState:
    """Tangent of a body's state along a displacement and turn x, and their time derivative.

    Args:
        x, x_rate: along the columns of R_NB; the derivative as the inertial frame sees it.
    """
    R = quaternion_to_matrix(body.q_NX).T @ R_NB
    turn = jnp.concatenate([jnp.zeros(1), 0.5 * R @ x[3:]])
    return BodyState(
        R_NB @ x[:3], quaternion_multiply(body.q_NX, turn), R_NB @ x_rate[:3], R @ x_rate[3:]
    )
