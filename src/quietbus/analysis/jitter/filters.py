"""Six decoupled second-order low-pass filters in place of the isolator (finite-element practice).

Jitter budgets made with finite elements often have no isolator in the structure: the CMG's six
disturbance components go through one filter each and act on the structure as if the CMG were
bolted to it (Gary et al. 1998, Meza et al. 2005, as cited by Zhang and Xu 2012). Each filter is
the single-axis isolator of Zhang and Xu's eq. 1 for one degree of freedom of the platform on a
held bus, about the platform's mass centre and along its axes (docs/theory.md, section 14.9).
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from quietbus.analysis.jitter.lines import at_rest, for_designs
from quietbus.dynamics.coefficients import SlowMotion, coefficients
from quietbus.dynamics.rotor_response import orders_of, rotor_forces, rotor_speeds
from quietbus.dynamics.vibration import Vibration, vibration
from quietbus.model.satellite import BUS, Satellite
from quietbus.model.variants import with_mount
from quietbus.programs import compiled, compiled_for_few_runs


class HeldPlatform(eqx.Module):
    """The platform on massless legs over a held bus: ``(s^2 M + s (C + G) + K) xi = wrench``.

    Coordinates are displacement and rotation of the platform's mass centre along plate axes.
    """

    M: Float[Array, "6 6"]
    C: Float[Array, "6 6"]  # of the legs
    G: Float[Array, "6 6"]  # gyroscopic, of the rotors
    K: Float[Array, "6 6"]
    by_center: Float[Array, "6 6"]  # (r_P, theta_P) along bus axes by these coordinates

    @property
    def frequency_hz(self) -> Float[Array, "6"]:
        """Undamped frequency of each filter."""
        return jnp.sqrt(jnp.diag(self.K) / jnp.diag(self.M)) / (2.0 * jnp.pi)

    @property
    def damping_ratio(self) -> Float[Array, "6"]:
        """Damping of each filter, of critical."""
        return 0.5 * jnp.diag(self.C) / jnp.sqrt(jnp.diag(self.K) * jnp.diag(self.M))

    def filters(self, s: Complex[Array, ""], damper: bool = True) -> Complex[Array, "6 6"]:
        """Wrench passed on by wrench: six filters ``(c s + k) / (m s^2 + c s + k)``, uncoupled.

        Args:
            damper: without it the numerator is k: what the damper passes on is left out.
        """
        m, c, k = jnp.diag(self.M), jnp.diag(self.C), jnp.diag(self.K)
        return jnp.diag((c * s * damper + k) / (m * s**2 + c * s + k))

    def coupled(self, s: Complex[Array, ""]) -> Complex[Array, "6 6"]:
        """Wrench passed on by wrench: one filter of six inputs and outputs, whole matrices."""
        Z = s**2 * self.M + s * (self.C + self.G) + self.K
        return (s * self.C + self.K) @ jnp.linalg.inv(Z)

    def at_plate(self, passed: Complex[Array, "6 6"]) -> Complex[Array, "6 6"]:
        """The same by and of wrenches about the plate's origin, along bus axes."""
        S = self.by_center
        return jnp.linalg.inv(S).T @ passed @ S.T


def held_platform(averaged: Satellite, slow: SlowMotion) -> HeldPlatform:
    """The first platform of a satellite at rest."""
    name = averaged.mounts[0].body
    legs = coefficients([e for e in averaged.hexapods if e.hosts[0] == name], slow)
    own = coefficients([e for e in averaged.elements if e.hosts == (name,)], slow)
    sum_of = lambda parts, kind: sum(getattr(part, kind)[:6, :6] for part in parts)  # noqa: E731
    M = sum_of(own, "M")
    # the first moment of mass about P, from the mass matrix on (v_P, w_P)
    m, mc = M[0, 0], M[3:6, :3]
    R = slow.now.motions[name].R_AX
    c_skew = R.T @ mc @ R / m
    zero = jnp.zeros((3, 3))
    S = jnp.block([[R, R @ c_skew], [zero, R]])
    on_plate = lambda matrix: S.T @ matrix @ S  # noqa: E731
    return HeldPlatform(
        on_plate(M),
        on_plate(-sum_of(legs, "by_speed")),
        on_plate(-sum_of(own, "by_speed")),
        on_plate(-sum_of(legs, "by_pose")),
        S,
    )


class FilteredJitter(eqx.Module):
    """Amplitudes of the bus rate [rad/s] with the isolator and with what stands in for it."""

    full: Complex[Array, "*design cmg order 3"]  # the isolated satellite
    coupled: Complex[Array, "*design cmg order 3"]  # one filter of six by six on the rigid mount
    filters: Complex[Array, "*design cmg order 3"]  # six filters on the rigid mount
    springs: Complex[Array, "*design cmg order 3"]  # the same without dampers in the numerators
    rigid: Complex[Array, "*design cmg order 3"]  # no isolator

    def error(self, kind: str) -> Float[np.ndarray, "*design 3"]:
        """Relative error of an approximation per axis, over all rotors and orders.

        The root sum of squares of the complex differences over that of the amplitudes.
        """
        size = lambda values: np.sqrt(np.sum(np.abs(values) ** 2, axis=(-3, -2)))  # noqa: E731
        full = np.asarray(self.full)
        return size(np.asarray(getattr(self, kind)) - full) / size(full)

    def ratio(self, kind: str) -> Float[np.ndarray, "*design 3"]:
        """Size by an approximation over that of the full model, RSS over rotors and orders."""
        size = lambda values: np.sqrt(np.sum(np.abs(values) ** 2, axis=(-3, -2)))  # noqa: E731
        return size(np.asarray(getattr(self, kind))) / size(np.asarray(self.full))


def filtered_jitter(satellite: Satellite, gimbal_angle: Float[Array, " cmg"]) -> FilteredJitter:
    """Jitter at rest in the nominal pose, with the full isolator and with filters for it.

    Args:
        satellite: of either mount; its control acts in all models. A satellite that cannot rest
            (preloaded struts) gives numbers without meaning: see ``analysis.jitter.rest_error``.
        gimbal_angle: (cmg,) [rad].
    """
    full, averaged, slow = at_rest(with_mount(satellite, False), gimbal_angle)
    _, welded, held = at_rest(with_mount(satellite, True), gimbal_angle)
    platform = held_platform(averaged, slow)
    isolated, rigid = vibration(averaged, slow), vibration(welded, held)
    layout = slow.now.layout
    rows = layout.rows(averaged.mounts[0].body)
    forces = rotor_forces(full, isolated)

    def line(s: Complex[Array, ""], force: Complex[Array, " n"]) -> FilteredJitter:
        standing = s == 0.0  # a rotor that stands still shakes nothing
        s = jnp.where(standing, 1j, s)

        def rate(small: Vibration, wrench: Complex[Array, "6"]) -> Complex[Array, "3"]:
            on_all = jnp.zeros((layout.size, 1), complex).at[rows, 0].set(wrench)
            xi = small.respond(s, on_all)[small.free.rows(BUS), 0]
            return jnp.where(standing, 0.0, s * xi[3:])

        def stand_in(passed: Complex[Array, "6 6"]) -> Complex[Array, "3"]:
            return rate(rigid, platform.at_plate(passed) @ force[rows])

        return FilteredJitter(
            full=rate(isolated, force[rows]),
            coupled=stand_in(platform.coupled(s)),
            filters=stand_in(platform.filters(s)),
            springs=stand_in(platform.filters(s, damper=False)),
            rigid=rate(rigid, force[rows]),
        )

    s = 1j * rotor_speeds(full, isolated)[:, None] * jnp.array(orders_of(full))
    return jax.vmap(jax.vmap(line))(s, jnp.swapaxes(forces, 0, 1))


def filtered_jitter_of_designs(
    designs: Sequence[Satellite], gimbal_angle: np.ndarray
) -> FilteredJitter:
    """``filtered_jitter`` of satellites alike but for their numbers, in one compiled program.

    Args:
        designs: with the same number of legs and CMGs, control and steering law.
        gimbal_angle: (cmg,) [rad], or (design, cmg) for each its own.
    """
    angles = np.broadcast_to(gimbal_angle, (len(designs), *gimbal_angle.shape[-1:]))
    return for_designs(_compiled, designs, angles)


@compiled
def _compiled(satellites, angles):
    return eqx.filter_vmap(filtered_jitter)(satellites, jnp.asarray(angles))


def platform_at_rest(satellite: Satellite, gimbal_angle: np.ndarray) -> HeldPlatform:
    """The platform of a satellite at rest, bus held; gimbal_angle (cmg,) [rad]."""
    return _compiled_platform(satellite, jnp.asarray(gimbal_angle))


@compiled_for_few_runs
def _compiled_platform(satellite, gimbal_angle):
    _, averaged, slow = at_rest(with_mount(satellite, False), gimbal_angle)
    return held_platform(averaged, slow)
