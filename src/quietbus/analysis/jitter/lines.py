"""Jitter at one operating point, of each rotor, of each kind of imbalance, and of all together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from quietbus.dynamics.closed_loop import initial_state
from quietbus.dynamics.vibration import (
    NOTHING_SEEN,
    SlowMotion,
    Vibration,
    leg_coefficients,
    linear_outputs,
    rotor_response,
    slow_motion,
    vibration,
)
from quietbus.model.cmg import ClusterMoments
from quietbus.model.disturbance import orders_of
from quietbus.model.guidance import StepGuidance
from quietbus.model.satellite import Satellite

Result = TypeVar("Result")
AT_REST = 1e-6  # [m/s^2, rad/s^2] accelerations smaller than this are none
SAME_FREQUENCY = 1e-9  # relative: lines closer than this are one
RMS_TIME = (
    1.0  # [s] over which a root mean square is meant: lines that beat more slowly are coherent
)


@dataclass(frozen=True)
class Combined:
    """Amplitudes of all orders of all rotors as one number for each output component.

    Without axes of rotors and orders, otherwise as what was combined, in its unit.
    """

    envelope: np.ndarray  # phases as given: what the sum reaches as lines of other frequency beat
    worst_case: np.ndarray  # any phases: the sum of all amplitudes
    rss: np.ndarray  # root of the sum of squares of all amplitudes
    rms: np.ndarray  # root mean square over RMS_TIME about the instant, phases as given

    def with_lines(
        self, amplitude: np.ndarray, frequency: np.ndarray, angle: np.ndarray
    ) -> "Combined":
        """With further lines of changing frequency, incoherent with the others.

        Args:
            amplitude: (..., line, component) complex; the line is Re(amplitude exp(i angle)).
            frequency: (..., line) d(angle)/dt [rad/s], of either sign.
            angle: (..., line) [rad].
        """
        size = np.abs(amplitude)
        turned = _forward(amplitude * np.exp(1j * angle)[..., None], frequency)
        together = _mean_square(np.moveaxis(turned, -2, 0), np.moveaxis(np.abs(frequency), -1, 0))
        return Combined(
            envelope=self.envelope + np.sum(size, axis=-2),
            worst_case=self.worst_case + np.sum(size, axis=-2),
            rss=np.sqrt(self.rss**2 + np.sum(size**2, axis=-2)),
            rms=np.sqrt(self.rms**2 + together),
        )

    def with_noise(self, square: np.ndarray) -> "Combined":
        """With noise of a mean square: it has no amplitude, and adds to the RMS alone."""
        return replace(self, rms=np.sqrt(self.rms**2 + square))


def combine(
    amplitude: np.ndarray,
    frequency: np.ndarray,
    phase: np.ndarray,
    time: np.ndarray | float = 0.0,
) -> Combined:
    """Combine lines.

    Lines of one frequency add with their phases; those of different frequencies beat, so that
    sooner or later their amplitudes add. (Lines at exactly n-fold frequencies keep their phase to
    each other and may never reach the envelope, which then is an upper bound.) For the RMS lines
    count together that RMS_TIME cannot tell apart, as they stand to each other at the instant.

    Args:
        amplitude: (..., cmg, order, component) complex; the line is Re(amplitude exp(i angle)).
        frequency: (cmg, order) d(angle)/dt [rad/s], of either sign; with the leading axes of
            ``amplitude`` where it changes: lines that always agree in it are one line then.
        phase: (cmg, order) angle at t = 0 [rad], or likewise the angle.
        time: (...) of the amplitudes [s], if frequencies stay.
    """
    amplitude, frequency = np.asarray(amplitude), np.asarray(frequency)
    size = np.abs(amplitude)
    turned = _forward(amplitude * np.exp(1j * np.asarray(phase))[..., None], frequency)
    groups = _groups(np.abs(frequency))
    lines = np.stack([turned[..., mask, :].sum(axis=-2) for mask in groups])
    speeds = np.stack([np.abs(frequency)[..., mask][..., 0] for mask in groups])
    now = lines
    if frequency.ndim == 2 and np.any(time):
        now = lines * np.exp(1j * np.multiply.outer(speeds, time))[..., None]
    return Combined(
        envelope=np.sum(np.abs(lines), axis=0),
        worst_case=np.sum(size, axis=(-3, -2)),
        rss=np.sqrt(np.sum(size**2, axis=(-3, -2))),
        rms=np.sqrt(_mean_square(now, speeds)),
    )


def _forward(turned: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Phasors (..., component) as of positive frequencies: conjugates of the others."""
    return np.where((frequency < 0.0)[..., None], turned.conj(), turned)


def _mean_square(lines: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Mean square (..., component) over RMS_TIME about an instant.

    Two lines have in common the mean of the cosine that they beat with, ``sin x / x`` with x half
    the phase of a beat in that time; those that part by a turn or more count as independent.

    Args:
        lines: (line, ..., component) phasors at the instant.
        frequency: (line,) or (line, ...) [rad/s], positive.
    """
    square = 0.5 * np.sum(np.abs(lines) ** 2, axis=0)
    for k, line in enumerate(lines):
        for other, f in zip(lines[:k], frequency[:k], strict=True):
            x = 0.5 * RMS_TIME * np.abs(frequency[k] - f) / np.pi
            if np.any(x < 1.0):
                common = np.where(x < 1.0, np.sinc(x), 0.0)
                square = square + np.asarray(common)[..., None] * (line * other.conj()).real
    return np.maximum(square, 0.0)


def _groups(frequency: np.ndarray) -> list[np.ndarray]:
    """Masks (cmg, order) of lines of one frequency."""
    if frequency.ndim > 2:
        return _groups_of_changing(frequency)
    ascending = np.unique(frequency)
    new = np.diff(ascending, prepend=-np.inf) > SAME_FREQUENCY * ascending
    new[0] = True
    starts = ascending[new]
    member = np.searchsorted(starts, frequency, side="right") - 1
    return [member == i for i in range(len(starts))]


def _groups_of_changing(frequency: np.ndarray) -> list[np.ndarray]:
    """The same of frequencies (..., cmg, order)."""
    shape = frequency.shape[-2:]
    lines = frequency.reshape(-1, np.prod(shape)).T
    left, masks = set(range(len(lines))), []
    while left:
        first = lines[min(left)]
        apart = SAME_FREQUENCY * np.max(first)
        alike = {i for i in left if np.max(np.abs(lines[i] - first)) <= apart}
        masks.append(np.isin(np.arange(len(lines)), list(alike)).reshape(shape))
        left -= alike
    return masks


def at_rest(
    satellite: Satellite, gimbal_angle: Float[Array, " cmg"]
) -> tuple[Satellite, SlowMotion, ClusterMoments]:
    """The satellite at its target, its plate in the nominal pose, free of loads.

    Rotors that run up have their nominal speeds.
    """
    unit = jnp.array([1.0, 0.0, 0.0, 0.0])
    satellite = replace(satellite, guidance=StepGuidance(unit), loads=())
    state = initial_state(satellite, unit, jnp.zeros(3), gimbal_angle)
    if satellite.cluster.run_up is not None:
        state = replace(state, rotor=None)
    moments = ClusterMoments.expand(satellite.cluster)
    slow = slow_motion(satellite, jnp.zeros(()), state, moments.averaged())
    return satellite, slow, moments


def steady_jitter(
    satellite: Satellite, gimbal_angle: Float[Array, " cmg"]
) -> tuple[dict[str, Complex[Array, "cmg order ..."]], Vibration]:
    """Amplitudes of the outputs (``dynamics.vibration.linear_outputs``) with the satellite at rest.

    The satellite is at its target, its plate in the nominal pose, rotors at their nominal speeds,
    no load acts; ``rest_error`` tells whether that is an equilibrium. Also the equations that the
    amplitudes solve.
    """
    satellite, slow, moments = at_rest(satellite, gimbal_angle)
    small = vibration(satellite, slow, moments, leg_coefficients(satellite, slow))
    xi = rotor_response(satellite, small, moments)
    s = 1j * slow.rotor_speed[:, None] * orders_of(satellite.disturbance)
    outputs = jax.vmap(jax.vmap(lambda s, x: linear_outputs(satellite, small, s, x, NOTHING_SEEN)))
    return outputs(s, xi), small


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


def imbalance_kinds(satellite: Satellite) -> list[Satellite]:
    """The satellite with static imbalance only, dynamic only, and both without installation error.

    Last the satellite with all imbalance; none has the rotors' tables. ``budget`` makes the parts
    of a budget of their jitter.
    """
    if satellite.disturbance is not None:  # kept, so that all have the same orders
        none = 0.0 * satellite.disturbance.coefficient
        satellite = replace(satellite, disturbance=replace(satellite.disturbance, coefficient=none))
    cluster = satellite.cluster
    speed_axes = jnp.broadcast_to(jnp.eye(3), cluster.R_GF.shape)
    inertia = cluster.I_RRcm_R
    transverse = 0.5 * (inertia[:, 1, 1] + inertia[:, 2, 2])
    even = jax.vmap(jnp.diag)(jnp.stack([inertia[:, 0, 0], transverse, transverse], axis=1))
    products = inertia.at[:, 1, 2].set(0.0).at[:, 2, 1].set(0.0)
    products = products - jax.vmap(jnp.diag)(jnp.diagonal(inertia, axis1=1, axis2=2)) + even
    none = jnp.zeros_like(cluster.eccentricity)
    kinds: tuple[dict[str, Any], ...] = (
        {"R_GF": speed_axes, "I_RRcm_R": even},
        {"R_GF": speed_axes, "I_RRcm_R": products, "eccentricity": none},
        {"R_GF": speed_axes},
        {},
    )
    return [replace(satellite, cluster=replace(cluster, **changes)) for changes in kinds]


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


@dataclass(frozen=True)
class WorstAngles:
    """Gimbal angles at which jitter is largest."""

    gimbal_angle: np.ndarray  # (cmg,) [rad], within -pi to pi
    value: float  # what was sought, there
    evaluations: int


def worst_angles(measure: Callable[[np.ndarray], np.ndarray], count: int) -> WorstAngles:
    """Search all gimbal angles for the largest value of a measure.

    Differential evolution from a Sobol sample, always with the same seed.

    Args:
        measure: of (SEARCHED, count) angles at once, (SEARCHED,).
        count: number of CMGs.
    """
    start = qmc.scale(qmc.Sobol(count, seed=1).random(SEARCHED), -np.pi, np.pi)
    found = differential_evolution(
        lambda angles: -measure(angles.T),
        [(-np.pi, np.pi)] * count,
        init=start,
        maxiter=120,
        tol=1e-6,
        seed=1,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    return WorstAngles(found.x, -float(found.fun), SEARCHED * int(found.nfev))


SEARCHED = 64  # sets of gimbal angles, or designs, looked at together


def for_designs(
    program: Callable[[Satellite, np.ndarray], Result],
    designs: Sequence[Satellite],
    angles: np.ndarray,
) -> Result:
    """What a program gives for many satellites alike but for their numbers, compiled once.

    Args:
        program: compiled; from SEARCHED satellites, stacked, and their (SEARCHED, cmg) angles.
        designs: any number of satellites.
        angles: (design, cmg) [rad].
    """
    parts = []
    for start in range(0, len(designs), SEARCHED):
        these = list(designs[start : start + SEARCHED])
        missing = SEARCHED - len(these)
        stacked = jax.tree.map(
            lambda *each: np.stack(each) if eqx.is_array(each[0]) else each[0],
            *these,
            *these[-1:] * missing,
        )
        at = np.pad(angles[start : start + SEARCHED], ((0, missing), (0, 0)), mode="edge")
        part = program(stacked, at)
        parts.append(jax.tree.map(lambda leaf: np.asarray(leaf)[: len(these)], part))  # noqa: B023
    return jax.tree.map(lambda *each: np.concatenate(each), *parts)
