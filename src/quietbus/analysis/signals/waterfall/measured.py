"""A measured map, and why one cannot be fitted."""

from dataclasses import dataclass, field

import numpy as np

TINY = 1e-30  # of the largest value: nothing measures less


class FitError(ValueError):
    """A map of which nothing can be fitted; the message says why."""


@dataclass(frozen=True, eq=False)
class Waterfall:
    """A measured map of one component."""

    component: str  # radial_force, axial_force, radial_torque or axial_torque
    speed: np.ndarray  # (n,) [rad/s] ascending
    frequency: np.ndarray  # (m,) [Hz] ascending, evenly spaced
    psd: np.ndarray  # (n, m) one-sided [N^2/Hz or N^2 m^2/Hz]
    window: str | None = None  # of the spectra, as by ``window_name``; None: not known
    sample_rate: float | None = field(default=None, kw_only=True)  # [Hz]; None: the last bin's
    # [bins] by which amplitudes became densities before the window was known; None: none did
    noise_bandwidth: float | None = field(default=None, kw_only=True)

    @property
    def bin(self) -> float:
        """[Hz]"""
        return float((self.frequency[-1] - self.frequency[0]) / (len(self.frequency) - 1))

    @property
    def turns(self) -> np.ndarray:
        """Speed (n,) [Hz]."""
        return self.speed / (2.0 * np.pi)

    @property
    def bins(self) -> np.ndarray:
        """Frequency (m,) [bins]."""
        return self.frequency / self.bin

    @property
    def positive(self) -> np.ndarray:
        """``psd`` (n, m), its zeros replaced by next to nothing, for logarithms."""
        return np.maximum(self.psd, TINY * np.max(self.psd))
