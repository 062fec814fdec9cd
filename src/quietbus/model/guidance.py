"""Guidance: the attitude that the controller follows."""

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.spatial.rotation import quaternion_multiply, rotation_vector_to_quaternion


class Reference(eqx.Module):
    """Attitude, rate and acceleration of the reference frame R."""

    q_NR: Float[Array, "4"]
    w_NR_R: Float[Array, "3"]  # [rad/s]
    dw_NR_R: Float[Array, "3"]  # [rad/s^2]


class Guidance(eqx.Module):
    """A reference attitude over time."""

    @abc.abstractmethod
    def reference(self, t: Float[Array, ""]) -> Reference:
        """Reference at time t [s]."""


class StepGuidance(Guidance):
    """The target attitude at once, at rest."""

    q_NR: Float[Array, "4"]

    def reference(self, t):
        return Reference(self.q_NR, jnp.zeros(3), jnp.zeros(3))


class EigenaxisSlew(Guidance):
    """Rest-to-rest turn about one axis, bounded in rate, acceleration and jerk.

    The time-optimal profile of seven segments of constant jerk (+j 0 -j 0 -j 0 +j), shortened
    where the angle is too small to reach the limits. Make it with ``plan``.
    """

    q_NR0: Float[Array, "4"]  # attitude at the start
    axis_R: Float[Array, "3"]  # [-] unit turn axis, the same in R at every instant
    start: Float[Array, " segment"]  # [s] of each segment
    duration: Float[Array, " segment"]  # [s]
    rate: Float[Array, " segment"]  # [rad/s] at the segment's start
    acceleration: Float[Array, " segment"]  # [rad/s^2] at the segment's start
    jerk: Float[Array, " segment"]  # [rad/s^3]

    @classmethod
    def plan(
        cls,
        q_NR0: np.ndarray,
        turn_R: np.ndarray,
        max_rate: float,
        max_acceleration: float,
        max_jerk: float,
        start: float = 0.0,
    ) -> "EigenaxisSlew":
        """Profile for the rotation vector ``turn_R`` [rad] from attitude ``q_NR0``.

        Limits in rad/s, rad/s^2, rad/s^3, all positive; a turn of zero length stays at rest.
        """
        angle = float(np.linalg.norm(turn_R))
        axis = np.asarray(turn_R) / angle if angle > 0.0 else np.array([1.0, 0.0, 0.0])
        # Limits that the angle lets the profile reach: without cruise the turn takes
        # rate * (ramp time), the ramp time being rate/acceleration + acceleration/jerk.
        acceleration = min(
            max_acceleration, np.cbrt(0.5 * angle * max_jerk**2), np.sqrt(max_rate * max_jerk)
        )
        t_jerk = acceleration / max_jerk
        rate = max_rate
        if angle < rate * (rate / acceleration + t_jerk if acceleration else 0.0):
            b = acceleration * t_jerk
            rate = 0.5 * (np.sqrt(b * b + 4.0 * acceleration * angle) - b)
        t_hold = max(rate / acceleration - t_jerk, 0.0) if acceleration else 0.0
        t_cruise = max(angle / rate - (2.0 * t_jerk + t_hold), 0.0) if rate else 0.0
        duration = np.array([t_jerk, t_hold, t_jerk, t_cruise, t_jerk, t_hold, t_jerk])
        jerk = max_jerk * np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])
        acceleration_at = np.concatenate([[0.0], np.cumsum(jerk * duration)[:-1]])
        gained = acceleration_at * duration + 0.5 * jerk * duration**2
        rate_at = np.concatenate([[0.0], np.cumsum(gained)[:-1]])
        starts = start + np.concatenate([[0.0], np.cumsum(duration)[:-1]])
        arrays = (q_NR0, axis, starts, duration, rate_at, acceleration_at, jerk)
        return cls(*(jnp.asarray(value, dtype=float) for value in arrays))

    def reference(self, t):
        tau = jnp.clip(t - self.start, 0.0, self.duration)
        angle = jnp.sum(tau * (self.rate + tau * (self.acceleration / 2.0 + tau * self.jerk / 6.0)))
        rate = jnp.sum(tau * (self.acceleration + tau * self.jerk / 2.0))
        acceleration = jnp.sum(tau * self.jerk)
        q_NR = quaternion_multiply(self.q_NR0, rotation_vector_to_quaternion(angle * self.axis_R))
        return Reference(q_NR, rate * self.axis_R, acceleration * self.axis_R)

    @property
    def end(self) -> Float[Array, ""]:
        """Time at which the turn is over [s]."""
        return self.start[-1] + self.duration[-1]
