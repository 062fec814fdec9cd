"""Mass moments of all units of a cluster, as trigonometric polynomials of their angles."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from quietbus.model.rigid import Moments
from quietbus.model.unit import ControlMomentGyro


class Turning(eqx.Module):
    """How gimbals or rotors turn at one instant."""

    angle: Float[Array, " cmg"]  # [rad]
    rate: Float[Array, " cmg"]  # [rad/s]
    acceleration: Float[Array, " cmg"]  # [rad/s^2]


class ClusterMoments(eqx.Module):
    """Mass moments of the whole cluster about the origin of what carries it, its axes.

    Every moment of a unit is a polynomial of degree one (c, H of the rotor's spin) or two (J) in
    the cosine and sine of its gimbal angle and of its rotor angle. Its coefficients follow
    *exactly* from five equally spaced samples of either angle, and its time derivatives from those
    of the basis 1, cos x, sin x, cos 2x, sin 2x. This makes the cluster cheap in the integrator's
    inner loop, and it is also the expansion that the harmonic view needs.
    """

    mass: Float[Array, ""]  # [kg] of the cluster
    c: Float[Array, "3 cmg 3 3"]  # [kg m] by gimbal and rotor basis of degree 1
    H_speed: Float[Array, "3 cmg 3 3"]  # [kg m^2] H of the spin per rotor speed
    J: Float[Array, "6 cmg 5 5"]  # [kg m^2] xx, yy, zz, xy, xz, yz
    H_gimbal: Float[Array, "3 cmg 3 5"]  # [kg m^2] H per gimbal rate

    @classmethod
    def expand(cls, units: ControlMomentGyro) -> "ClusterMoments":
        """Coefficients of all units."""

        def sample(unit, gamma, phi):
            held, moving = unit.carried(gamma, phi, 0.0), unit.carried(gamma, phi, 1.0)
            return held.c, held.H, held.J[_PAIRS], moving.H - held.H

        def unit(unit):
            grid = jax.vmap(jax.vmap(sample, (None, None, 0)), (None, 0, None))
            c, H, J, H_gimbal = grid(unit, _SAMPLES, _SAMPLES)
            fit = lambda values: jnp.einsum("gi,fj,ijm->gfm", _FROM_SAMPLES, _FROM_SAMPLES, values)  # noqa: E731
            c_H = fit(jnp.concatenate([c, H], axis=2))[:3, :3]
            return c_H[..., :3], c_H[..., 3:], fit(J), fit(H_gimbal)[:3]

        mass = jnp.sum(units.gimbal_mass + units.rotor_mass)
        at_one = eqx.tree_at(lambda u: u.rotor_speed, units, jnp.ones_like(units.rotor_speed))
        return cls(mass, *(jnp.moveaxis(m, -1, 0) for m in eqx.filter_vmap(unit)(at_one)))

    def averaged(self) -> "ClusterMoments":
        """The moments averaged over the rotor angles: the imbalance's rotating part is gone.

        Only the constant of the rotor basis is left, on an axis of length one.
        """
        constant = lambda coefficients: coefficients[..., :1]  # noqa: E731
        parts = (self.c, self.H_speed, self.J, self.H_gimbal)
        return ClusterMoments(self.mass, *map(constant, parts))

    def with_imbalance(self, some: Bool[Array, " cmg"]) -> "ClusterMoments":
        """The moments with the imbalance's rotating part of some units only."""
        only = lambda k: k.at[..., 1:].multiply(some[:, None, None])  # noqa: E731
        return ClusterMoments(
            self.mass, only(self.c), only(self.H_speed), only(self.J), only(self.H_gimbal)
        )

    def at(self, gimbal: Turning, rotor: Turning) -> Moments:
        """Moments and rates as gimbals and rotors turn."""
        g = _basis(gimbal.angle)[:, :, :, None]
        f = _basis(rotor.angle)[:, :, None, : self.J.shape[-1]]
        rate, acceleration, speed, spin_up = (
            each[:, None, None]
            for each in (gimbal.rate, gimbal.acceleration, rotor.rate, rotor.acceleration)
        )
        # the products of both bases, and their first and second time derivatives
        b = g[0] * f[0]
        b1 = rate * g[1] * f[0] + speed * g[0] * f[1]
        b2 = (
            rate**2 * g[2] * f[0]
            + 2.0 * rate * speed * g[1] * f[1]
            + speed**2 * g[0] * f[2]
            + acceleration * g[1] * f[0]
            + spin_up * g[0] * f[1]
        )
        low = lambda row: row[:, :3, :3]  # noqa: E731
        c, p, p_rate = (_contract(low(row), self.c) for row in (b, b1, b2))
        J, J_rate = (_contract(row, self.J)[_SYMMETRIC] for row in (b, b1))
        H = _contract(low(speed * b), self.H_speed)
        H_rate = _contract(low(speed * b1 + spin_up * b), self.H_speed)
        H_gimbal = _contract(rate * b[:, :3], self.H_gimbal)
        H_gimbal_rate = _contract(rate * b1[:, :3] + acceleration * b[:, :3], self.H_gimbal)
        return Moments(self.mass, c, J, p, H + H_gimbal, J_rate, p_rate, H_rate + H_gimbal_rate)

    def order(self, h: int, gimbal: Turning, rotor: Turning) -> Moments:
        """Complex amplitudes of each unit's moments at order h, with a leading axis of units.

        The moments are the real part of the sum of ``amplitude * exp(i h phi)`` over units and
        orders, from h = 0 (their mean) to 2. The mass, which is constant, is left out.
        """
        one, first, second = _basis(gimbal.angle)
        rate, acceleration, speed, spin_up = (
            each[:, None]
            for each in (gimbal.rate, gimbal.acceleration, rotor.rate, rotor.acceleration)
        )
        # the time derivative of exp(i h phi) is a factor, that of the gimbal basis is its own
        spin = 1j * h * speed if h else 0.0
        spin_rate = 1j * h * spin_up if h else 0.0
        b1 = spin * one + rate * first
        b2 = (
            spin**2 * one
            + 2.0 * spin * rate * first
            + rate**2 * second
            + acceleration * first
            + spin_rate * one
        )
        times = lambda row, k: jnp.einsum("jg,mjg->jm", row[:, : k.shape[2]], k)  # noqa: E731
        c, H_speed, J, H_gimbal = (
            _amplitude(k, h) for k in (self.c, self.H_speed, self.J, self.H_gimbal)
        )
        return Moments(
            mass=jnp.zeros(len(speed)),
            c=times(one, c),
            J=times(one, J)[:, _SYMMETRIC],
            p=times(b1, c),
            H=times(speed * one, H_speed) + times(rate * one, H_gimbal),
            J_rate=times(b1, J)[:, _SYMMETRIC],
            p_rate=times(b2, c),
            H_rate=times(speed * b1 + spin_up * one, H_speed)
            + times(rate * b1 + acceleration * one, H_gimbal),
        )


ORDERS = (1, 2)  # of a rigid rotor's mass moments
_PAIRS = (np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2]))  # of a symmetric matrix
_SYMMETRIC = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
_SAMPLES = 2.0 * np.pi / 5.0 * np.arange(5)


def _basis(x: Float[Array, " cmg"]) -> Float[Array, "3 cmg 5"]:
    """1, cos x, sin x, cos 2x, sin 2x with their first and second derivatives by x."""
    zero, cos, sin = jnp.zeros_like(x), jnp.cos(x), jnp.sin(x)
    cos2, sin2 = cos * cos - sin * sin, 2.0 * sin * cos
    return jnp.stack(
        [
            jnp.stack([zero + 1.0, cos, sin, cos2, sin2], axis=1),
            jnp.stack([zero, -sin, cos, -2.0 * sin2, 2.0 * cos2], axis=1),
            jnp.stack([zero, -cos, -sin, -4.0 * cos2, -4.0 * sin2], axis=1),
        ]
    )


_FROM_SAMPLES = np.linalg.inv(
    np.stack([0 * _SAMPLES + 1, *(trig(n * _SAMPLES) for n in (1, 2) for trig in (np.cos, np.sin))])
).T


def _amplitude(coefficients, h):
    """Complex amplitude of exp(i h phi), from coefficients by the rotor basis on the last axis."""
    if h == 0:
        return coefficients[..., 0]
    if 2 * h >= coefficients.shape[-1]:
        return jnp.zeros(coefficients.shape[:-1], complex)
    return coefficients[..., 2 * h - 1] - 1j * coefficients[..., 2 * h]


def _contract(row, coefficients):
    """Sum of a row (cmg x basis x basis) against coefficients, over units and bases.

    The moments come first in ``coefficients``, so that each is a dot product along memory.
    """
    return coefficients.reshape(len(coefficients), -1) @ row.reshape(-1)
