"""What a rotor does to its gimbal beyond the imbalance of a rigid body: orders, noise, whirl.

Orders are lines at multiples h of rotor speed with amplitudes C_h Omega^2; broadband noise is
given by one-sided power spectral densities. Both act on the rotor, which passes them on through
the internal modes of its bearings (docs/theory.md, section 15).

Channels are what has one transmission each: radial force and torque that turn forward (with the
rotor) or backward, axial force and torque. Their amplitudes are complex, in the bearing's axes
(x along the spin axis, y, z): forward is (0, 1, -i), backward (0, 1, i), axial (1, 0, 0), the
disturbance being Re(amplitude exp(i angle)).
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from quietbus.model.cmg import ORDERS, ControlMomentGyro

CHANNELS = (
    "radial force forward",
    "radial force backward",
    "axial force",
    "radial torque forward",
    "radial torque backward",
    "axial torque",
)
# force and torque along (x, y, z) of the bearing's axes, by channel
_TURNS = np.array([[0.0, 1.0, -1.0j], [0.0, 1.0, 1.0j], [1.0, 0.0, 0.0]])
DIRECTIONS = np.kron(np.eye(2), _TURNS)  # (channel, 6)
_MODE = np.array([0, 0, 1, 2, 2])  # radial, axial, rocking of each channel; the last has none
_TILT = np.array([0.0, 0.0, 0.0, 1.0, -1.0])  # sense of the gyroscopic torque


class Spectrum(eqx.Module):
    """A one-sided power spectral density, zero outside its table."""

    frequency: Float[Array, " point"]  # [Hz] ascending
    psd: Float[Array, " point"]  # [N^2/Hz or N^2 m^2/Hz]
    logarithmic: bool = eqx.field(static=True)  # log of psd straight over log of frequency

    def density(self, frequency: Float[Array, " f"]) -> Float[Array, " f"]:
        """PSD at frequencies [Hz]."""
        x, y, at = self.frequency, self.psd, jnp.asarray(frequency)
        if self.logarithmic:
            at = jnp.clip(at, x[0], x[-1])
            values = jnp.exp(jnp.interp(jnp.log(at), jnp.log(x), jnp.log(y)))
        else:
            values = jnp.interp(at, x, y)
        return jnp.where((frequency >= x[0]) & (frequency <= x[-1]), values, 0.0)


# of one rotor, by radial force, axial force, radial torque, axial torque
Spectra = tuple[Spectrum | None, Spectrum | None, Spectrum | None, Spectrum | None]
_SPECTRUM = (0, 0, 1, 2, 2, 3)  # of each channel


class Noise(eqx.Module):
    """One realisation of the broadband disturbance, as the gimbals feel it, over time.

    A periodic spline of degree five on equally spaced knots: four times differentiable, so that
    the integrator does not feel its knots.
    """

    rate: Float[Array, ""]  # [Hz] of the knots
    coefficients: Float[Array, "knot cmg 6"]  # force [N], torque [N m] along s, t, g

    def at(self, t: Float[Array, ""]) -> Float[Array, "cmg 6"]:
        """Force and torque at the rotor centres at time t [s]."""
        x = t * self.rate
        knot = jnp.floor(x)
        u = x - knot
        powers = jnp.stack([u**k for k in range(6)])
        weights = jnp.asarray(SPLINE) @ powers
        n = len(self.coefficients)
        first = (knot.astype(int) - 2) % n
        window = self.coefficients[(first + jnp.arange(6)) % n]
        return jnp.einsum("k,kjc->jc", weights, window)


# uniform B-spline of degree five: value at knot k + u by powers of u, of coefficients k-2 to k+3
SPLINE = (
    np.array(
        [
            [1, -5, 10, -10, 5, -1],
            [26, -50, 20, 20, -20, 5],
            [66, 0, -60, 0, 30, -10],
            [26, 50, 20, -20, -20, 10],
            [1, 5, 10, 10, 5, -5],
            [0, 0, 0, 0, 0, 1],
        ]
    )
    / 120.0
)


class Disturbance(eqx.Module):
    """Orders, internal modes and noise of all rotors of a cluster."""

    order: Float[Array, " order"]  # [-] ascending; 1 and 2, those of imbalance, among them
    imbalance_at: tuple[int, int] = eqx.field(static=True)  # where orders 1 and 2 are in it
    coefficient: Float[Array, "cmg order channel"]  # [kg m or kg m^2] C_h
    phase: Float[Array, "cmg order channel"]  # [rad] against order times rotor angle
    # modes of each rotor on its bearings: radial, axial, rocking at standstill
    period: Float[Array, "cmg 3"]  # [s/rad] inverse of the undamped frequency; 0: stiff
    damping: Float[Array, "cmg 3"]  # [-] over critical damping
    broadband: tuple[Spectra, ...]  # of each rotor
    noise: Noise | None = None  # realisation of ``broadband`` for the direct solver

    @property
    def noisy(self) -> bool:
        """Whether any rotor has a broadband disturbance."""
        return any(spectrum is not None for spectra in self.broadband for spectrum in spectra)

    def transmission(
        self,
        cluster: ControlMomentGyro,
        speed: Float[Array, " cmg"],
        omega: Float[Array, "*n cmg"],
    ) -> Complex[Array, "*n cmg channel"]:
        """Share of a disturbance exp(i omega t) at the rotor that reaches the gimbal.

        Translation: (k + i omega c) / (k - m omega^2 + i omega c). Rocking: the denominator has
        also +- I_s Omega omega, for tilt that turns with the rotor (forward) and against it.

        Args:
            speed: of the rotors [rad/s].
            omega: [rad/s], of either sign.
        """
        period, damping = self.period[:, _MODE], self.damping[:, _MODE]
        s = 1j * omega[..., None] * period
        spin = cluster.I_RRcm_R[:, 0, 0]
        across = 0.5 * (cluster.I_RRcm_R[:, 1, 1] + cluster.I_RRcm_R[:, 2, 2])
        split = _TILT * (spin * speed / across)[:, None] * period  # [-]
        damper = 2.0 * damping * s
        passed = (1.0 + damper) / (1.0 + damper + s**2 + split * omega[..., None] * period)
        return jnp.concatenate([passed, jnp.ones_like(passed[..., :1])], axis=-1)

    def amplitudes(
        self, cluster: ControlMomentGyro, speed: Float[Array, " cmg"]
    ) -> Complex[Array, "cmg order 6"]:
        """Steady force [N] and torque [N m] of each order, Re(amplitude exp(i h phi)).

        On the gimbal at the rotor centre, along (s, t, g).
        """
        passed = jnp.moveaxis(self.transmission(cluster, speed, self.order[:, None] * speed), 0, 1)
        size = self.coefficient * jnp.exp(1j * self.phase) * speed[:, None, None] ** 2
        return _along_gimbal(cluster, (size * passed) @ DIRECTIONS)

    def wrench(
        self,
        cluster: ControlMomentGyro,
        t: Float[Array, ""],
        phi: Float[Array, " cmg"],
        speed: Float[Array, " cmg"],
    ) -> Float[Array, "cmg 6"]:
        """Force [N] and torque [N m] at the rotor centres at rotor angles phi [rad], (s, t, g).

        Where speeds [rad/s] change, the bearings' modes answer as if they did so slowly.
        """
        turned = jnp.exp(1j * self.order * phi[:, None])
        lines = self.amplitudes(cluster, speed)
        total = jnp.sum((lines * turned[..., None]).real, axis=1)
        if self.noise is not None:
            return total + self.noise.at(t)
        if self.noisy:
            raise ValueError(
                "a broadband disturbance needs a realisation in time (solve.noise.with_noise)"
            )
        return total

    def density(self, frequency: Float[Array, " f"]) -> Float[Array, "f cmg channel"]:
        """One-sided PSD of each channel's amplitude at frequencies [Hz], at the rotor.

        A noise that acts along y and z alike and independently, each with the PSD S, consists of
        a forward and a backward part, independent, whose amplitudes have the PSD S / 2.
        """
        nothing = jnp.zeros(jnp.shape(frequency))
        share = (0.5, 0.5, 1.0, 0.5, 0.5, 1.0)

        def of(spectra, channel):
            spectrum = spectra[_SPECTRUM[channel]]
            return nothing if spectrum is None else share[channel] * spectrum.density(frequency)

        return jnp.stack(
            [
                jnp.stack([of(spectra, c) for c in range(len(CHANNELS))], axis=-1)
                for spectra in self.broadband
            ],
            axis=-2,
        )

    def unit_inputs(
        self, cluster: ControlMomentGyro, omega: Float[Array, ""]
    ) -> Complex[Array, "cmg channel 6"]:
        """Force and torque on the gimbals (s, t, g) by a unit amplitude exp(i omega t) of each."""
        speed = cluster.rotor_speed
        passed = self.transmission(cluster, speed, omega * jnp.ones_like(speed))
        return _along_gimbal(cluster, passed[..., None] * DIRECTIONS)


def _along_gimbal(cluster, wrenches):
    """(cmg, n, 6) from the bearing's axes to the gimbal's."""
    turn = jnp.kron(jnp.eye(2)[None], cluster.R_GF)
    return jnp.einsum("jab,jnb->jna", turn, wrenches)


def on_plate(cluster: ControlMomentGyro, gamma: Float[Array, " cmg"], wrench: Array) -> Array:
    """Force and torque about the plate's origin, plate axes (cmg, n, 6), of ones on the gimbals.

    Args:
        gamma: gimbal angles [rad].
        wrench: (cmg, n, 6) force and torque at the rotor centres along (s, t, g).
    """
    R = eqx.filter_vmap(ControlMomentGyro.R_PG)(cluster, gamma)
    r = cluster.p_PC_P + jnp.einsum("jab,jb->ja", R, cluster.p_CR_G)
    force = jnp.einsum("jab,jnb->jna", R, wrench[..., :3])
    torque = jnp.einsum("jab,jnb->jna", R, wrench[..., 3:])
    return jnp.concatenate([force, torque + jnp.cross(r[:, None], force)], axis=-1)


def orders_of(disturbance: Disturbance | None) -> Float[Array, " order"]:
    """Multiples of rotor speed at which a cluster shakes: of imbalance, and of tables."""
    return jnp.array(ORDERS) if disturbance is None else disturbance.order
