"""What a rotor does to its gimbal beyond the imbalance of a rigid body: orders, noise, whirl.

Orders are lines at multiples h of rotor speed with amplitudes C_h Omega^2; broadband noise is
given by one-sided power spectral densities. Both act on the rotor, which passes them on through
the internal modes of its bearings (docs/theory.md, section 15).

Channels are what has one transmission each: radial force and torque that turn forward (with the
rotor) or backward, axial force and torque. Their amplitudes are complex, in the bearing's axes
(x along the spin axis, y, z): forward is (0, 1, -i), backward (0, 1, i), axial (1, 0, 0), the
disturbance being Re(amplitude exp(i angle)).
"""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from quietbus.model.moments import ORDERS, Turning
from quietbus.model.unit import ControlMomentGyro, rotor_centres_P

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
BEARINGS = ("radial", "axial", "rocking")  # modes of a rotor on its bearings
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
_SILENT: Spectra = (None, None, None, None)


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


class AbstractDisturbance(eqx.Module):
    """What the rotors of a cluster do to their gimbals beyond imbalance."""

    # multiples of rotor speed, ascending; 1 and 2, those of imbalance, among them
    orders: eqx.AbstractVar[tuple[float, ...]]

    def tables(self) -> Float[Array, "cmg order channel"]:
        """Coefficients C_h [kg m or kg m^2] of each rotor's orders."""
        raise NotImplementedError

    def bearings(self) -> tuple[Float[Array, "cmg 3"], Float[Array, "cmg 3"]]:
        """Modes of each rotor on its bearings (``BEARINGS``) at standstill.

        Inverses of the undamped frequencies [s/rad], 0 where stiff; damping over critical.
        """
        raise NotImplementedError

    def spectra(self) -> tuple[Spectra, ...]:
        """Broadband disturbance of each rotor."""
        raise NotImplementedError

    def coefficients(self, orders: tuple[float, ...]) -> Float[Array, "cmg order channel"]:
        """The tables at other orders, zero where there are none."""
        own = self.tables()
        at = np.array([orders.index(h) for h in self.orders])
        return jnp.zeros((len(own), len(orders), len(CHANNELS))).at[:, at].set(own)

    @property
    def noisy(self) -> bool:
        """Whether any rotor has a broadband disturbance."""
        return False

    @property
    def rows(self) -> np.ndarray:
        """Where the orders of imbalance, 1 and 2, are among the orders."""
        return np.array([self.orders.index(h) for h in ORDERS])

    def silent(self) -> "AbstractDisturbance":
        """Itself without noise."""
        return self

    def with_lines(self, some: Bool[Array, "cmg order"]) -> "AbstractDisturbance":
        """Itself with some lines of its rotors only."""
        return self

    def with_noise(self, noise: Noise) -> "AbstractDisturbance":
        """Itself with a realisation of its noise."""
        return self

    def strongest(self) -> Float[Array, ""] | Float[Array, " cmg"]:
        """The highest order of each rotor's tables; 0: none."""
        return jnp.zeros(())

    @property
    def highest(self) -> Float[Array, ""]:
        """The highest frequency [rad/s] of noise that a run in time has; 0: none."""
        return jnp.zeros(())

    def lines_P(
        self, units: ControlMomentGyro, gimbal: Turning, rotor: Turning
    ) -> Complex[Array, "cmg order 6"]:
        """Force and torque about the carrier's origin of each order, Re(.. exp(i h phi)).

        Along the carrier's axes.
        """
        return jnp.zeros((len(units.rotor_mass), len(self.orders), 6), complex)

    def wrench_P(
        self, units: ControlMomentGyro, t: Float[Array, ""], gimbal: Turning, rotor: Turning
    ) -> Float[Array, "6"]:
        """Sum of force and torque about the carrier's origin at time t [s], its axes."""
        return jnp.zeros(6)

    def density(self, frequency: Float[Array, " f"]) -> Float[Array, "f cmg channel"]:
        """One-sided PSD of each channel's amplitude at frequencies [Hz], at the rotor."""
        raise NotImplementedError

    def unit_inputs(
        self, units: ControlMomentGyro, speed: Float[Array, " cmg"], omega: Float[Array, ""]
    ) -> Complex[Array, "cmg channel 6"]:
        """Force and torque on the gimbals (s, t, g) by a unit amplitude exp(i omega t) of each."""
        return jnp.zeros((len(speed), len(CHANNELS), 6), complex)


class QuietRotors(AbstractDisturbance):
    """Rotors with no disturbance but their imbalance."""

    orders: tuple[float, ...] = eqx.field(static=True)
    count: int = eqx.field(static=True)  # of units

    def tables(self):
        return jnp.zeros((self.count, len(self.orders), len(CHANNELS)))

    def bearings(self):
        return jnp.zeros((self.count, len(BEARINGS))), jnp.zeros((self.count, len(BEARINGS)))

    def spectra(self):
        return (_SILENT,) * self.count

    def density(self, frequency):
        return jnp.zeros((*jnp.shape(frequency), self.count, len(CHANNELS)))


def quiet_rotors(count: int) -> QuietRotors:
    """Of so many units."""
    return QuietRotors(ORDERS, count)


class Disturbance(AbstractDisturbance):
    """Orders, internal modes and noise of all rotors of a cluster."""

    orders: tuple[float, ...] = eqx.field(static=True)
    coefficient: Float[Array, "cmg order channel"]  # [kg m or kg m^2] C_h
    phase: Float[Array, "cmg order channel"]  # [rad] against order times rotor angle
    # modes of each rotor on its bearings: radial, axial, rocking at standstill
    period: Float[Array, "cmg 3"]  # [s/rad] inverse of the undamped frequency; 0: stiff
    damping: Float[Array, "cmg 3"]  # [-] over critical damping
    broadband: tuple[Spectra, ...]  # of each rotor
    noise: Noise | None = None  # realisation of ``broadband`` for the direct solver

    @property
    def order(self) -> Float[Array, " order"]:
        """Multiples of rotor speed."""
        return jnp.array(self.orders, dtype=float)

    @property
    def noisy(self):
        return any(spectrum is not None for spectra in self.broadband for spectrum in spectra)

    def tables(self):
        return self.coefficient

    def bearings(self):
        return self.period, self.damping

    def spectra(self):
        return self.broadband

    def silent(self):
        return replace(self, broadband=(_SILENT,) * len(self.broadband), noise=None)

    def with_noise(self, noise):
        return replace(self, noise=noise)

    def with_lines(self, some):
        return replace(self, coefficient=jnp.where(some[..., None], self.coefficient, 0.0))

    def strongest(self):
        there = jnp.any(self.coefficient > 0.0, axis=-1)
        return jnp.max(jnp.where(there, self.order, 0.0), axis=1)

    @property
    def highest(self):
        if self.noise is None:
            return jnp.zeros(())
        tables = [s for each in self.broadband for s in each if s is not None]
        return 2.0 * jnp.pi * jnp.max(jnp.stack([jnp.max(s.frequency) for s in tables]))

    def lines_P(self, units, gimbal, rotor):
        return on_carrier(units, gimbal.angle, self.amplitudes(units, rotor.rate))

    def wrench_P(self, units, t, gimbal, rotor):
        each = self.wrench(units, t, rotor.angle, rotor.rate)
        return jnp.sum(on_carrier(units, gimbal.angle, each[:, None]), axis=(0, 1))

    def transmission(
        self,
        units: ControlMomentGyro,
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
        spin = units.I_RRcm_R[:, 0, 0]
        across = 0.5 * (units.I_RRcm_R[:, 1, 1] + units.I_RRcm_R[:, 2, 2])
        split = _TILT * (spin * speed / across)[:, None] * period  # [-]
        damper = 2.0 * damping * s
        passed = (1.0 + damper) / (1.0 + damper + s**2 + split * omega[..., None] * period)
        return jnp.concatenate([passed, jnp.ones_like(passed[..., :1])], axis=-1)

    def amplitudes(
        self, units: ControlMomentGyro, speed: Float[Array, " cmg"]
    ) -> Complex[Array, "cmg order 6"]:
        """Steady force [N] and torque [N m] of each order, Re(amplitude exp(i h phi)).

        On the gimbal at the rotor centre, along (s, t, g).
        """
        passed = jnp.moveaxis(self.transmission(units, speed, self.order[:, None] * speed), 0, 1)
        size = self.coefficient * jnp.exp(1j * self.phase) * speed[:, None, None] ** 2
        return _along_gimbal(units, (size * passed) @ DIRECTIONS)

    def wrench(
        self,
        units: ControlMomentGyro,
        t: Float[Array, ""],
        phi: Float[Array, " cmg"],
        speed: Float[Array, " cmg"],
    ) -> Float[Array, "cmg 6"]:
        """Force [N] and torque [N m] at the rotor centres at rotor angles phi [rad], (s, t, g).

        Where speeds [rad/s] change, the bearings' modes answer as if they did so slowly.
        """
        turned = jnp.exp(1j * self.order * phi[:, None])
        lines = self.amplitudes(units, speed)
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

    def unit_inputs(self, units, speed, omega):
        passed = self.transmission(units, speed, omega * jnp.ones_like(speed))
        return _along_gimbal(units, passed[..., None] * DIRECTIONS)


def _along_gimbal(units, wrenches):
    """(cmg, n, 6) from the bearing's axes to the gimbal's."""
    turn = jnp.kron(jnp.eye(2)[None], units.R_GF)
    return jnp.einsum("jab,jnb->jna", turn, wrenches)


def on_carrier(units: ControlMomentGyro, gamma: Float[Array, " cmg"], wrench: Array) -> Array:
    """Force and torque about the carrier's origin, its axes (cmg, n, 6), of ones on the gimbals.

    Args:
        gamma: gimbal angles [rad].
        wrench: (cmg, n, 6) force and torque at the rotor centres along (s, t, g).
    """
    R = eqx.filter_vmap(ControlMomentGyro.R_PG)(units, gamma)
    r = rotor_centres_P(units, gamma)
    force = jnp.einsum("jab,jnb->jna", R, wrench[..., :3])
    torque = jnp.einsum("jab,jnb->jna", R, wrench[..., 3:])
    return jnp.concatenate([force, torque + jnp.cross(r[:, None], force)], axis=-1)
