"""Arbitrary motions of the reference's satellite to compare programs at."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.motion import Motion, beside_bus, placed, quaternion
from quietbus.reference.satellite import ReferenceSatellite

FASTEST = 600.0  # [rad/s] of wheels that have no limit of speed


def random_times(
    reference: ReferenceSatellite, count: int, duration: float, rng: np.random.Generator
) -> list[float]:
    """Instants of a run [s]: in stretches between corners of loads and commands, and at corners.

    Args:
        count: in stretches, each as likely; at most as many corners are looked at, from both sides.
    """
    corners = [t for t in reference.corners if 0.0 < t < duration]
    edges, i = np.array([0.0, *corners, duration]), rng.integers(len(corners) + 1, size=count)
    looked_at = rng.permutation(corners)[:count]
    beside = 1e-7 * duration
    within = rng.uniform(edges[i], edges[i + 1])
    return [*within.tolist(), *(looked_at - beside).tolist(), *(looked_at + beside).tolist()]


def random_motion(
    reference: ReferenceSatellite, t: float, rng: np.random.Generator, near: float | None = None
) -> Motion:
    """A motion at time t [s].

    Args:
        near: None: a bus of any attitude tumbling at 1 rad/s per axis. Otherwise the attitude and
            rate that the control is to follow, off by this [rad, rad/s], gimbals slow alike: where
            no limit of the actuators acts.
    """
    units = reference.mechanism.units
    attitude, w_R, _ = reference.control.guidance.reference(t)
    size = 1.0 if near is None else near
    q_NB, w_NB_B = rng.normal(size=4), rng.uniform(-1.0, 1.0, 3)
    if near is not None:
        turned = attitude * Rotation.from_rotvec(rng.uniform(-near, near, 3))
        q_NB, w_NB_B = quaternion(turned), w_R + rng.uniform(-near, near, 3)
    bodies, count = len(reference.mechanism.names), len(units.phase)
    swing = np.where(units.wheel, 0.0, 1.0)
    turn, speed, _ = reference.control.prescribed(t)
    limit = reference.control.speed_limit
    bound = np.where(np.isfinite(limit), 1.3 * limit, FASTEST)
    any_angle, any_speed = rng.uniform(-np.pi, np.pi, count), rng.uniform(-1.0, 1.0, count) * bound
    driven = units.wheel & ~reference.control.runs_up
    motion = Motion(
        p_NX_N=rng.uniform(-1.0, 1.0, 3) * np.ones((bodies, 1)),
        q_NX=q_NB / np.linalg.norm(q_NB) * np.ones((bodies, 1)),
        v_NX_N=rng.uniform(-1.0, 1.0, 3) * np.ones((bodies, 1)),
        w_NX_X=w_NB_B * np.ones((bodies, 1)),
        gimbal_angle=swing * rng.uniform(-np.pi, np.pi, count),
        gimbal_rate=swing * size * rng.uniform(-1.0, 1.0, count),
        rotor_angle=np.where(driven, any_angle, units.phase + turn),
        rotor_speed=np.where(driven, any_speed, speed),
        error_integral=size * rng.uniform(-1.0, 1.0, 3),
    )
    return _displaced(reference, motion, rng, 1.0)


def kicked(reference: ReferenceSatellite, motion: Motion, rng: np.random.Generator) -> Motion:
    """The motion with all bodies and gimbals pushed, so that every term of the equations acts.

    The bus turns by up to 0.05 rad/s per axis more, gimbals by 0.3 rad/s.
    """
    units, count = reference.mechanism.units, len(motion.gimbal_rate)
    velocity, rate = motion.v_NX_N.copy(), motion.w_NX_X.copy()
    velocity[0] += rng.uniform(-0.01, 0.01, 3)
    rate[0] += rng.uniform(-0.05, 0.05, 3)
    pushed = replace(
        motion,
        v_NX_N=velocity,
        w_NX_X=rate,
        gimbal_rate=np.where(units.wheel, 0.0, 0.3) * rng.uniform(-1.0, 1.0, count),
        error_integral=rng.uniform(-0.1, 0.1, 3),
    )
    return _displaced(reference, pushed, rng, 0.1)


def _displaced(
    reference: ReferenceSatellite, motion: Motion, rng: np.random.Generator, size: float
) -> Motion:
    """Bodies beside the bus displaced by up to 5 % of the shortest leg and 0.05 rad, times size.

    Their speeds in the bus are up to 1 m/s and 1 rad/s per axis, times size.
    """
    mechanism = reference.mechanism
    riding = placed(mechanism, motion, beside_bus(mechanism))
    free = beside_bus(mechanism) & ~mechanism.welded
    shift = 0.05 * size * float(np.min(np.linalg.norm(mechanism.spans_Y, axis=1)))
    shape = (np.count_nonzero(free), 3)
    off = [rng.uniform(-bound, bound, shape) for bound in (shift, 0.05 * size, size, size)]
    return placed(mechanism, riding, free, *off)
