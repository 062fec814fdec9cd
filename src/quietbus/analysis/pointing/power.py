"""Mean square of motion by frequency, contributor by contributor: cumulative power spectra."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from quietbus.analysis.pointing.windows import checked_density


@dataclass(frozen=True)
class LinePower:
    """Lines at some frequencies."""

    frequency_hz: np.ndarray  # (line,)
    mean_square: np.ndarray  # (line,) half the square of the amplitude

    def below(self, frequency_hz: np.ndarray) -> np.ndarray:
        """Mean square of the lines at or below each frequency [Hz]."""
        order = np.argsort(self.frequency_hz)
        sums = np.concatenate([[0.0], np.cumsum(np.asarray(self.mean_square)[order])])
        at = np.searchsorted(np.asarray(self.frequency_hz)[order], frequency_hz, side="right")
        return sums[at]

    @property
    def total(self) -> float:
        """Mean square of all."""
        return float(np.sum(self.mean_square))

    @property
    def corners(self) -> np.ndarray:
        """Frequencies [Hz] just before and at which the sum steps."""
        f = np.asarray(self.frequency_hz, dtype=float)
        return np.concatenate([np.nextafter(f, 0.0), f])


@dataclass(frozen=True)
class Density:
    """A one-sided power spectral density, linear between its frequencies, zero outside."""

    frequency_hz: np.ndarray  # (f,)
    density: np.ndarray  # (f,) [unit^2/Hz]

    def __post_init__(self) -> None:
        checked_density(self.frequency_hz, self.density)

    def below(self, frequency_hz: np.ndarray) -> np.ndarray:
        """Mean square below each frequency [Hz]."""
        f = np.asarray(self.frequency_hz, dtype=float)
        integral = make_interp_spline(f, np.asarray(self.density, float), k=1).antiderivative()
        return np.asarray(integral(np.clip(frequency_hz, f[0], f[-1])) - integral(f[0]))

    @property
    def total(self) -> float:
        """Mean square of all."""
        return float(self.below(np.asarray(self.frequency_hz)[-1:])[0])

    @property
    def corners(self) -> np.ndarray:
        """Frequencies [Hz] of the table."""
        return np.asarray(self.frequency_hz, dtype=float)


Power = LinePower | Density


def rms_above(parts: Mapping[str, Power], frequency_hz: float) -> float:
    """Root mean square of what all contributors have at or above a frequency [Hz]."""
    below = np.nextafter(frequency_hz, 0.0) if frequency_hz > 0.0 else -1.0
    return float(
        np.sqrt(sum(part.total - part.below(np.array([below]))[0] for part in parts.values()))
    )


@dataclass(frozen=True)
class Cumulative:
    """Cumulative mean square of independent contributors over common frequencies."""

    frequency_hz: np.ndarray  # (f,) rising; twice where lines step
    parts: dict[str, np.ndarray]  # (f,) by contributor

    @property
    def whole(self) -> np.ndarray:
        """(f,) of all contributors together."""
        return np.asarray(sum(self.parts.values()))


def cumulative(
    parts: Mapping[str, Power], direction: str = "forward", ends: tuple[float, float] | None = None
) -> Cumulative:
    """Cumulative power spectrum of named contributors.

    Args:
        parts: by name.
        direction: "forward": mean square up to each frequency. "backward": from each frequency on.
        ends: lowest and highest frequency [Hz] beside those of the contributors.

    Raises:
        ValueError: no contributors, or an unknown direction.
    """
    if direction not in ("forward", "backward"):
        raise ValueError(f"direction: expected forward or backward, got {direction!r}")
    if not parts:
        raise ValueError("expected one contributor or more")
    f = np.unique(np.concatenate([*(part.corners for part in parts.values()), list(ends or ())]))
    sums = {name: part.below(f) for name, part in parts.items()}
    if direction == "backward":
        sums = {name: parts[name].total - below for name, below in sums.items()}
    return Cumulative(f, sums)
