"""Momentum and energy of the whole satellite, rigid part by rigid part.

A check of the equations of motion that shares nothing with their mass matrix: every part (bus,
plates, gimbal bodies, rotors, lower and upper leg parts) moves with its own mass-centre and angular
velocity, from the velocities of the points that carry it. All vectors in inertial components.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.equations import moving
from quietbus.dynamics.state import State
from quietbus.model.element import Energy, RigidParts
from quietbus.model.satellite import Satellite


def linear_momentum_N(satellite: Satellite, t: Float[Array, ""], state: State) -> Float[Array, "3"]:
    """Linear momentum [kg m/s] at time t [s]."""
    parts = rigid_parts(satellite, t, state)
    return parts.mass @ parts.v


def angular_momentum_N(
    satellite: Satellite, t: Float[Array, ""], state: State
) -> Float[Array, "3"]:
    """Angular momentum about the inertial origin [N m s]."""
    parts = rigid_parts(satellite, t, state)
    orbital = jnp.cross(parts.p, parts.mass[:, None] * parts.v)
    return jnp.sum(orbital + jnp.einsum("bij,bj->bi", parts.I, parts.w), axis=0)


def kinetic_energy(satellite: Satellite, t: Float[Array, ""], state: State) -> Float[Array, ""]:
    """Kinetic energy [J], that of the spinning rotors included."""
    parts = rigid_parts(satellite, t, state)
    linear = parts.mass * jnp.sum(parts.v**2, axis=1)
    return 0.5 * jnp.sum(linear + jnp.einsum("bi,bij,bj->b", parts.w, parts.I, parts.w))


def energy(satellite: Satellite, t: Float[Array, ""], state: State) -> Energy:
    """Energy in springs [J] and power [W] that dampers and friction take from the motion."""
    now = moving(satellite, t, state)
    each = [element.energy(now.around(element)) for element in satellite.elements]
    return jax.tree.map(lambda *parts: jnp.sum(jnp.stack(parts)), *each)


def rigid_parts(satellite: Satellite, t: Float[Array, ""], state: State) -> RigidParts:
    """Mass and motion of all rigid parts, in the order of the elements."""
    now = moving(satellite, t, state)
    each = [element.rigid_parts(now.around(element)) for element in satellite.elements]
    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *each)
