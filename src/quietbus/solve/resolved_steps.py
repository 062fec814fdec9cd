"""Steps short enough for the fastest line there is, however small it is.

Error control sees what a line does to the state. One that does less than the tolerance it does not
see: its steps then may be longer than a rotor's turn, and the line comes out wrong.
"""

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.state import State
from quietbus.model.cluster import Cluster
from quietbus.model.element import NOTHING
from quietbus.model.satellite import Satellite

STEPS = 3.5  # in a period at the least: 1e-5 of a line's amplitude by the eighth-order method
NOTHING_OF = 1e-12  # of the mean inertia or the mass: imbalance that is none
FAINT = 1e-3  # of order 1, by force at a lever of a metre: imbalance's order 2 that is none


class FastestLine(eqx.Module):
    """What the highest frequency at a state follows from."""

    clusters: tuple[Cluster, ...]
    orders: tuple[Float[Array, " cmg"], ...]  # [-] highest of each rotor; 0: none
    noise: Float[Array, ""]  # [rad/s] the highest frequency of noise; 0: none
    unravel: Callable[[Array], State] = eqx.field(static=True)  # a flat state

    def frequency(self, t: Float[Array, ""], y: Float[Array, " n"]) -> Float[Array, ""]:
        """The highest frequency [rad/s] at time t [s] in flat state y."""
        state, highest = self.unravel(y), [self.noise]
        for cluster, order in zip(self.clusters, self.orders, strict=True):
            own = state.own.get(cluster.name, NOTHING)
            units = cluster.turning(t, own, jnp.zeros_like(own.y))
            ripple = jnp.max(cluster.motor.order, initial=0.0)
            highest.append(jnp.max(order * jnp.abs(units.rotor.rate)))
            highest.append(jnp.max(ripple * jnp.abs(units.gimbal.rate)))
        return jnp.max(jnp.stack(highest))


def fastest_line(satellite: Satellite, unravel: Callable[[Array], State]) -> FastestLine:
    """The lines of imbalance, of order tables, of gimbal motors, and the end of noise.

    Args:
        unravel: a flat state.
    """
    clusters = satellite.clusters
    orders = tuple(jnp.maximum(_imbalance_order(c), c.disturbance.strongest()) for c in clusters)
    noise = jnp.stack([jnp.zeros(()), *(c.disturbance.highest for c in clusters)])
    return FastestLine(clusters, orders, jnp.max(noise), unravel)


def _imbalance_order(cluster: Cluster) -> Float[Array, " cmg"]:
    """The highest order (0, 1 or 2) of each rotor's imbalance."""
    largest = lambda values: jnp.max(jnp.abs(values), axis=(0, 2, 3))  # noqa: E731
    J, c = cluster.moments.J, cluster.moments.c
    mean, first, second = (largest(J[..., part]) for part in (slice(1), slice(1, 3), slice(3, 5)))
    eccentric = largest(c[..., 1:3])
    shakes = (first > NOTHING_OF * mean) | (eccentric > NOTHING_OF * cluster.units.rotor_mass)
    seen = jnp.maximum(NOTHING_OF * mean, FAINT * (first + eccentric) / 4.0)
    return jnp.where(second > seen, 2.0, jnp.where(shakes, 1.0, 0.0))


class ResolvingController(diffrax.AbstractAdaptiveStepSizeController):
    """A step size controller whose steps are ``STEPS`` or more in a period of the fastest line."""

    controller: diffrax.AbstractAdaptiveStepSizeController
    line: FastestLine
    rtol: Any  # these three as of the controller within
    atol: Any
    norm: Callable[[Any], Any]

    def __init__(
        self, controller: diffrax.AbstractAdaptiveStepSizeController, line: FastestLine
    ) -> None:
        """A controller whose steps are to be cut, and what by."""
        self.controller, self.line = controller, line
        self.rtol, self.atol, self.norm = controller.rtol, controller.atol, controller.norm

    def wrap(self, direction):
        """As diffrax asks for it; time runs forward here."""
        return eqx.tree_at(lambda c: c.controller, self, self.controller.wrap(direction))

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        """The first step."""
        first, state = self.controller.init(terms, t0, t1, y0, dt0, args, func, error_order)
        return self._within(t0, first, y0), state

    def adapt_step_size(self, t0, t1, y0, y1_candidate, args, y_error, error_order, state):
        """Whether to keep a step, and the next."""
        keep, next_t0, next_t1, *rest = self.controller.adapt_step_size(
            t0, t1, y0, y1_candidate, args, y_error, error_order, state
        )
        y = jnp.where(keep, y1_candidate, y0)
        return keep, next_t0, self._within(next_t0, next_t1, y), *rest

    def _within(self, t0, t1, y):
        omega = self.line.frequency(t0, y)
        longest = 2.0 * jnp.pi / STEPS / jnp.where(omega > 0.0, omega, 1.0)
        return jnp.where(omega > 0.0, jnp.minimum(t1, t0 + longest), t1)
