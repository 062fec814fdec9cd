"""Measured speed-frequency maps (waterfalls) from CSV and NetCDF."""

from __future__ import annotations

import difflib
import math
import os
from pathlib import Path

import numpy as np
import xarray as xr

from quietbus.arguments import path as argument_path
from quietbus.measured.check import MapCheck, MapError
from quietbus.scenario import Problem, ScenarioError
from quietbus.scenario.units import shown
from quietbus.scenario.wheel_files import KINDS
from quietbus.scenario.wheel_files.lines import read_cells

KEYS = ("component", "unit", "speed_unit", "frequency_unit", "window", "sample_rate")


def read_waterfall(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a measured map from CSV or NetCDF, checked and in SI.

    The layouts are those of docs/import.md. Values become one-sided power spectral densities.

    Returns:
        A variable (speed, frequency) for each component among ``radial_force``, ``axial_force``,
        ``radial_torque`` and ``axial_torque``, its ``window`` an attribute.

    Raises:
        MapError: everything wrong with the file.
    """
    file = Path(argument_path("path", path))
    if not file.is_file():
        what = "is a folder; expected the file of a map" if file.is_dir() else "no such file"
        raise MapError(str(file), [Problem(what)])
    return _read_netcdf(file) if _is_netcdf(file) else _read_csv(file)


def _is_netcdf(file: Path) -> bool:
    with file.open("rb") as opened:
        return opened.read(4) in (b"\x89HDF", b"CDF\x01", b"CDF\x02")


def _read_netcdf(file: Path) -> xr.Dataset:
    check = MapCheck(file)
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
    check = MapCheck(file)
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


def _rising(
    check: MapCheck, speed: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
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


def _number(check: MapCheck, cell: str, column: str, line: int, least: float = 0.0) -> float:
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
    check: MapCheck, rows: list[tuple[int, list[str]]], about: dict[str, str]
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
    check: MapCheck, rows: list[tuple[int, list[str]]], about: dict[str, str]
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
