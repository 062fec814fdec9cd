"""Where the parts of a scenario stand: positions and directions in the bus frame B."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quietbus.scenario import Scenario
from quietbus.scenario.blocks import Blocks


@dataclass(frozen=True)
class UnitLayout:
    """A CMG or a wheel; vectors in the bus frame."""

    position: np.ndarray  # (3,) [m]
    gimbal: np.ndarray | None  # (3,) gimbal axis g; None: a wheel
    spin: np.ndarray  # (3,) spin axis s at its gimbal angle
    momentum: np.ndarray  # (3,) [N m s] of the rotor relative to its gimbal
    angle: float  # [rad] of the gimbal


@dataclass(frozen=True)
class Layout:
    """A scenario's satellite in its nominal pose; positions from the bus mass centre."""

    p_BD_B: np.ndarray  # (3,) [m] origin of the base-plate frame D
    p_BP_B: np.ndarray  # (3,) [m] origin of the upper-plate frame P
    R_BD: np.ndarray  # (3, 3) also of the upper plate
    lower_B: np.ndarray  # (leg, 3) [m] universal joints
    upper_B: np.ndarray  # (leg, 3) [m] spherical joints
    axes_B: np.ndarray  # (leg, 3) universal axes that are fixed in the base plate
    units: tuple[UnitLayout, ...]
    corners_B: np.ndarray  # (8, 3) [m] of the homogeneous cuboid with the bus's mass and inertia

    @property
    def size(self) -> float:
        """[m] Width of the platform."""
        ends = np.concatenate([self.lower_B, self.upper_B])
        return float(np.max(np.ptp(ends, axis=0)))

    @property
    def total_momentum(self) -> np.ndarray:
        """(3,) [N m s] of all rotors."""
        return np.sum([unit.momentum for unit in self.units], axis=0)


def layout(scenario: Scenario) -> Layout:
    """Positions and directions of a scenario's parts, gimbals at their angles at the start.

    Of several platforms the first.
    """
    site = scenario.sites[0]
    isolator, blocks = site.isolator, Blocks(site.blocks)
    R_BD = _rotation(isolator.orientation)
    p_BD_B = np.array(isolator.offset)
    lower, upper = isolator.joints()
    p_BP_B = p_BD_B + R_BD @ np.array([0.0, 0.0, isolator.separation])
    units = []
    for unit, angle, turns in zip(
        blocks.placed(), blocks.gimbal_angles, blocks.turning, strict=True
    ):
        g, s = np.array(unit.gimbal_axis), np.array(unit.spin_axis)
        turned = s if not turns else np.cos(angle) * s + np.sin(angle) * np.cross(g, s)
        momentum = unit.rotor.inertia[0, 0] * unit.rotor.speed * turned
        units.append(
            UnitLayout(
                p_BP_B + R_BD @ np.array(unit.position),
                R_BD @ g if turns else None,
                R_BD @ turned,
                R_BD @ momentum,
                float(angle),
            )
        )
    return Layout(
        p_BD_B,
        p_BP_B,
        R_BD,
        p_BD_B + lower @ R_BD.T,
        p_BD_B + upper @ R_BD.T,
        np.array(isolator.legs.universal_axes) @ R_BD.T,
        tuple(units),
        _cuboid(scenario.bus.mass, np.array(scenario.bus.inertia)),
    )


def _rotation(angles: tuple[float, float, float]) -> np.ndarray:
    """R_BD of [roll, pitch, yaw], sequence yaw-pitch-roll."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    turned: np.ndarray = about_z @ about_y @ about_x
    return turned


def _cuboid(mass: float, inertia: np.ndarray) -> np.ndarray:
    """Corners of the homogeneous cuboid: I_x = m (b^2 + c^2) / 12 and so on, solved."""
    moments, axes = np.linalg.eigh(inertia)
    edges = np.sqrt(6.0 / mass * np.maximum(moments.sum() - 2.0 * moments, 0.0))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners: np.ndarray = (0.5 * signs * edges) @ axes.T
    return corners


EDGES = [(i, j) for i in range(8) for j in range(i) if bin(i ^ j).count("1") == 1]  # of the cuboid
