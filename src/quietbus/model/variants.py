"""A satellite with something taken out of it, for checks and for "what if"."""

from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.cluster import Cluster
from quietbus.model.disturbance import quiet_rotors
from quietbus.model.gimbal_motor import SmoothMotor
from quietbus.model.guidance import StepGuidance
from quietbus.model.satellite import Satellite
from quietbus.model.unit import balanced as balanced_units


def with_clusters(satellite: Satellite, change: Callable[[Cluster], Cluster]) -> Satellite:
    """The satellite with every cluster changed."""
    return replace(satellite, clusters=tuple(map(change, satellite.clusters)))


def without_leg_mass(satellite: Satellite) -> Satellite:
    """The satellite with massless legs."""
    masses = lambda s: [  # noqa: E731
        getattr(part, name)
        for hexapod in s.hexapods
        for part in (hexapod.bodies.upper, hexapod.bodies.lower)
        for name in ("mass", "transverse_inertia", "axial_inertia")
    ]
    return eqx.tree_at(masses, satellite, [0.0 * value for value in masses(satellite)])


def without_friction(satellite: Satellite) -> Satellite:
    """The satellite with joints that turn freely."""
    joints = lambda s: [  # noqa: E731
        getattr(hexapod.bodies, name)
        for hexapod in s.hexapods
        for name in ("spherical_friction", "universal_friction")
    ]
    return eqx.tree_at(joints, satellite, [0.0 * value for value in joints(satellite)])


def without_disturbance(satellite: Satellite) -> Satellite:
    """The satellite with no disturbance but the rotors' imbalance, gimbal motors running smooth."""
    quiet = lambda c: replace(c, disturbance=quiet_rotors(c.count), motor=SmoothMotor())  # noqa: E731
    return with_clusters(satellite, quiet)


def without_noise(satellite: Satellite) -> Satellite:
    """The satellite without broadband disturbance: with the lines of its rotors alone."""
    return with_clusters(satellite, lambda c: replace(c, disturbance=c.disturbance.silent()))


def without_rotation(satellite: Satellite) -> Satellite:
    """The satellite with its rotors at a standstill, which they keep."""
    return with_clusters(satellite, Cluster.without_rotation)


def balanced(satellite: Satellite) -> Satellite:
    """The satellite with balanced rotors, whose transverse inertia is its mean over a turn."""
    return with_clusters(satellite, lambda c: replace(c, units=balanced_units(c.units), kept=None))


def with_base_fixed(satellite: Satellite, factor: float = 1e12) -> Satellite:
    """The satellite with a bus so heavy that it does not move."""
    heavy = lambda s: (s.bodies[0].mass_X, s.bodies[0].I_XXcm_X)  # noqa: E731
    return eqx.tree_at(heavy, satellite, tuple(factor * value for value in heavy(satellite)))


def with_rotor_speed(satellite: Satellite, speed: Float[Array, " cmg"]) -> Satellite:
    """The satellite with other nominal speeds of all rotors [rad/s]."""
    clusters = []
    for cluster, own in satellite.numbered():
        units = eqx.tree_at(lambda u: u.rotor_speed, cluster.units, speed[own])
        clusters.append(replace(cluster, units=units, kept=None))
    return replace(satellite, clusters=tuple(clusters))


def at_rest(satellite: Satellite) -> Satellite:
    """The satellite at its target, free of loads, its rotors at their nominal speeds."""
    guidance = StepGuidance(jnp.array([1.0, 0.0, 0.0, 0.0]))
    return replace(
        with_clusters(satellite, lambda c: replace(c, rotors=c.rotors.at_rest())),
        others=tuple(e for e in satellite.others if not e.external),
        control=replace(satellite.control, guidance=guidance),
    )


def with_mount(satellite: Satellite, welded: bool) -> Satellite:
    """The satellite with all platforms welded to their bases, or on their struts."""
    mounts = tuple(replace(mount, welded=welded) for mount in satellite.mounts)
    hexapods = tuple(replace(legs, holds=not welded) for legs in satellite.hexapods)
    return replace(satellite, mounts=mounts, hexapods=hexapods)
