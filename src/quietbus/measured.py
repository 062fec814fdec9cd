"""Measured speed-frequency maps (waterfalls) of a rotor's forces and torques: files and fit."""

from __future__ import annotations

import difflib
import math
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from pydantic_core import PydanticCustomError

from quietbus.analysis.waterfall import (
    ComponentFit,
    FitError,
    FittedMode,
    LineShape,
    Waterfall,
    fit,
    segment_size,
    transmission,
    window_name,
)
from quietbus.scenario import Problem, ScenarioError
from quietbus.scenario.text import write_yaml
from quietbus.scenario.units import Quantity, shown
from quietbus.scenario.wheel_files import KINDS
from quietbus.scenario.wheel_files.lines import read_cells

KEYS = ("component", "unit", "speed_unit", "frequency_unit", "window", "sample_rate")
_SPEED = Quantity("a rotor speed", "rad/s", above=0.0)
_FREQUENCY = Quantity("a frequency", "Hz", least=0.0)
_PSD = {
    "force": Quantity("a power spectral density", "N^2/Hz", exact=True),
    "torque": Quantity("a power spectral density", "N^2*m^2/Hz", exact=True),
}
_ROOT = {
    "force": Quantity("the root of a power spectral density", "N/Hz^0.5", exact=True),
    "torque": Quantity("the root of a power spectral density", "N*m/Hz^0.5", exact=True),
}
_SQUARE = {
    "force": Quantity("a power spectrum", "N^2", exact=True),
    "torque": Quantity("a power spectrum", "N^2*m^2", exact=True),
}
_AMPLITUDE = {"force": Quantity("an amplitude", "N"), "torque": Quantity("an amplitude", "N*m")}
# an amplitude's reading of a sinusoid, of its root mean square
_READINGS = {"rms": 1.0, "peak": 0.5**0.5, "pk": 0.5**0.5, "pp": 0.125**0.5}
_READING = re.compile(r"[_ ]?(rms|peak|pk|pp)\b", re.IGNORECASE)
_LEAST_WINDOW = "hann"  # by which amplitudes are read until the window is known
_EVEN = 1e-3  # relative difference of steps of frequency
_TOLD = 5  # problems of a file
_RESONANCES = {"radial_force": "radial", "axial_force": "axial", "radial_torque": "rocking"}
_SNAP = 2e-3  # orders as near to a whole number are taken as that


class MapError(ScenarioError):
    """A measured map that cannot be used: file, place, what was expected and what came."""


def read_waterfall(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a measured map from CSV or NetCDF, checked and in SI.

    The layouts are those of docs/import.md. Values become one-sided power spectral densities.

    Returns:
        A variable (speed, frequency) for each component among ``radial_force``, ``axial_force``,
        ``radial_torque`` and ``axial_torque``, its ``window`` an attribute.

    Raises:
        MapError: everything wrong with the file.
    """
    file = Path(path)
    if not file.is_file():
        what = "is a folder; expected the file of a map" if file.is_dir() else "no such file"
        raise MapError(str(file), [Problem(what)])
    return _read_netcdf(file) if _is_netcdf(file) else _read_csv(file)


def _is_netcdf(file: Path) -> bool:
    with file.open("rb") as opened:
        return opened.read(4) in (b"\x89HDF", b"CDF\x01", b"CDF\x02")


class _Check:
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
            "units": _PSD[kind].unit,
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

    def _scale(self, kind: str, unit: str) -> "_Scale | None":
        """What a value of a map is."""
        reading = _READING.search(unit)
        plain = _READING.sub("", unit)
        for text in ("sqrt(Hz)", "√(Hz)", "√Hz", "rtHz"):
            plain = plain.replace(text, "Hz^0.5")
        rms = reading is None or reading[1].lower() == "rms"
        for quantity, power, density in (
            (_PSD[kind], 1, True),
            (_ROOT[kind], 2, True),
            (_SQUARE[kind], 1, False),
        ):
            factor = self._factor(quantity, plain)
            if factor is not None and rms:
                return _Scale(factor, power, density)
        factor, si = self._factor(_AMPLITUDE[kind], plain), _AMPLITUDE[kind].unit
        if factor is not None and reading is not None:
            return _Scale(factor * _READINGS[reading[1].lower()], 2, False)
        if factor is not None:
            self.wrong(
                f"an amplitude: does a sinusoid read its peak or its root mean square? write "
                f"{unit}_peak or {unit}_rms; got {shown(unit)}",
                "unit",
            )
            return None
        self.wrong(
            f"expected a power spectral density in {_PSD[kind].unit} or its root in "
            f"{_ROOT[kind].unit}, a power spectrum in {_SQUARE[kind].unit}, or an amplitude in "
            f"{si}_rms or {si}_peak, got {shown(unit or None)}",
            "unit",
        )
        return None

    @staticmethod
    def _factor(quantity: Quantity, unit: str) -> float | None:
        try:
            return quantity.read(f"1 {unit}") if unit else None
        except PydanticCustomError:
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


@dataclass(frozen=True)
class _Scale:
    """How a value becomes a power: (factor * value) ** power, in SI."""

    factor: float
    power: int
    density: bool  # per Hz; else what a sinusoid reads, by the window's noise bandwidth


def _read_netcdf(file: Path) -> xr.Dataset:
    check = _Check(file)
    try:
        with xr.open_dataset(file) as stored:
            data = stored.load()
    except (OSError, ValueError, KeyError) as error:
        why = str(error).splitlines()[0].partition(". ")[0]
        raise MapError(str(file), [Problem(f"not a whole NetCDF file ({why})")]) from None
    wanted = [name for name in data.data_vars if name in KINDS]
    for name in ("speed", "frequency"):
        if name not in data.coords:
            check.wrong(f"expected a coordinate '{name}', got {', '.join(map(str, data.coords))}")
    if not wanted:
        check.wrong(
            f"expected variables among {', '.join(KINDS)}, got "
            f"{', '.join(map(str, data.data_vars)) or 'none'}"
        )
    check.raise_any()
    maps = []
    for name in wanted:
        array = data[name]
        if set(array.dims) != {"speed", "frequency"}:
            got = ", ".join(map(str, array.dims))
            check.wrong(f"expected dimensions speed, frequency, got {got}", str(name))
            continue
        attributes = data.attrs | array.attrs
        about = {
            key: str(attributes[key]) for key in ("window", "sample_rate") if key in attributes
        }
        about["unit"] = str(array.attrs.get("units", ""))
        for axis in ("speed", "frequency"):
            about[f"{axis}_unit"] = str(data[axis].attrs.get("units", ""))
        values = array.transpose("speed", "frequency").to_numpy().astype(float)
        speed, frequency = (data[a].to_numpy().astype(float) for a in ("speed", "frequency"))
        speed, values = _rising(check, speed, values)
        maps.append(check.component(str(name), speed, frequency, values, about))
    check.raise_any()
    return xr.merge([each for each in maps if each is not None])


def _read_csv(file: Path) -> xr.Dataset:
    """A matrix with frequencies in the first row and speeds in the first column, or long rows."""
    check = _Check(file)
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise MapError(str(file), [Problem(f"cannot be read as text: {error}")]) from None
    about: dict[str, str] = {}
    numbered: list[tuple[int, str]] = []
    for number, line in enumerate(lines, 1):
        if line.startswith("#"):
            key, colon, value = (part.strip() for part in line[1:].partition(":"))
            if colon and key in KEYS:
                if key in about:
                    check.wrong("this key appears twice", key, number)
                about[key] = value
            elif colon and (close := difflib.get_close_matches(key.lower(), KEYS, 1, 0.8)):
                check.wrong(f"unknown key {shown(key)}; did you mean '{close[0]}'?", line=number)
        else:
            numbered.append((number, line.strip()))
    try:
        rows = read_cells(file, numbered).rows
    except ScenarioError as error:
        raise MapError(error.source, error.problems) from None
    if len(rows) < 2:
        check.wrong("expected a row of frequencies and one for each speed, got no map")
    check.raise_any()
    if "frequency" in [cell.lower() for cell in rows[0][1]]:
        maps = _long(check, rows, about)
    else:
        maps = [_matrix(check, rows, about)]
    check.raise_any()
    return xr.merge([each for each in maps if each is not None])


def _rising(check: _Check, speed: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speeds above 0 that ascend, with their rows: a rig may slow down, or turn the rotor back.

    A rotor that turns backwards has the spectra of one that turns forwards: they have no sign.
    """
    if np.any(speed > 0.0) and np.any(speed < 0.0):
        check.wrong(
            f"expected speeds of one sense of rotation, got {speed[speed < 0.0][0]:g} and "
            f"{speed[speed > 0.0][0]:g}: fit each by itself",
            "speed",
        )
    elif np.any(speed < 0.0):
        speed = np.abs(speed)
    if len(speed) == len(values) and len(speed) > 1 and np.all(np.diff(speed) < 0.0):
        return speed[::-1], values[::-1]
    return speed, values


def _number(check: _Check, cell: str, column: str, line: int, least: float = 0.0) -> float:
    """A cell as a number of at least 0, as frequencies and values are; speeds may be less."""
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or number < least:
        what = "a number of at least 0" if least == 0.0 else "a number"
        check.wrong(f"expected {what}, got {shown(cell)}", column, line)
    return number


def _matrix(
    check: _Check, rows: list[tuple[int, list[str]]], about: dict[str, str]
) -> xr.DataArray | None:
    line, head = rows[0]
    columns = [f"column {i}" for i in range(1, len(head) + 1)]
    places = list(zip(columns[1:], head[1:], strict=True))
    frequency = np.array([_number(check, cell, column, line) for column, cell in places])
    speed, values = [], []
    for number, cells in rows[1:]:
        if len(cells) != len(head):
            check.wrong(f"expected {len(head)} cells, got {len(cells)}", line=number)
            continue
        speed.append(_number(check, cells[0], columns[0], number, -math.inf))
        places = list(zip(columns[1:], cells[1:], strict=True))
        values.append([_number(check, cell, column, number) for column, cell in places])
    check.raise_any()
    rising, power = _rising(check, np.array(speed), np.array(values))
    return check.component(about.get("component", ""), rising, frequency, power, about)


def _long(
    check: _Check, rows: list[tuple[int, list[str]]], about: dict[str, str]
) -> list[xr.DataArray | None]:
    line, head = rows[0]
    head = [cell.lower() for cell in head]
    known = ("component", "speed", "frequency", "value")
    for name in head:
        if name not in known:
            check.wrong(f"unknown column {shown(name)}; known: {', '.join(known)}", line=line)
    for name in known[1:]:
        if name not in head:
            check.wrong(f"expected a column '{name}', got {', '.join(head)}", line=line)
    check.raise_any()
    points: dict[str, dict[tuple[float, float], float]] = {}
    for number, cells in rows[1:]:
        if len(cells) != len(head):
            check.wrong(f"expected {len(head)} cells, got {len(cells)}", line=number)
            continue
        row = dict(zip(head, cells, strict=True))
        component = row.get("component") or about.get("component", "")
        speed = _number(check, row["speed"], "speed", number, -math.inf)
        frequency, value = (
            _number(check, row[name], name, number) for name in ("frequency", "value")
        )
        place = points.setdefault(component, {})
        if (speed, frequency) in place:
            check.wrong(
                f"speed {speed:g} and frequency {frequency:g} stand here twice", line=number
            )
        place[speed, frequency] = value
    check.raise_any()
    maps = []
    for component, place in points.items():
        speeds, frequencies = (np.array(sorted({at[i] for at in place})) for i in range(2))
        values = np.full((len(speeds), len(frequencies)), np.nan)
        for (speed, frequency), value in place.items():
            values[np.searchsorted(speeds, speed), np.searchsorted(frequencies, frequency)] = value
        missing = values.size - len(place)
        if missing:
            check.wrong(f"expected every speed with every frequency; {missing} are missing",
                        component)  # fmt: skip
            continue
        speeds, values = _rising(check, speeds, values)
        maps.append(check.component(component, speeds, frequencies, values, about))
    return maps


@dataclass(frozen=True, eq=False)
class WaterfallFit:
    """What the maps of a rotor say: orders, modes on its bearings, broadband floor."""

    components: dict[str, ComponentFit]

    @property
    def notes(self) -> list[str]:
        """What is not to be relied on, and what the block ``disturbance`` leaves out."""
        notes = []
        for name, each in self.components.items():
            notes += [f"{name}: {note}" for note in each.notes]
            kept = _kept(name, each)
            for mode in each.modes:
                if mode is not kept:
                    notes.append(f"{name}: {_left_out(each, mode)}")
            if any(line.doubt for line in each.orders):
                notes.append(f"{name}: orders in doubt are left out of the block 'disturbance'")
        return notes

    def to_dict(self) -> dict[str, Any]:
        """All fitted numbers with their standard deviations, for JSON."""
        return {
            "components": {name: each.to_dict() for name, each in self.components.items()},
            "disturbance": self.disturbance(),
            "notes": self.notes,
        }

    def disturbance(self) -> dict[str, Any]:
        """The scenario's ``rotor.disturbance``.

        Orders of several components that agree within three standard deviations or 0.2 % are one;
        those as near to a whole number are that number. Phases are random: a map has none. Orders
        in doubt are left out. A scenario has one resonance of a component: the one that shapes
        the lines most, with the floor before it.
        """
        resonances, broadband = {}, {}
        for name, each in self.components.items():
            kept = _kept(name, each)
            if kept is not None:
                resonances[_RESONANCES[name]] = {
                    "frequency": kept.frequency.value,
                    "damping": kept.damping.value,
                }
            floor = each.rotor_floor([kept] if kept else [])
            broadband[name] = {"frequency": each.floor_frequency.tolist(), "psd": floor.tolist()}
        block: dict[str, Any] = {"orders": self._orders()}
        if resonances:
            block["resonances"] = resonances
        return _rounded(block | {"broadband": broadband})

    def _orders(self) -> list[dict[str, Any]]:
        orders: list[dict[str, Any]] = []
        found = [
            (line, name)
            for name, each in self.components.items()
            for line in each.orders
            if line.doubt is None
        ]
        for line, name in sorted(found, key=lambda pair: pair[0].order.value):
            value, whirl = line.order.value, line.whirl
            near = max(3.0 * (line.order.deviation or 0.0), _SNAP * min(value, 1.0))
            if round(value) >= 1 and abs(value - round(value)) < near:
                value = float(round(value))
            same = next(
                (
                    o
                    for o in orders
                    if abs(o["order"] - value) < near
                    and o.get("whirl", "forward") == whirl
                    and name not in o
                ),
                None,
            )
            if same is None:
                same = {"order": value}
                if whirl == "backward":
                    same["whirl"] = "backward"
                orders.append(same)
            same[name] = line.coefficient.value
        orders = [order | {"phase": "random"} for order in orders]
        return sorted(orders, key=lambda o: (o["order"], o.get("whirl") == "backward"))

    def to_yaml(self) -> str:
        """YAML text of the block ``disturbance``, in SI units."""
        return write_yaml({"disturbance": self.disturbance()})

    def to_dataset(self) -> xr.Dataset:
        """Maps: measured, fitted and residual, by component."""
        data = {}
        for name, each in self.components.items():
            unit = {"units": _PSD[name.rpartition("_")[2]].unit}
            for what, values, attributes in (
                ("measured", each.measured.psd, unit),
                ("fitted", each.fitted, unit),
                ("residual", each.residual_db, {"units": "dB"}),
            ):
                data[f"{name}_{what}"] = (("speed", "frequency"), values, attributes)
        first = next(iter(self.components.values())).measured
        coordinates = {
            "speed": ("speed", first.speed, {"units": "rad/s"}),
            "frequency": ("frequency", first.frequency, {"units": "Hz"}),
        }
        return xr.Dataset(data, coordinates)


def _kept(name: str, fitted: ComponentFit) -> FittedMode | None:
    """The mode of a component that a scenario can have: the one that shapes the lines most."""
    # a mode in a torque that does not split is a structure's, not the rotor's rocking
    able = [mode for mode in fitted.modes if mode.split or name != "radial_torque"]
    if name not in _RESONANCES or not able:
        return None
    return max(able, key=lambda mode: float(np.ptp(np.log(_amplified(fitted, mode)))))


def _left_out(fitted: ComponentFit, mode: FittedMode) -> str:
    largest = float(np.max(np.abs(np.log(_amplified(fitted, mode)))))
    return (
        f"the block 'disturbance' holds one resonance of the rotor on its bearings; the mode at "
        f"{mode.frequency.value:.4g} Hz is left out, which changes lines by up to a factor of "
        f"{math.exp(largest):.2g}"
    )


def _amplified(fitted: ComponentFit, mode: FittedMode) -> np.ndarray:
    """What a mode lets pass of every line at every speed."""
    own = mode.mode
    ways = [1.0 if line.whirl == "forward" else -1.0 for line in fitted.orders]
    return np.concatenate(
        [
            transmission(line.order.value, speed, own.w0, own.damping, way * own.split)
            for line, speed, way in zip(fitted.orders, fitted.line_speed, ways, strict=True)
        ]
    )


def _rounded(data: Any) -> Any:
    """Six digits, more than any fit is good for, which can be read."""
    if isinstance(data, dict):
        return {key: _rounded(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_rounded(value) for value in data]
    return float(f"{data:.6g}") if isinstance(data, float) else data


def fit_waterfall(maps: xr.Dataset | str | os.PathLike[str], most: int = 20) -> WaterfallFit:
    """Fit orders, coefficients, modes on the bearings and broadband floor to measured maps.

    Args:
        maps: as of ``read_waterfall``, or the path of a file for it.
        most: number of orders that are looked for in each component.

    Raises:
        MapError: the file is wrong.
        FitError: too few speeds, no order stands out, lines do not have the declared window's
            shape, or what was found does not explain the map; it names the component.
    """
    data = maps if isinstance(maps, xr.Dataset) else read_waterfall(maps)
    fits = {}
    for name in (kind for kind in KINDS if kind in data):
        array = data[name].transpose("speed", "frequency")
        measured = Waterfall(
            name,
            array["speed"].to_numpy(),
            array["frequency"].to_numpy(),
            array.to_numpy(),
            array.attrs.get("window"),
            sample_rate=_hertz(array.attrs.get("sample_rate")),
            noise_bandwidth=array.attrs.get("noise_bandwidth"),
        )
        try:
            fits[name] = fit(measured, most)
        except FitError as error:
            raise FitError(f"{name}: {error}") from None
    if not fits:
        raise FitError(f"expected variables among {', '.join(KINDS)}, got none")
    return WaterfallFit(fits)


def _hertz(rate: str | None) -> float | None:
    return None if rate is None else Quantity("a frequency", "Hz", above=0.0).read(rate)
