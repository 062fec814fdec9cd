"""What of the CMGs' forces and torques reaches the base and the bus."""

from dataclasses import dataclass

import numpy as np

from quietbus.dynamics.linearize import LinearModel


@dataclass(frozen=True)
class Transmissibility:
    """Frequency responses from a wrench on the plate (force, torque about its origin)."""

    frequency_hz: np.ndarray  # (f,)
    base: (
        np.ndarray
    )  # (f, 6, 6) to force [N] and torque [N m] on the base, about the plate's origin
    bus_rate: np.ndarray  # (f, 3, 6) [rad/s] per N and N m
    rigid_bus_rate: np.ndarray  # (f, 3, 6) the same with the plate fixed to the bus

    @property
    def largest_base(self) -> np.ndarray:
        """(f, 2) largest singular value of force to force [-] and torque to torque [-]."""
        blocks = (self.base[:, :3, :3], self.base[:, 3:, 3:])
        return np.stack([np.linalg.norm(block, 2, axis=(1, 2)) for block in blocks], axis=1)

    @property
    def rate_ratio(self) -> np.ndarray:
        """(f, 2) bus rate, isolated over rigid: largest singular values by force and by torque."""
        parts = [slice(0, 3), slice(3, 6)]
        size = lambda response, part: np.linalg.norm(response[:, :, part], 2, axis=(1, 2))  # noqa: E731
        ratios = [size(self.bus_rate, p) / size(self.rigid_bus_rate, p) for p in parts]
        return np.stack(ratios, axis=1)


def transmissibility(
    isolated: LinearModel, rigid: LinearModel, inertia: np.ndarray, frequency_hz: np.ndarray
) -> Transmissibility:
    """Transmissibility of the platform on the free satellite.

    The wrench on the base follows from momentum: what the plate (6 x 6 ``inertia`` about its
    origin, with all it carries) does not keep of the wrench on it goes through the legs.

    Args:
        isolated, rigid: linear models of either mount, gimbals held (``actuator="ideal"``).
        inertia: (6, 6) mass matrix of the plate with its CMGs on (velocity, rate) of its origin.
        frequency_hz: (f,) above zero.
    """
    wrench = ["plate_force", "plate_torque"]
    plate = ["plate_velocity", "plate_rate", "bus_velocity"]
    motion = isolated.select(wrench, plate).response(frequency_hz)
    speeds = motion[:, :6].copy()
    speeds[:, :3] += motion[:, 6:9]
    s = 2j * np.pi * frequency_hz[:, None, None]
    return Transmissibility(
        frequency_hz=frequency_hz,
        base=np.eye(6) - inertia @ (s * speeds),
        bus_rate=isolated.select(wrench, ["bus_rate"]).response(frequency_hz),
        rigid_bus_rate=rigid.select(wrench, ["bus_rate"]).response(frequency_hz),
    )
