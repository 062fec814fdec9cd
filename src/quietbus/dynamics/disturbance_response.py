"""Small vibration by noise of the rotors and by ripple of the gimbal motors, about a slow motion.

The same equations as for the rotors' orders (``dynamics.rotor_response``), with other forces and at
other frequencies (docs/theory.md, section 15).
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from quietbus.dynamics.equations import rates_of
from quietbus.dynamics.vibration import Vibration
from quietbus.dynamics.views import View, linear_outputs, linear_outputs_with
from quietbus.model.cluster import Cluster, on_axes
from quietbus.model.disturbance import on_carrier
from quietbus.model.satellite import Satellite
from quietbus.programs import compiled
from quietbus.spatial.vector import solve_small

CROSS = "line_of_sight_cospectrum"


def noise_response(
    satellite: Satellite, small: Vibration, frequency: Float[Array, ""], view: View
) -> dict[str, Float[Array, "cmg ..."]]:
    """One-sided PSD of the outputs at one frequency [Hz], by rotor; the rotors are independent.

    Under ``CROSS`` what two of a line of sight's components have in common: the real part of their
    cross-spectrum, of the pairs yz, zx and xy.
    """
    parts = [_of_cluster(c, satellite, small, frequency, view) for c in satellite.clusters]
    return {name: jnp.concatenate([part[name] for part in parts]) for name in parts[0]}


def _of_cluster(cluster: Cluster, satellite, small, frequency, view):
    disturbance, n = cluster.disturbance, cluster.count
    omega = 2.0 * jnp.pi * frequency
    units = _turning(cluster, small)
    inputs = disturbance.unit_inputs(cluster.units, units.rotor.rate, omega)
    inputs = on_carrier(cluster.units, units.gimbal.angle, inputs)
    channels = inputs.shape[1]
    layout = small.slow.now.layout
    R_AP = small.slow.now.around(cluster).hosts[0].R_AX
    columns = on_axes(R_AP, inputs).reshape(n * channels, 6).T
    xi = small.respond(1j * omega, layout.vector([(cluster, columns)])).T
    seen = jax.vmap(lambda xi: linear_outputs(satellite, small, 1j * omega, xi, view))(xi)
    density = disturbance.density(frequency).reshape(n, channels)

    def psd(values):
        each = values.reshape(n, channels, *values.shape[1:])
        return jnp.einsum("jc,jc...->j...", density, jnp.abs(each) ** 2)

    image = seen["line_of_sight"]
    first, second = image[..., jnp.array([1, 2, 0])], image[..., jnp.array([2, 0, 1])]
    common = (first * second.conj()).real
    common = common.reshape(n, channels, *common.shape[1:])
    cross = jnp.einsum("jc,jc...->j...", density, common)
    return {name: psd(values) for name, values in seen.items()} | {CROSS: cross}


def ripple_orders(satellite: Satellite) -> Float[Array, " line"]:
    """Lines in a turn of the gimbals, of the motors of all clusters."""
    return jnp.concatenate([cluster.motor.order for cluster in satellite.clusters])


def ripple_response(
    satellite: Satellite, small: Vibration, view: View
) -> dict[str, Complex[Array, "cmg line ..."]]:
    """Amplitudes of the outputs for each line n of each gimbal motor, Re(amplitude exp(i n gamma)).

    The gimbal's own motion is what its servo and the attitude control leave of it. Each cluster
    has its own lines; the others' units have none there.
    """
    rows = []
    for cluster in satellite.clusters:
        lines = [
            _lines(c, satellite, small, view)
            if c is cluster
            else _no_lines(cluster, c, satellite, small, view)
            for c in satellite.clusters
        ]
        rows.append({name: jnp.concatenate([r[name] for r in lines], axis=1) for name in lines[0]})
    return {name: jnp.concatenate([row[name] for row in rows]) for name in rows[0]}


def _lines(cluster: Cluster, satellite, small, view):
    units = _turning(cluster, small)
    rate = units.gimbal.rate
    pushed = cluster.motor.amplitudes(cluster.units, rate)
    s = 1j * cluster.motor.order * rate[:, None]

    def one(s, pushed, unit):
        standing = s == 0.0  # a gimbal at rest is not moved
        s = jnp.where(standing, 1j, s)
        xi, kept = _by_gimbals(cluster, small, s, pushed * unit)
        xi = jnp.where(standing, 0.0, xi)
        moved = jnp.where(standing, 0.0, kept)
        return linear_outputs_with(satellite, small, s, xi, view, lambda: moved)

    over_lines = jax.vmap(one, (0, 0, None))
    return jax.vmap(over_lines)(s, pushed, jnp.eye(cluster.count))


def _no_lines(cluster: Cluster, other: Cluster, satellite, small, view):
    """Of the units of a cluster, the lines of another cluster's motors: none."""
    xi = jnp.zeros(small.free.size, complex)
    nothing = linear_outputs(satellite, small, 1j * jnp.ones(()), xi, view)
    shape = (cluster.count, len(other.motor.order))
    return {name: jnp.zeros((*shape, *value.shape), complex) for name, value in nothing.items()}


def _by_gimbals(cluster, small, s, acceleration):
    """xi, and drives and memories, for gimbal accelerations (cmg,) exp(st) beside the control's."""
    memory = small.memory
    m = memory.layout.driven + memory.layout.kept
    rows = memory.of(cluster.name, jnp.arange(m))[: len(acceleration)]
    if not len(rows):  # the gimbals do not move
        return jnp.zeros(small.free.size, complex), jnp.zeros(m, complex)
    given = jnp.zeros((m, 1), complex).at[rows, 0].set(acceleration)
    own = memory.answer(s, given)
    xi = solve_small(small.stiffness(s), memory.force(s, own))[:, 0]
    return xi, own[:, 0] + small.remembered(s, xi)


def _turning(cluster, small):
    now = small.slow.now
    return cluster.turning(now.t, now.around(cluster).own, rates_of(small.slow.rates, cluster).y)


@compiled
def noise_psd(satellite, small, frequency, view):
    """``noise_response`` at instants (leading axis of ``small``) and frequencies (second)."""
    at = lambda small: jax.vmap(lambda f: noise_response(satellite, small, f, view))(frequency)  # noqa: E731
    return jax.lax.map(at, small)


@compiled
def ripple_lines(satellite, small, view):
    """``ripple_response`` at instants (leading axis of ``small``)."""
    return jax.vmap(lambda small: ripple_response(satellite, small, view))(small)
