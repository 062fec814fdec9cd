"""What turns the gimbals of a cluster: servos, or nothing where they are held."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.moments import Turning

UNLIMITED_RATE = 1.0  # [rad/s] that counts as full where no limit is given


class AbstractGimbals(eqx.Module):
    """Gimbals of all units."""

    def count(self, units: int) -> int:
        """How many driven coordinates they have."""
        raise NotImplementedError

    def turning(
        self, y: Float[Array, " y"], y_rate: Float[Array, " y"], y_second: Float[Array, " y"]
    ) -> Turning:
        """How they turn."""
        raise NotImplementedError

    def acceleration(
        self, y_rate: Float[Array, " y"], command: Float[Array, " y"]
    ) -> Float[Array, " y"]:
        """Gimbal accelerations [rad/s^2] on rate commands [rad/s]."""
        raise NotImplementedError

    def share(self, command: Float[Array, " y"]) -> Float[Array, ""]:
        """Largest factor up to 1 that brings every commanded rate within the limit."""
        raise NotImplementedError

    def full(self, units: int) -> Float[Array, " y"]:
        """A full rate command of each driven gimbal [rad/s]."""
        return jnp.zeros(0)

    def stiffness(self, omega: Float[Array, "n cmg line"]) -> Float[Array, "n cmg line"]:
        """Acceleration over angle [1/s^2] of forced motion at frequencies [rad/s]."""
        return omega**2


class HeldGimbals(AbstractGimbals):
    """Gimbals that stay where they are, as housings of reaction wheels do."""

    angle: Float[Array, " cmg"]  # [rad]

    def count(self, units):
        return 0

    def turning(self, y, y_rate, y_second):
        still = jnp.zeros_like(self.angle)
        return Turning(self.angle, still, still)

    def acceleration(self, y_rate, command):
        return y_rate

    def share(self, command):
        return jnp.ones(())


class GimbalServos(AbstractGimbals):
    """First-order gimbal-rate servos with rate and acceleration limits."""

    bandwidth: Float[Array, ""] | Float[Array, " cmg"]  # [rad/s] of all, or of each
    rate_limit: Float[Array, ""]  # [rad/s], infinite without
    acceleration_limit: Float[Array, ""]  # [rad/s^2], infinite without

    def count(self, units):
        return units

    def turning(self, y, y_rate, y_second):
        return Turning(y, y_rate, y_second)

    def acceleration(self, y_rate, command):
        acceleration = self.bandwidth * (command - y_rate)
        return jnp.clip(acceleration, -self.acceleration_limit, self.acceleration_limit)

    def share(self, command):
        """All rates are cut alike, so the torque keeps its direction."""
        return 1.0 / jnp.maximum(1.0, jnp.max(jnp.abs(command)) / self.rate_limit)

    def stiffness(self, omega):
        bandwidth = jnp.atleast_1d(self.bandwidth)[:, None]
        return omega * jnp.sqrt(omega**2 + bandwidth**2)

    def full(self, units):
        full = jnp.where(jnp.isfinite(self.rate_limit), self.rate_limit, UNLIMITED_RATE)
        return full * jnp.ones(units)
