"""Attitude control of the whole satellite: guidance, controller, and sharing among actuators."""

import itertools
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.controller import AbstractController, Measured
from quietbus.model.element import AbstractActuator, Around
from quietbus.model.guidance import Guidance
from quietbus.model.report import AXIS, Output, Quantity, Report
from quietbus.model.steering import Steering, singularity_measure
from quietbus.spatial.rotation import (
    attitude_error,
    quaternion_conjugate,
    quaternion_multiply,
    quaternion_to_matrix,
)
from quietbus.spatial.vector import rotate

TORQUE = Quantity("control_torque", AXIS, "N m", "commanded torque on the bus, bus frame")
ERROR = Quantity(
    "attitude_error",
    AXIS,
    "rad",
    "twice the vector part of the shortest error quaternion, bus frame",
)
SINGULARITY = Quantity(
    "singularity_measure",
    (),
    "1",
    "sqrt(det(A A^T)) of the actuators' torque directions, weighted by what they can give",
)
SHARE = Quantity(
    "torque_share",
    (),
    "1",
    "part of the control torque that is delivered along it",
    "in which the control makes units act",
)
QUANTITIES = (TORQUE, ERROR, SINGULARITY, SHARE)
Commands = tuple[Float[Array, " command"], ...]


class Decision(eqx.Module):
    """What the attitude control decides at one instant."""

    error_B: Float[Array, "3"]  # [rad]
    torque_B: Float[Array, "3"]  # [N m] commanded, within the torque limit
    memory_rate: Float[Array, " z"]
    commands: Commands  # of each actuator
    singularity: Float[Array, ""]  # [-]
    torque_share: Float[Array, ""]  # [-] as of ``share_along``


class Actuators:
    """All actuators together: torque along bus axes, in shares of full commands."""

    def __init__(self, elements: Sequence[AbstractActuator], arounds: Sequence[Around]):
        """Actuators and where they are, along bus axes."""
        self.elements, self.arounds = tuple(elements), tuple(arounds)
        self.groups = [e.authority(a) for e, a in zip(elements, arounds, strict=True)]
        sizes = [len(group.full) for group in self.groups]
        self._ends = list(itertools.accumulate(sizes))
        each = [jnp.full(n, 1.0) * g.torque for n, g in zip(sizes, self.groups, strict=True)]
        # [N m] root mean square of the torques by full commands
        self.torque = jnp.sqrt(jnp.mean(jnp.concatenate(each) ** 2)) if each else jnp.ones(())

    @property
    def axes_B(self) -> Float[Array, "3 command"]:
        """Torques on the satellite by full commands, over ``torque`` [-]."""
        each = [group.axes_A * (group.torque / self.torque) for group in self.groups]
        return jnp.concatenate([jnp.zeros((3, 0)), *each], axis=1)

    def split(self, shares: Float[Array, " command"]) -> Commands:
        """Commands of each actuator, each in its own unit, from shares of full ones."""
        first = [0, *self._ends]
        parts = [shares[a:b] for a, b in itertools.pairwise(first)]
        return tuple(g.full * part for g, part in zip(self.groups, parts, strict=True))

    def share(self, commands: Commands) -> Float[Array, ""]:
        """Factor up to 1 that brings all commands within their limits."""
        pairs = zip(self.elements, commands, strict=True)
        return jnp.min(jnp.stack([jnp.ones(()), *(e.share(c) for e, c in pairs)]))

    def possible(self, commands: Commands) -> Commands:
        """What is left of commands where actuators cannot follow further."""
        all_ = zip(self.elements, self.arounds, commands, strict=True)
        return tuple(element.possible(around, command) for element, around, command in all_)

    def given(self, commands: Commands) -> Float[Array, "3"]:
        """Torque [N m] by commands."""
        pairs = zip(self.groups, commands, strict=True)
        each = [g.torque * (g.axes_A @ (command / g.full)) for g, command in pairs]
        return sum(each, jnp.zeros(3))


class Control(eqx.Module):
    """Guidance, controller and steering; the bus is what is controlled."""

    guidance: Guidance
    controller: AbstractController
    steering: Steering
    actuators: tuple[str, ...] = eqx.field(static=True)  # names of those that can be commanded

    @property
    def acts(self) -> bool:
        """Whether actuators are commanded at all."""
        return self.controller.acts and self.steering.acts and bool(self.actuators)

    def measured(
        self, t: Float[Array, ""], q_NB: Float[Array, "4"], w_NB_B: Float[Array, "3"]
    ) -> Measured:
        """Errors of the bus against the reference at time t [s]."""
        reference = self.guidance.reference(t)
        q_BR = quaternion_multiply(quaternion_conjugate(q_NB), reference.q_NR)
        R_BR = quaternion_to_matrix(q_BR)
        return Measured(
            attitude_error(reference.q_NR, q_NB),
            w_NB_B - R_BR @ reference.w_NR_R,
            R_BR @ reference.dw_NR_R,
        )

    def decide(
        self,
        t: Float[Array, ""],
        measured: Measured,
        z: Float[Array, " z"],
        actuators: Actuators,
    ) -> Decision:
        """What to command.

        All commands are cut alike where one is beyond its limit, so that the torque keeps its
        direction; what limits leave of it counts as delivered for the controller.

        Args:
            z: the controller's memory.
            actuators: what can be commanded.
        """
        asked = self.controller.torque_B(measured, z)
        torque = delivered = self.controller.limited(asked)
        axes = actuators.axes_B
        commands = actuators.split(jnp.zeros(axes.shape[1]))
        torque_share = jnp.ones(())
        if self.acts:
            R = actuators.arounds[0].hosts[0].R_AX  # laws have the axes of the first carrier
            axes_A = rotate(R.T, axes.T).T
            shares = self.steering.rates(axes_A, R.T @ torque / actuators.torque, t)
            wanted = actuators.split(shares)
            share = actuators.share(wanted)
            within = tuple(share * each for each in wanted)
            commands = actuators.possible(within)
            given = actuators.given(commands)
            delivered = share * torque - (actuators.given(within) - given)
            torque_share = share_along(given, torque)
        return Decision(
            measured.error_B,
            torque,
            self.controller.memory_rate(measured, z, asked, delivered),
            commands,
            singularity_measure(axes),
            torque_share,
        )

    def report(self, decision: Decision) -> Report:
        """What it tells."""
        told = (
            Output(TORQUE, decision.torque_B),
            Output(ERROR, decision.error_B),
            Output(SINGULARITY, decision.singularity),
        )
        return (*told, Output(SHARE, decision.torque_share)) if self.acts else told


def share_along(delivered: Float[Array, "3"], asked: Float[Array, "3"]) -> Float[Array, ""]:
    """Part of a torque that is delivered along its own direction; 1 where nothing is asked."""
    square = asked @ asked
    return jnp.where(square > 0.0, delivered @ asked / jnp.where(square > 0.0, square, 1.0), 1.0)
