"""What moves, as plain arrays."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.mechanism import Mechanism, apply


@dataclass(frozen=True)
class Motion:
    """Positions and velocities of bodies (the bus first) and units, and the controller's memory."""

    p_NX_N: np.ndarray  # (body, 3) [m]
    q_NX: np.ndarray  # (body, 4) scalar first
    v_NX_N: np.ndarray  # (body, 3) [m/s]
    w_NX_X: np.ndarray  # (body, 3) [rad/s]
    gimbal_angle: np.ndarray  # (unit,) [rad]; of wheels as they stand
    gimbal_rate: np.ndarray  # (unit,) [rad/s]
    rotor_angle: np.ndarray  # (unit,) [rad]
    rotor_speed: np.ndarray  # (unit,) [rad/s]
    error_integral: np.ndarray  # (3,) [rad s]

    def as_vector(self) -> np.ndarray:
        """All numbers in a row."""
        return np.concatenate([value.ravel() for value in vars(self).values()])

    def from_vector(self, vector: np.ndarray) -> Self:
        """A motion of the same shape from such a row."""
        parts, start = {}, 0
        for name, value in vars(self).items():
            parts[name] = vector[start : start + value.size].reshape(value.shape)
            start += value.size
        return type(self)(**parts)


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrices of quaternions, scalar first, of any length."""
    return Rotation.from_quat(q, scalar_first=True).as_matrix()


def quaternion(R: Rotation) -> np.ndarray:
    """Unit quaternions, scalar first."""
    return R.as_quat(scalar_first=True)


def placed(
    mechanism: Mechanism,
    motion: Motion,
    which: np.ndarray,
    displacement_B: np.ndarray | None = None,
    turn_B: np.ndarray | None = None,
    velocity_B: np.ndarray | None = None,
    rate_B: np.ndarray | None = None,
) -> Motion:
    """The motion with some bodies set relative to the bus; by default they ride in their places.

    Args:
        which: (body,) the bodies, n of them.
        displacement_B, turn_B: (n, 3) from the nominal pose [m], rotation vector [rad].
        velocity_B, rate_B: (n, 3) of origins [m/s] and angular [rad/s], seen from the bus.
    """
    if not np.any(which):
        return motion
    zero = np.zeros((np.count_nonzero(which), 3))
    displacement, turn, velocity, rate = (
        zero if given is None else given for given in (displacement_B, turn_B, velocity_B, rate_B)
    )
    bus = Rotation.from_quat(motion.q_NX[0], scalar_first=True)
    R_BX = Rotation.from_rotvec(turn) * Rotation.from_matrix(mechanism.R_BX[which])
    p_BX_B, w_NB_B = mechanism.p_BX_B[which] + displacement, motion.w_NX_X[0]
    set_to = {
        "p_NX_N": motion.p_NX_N[0] + bus.apply(p_BX_B),
        "q_NX": quaternion(bus * R_BX),
        "v_NX_N": motion.v_NX_N[0] + bus.apply(np.cross(w_NB_B, p_BX_B) + velocity),
        "w_NX_X": apply(R_BX.inv().as_matrix(), w_NB_B + rate),
    }
    changed = {name: getattr(motion, name).copy() for name in set_to}
    for name, value in set_to.items():
        changed[name][which] = value
    return replace(motion, **changed)


def beside_bus(mechanism: Mechanism) -> np.ndarray:
    """(body,) which bodies are not the bus."""
    return np.arange(len(mechanism.names)) > 0
