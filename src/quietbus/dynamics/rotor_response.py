"""Steady response to each order of each rotor, and what the outputs tell of it."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from quietbus.dynamics.equations import rates_of
from quietbus.dynamics.vibration import Vibration
from quietbus.dynamics.views import View, linear_outputs
from quietbus.model.alike import of_each
from quietbus.model.moments import ORDERS
from quietbus.model.satellite import Satellite


def orders_of(satellite: Satellite) -> tuple[float, ...]:
    """Multiples of rotor speed at which rotors shake: of imbalance, and of tables; ascending."""
    each = {h for cluster in satellite.clusters for h in cluster.disturbance.orders}
    return tuple(sorted({*ORDERS, *each}))


def rotor_speeds(satellite: Satellite, small: Vibration) -> Float[Array, " cmg"]:
    """Speeds of all rotors [rad/s]."""
    now, rates = small.slow.now, small.slow.rates
    each = [
        c.turning(now.t, now.around(c).own, rates_of(rates, c).y).rotor.rate
        for c in satellite.clusters
    ]
    return jnp.concatenate(each)


def rotor_forces(satellite: Satellite, small: Vibration) -> Complex[Array, "order cmg n"]:
    """Amplitudes of the forces on all speeds at each order of each rotor.

    Args:
        satellite: with its imbalance and disturbance, not averaged.
    """
    slow, orders = small.slow, orders_of(satellite)
    layout, parts = slow.now.layout, []
    lines_of = of_each(
        lambda cluster, around, rates, u_rate: cluster.lines(around, rates, u_rate),
        satellite.clusters,
        map(slow.now.around, satellite.clusters),
        (rates_of(slow.rates, c) for c in satellite.clusters),
        (layout.gathered(c, slow.u_rate) for c in satellite.clusters),
    )
    for cluster, own in zip(satellite.clusters, lines_of, strict=True):
        at = jnp.array([orders.index(h) for h in cluster.disturbance.orders])
        lines = jnp.zeros((len(orders), cluster.count, 6), complex).at[at].set(own)
        columns = layout.vector([(cluster, lines.reshape(-1, 6).T)])
        parts.append(columns.T.reshape(len(orders), cluster.count, layout.size))
    return jnp.concatenate(parts, axis=1)


def rotor_response(
    satellite: Satellite, small: Vibration, one_speed: bool = False
) -> Complex[Array, "cmg order m"]:
    """xi of the free bodies in the steady response to each order of each rotor.

    The deviation is Re(xi exp(i h phi)).

    Args:
        satellite: with its imbalance and disturbance, not averaged.
        one_speed: all rotors turn at one speed, so that one elimination serves them all.
    """

    def respond(h, speed, force):
        s = 1j * h * speed
        standing = s == 0.0  # a rotor that stands still shakes nothing
        return jnp.where(standing, 0.0, small.respond(jnp.where(standing, 1j, s), force))

    forces, speeds = rotor_forces(satellite, small), rotor_speeds(satellite, small)
    h = jnp.array(orders_of(satellite), dtype=float)
    if one_speed:
        columns = jnp.swapaxes(forces, 1, 2)
        xi = jax.vmap(respond, (0, None, 0))(h, speeds[0], columns)
        return jnp.moveaxis(xi, 2, 0)
    each = jax.vmap(jax.vmap(respond, (None, 0, 0)), (0, None, 0))
    return jnp.swapaxes(each(h, speeds, forces[..., None])[..., 0], 0, 1)


def rotor_outputs(
    satellite: Satellite, small: Vibration, view: View, one_speed: bool = False
) -> tuple[dict[str, Complex[Array, "cmg order ..."]], Complex[Array, "cmg order m"]]:
    """Amplitudes of the outputs to each order of each rotor, and the response that they are of."""
    xi = rotor_response(satellite, small, one_speed)
    s = 1j * rotor_speeds(satellite, small)[:, None] * jnp.array(orders_of(satellite))
    each = jax.vmap(jax.vmap(lambda s, x: linear_outputs(satellite, small, s, x, view)))
    return each(s, xi), xi
