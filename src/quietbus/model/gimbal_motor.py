"""Gimbal motors that do not follow their command smoothly: torque ripple and steps.

Both repeat over a turn of the gimbal: lines exp(i n gamma). They accelerate the gimbal on top of
what its servo asks for, and depend on the gimbal's rate: a gimbal at rest is not moved by them
(docs/theory.md, section 15).
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from quietbus.model.unit import ControlMomentGyro


class AbstractGimbalMotor(eqx.Module):
    """What a cluster's gimbal motors do beside what their servos ask for."""

    @property
    def order(self) -> Float[Array, " line"]:
        """Lines in a turn of the gimbal, of ripple and of steps."""
        return jnp.zeros(0)

    def amplitudes(
        self, units: ControlMomentGyro, gamma_rate: Float[Array, " cmg"]
    ) -> Complex[Array, "cmg line"]:
        """Gimbal accelerations [rad/s^2] by each line, Re(amplitude exp(i n gamma))."""
        return jnp.zeros((len(gamma_rate), 0), complex)

    def acceleration(
        self,
        units: ControlMomentGyro,
        gamma: Float[Array, " y"],
        gamma_rate: Float[Array, " y"],
    ) -> Float[Array, " y"]:
        """Gimbal accelerations [rad/s^2] at gimbal angles [rad] and rates [rad/s]."""
        return jnp.zeros_like(gamma)


class SmoothMotor(AbstractGimbalMotor):
    """Gimbals move exactly as their servos say."""


class GimbalMotor(AbstractGimbalMotor):
    """Ripple torque and stepping, alike for all units but for their phases."""

    per_turn: Float[Array, " ripple"]  # [-] periods of the ripple in a turn of the gimbal
    torque: Float[Array, " ripple"]  # [N m]
    phase: Float[Array, "cmg ripple"]  # [rad] against per_turn times gimbal angle
    holding: Float[Array, ""]  # [rad/s] ripple slower than this is held
    step_per_turn: Float[Array, " harmonic"]  # [-] multiples of the number of steps in a turn
    step_turn: Float[Array, " harmonic"]  # [rad] amplitude of a step's harmonic
    step_phase: Float[Array, "cmg harmonic"]  # [rad] of each harmonic against its gimbal angle
    step_frequency: Float[Array, ""]  # [rad/s] undamped, of the gimbal about a step
    step_damping: Float[Array, ""]  # [-] over critical damping

    @property
    def order(self):
        return jnp.concatenate([self.per_turn, self.step_per_turn])

    def amplitudes(
        self, units: ControlMomentGyro, gamma_rate: Float[Array, " cmg"]
    ) -> Complex[Array, "cmg line"]:
        """Gimbal accelerations [rad/s^2] by each line, Re(amplitude exp(i n gamma)).

        Ripple: T w^2 / (w^2 + w_h^2) over the gimbal's inertia, w = n dgamma/dt. Steps: the field
        runs ahead of the mean by the saw tooth sum sin(k N gamma) 2 / (k N); the gimbal follows
        it as a damped oscillator.
        """
        rate = gamma_rate[:, None]
        square = (self.per_turn * rate) ** 2
        shared = square / (square + self.holding**2)
        ripple = shared * self.torque * jnp.exp(1j * self.phase)
        ripple = ripple / gimbal_inertia(units)[:, None]
        s = 1j * self.step_per_turn * rate
        oscillator = self.step_frequency**2 + 2.0 * self.step_damping * self.step_frequency * s
        follows = self.step_frequency**2 / (oscillator + s**2)
        field = -1j * self.step_turn * jnp.exp(1j * self.step_phase)
        return jnp.concatenate([ripple, field * s**2 * follows], axis=1)

    def acceleration(
        self,
        units: ControlMomentGyro,
        gamma: Float[Array, " cmg"],
        gamma_rate: Float[Array, " cmg"],
    ) -> Float[Array, " cmg"]:
        """Gimbal accelerations [rad/s^2] at gimbal angles [rad] and rates [rad/s]."""
        turned = jnp.exp(1j * self.order * gamma[:, None])
        return jnp.sum((self.amplitudes(units, gamma_rate) * turned).real, axis=1)


def gimbal_inertia(units: ControlMomentGyro) -> Float[Array, " cmg"]:
    """Inertia [kg m^2] of gimbal body and rotor about the gimbal axis, mean over the rotor's turn.

    Static imbalance, whose share is of second order, is left out.
    """
    across = lambda r: r[:, 0] ** 2 + r[:, 1] ** 2  # noqa: E731
    body = units.I_GGcm_G[:, 2, 2] + units.gimbal_mass * across(units.p_CGcm_G)
    spin = units.I_RRcm_R[:, 0, 0]
    other = 0.5 * (units.I_RRcm_R[:, 1, 1] + units.I_RRcm_R[:, 2, 2])
    rotor = other + (spin - other) * units.R_GF[:, 2, 0] ** 2
    return body + rotor + units.rotor_mass * across(units.p_CR_G)
