"""A satellite with something taken out of it, for checks and for "what if"."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp

from quietbus.model.satellite import Satellite


def without_leg_mass(satellite: Satellite) -> Satellite:
    """The satellite with massless legs."""
    masses = lambda s: [  # noqa: E731
        getattr(part, name)
        for part in (s.legs.upper, s.legs.lower)
        for name in ("mass", "transverse_inertia", "axial_inertia")
    ]
    return eqx.tree_at(masses, satellite, [0.0 * value for value in masses(satellite)])


def without_friction(satellite: Satellite) -> Satellite:
    """The satellite with joints that turn freely."""
    joints = lambda s: (s.legs.spherical_friction, s.legs.universal_friction)  # noqa: E731
    return eqx.tree_at(joints, satellite, tuple(0.0 * value for value in joints(satellite)))


def without_disturbance(satellite: Satellite) -> Satellite:
    """The satellite with no disturbance but the rotors' imbalance, gimbal motors running smoothly.

    The harmonic solver's slow motion is that of this one.
    """
    return replace(satellite, disturbance=None, motor=None)


def without_noise(satellite: Satellite) -> Satellite:
    """The satellite without broadband disturbance: with the lines of its rotors alone."""
    if satellite.disturbance is None:
        return satellite
    silent = ((None,) * 4,) * len(satellite.disturbance.broadband)
    return replace(
        satellite, disturbance=replace(satellite.disturbance, broadband=silent, noise=None)
    )


def without_rotation(satellite: Satellite) -> Satellite:
    """The satellite with its rotors at a standstill, which they keep."""
    cluster = satellite.cluster
    still = replace(cluster, rotor_speed=0.0 * cluster.rotor_speed, drive=None)
    return replace(satellite, cluster=still)


def balanced(satellite: Satellite) -> Satellite:
    """The satellite with balanced rotors, whose transverse inertia is its mean over a turn."""
    cluster = satellite.cluster
    I = cluster.I_RRcm_R
    across = 0.5 * (I[:, 1, 1] + I[:, 2, 2])
    round_ = jnp.stack([I[:, 0, 0], across, across], axis=1)[:, :, None] * jnp.eye(3)
    where = lambda s: (s.cluster.eccentricity, s.cluster.I_RRcm_R)  # noqa: E731
    return eqx.tree_at(where, satellite, (0.0 * cluster.eccentricity, round_))
