"""What moves, as plain arrays."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.mechanism import Mechanism


@dataclass(frozen=True)
class Motion:
    """Positions and velocities of bus, plate and units, and the controller's memory."""

    p_NB_N: np.ndarray  # (3,) [m]
    q_NB: np.ndarray  # (4,) scalar first
    p_NP_N: np.ndarray  # (3,) [m]
    q_NP: np.ndarray  # (4,)
    v_NB_N: np.ndarray  # (3,) [m/s]
    w_NB_B: np.ndarray  # (3,) [rad/s]
    v_NP_N: np.ndarray  # (3,) [m/s]
    w_NP_P: np.ndarray  # (3,) [rad/s]
    gimbal_angle: np.ndarray  # (unit,) [rad]
    gimbal_rate: np.ndarray  # (unit,) [rad/s]
    rotor_angle: np.ndarray  # (unit,) [rad]
    rotor_speed: np.ndarray  # (unit,) [rad/s]
    error_integral: np.ndarray  # (3,) [rad s]

    def as_vector(self) -> np.ndarray:
        """All numbers in a row."""
        return np.concatenate(list(vars(self).values()))

    def from_vector(self, vector: np.ndarray) -> Self:
        """A motion of the same shape from such a row."""
        parts, start = {}, 0
        for name, value in vars(self).items():
            parts[name] = vector[start : start + len(value)]
            start += len(value)
        return type(self)(**parts)


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of a quaternion, scalar first, of any length."""
    return Rotation.from_quat(q, scalar_first=True).as_matrix()


def quaternion(R: Rotation) -> np.ndarray:
    """Unit quaternion, scalar first."""
    return R.as_quat(scalar_first=True)


def with_plate(
    mechanism: Mechanism,
    motion: Motion,
    displacement_B: np.ndarray | None = None,
    turn_B: np.ndarray | None = None,
    velocity_B: np.ndarray | None = None,
    rate_B: np.ndarray | None = None,
) -> Motion:
    """The motion with the plate's set relative to the bus; by default it rides on it in its place.

    Args:
        displacement_B, turn_B: (3,) from the nominal pose [m], rotation vector [rad].
        velocity_B, rate_B: (3,) of the plate's origin [m/s] and angular [rad/s], seen from the bus.
    """
    zero = np.zeros(3)
    displacement, turn, velocity, rate = (
        zero if given is None else given for given in (displacement_B, turn_B, velocity_B, rate_B)
    )
    bus = Rotation.from_quat(motion.q_NB, scalar_first=True)
    R_BP = Rotation.from_rotvec(turn) * Rotation.from_matrix(mechanism.R_BP)
    p_BP_B = mechanism.p_BP_B + displacement
    return replace(
        motion,
        p_NP_N=motion.p_NB_N + bus.apply(p_BP_B),
        q_NP=quaternion(bus * R_BP),
        v_NP_N=motion.v_NB_N + bus.apply(np.cross(motion.w_NB_B, p_BP_B) + velocity),
        w_NP_P=R_BP.inv().apply(motion.w_NB_B + rate),
    )
