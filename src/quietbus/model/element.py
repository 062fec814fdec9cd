"""The law of all parts: what each gives to the equations of motion, and tells of itself.

An element touches some bodies, its hosts, and may have coordinates of its own:

- q with speeds u = dq/dt that have inertia,
- driven coordinates y, whose second derivative a drive makes (gimbals, wheels),
- first-order memory z (an inner force of a strut, the integral of a controller).

It gives its shares of the mass matrix M and of ``f - M du/dt``, on the speeds of its hosts, (v, w)
each along common axes, and on its own u. From these two the nonlinear equations are assembled,
and the linear, harmonic and energy views follow by derivative: a new part needs no line there.

An element depends on the *relative* positions and velocities of its hosts, and on time, attitudes
and angular velocities: nothing depends on where the satellite is and how fast it drifts.
"""

from dataclasses import replace
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.motion import Motion
from quietbus.model.report import Report


class Own(eqx.Module):
    """An element's own part of the state."""

    q: Float[Array, " q"]  # coordinates with inertia
    u: Float[Array, " q"]  # their rates
    y: Float[Array, " y"]  # driven coordinates
    y_rate: Float[Array, " y"]
    z: Float[Array, " z"]  # first-order memory

    @classmethod
    def of(
        cls,
        q: Array | None = None,
        y: Array | None = None,
        y_rate: Array | None = None,
        z: Array | None = None,
    ) -> "Own":
        """With the given parts, at rest where no rates are given."""
        q, y, z = (jnp.zeros(0) if each is None else each for each in (q, y, z))
        return cls(q, jnp.zeros_like(q), y, jnp.zeros_like(y) if y_rate is None else y_rate, z)


NOTHING = Own.of()


class Rates(eqx.Module):
    """What drives and memories do."""

    y: Float[Array, " y"]  # second derivatives of the driven coordinates
    z: Float[Array, " z"]  # first derivatives of the memory


class Around(eqx.Module):
    """All that an element may depend on at one instant."""

    t: Float[Array, ""]  # [s]
    R_AN: Float[Array, "3 3"]  # takes inertial components to the axes A of the hosts' motions
    hosts: tuple[Motion, ...]
    own: Own


class RigidParts(eqx.Module):
    """Rigid bodies that an element consists of; along axes A, each field with them first."""

    mass: Float[Array, " part"]  # [kg]
    I: Float[Array, "part 3 3"]  # [kg m^2] about the mass centre
    p: Float[Array, "part 3"]  # [m] mass centre
    v: Float[Array, "part 3"]  # [m/s]
    w: Float[Array, "part 3"]  # [rad/s]

    @classmethod
    def none(cls) -> "RigidParts":
        """No body."""
        three = jnp.zeros((0, 3))
        return cls(jnp.zeros(0), jnp.zeros((0, 3, 3)), three, three, three)


class Energy(eqx.Module):
    """What an element stores, and takes from the motion."""

    stored: Float[Array, ""]  # [J] in springs
    dissipated: Float[Array, ""]  # [W]

    @classmethod
    def none(cls) -> "Energy":
        """Of an element that only moves."""
        return cls(jnp.zeros(()), jnp.zeros(()))


class Driven(NamedTuple):
    """Names of a driven coordinate and of its rate."""

    angle: str
    rate: str


class AbstractElement(eqx.Module):
    """A part of the satellite. What it does not have, it need not say."""

    name: eqx.AbstractVar[str]  # unique
    hosts: eqx.AbstractVar[tuple[str, ...]]  # names of the bodies it touches
    # whether its linearisation costs much and changes little, so that the harmonic solver samples
    # it along a motion and interpolates
    sampled: ClassVar[bool] = False
    external: ClassVar[bool] = False  # acts from outside, and is no part of a linear model

    def nameless(self) -> "AbstractElement":
        """The same without any name, so that elements that are alike have one structure."""
        return replace(self, name="", hosts=("",) * len(self.hosts))

    @property
    def count(self) -> int:
        """How many of the satellite's numbered units (CMGs, wheels) it holds."""
        return 0

    def driven_names(self, first: int) -> list[Driven]:
        """Names of driven coordinates and their rates, units numbered from ``first``."""
        count = range(len(self.start().y))
        return [Driven(*(f"{self.name}_{k}_{i}" for k in Driven._fields)) for i in count]

    def start(self) -> Own:
        """Its part of the state at the start of a run."""
        return NOTHING

    def mass(self, around: Around) -> Float[Array, "n n"]:
        """Its share of M, on the speeds of its hosts and its own."""
        n = 6 * len(self.hosts) + len(around.own.u)
        return jnp.zeros((n, n))

    def balance(
        self, around: Around, rates: Rates, u_rate: Float[Array, " n"]
    ) -> Float[Array, " n"]:
        """Its share of ``f - M du/dt``, linear in ``u_rate``."""
        return jnp.zeros(6 * len(self.hosts) + len(around.own.u))

    def rates(self, around: Around, command: Float[Array, " y"]) -> Rates:
        """What its drives and memory do, of actuators on a command."""
        return Rates(jnp.zeros_like(around.own.y), jnp.zeros_like(around.own.z))

    def answer(
        self, around: Around, rates: Rates, u_rate: Float[Array, " n"]
    ) -> Float[Array, "3 n y"]:
        """Derivatives of ``balance`` by driven coordinates, their rates and second derivatives."""

        def balance(y, y_rate, y_second):
            own = eqx.tree_at(lambda o: (o.y, o.y_rate), around.own, (y, y_rate))
            moved = eqx.tree_at(lambda a: a.own, around, own)
            return self.balance(moved, Rates(y_second, rates.z), u_rate)

        at = (around.own.y, around.own.y_rate, rates.y)
        return jnp.stack(jax.jacfwd(balance, argnums=(0, 1, 2))(*at))

    def configuration(self, around: Around) -> Float[Array, " c"]:
        """What its linearisation depends on, in shares of what would change it wholly."""
        return jnp.zeros(0)

    def margin(self, around: Around) -> Float[Array, ""]:
        """How far it is from where its geometry ends [-]; zero or less there."""
        return jnp.full((), jnp.inf)

    def corners(self) -> Float[Array, " corner"]:
        """Instants [s] at which it is not smooth in time; the integrator stops at them."""
        return jnp.zeros(0)

    def energy(self, around: Around) -> Energy:
        """What it stores and takes from the motion."""
        return Energy.none()

    def rigid_parts(self, around: Around) -> RigidParts:
        """The rigid bodies it consists of."""
        return RigidParts.none()

    def report(
        self, around: Around, rates: Rates, u_rate: Float[Array, " n"], detailed: bool = False
    ) -> Report:
        """What it tells; ``detailed``: with what costs more."""
        return ()


class Authority(eqx.Module):
    """What the commands of an actuator do to the satellite, and how far they may go."""

    axes_A: Float[Array, "3 command"]  # [-] torque on the host along axes A, by ``full`` commands
    torque: Float[Array, ""]  # [N m] of a full command
    full: Float[Array, " command"]  # a full command, in the command's own unit


class AbstractActuator(AbstractElement):
    """An element that follows commands of the attitude control by torque on its host.

    It does so through what it drives or remembers: its ``rates`` are given the commands.
    """

    @property
    def commands(self) -> int:
        """Number of commands."""
        return len(self.command_names(0))

    def command_names(self, first: int) -> list[str]:
        """Names of the commands, units numbered from ``first``; by default one."""
        return [f"{self.name}_command"]

    def authority(self, around: Around) -> Authority:
        """What its commands do, at this configuration."""
        raise NotImplementedError

    def share(self, command: Float[Array, " command"]) -> Float[Array, ""]:
        """Largest factor up to 1 that brings every command within its limit."""
        return jnp.ones(())

    def possible(
        self, around: Around, command: Float[Array, " command"]
    ) -> Float[Array, " command"]:
        """What is left of commands where an actuator cannot follow further."""
        return command
