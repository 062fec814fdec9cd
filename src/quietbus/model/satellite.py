"""The whole satellite as one pytree of parameters."""

from collections.abc import Iterator
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.alike import of_each
from quietbus.model.body import Body, Mount
from quietbus.model.cluster import Cluster
from quietbus.model.control import Control
from quietbus.model.element import AbstractActuator, AbstractElement, Own
from quietbus.model.legs.hexapod import Hexapod
from quietbus.model.motion import Motion

BUS = "bus"
CONTROL = "control"  # name of the control's own part of the state


class Satellite(eqx.Module):
    """Parameters of all parts; nothing in it changes during a run."""

    bodies: tuple[Body, ...]  # the bus first
    mounts: tuple[Mount, ...]  # of every body but the bus, its base's before its own
    hexapods: tuple[Hexapod, ...]
    clusters: tuple[Cluster, ...]
    others: tuple[AbstractElement, ...]  # loads, and parts of users' own kinds
    control: Control

    @property
    def elements(self) -> tuple[AbstractElement, ...]:
        """All that gives to the equations of motion."""
        return (*self.bodies, *self.hexapods, *self.clusters, *self.others)

    @property
    def actuators(self) -> tuple[AbstractActuator, ...]:
        """What the control commands, in its order."""
        named = {element.name: element for element in (*self.clusters, *self.others)}
        return tuple(named[name] for name in self.control.actuators)  # type: ignore[misc]

    @property
    def bus(self) -> Body:
        """The controlled body."""
        return self.bodies[0]

    @property
    def count(self) -> int:
        """Number of CMGs and wheels."""
        return sum(cluster.count for cluster in self.clusters)

    def numbered(self) -> Iterator[tuple[Cluster, slice]]:
        """The clusters, and where their units are among all."""
        first = 0
        for cluster in self.clusters:
            yield cluster, slice(first, first + cluster.count)
            first += cluster.count

    @property
    def steady(self) -> bool:
        """Whether no rotor changes its speed."""
        return all(cluster.rotors.steady for cluster in self.clusters)

    def start(self) -> dict[str, Own]:
        """What elements and control have of their own at the start, of those that have any."""
        own = {element.name: element.start() for element in self.elements}
        own = {name: each for name, each in own.items() if sum(map(len, jax.tree.leaves(each)))}
        return own | {CONTROL: Own.of(z=self.control.controller.start())}

    @property
    def rotor_speed(self) -> Float[Array, " cmg"]:
        """Nominal speeds of all rotors [rad/s]."""
        return jnp.concatenate([jnp.zeros(0), *(c.units.rotor_speed for c in self.clusters)])

    @property
    def rotor_phase(self) -> Float[Array, " cmg"]:
        """Angles of all rotors at t = 0 [rad]."""
        return jnp.concatenate([jnp.zeros(0), *(c.units.rotor_phase for c in self.clusters)])

    @property
    def steered(self) -> tuple[int, ...]:
        """Numbers of the units whose gimbals turn."""
        has = [cluster.cut > 0 for cluster in self.clusters for _ in range(cluster.count)]
        return tuple(j for j, turns in enumerate(has) if turns)

    @property
    def held(self) -> bool:
        """Whether all bodies are one with the bus."""
        return len(self.free) == 1

    def body(self, name: str) -> Body:
        """A body by its name."""
        return next(body for body in self.bodies if body.name == name)

    def mount(self, name: str) -> Mount:
        """How a body stands on its base."""
        return next(mount for mount in self.mounts if mount.body == name)

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the bodies that move on their own."""
        welded = {mount.body for mount in self.mounts if mount.welded}
        return tuple(body.name for body in self.bodies if body.name not in welded)

    def nominal(self) -> dict[str, Motion]:
        """Pose of all bodies in the bus, at rest, along bus axes."""
        zero = jnp.zeros(3)
        found = {BUS: Motion(jnp.eye(3), zero, zero, zero)}
        for mount in self.mounts:
            found[mount.body] = mount.motion(found[mount.base])
        return found

    def prepared(self) -> "Satellite":
        """Itself with what evaluation needs again and again computed once."""
        moments = of_each(lambda cluster: cluster.moments, self.clusters)
        pairs = zip(self.clusters, moments, strict=True)
        return replace(self, clusters=tuple(replace(c, kept=kept) for c, kept in pairs))

    def averaged(self) -> "Satellite":
        """The satellite of the slow motion: without what its rotors and gimbal motors shake."""
        return replace(self, clusters=tuple(cluster.averaged() for cluster in self.clusters))
