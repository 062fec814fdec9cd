"""What turns the rotors of a cluster: constant speed, a prescribed run-up, or wheels' motors.

A motor drives its rotor with the angular acceleration that is asked of it, relative to the unit's
body; its reaction acts on that body. This is the rotor's counterpart of the gimbal servo: no
freedom is added to the equations of motion.
"""

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.moments import Turning
from quietbus.model.unit import ControlMomentGyro

UNLIMITED_TORQUE = 1.0  # [N m] that counts as full where no limit is given


class AbstractRotors(eqx.Module):
    """Drives of the rotors of all units."""

    def count(self, units: int) -> int:
        """How many driven coordinates they have."""
        return 0

    def start(self, units: ControlMomentGyro) -> tuple[Float[Array, " y"], Float[Array, " y"]]:
        """Driven angles [rad] and speeds [rad/s] at t = 0."""
        return jnp.zeros(0), jnp.zeros(0)

    def turning(
        self,
        units: ControlMomentGyro,
        t: Float[Array, ""],
        y: Float[Array, " y"],
        y_rate: Float[Array, " y"],
        y_second: Float[Array, " y"],
    ) -> Turning:
        """How the rotors turn at time t [s]."""
        raise NotImplementedError

    @property
    def steady(self) -> bool:
        """Whether speeds are the same at all times."""
        return False

    def axes(self, R_PG: Float[Array, "cmg 3 3"]) -> Float[Array, "3 y"]:
        """What they drive: axes of the torques on their rotors, in the frame P of the plate."""
        return jnp.zeros((3, 0))

    @property
    def full(self) -> Float[Array, " y"]:
        """A full torque command of each driven rotor [N m]."""
        return jnp.zeros(0)

    def acceleration(
        self, units: ControlMomentGyro, torque: Float[Array, " y"]
    ) -> Float[Array, " y"]:
        """Rotor accelerations [rad/s^2] on torque commands [N m]."""
        return torque

    def share(self, torque: Float[Array, " y"]) -> Float[Array, ""]:
        """Largest factor up to 1 that brings every torque [N m] within its limit."""
        return jnp.ones(())

    def possible(self, torque: Float[Array, " y"], speed: Float[Array, " y"]) -> Float[Array, " y"]:
        """The torques without those that would take a wheel beyond its speed limit."""
        return torque

    def corners(self) -> Float[Array, " corner"]:
        """Instants [s] at which the acceleration is not smooth."""
        return jnp.zeros(0)

    def at_rest(self) -> "AbstractRotors":
        """Itself where speeds are to stay the nominal ones."""
        return self


class ConstantSpeed(AbstractRotors):
    """Rotors that keep their speed."""

    @property
    def steady(self):
        return True

    def turning(self, units, t, y, y_rate, y_second):
        angle = units.rotor_phase + units.rotor_speed * t
        return Turning(angle, units.rotor_speed, jnp.zeros_like(units.rotor_speed))


class RunUp(AbstractRotors):
    """A prescribed change of speed; every field with the units as its first axis.

    Constant acceleration over the duration ("linear"), or that of the speed ``3 x^2 - 2 x^3`` of
    the change at the share x of the duration ("smooth"): without a jump of torque.
    """

    initial_speed: Float[Array, " cmg"]  # [rad/s]
    final_speed: Float[Array, " cmg"]  # [rad/s]
    begin: Float[Array, " cmg"]  # [s]
    duration: Float[Array, " cmg"]  # [s]
    shape: Literal["smooth", "linear"] = eqx.field(static=True)

    def turning(self, units, t, y, y_rate, y_second):
        past = (t - self.begin) / self.duration
        x = jnp.clip(past, 0.0, 1.0)
        change = self.final_speed - self.initial_speed
        if self.shape == "smooth":
            slope, share, area = 6.0 * x * (1.0 - x), x**2 * (3.0 - 2.0 * x), x**3 * (1.0 - 0.5 * x)
        else:
            slope, share, area = jnp.ones_like(x), x, 0.5 * x**2
        after = jnp.maximum(past - 1.0, 0.0)
        angle = self.initial_speed * t + change * self.duration * (area + after)
        during = (past >= 0.0) & (past < 1.0)
        return Turning(
            units.rotor_phase + angle,
            self.initial_speed + change * share,
            jnp.where(during, change / self.duration * slope, 0.0),
        )

    def at_rest(self):
        return ConstantSpeed()

    def corners(self):
        return jnp.concatenate([self.begin, self.begin + self.duration])


class WheelMotors(AbstractRotors):
    """Motors of reaction wheels; every field with the units as its first axis."""

    torque_limit: Float[Array, " cmg"]  # [N m] on the torque that is asked for, infinite without
    speed_limit: Float[Array, " cmg"]  # [rad/s] above it no torque speeds a wheel up; or infinite

    def count(self, units):
        return units

    def start(self, units):
        return units.rotor_phase, units.rotor_speed

    def turning(self, units, t, y, y_rate, y_second):
        return Turning(y, y_rate, y_second)

    def axes(self, R_PG):
        return R_PG[:, :, 0].T

    @property
    def full(self):
        return jnp.where(jnp.isfinite(self.torque_limit), self.torque_limit, UNLIMITED_TORQUE)

    def acceleration(self, units, torque):
        return torque / units.I_RRcm_R[:, 0, 0]

    def share(self, torque):
        return 1.0 / jnp.maximum(1.0, jnp.max(jnp.abs(torque) / self.torque_limit))

    def possible(self, torque, speed):
        outward = (jnp.abs(speed) >= self.speed_limit) & (torque * speed > 0.0)
        return jnp.where(outward, 0.0, torque)
