"""A table of a spectral density, linear between its rows: cut, shared to a grid, smoothed."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline


@dataclass(frozen=True)
class Table:
    """Densities (f, c, c), linear between frequencies (f,) [Hz] that increase, zero outside."""

    frequency: np.ndarray
    density: np.ndarray

    def at(self, f: np.ndarray) -> np.ndarray:
        """Densities (..., c, c)."""
        here = np.clip(f, self.frequency[0], self.frequency[-1])
        inside = (f >= self.frequency[0]) & (f <= self.frequency[-1])
        return np.asarray(np.where(inside[..., None, None], self._line(here), 0.0))

    def between(self, low: float, high: float) -> "Table":
        """What lies between two frequencies [Hz]."""
        f = self.frequency
        low, high = max(low, f[0]), min(high, f[-1])
        if low >= high:
            return Table(f[-2:], np.zeros_like(self.density[-2:]))
        x = np.concatenate([[low], f[(f > low) & (f < high)], [high]])
        return Table(x, self._line(x))

    @cached_property
    def total(self) -> np.ndarray:
        """(c, c) mean products."""
        return np.asarray(np.trapezoid(self.density, self.frequency, axis=0))

    def shared(self, grid: np.ndarray, moment: int = 0) -> np.ndarray:
        """Mean products (k, c, c) at the points of a grid [Hz] instead, each share linearly.

        Args:
            moment: 2 gives those of the time derivative.
        """
        at, weights = gauss(np.concatenate([self.frequency, grid]), *self.frequency[[0, -1]])
        left = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2)
        part = (at - grid[left]) / (grid[left + 1] - grid[left])
        power = (weights * (2.0 * np.pi * at) ** moment)[:, None, None] * self.at(at)
        result = np.zeros((len(grid), *power.shape[1:]))
        np.add.at(result, left, (1.0 - part)[:, None, None] * power)
        np.add.at(result, left + 1, part[:, None, None] * power)
        return result

    def smoothed(self, f: np.ndarray, time: float) -> np.ndarray:
        """Densities (..., c, c) as seen in a time [s]: averaged under a triangle of base 2/time.

        Close to the window's own ``time sinc^2``, of the same height and area.
        """
        step = 1.0 / time
        return np.asarray(
            (self._twice(f + step) - 2.0 * self._twice(f) + self._twice(f - step)) * time**2
        )

    def local_moments(self, time: float) -> np.ndarray:
        """tr C^2 and tr C^3 of its share of a window [s] that holds many periods.

        C of a narrow band with power P is P/2 twice, of a wide one S/2T at 2T frequencies a hertz.
        """
        f, step = self.frequency, 1.0 / time
        at, weights = gauss(np.concatenate([f, f - step, f + step]), f[0], f[-1])
        S, seen = self.at(at), self.smoothed(at, time)
        two = S @ seen
        second = weights @ np.trace(two, axis1=1, axis2=2) / (2.0 * time)
        third = weights @ np.trace(two @ seen, axis1=1, axis2=2) / (4.0 * time**2)
        return np.array([second, third])

    @cached_property
    def _line(self) -> BSpline:
        return make_interp_spline(self.frequency, self.density, k=1)

    @cached_property
    def _integrals(self) -> tuple[BSpline, BSpline]:
        return self._line.antiderivative(1), self._line.antiderivative(2)

    def _twice(self, f: np.ndarray) -> np.ndarray:
        """Integrated twice from the first frequency, beyond the last one straight on."""
        once, twice = self._integrals
        start, end = self.frequency[[0, -1]]
        here = np.clip(f, start, end)
        return np.asarray(twice(here) + np.maximum(f - end, 0.0)[..., None, None] * once(end))


def gauss(edges: np.ndarray, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss's quadrature from start to end, of three points between edges."""
    x = np.unique(np.clip(edges, start, end))
    nodes, weights = np.polynomial.legendre.leggauss(3)
    half = 0.5 * np.diff(x)[:, None]
    return ((0.5 * (x[1:] + x[:-1]))[:, None] + half * nodes).ravel(), (half * weights).ravel()
