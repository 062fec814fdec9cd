"""Rotors whose speed changes: prescribed run-up, and the motors of reaction wheels.

The motor drives its rotor with the angular acceleration that is asked of it, relative to the unit's
body; its reaction acts on that body. This is the rotor's counterpart of the gimbal servo: no
freedom is added to the equations of motion.
"""

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float


class RotorState(eqx.Module):
    """Rotors whose speed changes, at one instant."""

    angle: Float[Array, " cmg"]  # [rad]
    speed: Float[Array, " cmg"]  # [rad/s]


class RunUp(eqx.Module):
    """A prescribed change of speed; every field with the units as its first axis."""

    initial_speed: Float[Array, " cmg"]  # [rad/s]
    final_speed: Float[Array, " cmg"]  # [rad/s]
    start: Float[Array, " cmg"]  # [s]
    duration: Float[Array, " cmg"]  # [s]
    shape: Literal["smooth", "linear"] = eqx.field(static=True)

    def acceleration(self, t: Float[Array, ""]) -> Float[Array, " cmg"]:
        """Rotor accelerations [rad/s^2] at time t [s].

        Constant over the duration, or of the speed ``3 x^2 - 2 x^3`` of the change at the share x
        of the duration: without a jump of torque.
        """
        x = (t - self.start) / self.duration
        mean = (self.final_speed - self.initial_speed) / self.duration
        share = 6.0 * x * (1.0 - x) if self.shape == "smooth" else 1.0
        return jnp.where((x >= 0.0) & (x < 1.0), mean * share, 0.0)

    @property
    def corners(self) -> Float[Array, " corner"]:
        """Instants [s] at which the acceleration is not smooth."""
        return jnp.concatenate([self.start, self.start + self.duration])


class WheelMotors(eqx.Module):
    """Motors of reaction wheels; every field with the units as its first axis."""

    torque_limit: Float[Array, " cmg"] | None  # [N m] on the torque that is asked for
    speed_limit: Float[Array, " cmg"] | None  # [rad/s] above it no torque speeds a wheel up
    run_up: RunUp | None = None  # instead of what the control asks for

    @property
    def weights(self) -> Float[Array, " cmg"] | float:
        """Share of each wheel in a torque [-]: as its torque limit, over their RMS."""
        if self.torque_limit is None:
            return 1.0
        return self.torque_limit / jnp.sqrt(jnp.mean(self.torque_limit**2))

    def share(self, torque: Float[Array, " cmg"]) -> Float[Array, ""]:
        """Largest factor up to 1 that brings every torque [N m] within its limit.

        All torques are cut alike, so that their sum keeps its direction.
        """
        if self.torque_limit is None:
            return jnp.ones(())
        return 1.0 / jnp.maximum(1.0, jnp.max(jnp.abs(torque) / self.torque_limit))

    def within_speed(
        self, torque: Float[Array, " cmg"], speed: Float[Array, " cmg"]
    ) -> Float[Array, " cmg"]:
        """The torques without those that would take a wheel beyond its speed limit."""
        if self.speed_limit is None:
            return torque
        outward = (jnp.abs(speed) >= self.speed_limit) & (torque * speed > 0.0)
        return jnp.where(outward, 0.0, torque)


RotorDrive = RunUp | WheelMotors
