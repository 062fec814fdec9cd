"""Attitude control: the torque that the bus is to feel."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float


class Measured(eqx.Module):
    """What the attitude control knows of the bus, and what it is to be."""

    error_B: Float[Array, "3"]  # [rad] twice the vector part of the shortest error quaternion
    rate_error_B: Float[Array, "3"]  # [rad/s]
    acceleration_ref_B: Float[Array, "3"]  # [rad/s^2] of the reference


class AbstractController(eqx.Module):
    """A law from attitude errors to the torque that the bus is to feel, with memory z."""

    acts: ClassVar[bool] = True  # whether it asks for any torque

    def start(self) -> Float[Array, " z"]:
        """Memory at the start."""
        return jnp.zeros(0)

    def torque_B(self, measured: Measured, z: Float[Array, " z"]) -> Float[Array, "3"]:
        """Torque asked for [N m], before any limit."""
        raise NotImplementedError

    def limited(self, torque_B: Float[Array, "3"]) -> Float[Array, "3"]:
        """The torque within the limit, in its own direction."""
        return torque_B

    def memory_rate(
        self,
        measured: Measured,
        z: Float[Array, " z"],
        asked_B: Float[Array, "3"],
        delivered_B: Float[Array, "3"],
    ) -> Float[Array, " z"]:
        """dz/dt, given the torques asked for and delivered [N m]."""
        return jnp.zeros_like(z)


class NoController(AbstractController):
    """The satellite is left to itself."""

    acts: ClassVar[bool] = False

    def torque_B(self, measured, z):
        return jnp.zeros(3)


class PIDController(AbstractController):
    """PID on the attitude error, with back-calculation against integrator windup.

        T = -(Kp e + Ki q + Kd (w - w_ref)) + J dw_ref/dt
        dq/dt = e + (T - T_delivered) / (Ki T_t)

    e is twice the vector part of the shortest error quaternion. T_delivered is T cut by the
    torque limit and by the gimbals' rate limit; where neither acts, dq/dt = e exactly.
    ``T_t = sqrt(Kd / Ki)`` is Astrom's tracking time sqrt(Ti Td); with Ki or Kd zero nothing is
    unwound. Limits of the gimbals' acceleration do not count as cuts.
    """

    kp: Float[Array, ""]  # [N m/rad]
    ki: Float[Array, ""]  # [N m/(rad s)]
    kd: Float[Array, ""]  # [N m s/rad]
    J_feedforward_B: Float[Array, "3 3"]  # [kg m^2] inertia for the slew's feedforward torque
    unwinding: Float[Array, ""]  # [rad/(N m)] 1/(Ki T_t)
    torque_limit: Float[Array, ""]  # [N m] on the norm of T, infinite without

    def start(self):
        return jnp.zeros(3)

    def torque_B(self, measured, z):
        feedback = self.kp * measured.error_B + self.ki * z + self.kd * measured.rate_error_B
        return self.J_feedforward_B @ measured.acceleration_ref_B - feedback

    def limited(self, torque_B):
        share = torque_B / self.torque_limit  # no square of the limit, which may be infinite
        return torque_B / jnp.sqrt(jnp.maximum(1.0, share @ share))

    def memory_rate(self, measured, z, asked_B, delivered_B):
        return measured.error_B + self.unwinding * (asked_B - delivered_B)
