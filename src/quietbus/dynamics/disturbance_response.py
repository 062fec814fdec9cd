"""Small vibration by noise of the rotors and by ripple of the gimbal motors, about a slow motion.

The same equations as for the rotors' orders (``dynamics.vibration``), with other forces and at
other frequencies (docs/theory.md, section 15).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from quietbus.dynamics.vibration import Vibration, View, linear_outputs, on_bus
from quietbus.model.disturbance import on_plate
from quietbus.model.satellite import Satellite
from quietbus.spatial.vector import solve_small

CROSS = "line_of_sight_cospectrum"


def noise_response(
    satellite: Satellite, small: Vibration, frequency: Float[Array, ""], view: View
) -> dict[str, Float[Array, "cmg ..."]]:
    """One-sided PSD of the outputs at one frequency [Hz], by rotor; the rotors are independent.

    Under ``CROSS`` what two of a line of sight's components have in common: the real part of their
    cross-spectrum, of the pairs yz, zx and xy.
    """
    disturbance, cluster = satellite.disturbance, satellite.cluster
    assert disturbance is not None
    omega = 2.0 * jnp.pi * frequency
    inputs = disturbance.unit_inputs(cluster, omega)
    inputs = on_bus(small.slow, on_plate(cluster, small.slow.gimbal[0], inputs))
    n, channels = inputs.shape[:2]
    forces = jnp.pad(inputs, ((0, 0), (0, 0), (0, 6))).reshape(n * channels, 12).T
    xi = small.respond(1j * omega, forces).T
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


def ripple_response(
    satellite: Satellite, small: Vibration, view: View
) -> dict[str, Complex[Array, "cmg line ..."]]:
    """Amplitudes of the outputs for each line n of each gimbal motor, Re(amplitude exp(i n gamma)).

    The gimbal's own motion is what its servo and the attitude control leave of it.
    """
    motor = satellite.motor
    assert motor is not None
    rate = small.slow.state.gimbal_rate
    pushed = motor.amplitudes(satellite.cluster, rate)
    s = 1j * motor.order * rate[:, None]

    def one(s, pushed, unit):
        standing = s == 0.0  # a gimbal at rest is not moved
        s = jnp.where(standing, 1j, s)
        xi = _by_gimbals(small, s, pushed * unit)
        xi = jnp.where(standing, 0.0, xi)
        return linear_outputs(satellite, small, s, xi, view)

    over_lines = jax.vmap(one, (0, 0, None))
    return jax.vmap(over_lines)(s, pushed, jnp.eye(len(rate)))


def _by_gimbals(small, s, acceleration):
    """xi (12,) for gimbal accelerations (cmg,) exp(st) beside those that the control asks for."""
    control, T = small.control, small.projection
    if control is None:  # the gimbals do not move
        return jnp.zeros(12, complex)
    n = len(acceleration)
    given = jnp.zeros((n + 3, 1), complex).at[:n, 0].set(acceleration)
    angle = control.memory(s, given)[:n, 0]
    force = jnp.einsum("kia,ka->i", control.reaction, jnp.stack([angle, s * angle, s**2 * angle]))
    xi = solve_small(small.stiffness(s), force[:, None])[:, 0]
    return xi if T is None else T @ xi


@eqx.filter_jit
def noise_psd(satellite, small, frequency, view):
    """``noise_response`` at instants (leading axis of ``small``) and frequencies (second)."""
    at = lambda small: jax.vmap(lambda f: noise_response(satellite, small, f, view))(frequency)  # noqa: E731
    return jax.lax.map(at, small)


@eqx.filter_jit
def ripple_lines(satellite, small, view):
    """``ripple_response`` at instants (leading axis of ``small``)."""
    return jax.vmap(lambda small: ripple_response(satellite, small, view))(small)
