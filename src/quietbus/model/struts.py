"""Laws of struts: tension from length, its rate, and memory of their own.

A law serves all legs of a hexapod at once. One with memory says how it changes; linearised,
in vibration and in the energy balance it then takes part as it is.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.programs import compiled_for_few_runs


class StrutTangent(NamedTuple):
    """Struts for small motion: tension ``k e + c e' + F z`` with ``z' = E e + R e' + Z z``."""

    stiffness: Float[Array, " leg"]  # k [N/m], memory held
    damping: Float[Array, " leg"]  # c [N s/m], memory held
    force: Float[Array, "leg z"]  # F
    elongation: Float[Array, "z leg"]  # E
    rate: Float[Array, "z leg"]  # R
    decay: Float[Array, "z z"]  # Z


class AbstractStrut(eqx.Module):
    """Struts between the lower and the upper parts of legs; tension is positive."""

    free_length: eqx.AbstractVar[Float[Array, " leg"]]  # [m] at which it is free of force at rest

    def start(self) -> Float[Array, " z"]:
        """Memory at the start, of a strut at rest at its free length."""
        return jnp.zeros(0)

    def tension(
        self, length: Float[Array, " leg"], rate: Float[Array, " leg"], z: Float[Array, " z"]
    ) -> Float[Array, " leg"]:
        """Tension [N] at lengths [m] and their rates [m/s]."""
        raise NotImplementedError

    def memory_rate(
        self, length: Float[Array, " leg"], rate: Float[Array, " leg"], z: Float[Array, " z"]
    ) -> Float[Array, " z"]:
        """dz/dt."""
        return jnp.zeros_like(z)

    def stored(
        self, length: Float[Array, " leg"], rate: Float[Array, " leg"], z: Float[Array, " z"]
    ) -> Float[Array, ""]:
        """Energy [J] in springs."""
        raise NotImplementedError

    def dissipated(
        self, length: Float[Array, " leg"], rate: Float[Array, " leg"], z: Float[Array, " z"]
    ) -> Float[Array, ""]:
        """Power [W] that dampers take."""
        raise NotImplementedError


@compiled_for_few_runs
def tangent(strut: AbstractStrut, length: Float[Array, " leg"]) -> StrutTangent:
    """Struts for small motion about lengths at rest, with the memory of the start."""
    z, still, one = strut.start(), jnp.zeros_like(length), jnp.ones_like(length)
    law = lambda length, rate: strut.tension(length, rate, z)  # noqa: E731
    at = (length, still)
    k, c = jax.jvp(law, at, (one, still))[1], jax.jvp(law, at, (still, one))[1]
    forces = jax.jacfwd(strut.tension, argnums=2)(length, still, z)
    memory = jax.jacfwd(strut.memory_rate, argnums=(0, 1, 2))(length, still, z)
    return StrutTangent(k, c, forces, *memory)


class SpringDamper(AbstractStrut):
    """Linear spring and damper in parallel: ``k (l - l0) + c dl/dt``."""

    stiffness: Float[Array, " leg"]  # [N/m]
    damping: Float[Array, " leg"]  # [N s/m]
    free_length: Float[Array, " leg"]  # [m]

    def tension(self, length, rate, z):
        return self.stiffness * (length - self.free_length) + self.damping * rate

    def stored(self, length, rate, z):
        return 0.5 * jnp.sum(self.stiffness * (length - self.free_length) ** 2)

    def dissipated(self, length, rate, z):
        return jnp.sum(self.damping * rate**2)
