"""External forces and torques over time, on a body."""

import abc
from typing import ClassVar, Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.element import AbstractElement
from quietbus.spatial.vector import cross, rotate


class Profile(eqx.Module):
    """A dimensionless factor over time."""

    @abc.abstractmethod
    def factor(self, t: Float[Array, ""]) -> Float[Array, ""]:
        """Factor at time t [s]."""

    @property
    @abc.abstractmethod
    def corners(self) -> Float[Array, " corner"]:
        """Times [s] at which the factor is not smooth; the integrator stops at them."""


class Constant(Profile):
    """Always 1."""

    def factor(self, t):
        return jnp.ones(())

    @property
    def corners(self):
        return jnp.zeros(0)


class Step(Profile):
    """1 from ``start`` until ``end``, otherwise 0."""

    start: Float[Array, ""]  # [s]
    end: Float[Array, ""]  # [s]

    def factor(self, t):
        return jnp.where((t >= self.start) & (t < self.end), 1.0, 0.0)

    @property
    def corners(self):
        return jnp.stack([self.start, self.end])


class HalfSine(Profile):
    """Half a period of a sine from ``start``, lasting ``duration``; otherwise 0."""

    start: Float[Array, ""]  # [s]
    duration: Float[Array, ""]  # [s]

    def factor(self, t):
        return jnp.sin(jnp.pi * jnp.clip((t - self.start) / self.duration, 0.0, 1.0))

    @property
    def corners(self):
        return jnp.stack([self.start, self.start + self.duration])


class Table(Profile):
    """Linear between given points; the first and last values hold outside them."""

    times: Float[Array, " point"]  # [s] increasing
    values: Float[Array, " point"]  # [-]

    def factor(self, t):
        return jnp.interp(t, self.times, self.values)

    @property
    def corners(self):
        return self.times


class Load(AbstractElement):
    """One force and torque, applied at a point of a body, following a profile."""

    name: str = eqx.field(static=True)
    hosts: tuple[str] = eqx.field(static=True)
    frame: Literal["body", "inertial"] = eqx.field(static=True)  # of force and torque
    force: Float[Array, "3"]  # [N]
    torque: Float[Array, "3"]  # [N m]
    point: Float[Array, "3"]  # [m] where the force acts, body frame
    profile: Profile
    external: ClassVar[bool] = True

    def balance(self, around, rates, u_rate):
        (body,) = around.hosts
        R = body.R_AX if self.frame == "body" else around.R_AN
        factor = self.profile.factor(around.t)
        force = factor * rotate(R, self.force)
        torque = factor * rotate(R, self.torque) + cross(rotate(body.R_AX, self.point), force)
        return jnp.concatenate([force, torque])

    def corners(self):
        return self.profile.corners
