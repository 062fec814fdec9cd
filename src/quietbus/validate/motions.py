"""Arbitrary motions of the reference's satellite to compare programs at."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.motion import Motion, quaternion, with_plate
from quietbus.reference.satellite import ReferenceSatellite

FASTEST = 600.0  # [rad/s] of rotors whose speeds change and have no limit


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
    count, swing = len(units.phase), 0.0 if units.wheels else 1.0
    angle, speed = units.phase + units.speed * t, units.speed
    if reference.control.run_up is not None or units.wheels:
        limit = reference.control.speed_limit
        bound = FASTEST if limit is None else np.where(np.isfinite(limit), 1.3 * limit, FASTEST)
        angle, speed = rng.uniform(-np.pi, np.pi, count), rng.uniform(-1.0, 1.0, count) * bound
    motion = Motion(
        p_NB_N=rng.uniform(-1.0, 1.0, 3),
        q_NB=q_NB / np.linalg.norm(q_NB),
        p_NP_N=np.zeros(3),
        q_NP=np.zeros(4),
        v_NB_N=rng.uniform(-1.0, 1.0, 3),
        w_NB_B=w_NB_B,
        v_NP_N=np.zeros(3),
        w_NP_P=np.zeros(3),
        gimbal_angle=swing * rng.uniform(-np.pi, np.pi, count),
        gimbal_rate=swing * size * rng.uniform(-1.0, 1.0, count),
        rotor_angle=angle,
        rotor_speed=speed,
        error_integral=size * rng.uniform(-1.0, 1.0, 3),
    )
    return _displaced(reference, motion, rng, 1.0)


def kicked(reference: ReferenceSatellite, motion: Motion, rng: np.random.Generator) -> Motion:
    """The motion with bus, plate and gimbals pushed, so that every term of the equations acts.

    The bus turns by up to 0.05 rad/s per axis more, gimbals by 0.3 rad/s.
    """
    units = reference.mechanism.units
    swing = 0.0 if units.wheels else 0.3
    pushed = replace(
        motion,
        v_NB_N=motion.v_NB_N + rng.uniform(-0.01, 0.01, 3),
        w_NB_B=motion.w_NB_B + rng.uniform(-0.05, 0.05, 3),
        gimbal_rate=swing * rng.uniform(-1.0, 1.0, len(units.phase)),
        error_integral=rng.uniform(-0.1, 0.1, 3),
    )
    return _displaced(reference, pushed, rng, 0.1)


def _displaced(
    reference: ReferenceSatellite, motion: Motion, rng: np.random.Generator, size: float
) -> Motion:
    """The plate displaced by up to 5 % of the shortest leg and 0.05 rad per axis, times size.

    Its speeds in the bus are up to 1 m/s and 1 rad/s, times size.
    """
    mechanism = reference.mechanism
    if mechanism.mount == "rigid":
        return with_plate(mechanism, motion)
    shift = 0.05 * size * float(np.min(np.linalg.norm(mechanism.spans_B, axis=1)))
    off = [rng.uniform(-bound, bound, 3) for bound in (shift, 0.05 * size, size, size)]
    return with_plate(mechanism, motion, *off)
