"""Parts of a measured map, read into SI and checked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from pydantic_core import PydanticCustomError

from quietbus.analysis.signals.waterfall import LineShape, segment_size, window_name
from quietbus.measured.units import PSD, Scale, scale_of
from quietbus.scenario import Problem, ScenarioError
from quietbus.scenario.units import Quantity, shown
from quietbus.scenario.wheel_files import KINDS

_SPEED = Quantity("a rotor speed", "rad/s", above=0.0)
_FREQUENCY = Quantity("a frequency", "Hz", least=0.0)
_LEAST_WINDOW = "hann"  # by which amplitudes are read until the window is known
_EVEN = 1e-3  # relative difference of steps of frequency
_TOLD = 5  # problems of a file


class MapError(ScenarioError):
    """A measured map that cannot be used: file, place, what was expected and what came."""


class MapCheck:
    """Reads and checks the parts of a map, and collects what is wrong."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.problems: list[Problem] = []

    def wrong(self, message: str, column: str = "", line: int | None = None) -> None:
        self.problems.append(Problem(message, (column,) if column else (), line))

    def raise_any(self) -> None:
        """Tell what is wrong, of a long file the first problems only: all have one cause."""
        if self.problems:
            told, left = self.problems[:_TOLD], len(self.problems) - _TOLD
            more = [Problem(f"and {left} problems more")] if left > 0 else []
            raise MapError(str(self.file), [*told, *more])

    def factor(self, quantity: Quantity, unit: str, where: str) -> float | None:
        """SI per unit, or None if the unit is another quantity's."""
        try:
            return quantity.read(f"1 {unit}")
        except PydanticCustomError as error:
            self.wrong(str(error), where)
            return None

    def component(
        self,
        name: str,
        speed: np.ndarray,
        frequency: np.ndarray,
        values: np.ndarray,
        about: dict[str, str],
    ) -> xr.DataArray | None:
        """One map in SI, or None if it has problems."""
        before = len(self.problems)
        if name not in KINDS:
            got = shown(name or None)
            self.wrong(f"expected one of {', '.join(KINDS)}, got {got}", "component")
            return None
        window = self._window(about)
        per_speed = self._unit(_SPEED, about, "speed_unit")
        per_frequency = self._unit(_FREQUENCY, about, "frequency_unit", "Hz")
        kind, unit = name.rpartition("_")[2], about.get("unit", "")
        scale = self._scale(kind, unit)
        self.axis("speed", speed, "above 0", speed > 0.0)
        self.axis("frequency", frequency, "at least 0", frequency >= 0.0)
        if values.shape != (len(speed), len(frequency)):
            self.wrong(
                f"expected {len(speed)} x {len(frequency)} values, speeds by frequencies, got "
                f"{' x '.join(map(str, values.shape))}",
                name,
            )
        elif not np.all(np.isfinite(values)) or np.any(values < 0.0):
            i, k = np.argwhere(~(np.isfinite(values) & (values >= 0.0)))[0]
            self.wrong(
                f"expected numbers of at least 0, got {values[i, k]:g} at speed {speed[i]:g} and "
                f"frequency {frequency[k]:g}",
                name,
            )
        if len(self.problems) > before:
            return None
        assert per_speed is not None
        assert per_frequency is not None
        hertz = frequency * per_frequency
        steps = np.diff(hertz)
        if np.ptp(steps) > _EVEN * np.mean(steps):
            self.wrong("expected evenly spaced frequencies, as of a spectrum", "frequency")
        rate = self._nyquist(about, hertz)
        if len(self.problems) > before:
            return None
        assert scale is not None
        values = (scale.factor * values) ** scale.power
        shape = LineShape(window or _LEAST_WINDOW, segment_size(hertz, rate))
        if not scale.density:
            values = values / (shape.noise_bandwidth * float(np.mean(steps)))
        coordinates = {
            "speed": ("speed", speed * per_speed, {"units": "rad/s"}),
            "frequency": ("frequency", hertz, {"units": "Hz"}),
        }
        attributes: dict[str, Any] = {
            "units": PSD[kind].unit,
            "long_name": f"one-sided power spectral density of the {name.replace('_', ' ')}",
        }
        if window is not None:
            attributes["window"] = window
        elif not scale.density:
            attributes["noise_bandwidth"] = shape.noise_bandwidth
        if rate is not None:
            attributes["sample_rate"] = f"{rate:.15g} Hz"
        return xr.DataArray(values, coordinates, ("speed", "frequency"), name, attributes)

    def _unit(
        self, quantity: Quantity, about: dict[str, str], key: str, default: str = ""
    ) -> float | None:
        unit = about.get(key, default)
        if not unit:
            self.wrong(f"expected a unit, such as {quantity.unit}, got none", key)
            return None
        return self.factor(quantity, unit, key)

    def _window(self, about: dict[str, str]) -> str | None:
        if not about.get("window"):
            return None
        try:
            return window_name(about["window"])
        except ValueError as error:
            self.wrong(str(error), "window")
            return None

    def _scale(self, kind: str, unit: str) -> Scale | None:
        try:
            return scale_of(kind, unit)
        except ValueError as error:
            self.wrong(str(error), "unit")
            return None

    def axis(self, name: str, values: np.ndarray, what: str, fine: np.ndarray) -> None:
        """An axis of a map is long enough, in order and of the right sign."""
        if len(values) < 3:
            self.wrong(f"expected at least three, got {len(values)}", name)
        for i in np.flatnonzero(~(np.isfinite(values) & fine))[:1]:
            self.wrong(f"expected numbers {what}, got {values[i]:g}", name)
        for i in np.flatnonzero(np.diff(values) <= 0.0)[:1]:
            self.wrong(
                f"expected ascending values, got {values[i + 1]:g} after {values[i]:g}", name
            )

    def _nyquist(self, about: dict[str, str], hertz: np.ndarray) -> float | None:
        """The sample rate [Hz], where one is given."""
        if not about.get("sample_rate"):
            return None
        try:
            rate = Quantity("a frequency", "Hz", above=0.0).read(about["sample_rate"])
        except PydanticCustomError as error:
            self.wrong(str(error), "sample_rate")
            return None
        if hertz[-1] > 0.5 * rate * (1.0 + 1e-9):
            self.wrong(
                f"expected at most {0.5 * rate:g} Hz, the Nyquist frequency of the sample_rate, "
                f"got {hertz[-1]:g}",
                "frequency",
            )
        return rate
