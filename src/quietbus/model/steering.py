"""Steering laws: which commands of all actuators together give a torque.

``A`` (3 x n) holds the torques by full commands of gimbals and wheels, divided by their
root-mean-square, so that thresholds mean the same for every size of actuator. ``det(A A^T)`` falls
to zero where some torque cannot be had; the singularity measure is its square root.
"""

import abc
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float


def singularity_measure(A: Float[Array, "3 command"]) -> Float[Array, ""]:
    """``sqrt(det(A A^T))`` [-]; zero where some torque direction cannot be had."""
    return jnp.sqrt(jnp.maximum(_determinant(A @ A.T), 0.0))


class Steering(eqx.Module):
    """A law that answers a wanted torque with commands."""

    acts: ClassVar[bool] = True  # whether it gives any commands

    @abc.abstractmethod
    def rates(
        self, A: Float[Array, "3 command"], torque: Float[Array, "3"], t: Float[Array, ""]
    ) -> Float[Array, " command"]:
        """Commands in shares of full ones [-].

        Args:
            A: (3, command) torques by full commands, over their RMS [-].
            torque: (3,) wanted, over the same RMS [-].
            t: time [s].
        """


class NoSteering(Steering):
    """No commands: gimbals stay where they are, and wheels keep their speeds."""

    acts: ClassVar[bool] = False

    def rates(self, A, torque, t):
        return jnp.zeros(A.shape[1])


class PseudoInverse(Steering):
    """Moore-Penrose: ``A^T (A A^T)^-1``; exact where it exists, without bound near singularity."""

    def rates(self, A, torque, t):
        return A.T @ _inverse(A @ A.T) @ torque


class SingularityRobust(Steering):
    """``A^T (A A^T + lambda E)^-1`` with ``lambda = lambda0 exp(-mu det(A A^T))``.

    Nakamura and Hanafusa's robust pseudo-inverse in Wie's form: rates stay bounded at a singular
    set, at the cost of a torque error elsewhere: lambda / (sigma^2 + lambda) of the part along a
    direction whose singular value in A is sigma. Defaults: lambda0 = 0.01, mu = 10.
    """

    lambda0: Float[Array, ""]  # [-]
    mu: Float[Array, ""]  # [-]

    def rates(self, A, torque, t):
        AAt = A @ A.T
        weight = self.lambda0 * jnp.exp(-self.mu * _determinant(AAt))
        return A.T @ _inverse(AAt + weight * jnp.eye(3)) @ torque


class GeneralizedSingularityRobust(Steering):
    """Wie's generalised SR inverse: the added matrix has moving off-diagonal terms.

    ``A^T (A A^T + lambda E)^-1`` with E_ii = 1 and E_23, E_13, E_12 equal to
    ``epsilon0 sin(omega t + phases)``: a torque along the singular direction then still moves the
    gimbals, so the cluster leaves a singular set instead of staying in it (Wie, Bailey, Heiberg
    2001).
    """

    lambda0: Float[Array, ""]  # [-]
    mu: Float[Array, ""]  # [-]
    epsilon0: Float[Array, ""]  # [-]
    frequency: Float[Array, ""]  # [rad/s]
    phases: Float[Array, "3"]  # [rad]

    def rates(self, A, torque, t):
        AAt = A @ A.T
        weight = self.lambda0 * jnp.exp(-self.mu * _determinant(AAt))
        e1, e2, e3 = self.epsilon0 * jnp.sin(self.frequency * t + self.phases)
        E = jnp.array([[1.0, e3, e2], [e3, 1.0, e1], [e2, e1, 1.0]])
        return A.T @ _inverse(AAt + weight * E) @ torque


def _determinant(S: Float[Array, "3 3"]) -> Float[Array, ""]:
    return S[0] @ jnp.cross(S[1], S[2])


def _inverse(S: Float[Array, "3 3"]) -> Float[Array, "3 3"]:
    """Inverse by cofactors; a singular matrix gives infinities, which the run reports."""
    cofactors = jnp.stack([jnp.cross(S[1], S[2]), jnp.cross(S[2], S[0]), jnp.cross(S[0], S[1])])
    return cofactors.T / _determinant(S)
