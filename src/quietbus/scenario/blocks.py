"""All CMGs and reaction wheels of a satellite, through all platforms and blocks, as one list."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from quietbus.scenario.hardware import Cluster
from quietbus.scenario.wheels import Wheel, WheelCluster

Block = Cluster | WheelCluster


@dataclass(frozen=True)
class Blocks:
    """Units in their order, numbered through; random phases go by these numbers."""

    blocks: tuple[Block, ...]

    @property
    def count(self) -> int:
        """Number of units."""
        return sum(block.count for block in self.blocks)

    def placed(self) -> tuple[Any, ...]:
        """All units, each with its parts."""
        return tuple(unit for block in self.blocks for unit in block.placed())

    @property
    def orders(self) -> tuple[float, ...]:
        """Multiples of rotor speed in a run: those of imbalance, 1 and 2, and of all tables."""
        return tuple(sorted({order for block in self.blocks for order in block.orders} | {1, 2}))

    @property
    def seeds(self) -> tuple[int, ...]:
        """Of the rotors' random phases and noise."""
        return tuple(seed for block in self.blocks for seed in block.seeds)

    def phases(self) -> tuple[float, ...]:
        """Rotor angles at the start [rad]."""
        found: list[float] = []
        for block in self.blocks:
            found += block.phases(len(found))
        return tuple(found)

    @property
    def speeds(self) -> np.ndarray:
        """Nominal speeds (cmg,) [rad/s]; zero where a unit has no rotor."""
        return np.array([unit.rotor.speed if unit.rotor else 0.0 for unit in self.placed()])

    @property
    def fastest(self) -> np.ndarray:
        """Largest speeds (cmg,) [rad/s] that are known before a run: nominal, and of run-ups."""
        found = []
        for block in self.blocks:
            own = np.array([unit.rotor.speed if unit.rotor else 0.0 for unit in block.placed()])
            ends = block.run_up.speeds(tuple(own)) if block.run_up else ()
            found.append(np.max(np.abs([own, *ends]), axis=0))
        return np.concatenate(found) if found else np.zeros(0)

    @property
    def gimbal_angles(self) -> np.ndarray:
        """Gimbal angles at the start (cmg,) [rad]; zero of units without."""
        each = [np.array(block.gimbal_angles or np.zeros(block.count)) for block in self.blocks]
        return np.concatenate(each) if each else np.zeros(0)

    @property
    def turning(self) -> np.ndarray:
        """Which units (cmg,) have gimbals that turn."""
        each = [np.full(block.count, isinstance(block, Cluster)) for block in self.blocks]
        return np.concatenate(each) if each else np.zeros(0, bool)

    @property
    def gimbals_turn(self) -> bool:
        """Whether any does."""
        return bool(np.any(self.turning))

    @property
    def wheels(self) -> tuple[tuple[int, Wheel], ...]:
        """The reaction wheels, with their numbers."""
        numbered = enumerate(self.placed())
        return tuple((j, unit) for j, unit in numbered if isinstance(unit, Wheel))

    @property
    def speeds_change(self) -> bool:
        """Whether rotor speeds may change in a run."""
        return any(block.run_up or isinstance(block, WheelCluster) for block in self.blocks)

    @property
    def run_up(self) -> bool:
        """Whether speeds are made to change as the scenario says."""
        return any(block.run_up for block in self.blocks)

    @property
    def ripple(self) -> tuple[float, ...]:
        """Lines in a turn of the gimbals, of the motors of all blocks."""
        motors = (block.gimbal_motor for block in self.blocks)
        return tuple(line for motor in motors if motor for line in motor.lines)

    @property
    def gimbal_rate_limits(self) -> np.ndarray:
        """Limits (cmg,) [rad/s] on gimbal rates; infinite without one."""
        each = [
            np.full(block.count, getattr(block, "gimbal_rate_limit", None) or np.inf)
            for block in self.blocks
        ]
        return np.concatenate(each) if each else np.zeros(0)
