"""Slow motion and lines within exposure windows: covariance of their jitter, and their smear."""

from functools import cached_property

import numpy as np

from quietbus.analysis.pointing.motion import WindowParts
from quietbus.analysis.pointing.window_noise import of_lines
from quietbus.analysis.pointing.windows import Metric, gain, left_over


class Inside:
    """Of windows of a length [s], with lines at frequencies (group,) [Hz]."""

    def __init__(self, slow: WindowParts, window: float, lines_hz: np.ndarray):
        self.slow, self.window, self.f = slow, window, lines_hz
        u = np.pi * lines_hz * window
        self.same, self.other = (left_over(u[:, None], side, 2) for side in (u, -u))

    def smear(self, z: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        """(n, c) of slow motion and lines with phasors (n, group, c)."""
        drift = gain(Metric("smear", self.window), self.f)[:, None]
        return self.slow.smear[which] + np.sum(drift * z, axis=1).real

    def covariance(self, z: np.ndarray, which: np.ndarray | slice) -> np.ndarray:
        """(n, c, c) of jitter, of slow motion and lines with phasors (n, group, c) together."""
        slow = self.slow.coefficients[which][:, 1:]
        lines = self._coefficients[1 : slow.shape[1] + 1]
        mixed = slow.swapaxes(1, 2) @ np.einsum("mg,nga->nma", lines, z).real
        own = self.slow.about_line[which] + self._of_lines(z)
        return own + mixed + mixed.swapaxes(1, 2)

    @cached_property
    def _coefficients(self) -> np.ndarray:
        """(order, group) as ``of_lines``."""
        return of_lines(self.f, self.window)

    def _of_lines(self, z: np.ndarray) -> np.ndarray:
        """(n, c, c) of coherent lines z about their mean and slope, exactly."""
        mixed = self.same @ z.conj() + self.other @ z
        return np.asarray(0.5 * (z.swapaxes(1, 2) @ mixed).real)
