"""What of the CMGs' forces and torques reaches the base and the bus."""

from dataclasses import dataclass

import numpy as np

from quietbus.dynamics.linear_model import LinearModel


@dataclass(frozen=True)
class Transmissibility:
    """Frequency responses from a wrench (force, torque) on the platform at its mass centre."""

    frequency_hz: np.ndarray  # (f,)
    base: np.ndarray  # (f, 6, 6) to force [N] and torque [N m] on the base, about its centre
    bus_rate: np.ndarray  # (f, 3, 6) [rad/s] per N and N m
    rigid_bus_rate: np.ndarray  # (f, 3, 6) the same with the plate fixed to the bus

    @property
    def line_of_sight(self) -> np.ndarray:
        """(f, 3, 6) turn of the bus, and of what looks from it [rad] per N and N m."""
        return self.bus_rate / (2j * np.pi * self.frequency_hz[:, None, None])

    @property
    def largest_base(self) -> np.ndarray:
        """(f, 2) largest singular value of force to force [-] and torque to torque [-]."""
        blocks = (self.base[:, :3, :3], self.base[:, 3:, 3:])
        return np.stack([np.linalg.norm(block, 2, axis=(1, 2)) for block in blocks], axis=1)

    @property
    def rate_ratio(self) -> np.ndarray:
        """(f, 2) bus rate, isolated over rigid: largest singular values by force and by torque.

        That of the line of sight is the same.
        """
        parts = [slice(0, 3), slice(3, 6)]
        size = lambda response, part: np.linalg.norm(response[:, :, part], 2, axis=(1, 2))  # noqa: E731
        ratios = [size(self.bus_rate, p) / size(self.rigid_bus_rate, p) for p in parts]
        return np.stack(ratios, axis=1)


@dataclass(frozen=True)
class Places:
    """Where a wrench acts, where it is felt, and what feels it."""

    mass: float  # [kg] of the bus
    inertia: np.ndarray  # (3, 3) [kg m^2] of the bus about its mass centre
    base: np.ndarray  # (3,) [m] centre of the base plate, bus frame
    R_BP: np.ndarray  # (3, 3) attitude of the plate
    center: np.ndarray  # (3,) [m] mass centre of the platform, plate frame


def transmissibility(
    isolated: LinearModel, rigid: LinearModel, places: Places, frequency_hz: np.ndarray
) -> Transmissibility:
    """Transmissibility of the platform on the free satellite, bus axes.

    The legs' wrench on the base is what changes the momentum of the bus, on which nothing else
    acts.

    Args:
        isolated, rigid: linear models of either mount at rest, gimbals held.
        places: of the same satellite.
        frequency_hz: (f,) above zero.
    """
    R_PB, zero = places.R_BP.T, np.zeros((3, 3))
    drive = np.block([[R_PB, zero], [_cross(places.center) @ R_PB, R_PB]])
    momentum = np.block(
        [
            [places.mass * np.eye(3), zero],
            [-_cross(places.base) * places.mass, places.inertia],
        ]
    )
    wrench = ["plate_force", "plate_torque"]
    motion = isolated.select(wrench, ["bus_velocity", "bus_rate"]).response(frequency_hz) @ drive
    s = 2j * np.pi * frequency_hz[:, None, None]
    return Transmissibility(
        frequency_hz=frequency_hz,
        base=momentum @ (s * motion),
        bus_rate=motion[:, 3:],
        rigid_bus_rate=rigid.select(wrench, ["bus_rate"]).response(frequency_hz) @ drive,
    )


def _cross(v: np.ndarray) -> np.ndarray:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
