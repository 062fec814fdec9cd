"""Attitude control: the torque that the bus is to feel."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float


class PIDController(eqx.Module):
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
    torque_limit: Float[Array, ""] | None  # [N m] on the norm of T

    def torque_B(
        self,
        error_B: Float[Array, "3"],
        integral_B: Float[Array, "3"],
        rate_error_B: Float[Array, "3"],
        acceleration_ref_B: Float[Array, "3"],
    ) -> Float[Array, "3"]:
        """Torque asked for [N m], before any limit."""
        feedback = self.kp * error_B + self.ki * integral_B + self.kd * rate_error_B
        return self.J_feedforward_B @ acceleration_ref_B - feedback

    def limited(self, torque_B: Float[Array, "3"]) -> Float[Array, "3"]:
        """The torque within the limit, in its own direction."""
        if self.torque_limit is None:
            return torque_B
        square = torque_B @ torque_B / self.torque_limit**2
        return torque_B / jnp.sqrt(jnp.maximum(1.0, square))

    def integral_rate(
        self,
        error_B: Float[Array, "3"],
        asked_B: Float[Array, "3"],
        delivered_B: Float[Array, "3"],
    ) -> Float[Array, "3"]:
        """dq/dt [rad]."""
        return error_B + self.unwinding * (asked_B - delivered_B)


class GimbalServo(eqx.Module):
    """First-order gimbal-rate servo with rate and acceleration limits."""

    bandwidth: Float[Array, ""] | Float[Array, " cmg"]  # [rad/s] of all, or of each
    rate_limit: Float[Array, ""] | None  # [rad/s]
    acceleration_limit: Float[Array, ""] | None  # [rad/s^2]

    def share(self, rate_command: Float[Array, " cmg"]) -> Float[Array, ""]:
        """Largest factor up to 1 that brings every commanded rate within the limit.

        All rates are cut alike, so the torque keeps its direction.
        """
        if self.rate_limit is None:
            return jnp.ones(())
        return 1.0 / jnp.maximum(1.0, jnp.max(jnp.abs(rate_command)) / self.rate_limit)

    def acceleration(
        self, rate_command: Float[Array, " cmg"], rate: Float[Array, " cmg"]
    ) -> Float[Array, " cmg"]:
        """Gimbal accelerations [rad/s^2]."""
        acceleration = self.bandwidth * (rate_command - rate)
        if self.acceleration_limit is None:
            return acceleration
        return jnp.clip(acceleration, -self.acceleration_limit, self.acceleration_limit)
