"""Jitter at one operating point, of each rotor, of each kind of imbalance, of many designs."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from quietbus.dynamics.closed_loop import initial_state
from quietbus.dynamics.coefficients import SlowMotion, slow_motion
from quietbus.dynamics.rotor_response import rotor_outputs
from quietbus.dynamics.vibration import Vibration, vibration
from quietbus.dynamics.views import NOTHING_SEEN, View
from quietbus.model import variants
from quietbus.model.cluster import Cluster
from quietbus.model.satellite import Satellite
from quietbus.model.unit import balanced
from quietbus.programs import compiled_for_few_runs

Result = TypeVar("Result")
AT_REST = 1e-6  # [m/s^2, rad/s^2] accelerations smaller than this are none


def at_rest(
    satellite: Satellite, gimbal_angle: Float[Array, " cmg"]
) -> tuple[Satellite, Satellite, SlowMotion]:
    """The satellite at its target, its bodies in the nominal pose, free of loads.

    Rotors that run up have their nominal speeds. Also the averaged satellite, and its motion.
    """
    satellite = variants.at_rest(satellite).prepared()
    averaged, unit = satellite.averaged(), jnp.array([1.0, 0.0, 0.0, 0.0])
    state = initial_state(satellite, unit, jnp.zeros(3), gimbal_angle)
    return satellite, averaged, slow_motion(averaged, jnp.zeros(()), state)


def steady_jitter(
    satellite: Satellite, gimbal_angle: Float[Array, " cmg"], view: View = NOTHING_SEEN
) -> tuple[dict[str, Complex[Array, "cmg order ..."]], Vibration]:
    """Amplitudes of the outputs (``dynamics.views.linear_outputs``) with the satellite at rest.

    The satellite is at its target, its bodies in the nominal pose, rotors at their nominal speeds,
    no load acts; ``rest_error`` tells whether that is an equilibrium. Also the equations that the
    amplitudes solve.
    """
    satellite, averaged, slow = at_rest(satellite, gimbal_angle)
    small = vibration(averaged, slow)
    return rotor_outputs(satellite, small, view)[0], small


steady_jitter_once = compiled_for_few_runs(steady_jitter)


def rest_error(small: Vibration) -> float:
    """Largest acceleration [m/s^2, rad/s^2] of the satellite at rest: 0 at an equilibrium."""
    return float(np.max(np.abs(small.slow.u_rate)))


KINDS = (
    "static imbalance",
    "dynamic imbalance",
    "installation error",
    "asymmetry and products",
    "order tables",
)


@compiled_for_few_runs
def imbalance_kinds(satellite: Satellite) -> list[Satellite]:
    """The satellite with static imbalance only, dynamic only, and both without installation error.

    Last the satellite with all imbalance; none has the rotors' tables. ``budget`` makes the parts
    of a budget of their jitter.
    """
    each = [_kinds_of(cluster) for cluster in satellite.clusters]
    return [replace(satellite, clusters=clusters) for clusters in zip(*each, strict=True)]


def _kinds_of(cluster: Cluster) -> list[Cluster]:
    units = cluster.units
    speed_axes = jnp.broadcast_to(jnp.eye(3), units.R_GF.shape)
    inertia, even = units.I_RRcm_R, balanced(units).I_RRcm_R
    products = inertia.at[:, 1, 2].set(0.0).at[:, 2, 1].set(0.0)
    products = products - jax.vmap(jnp.diag)(jnp.diagonal(inertia, axis1=1, axis2=2)) + even
    none = jnp.zeros_like(units.eccentricity)
    kinds: tuple[dict[str, Any], ...] = (
        {"R_GF": speed_axes, "I_RRcm_R": even},
        {"R_GF": speed_axes, "I_RRcm_R": products, "eccentricity": none},
        {"R_GF": speed_axes},
        {},
    )
    orders = len(cluster.disturbance.orders)
    no_tables = cluster.disturbance.with_lines(jnp.zeros((cluster.count, orders), bool))
    return [
        replace(cluster, units=replace(units, **changes), disturbance=no_tables, kept=None)
        for changes in kinds
    ]


def budget(
    whole: np.ndarray,
    static: np.ndarray,
    dynamic: np.ndarray,
    installed_exactly: np.ndarray,
    imbalance: np.ndarray,
) -> np.ndarray:
    """Parts of the complex amplitudes by kind (kind, ...), in the order of ``KINDS``.

    Their sum is ``whole``. What the installation error changes of the imbalance's jitter is its
    part; what is left of that is due to the rotor's unequal transverse inertias and to products of
    both imbalances. All beyond imbalance is of the order tables.
    """
    return np.stack(
        [
            static,
            dynamic,
            imbalance - installed_exactly,
            installed_exactly - static - dynamic,
            whole - imbalance,
        ]
    )


TOGETHER = 16  # designs that a program looks at together: one alone costs as much


def for_designs(
    program: Callable[[Satellite, np.ndarray], Result],
    designs: Sequence[Satellite],
    angles: np.ndarray,
) -> Result:
    """What a program gives for many satellites alike but for their numbers, compiled once.

    Args:
        program: compiled; from TOGETHER satellites, stacked, and their (TOGETHER, cmg) angles.
        designs: any number of satellites.
        angles: (design, cmg) [rad].
    """
    parts = []
    for start in range(0, len(designs), TOGETHER):
        these = list(designs[start : start + TOGETHER])
        missing = TOGETHER - len(these)
        stacked = jax.tree.map(_stacked, *these, *these[-1:] * missing)
        at = np.pad(angles[start : start + TOGETHER], ((0, missing), (0, 0)), mode="edge")
        part = program(stacked, at)
        parts.append(jax.tree.map(lambda leaf: np.asarray(leaf)[: len(these)], part))  # noqa: B023
    return jax.tree.map(lambda *each: np.concatenate(each), *parts)


def _stacked(*each: Any) -> Any:
    """A leaf of many designs along a first axis; what all share is not copied."""
    if not eqx.is_array(each[0]):
        return each[0]
    if all(leaf is each[0] for leaf in each):
        return np.broadcast_to(np.asarray(each[0]), (len(each), *np.shape(each[0])))
    return np.stack(each)
