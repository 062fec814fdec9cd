"""How much of a map's power a fit explains, by speed and order."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from quietbus.analysis.signals.waterfall.measured import Waterfall


@dataclass(frozen=True, eq=False)
class Explained:
    """Power of a map and of its fit [N^2 or N^2 m^2]; every bin belongs to one order or to none.

    What is measured above the fit is unexplained, and so is what the fit has too much, by bands:
    each order's bins of a row, and the rest of the row.
    """

    measured: np.ndarray  # (n, h + 1) in the bins about each order's line, and in all others
    fitted: np.ndarray  # (n, h + 1)

    @property
    def by_speed(self) -> np.ndarray:
        """Share (n,) of a row's power."""
        return self._share(1)

    @property
    def by_order(self) -> np.ndarray:
        """Share (h + 1,) of the power about each order's lines, and of the rest."""
        return self._share(0)

    def _share(self, axis: int) -> np.ndarray:
        same = np.minimum(self.measured, self.fitted).sum(axis=axis)
        more = np.maximum(self.fitted - self.measured, 0.0).sum(axis=axis)
        total = self.measured.sum(axis=axis)
        share = (same - more) / np.where(total > 0.0, total, 1.0)
        return np.where(total > 0.0, np.maximum(share, 0.0), 1.0)

    @property
    def total(self) -> float:
        """Share of the map's power."""
        same = np.minimum(self.measured, self.fitted).sum()
        more = np.maximum(self.fitted - self.measured, 0.0).sum()
        return float(max(same - more, 0.0) / self.measured.sum())

    def to_dict(self, speed: np.ndarray) -> dict[str, Any]:
        return {
            "total": self.total,
            "speed_rad_s": speed.tolist(),
            "by_speed": self.by_speed.tolist(),
            "by_order": self.by_order[:-1].tolist(),
            "rest": float(self.by_order[-1]),
            "power_by_speed": self.measured.sum(axis=1).tolist(),
            "power_by_order": self.measured.sum(axis=0)[:-1].tolist(),
        }


def explained(
    measured: Waterfall, fitted: np.ndarray, positions: Sequence[np.ndarray], halves: Sequence[int]
) -> Explained:
    """Power by bands.

    Args:
        fitted: (n, m) as the map.
        positions: of each order's line (n,) [bins from 0 Hz].
        halves: of each order's band [bins].
    """
    owner = np.full(measured.psd.shape, len(positions))
    nearest = np.full(measured.psd.shape, np.inf)
    for k, (at, half) in enumerate(zip(positions, halves, strict=True)):
        away = np.abs(measured.bins - at[:, None])
        own = (away <= half + 0.5) & (away < nearest)
        owner[own], nearest[own] = k, away[own]
    sums = [
        np.stack([(values * (owner == k)).sum(axis=1) for k in range(len(positions) + 1)], axis=1)
        for values in (measured.psd, fitted)
    ]
    return Explained(sums[0] * measured.bin, sums[1] * measured.bin)
