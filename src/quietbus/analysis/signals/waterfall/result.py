"""What a fitted map says, and how far that can be relied on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from quietbus.analysis.signals.waterfall.measured import TINY, Waterfall
from quietbus.analysis.signals.waterfall.misfit import Explained
from quietbus.analysis.signals.waterfall.modes import Mode, noise_passed, passed
from quietbus.analysis.signals.waterfall.window import SeenWindow


@dataclass(frozen=True)
class Estimate:
    """A fitted number and its standard deviation; None where the model does not fit."""

    value: float
    deviation: float | None

    @property
    def relative(self) -> float | None:
        return None if self.deviation is None else self.deviation / abs(self.value)


@dataclass(frozen=True)
class FittedOrder:
    """One ray."""

    order: Estimate
    coefficient: Estimate  # [kg m or kg m^2] amplitude over speed squared
    whirl: str  # "forward" or "backward"
    line_error: float | None  # RMS of measured over fitted amplitude, less one; None: all is noise
    doubt: str | None  # why the coefficient is not to be relied on


@dataclass(frozen=True)
class FittedMode:
    """A mode between the rotor and the measurement that the component excites."""

    frequency: Estimate  # [Hz] undamped, rotor still
    damping: Estimate  # [-] over critical
    split: Estimate | None  # [-] spin over transverse inertia of the rotor; None: no split

    @property
    def mode(self) -> Mode:
        split = self.split.value if self.split else 0.0
        return Mode(2.0 * np.pi * self.frequency.value, self.damping.value, split)


@dataclass(frozen=True, eq=False)
class ComponentFit:
    """What a map says of one component."""

    measured: Waterfall
    window: SeenWindow
    orders: tuple[FittedOrder, ...]  # ascending
    modes: tuple[FittedMode, ...]  # in series, ascending
    floor_frequency: np.ndarray  # (k,) [Hz]
    floor: np.ndarray  # (k,) [as the map] straight between these on double-logarithmic paper
    floor_bounded: np.ndarray  # (k,) leakage hides the floor: it is at most this
    floor_at_rotor: bool  # the modes shape the noise too; else ``floor`` is what is measured
    averages: float | None  # of the spectra, from their scatter off the rays; None: not seen
    fitted: np.ndarray  # (n, m) as the map
    line_speed: tuple[np.ndarray, ...]  # per order: speeds (i,) [rad/s] at which its line was used
    line_amplitude: tuple[np.ndarray, ...]  # (i,) measured amplitude there
    line_error: float  # root mean square of measured over fitted amplitude, less one
    misfit: float  # root of the lines' chi-square over its degrees of freedom
    chance: float  # that it is so large if the model is right
    explained: Explained
    notes: tuple[str, ...]  # what is not to be relied on, for the user

    @property
    def residual_db(self) -> np.ndarray:
        """Measured over fitted (n, m) [dB]."""
        least = TINY * np.max(self.measured.psd)
        return 10.0 * np.log10(np.maximum(self.measured.psd, least) / self.fitted)

    def amplitude(self, k: int, speed: np.ndarray) -> np.ndarray:
        """Fitted amplitude [N or N m] of order number k at speeds [rad/s]."""
        line = self.orders[k]
        whirl = 1.0 if line.whirl == "forward" else -1.0
        through = passed([mode.mode for mode in self.modes], line.order.value, speed, whirl)
        return line.coefficient.value * speed**2 * through

    def whirl_hz(self, speed: np.ndarray) -> np.ndarray:
        """Undamped frequencies of modes (branch, n) [Hz]: one, or backward and forward, of each."""
        branches: list[np.ndarray] = []
        for mode in (each.mode for each in self.modes):
            half = 0.5 * mode.split * speed
            root = np.sqrt(mode.w0**2 + half**2)
            branches += [root - half, root + half] if mode.split else [root]
        return np.array(branches).reshape(-1, len(speed)) / (2.0 * np.pi)

    def rotor_floor(self, modes: Sequence[FittedMode]) -> np.ndarray:
        """Floor (k,) at the rotor, before modes, which make of it the measured level on average."""
        if self.floor_at_rotor and tuple(modes) == self.modes:
            return self.floor
        at_mount = self.floor * self._passed(self.modes) if self.floor_at_rotor else self.floor
        return at_mount / self._passed(modes)

    def _passed(self, modes: Sequence[FittedMode]) -> np.ndarray:
        """Power (k,) of noise that modes let pass, the mean of its logarithm over speeds."""
        through = noise_passed(
            [mode.mode for mode in modes], self.measured.speed, self.floor_frequency
        )
        return np.exp(np.mean(np.log(through), axis=0))

    def to_dict(self) -> dict[str, Any]:
        """Numbers and lists, for JSON."""

        def both(estimate: Estimate) -> dict[str, float | None]:
            return {"value": estimate.value, "deviation": estimate.deviation}

        return {
            "orders": [
                {
                    "order": both(line.order),
                    "coefficient": both(line.coefficient),
                    "whirl": line.whirl,
                    "speeds": len(speeds),
                    "line_error": line.line_error,
                    "doubt": line.doubt,
                }
                for line, speeds in zip(self.orders, self.line_speed, strict=True)
            ],
            "modes": [
                {
                    "frequency_hz": both(mode.frequency),
                    "damping": both(mode.damping),
                    "split": mode.split and both(mode.split),
                }
                for mode in self.modes
            ],
            "floor": {
                "frequency_hz": self.floor_frequency.tolist(),
                "psd": self.floor.tolist(),
                "upper_bound": self.floor_bounded.tolist(),
                "at": "rotor" if self.floor_at_rotor else "mount",
            },
            "averages": self.averages,
            "window": {
                "name": self.window.name,
                "source": self.window.source,
                "tested": self.window.tested,
                "difference": self.window.difference,
                "speed_change_rad_s": 2.0 * np.pi * self.window.smear,
            },
            "line_error": self.line_error,
            "misfit": self.misfit,
            "chance": self.chance,
            "explained": self.explained.to_dict(self.measured.speed),
            "notes": list(self.notes),
        }
