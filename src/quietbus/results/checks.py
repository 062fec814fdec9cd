"""What a file must be to pass for a run: it may come from elsewhere, or be damaged."""

import mmap
from collections.abc import Iterator, Set
from typing import Any, BinaryIO

import h5py
import numpy as np
import xarray as xr

from quietbus.methods import METHODS
from quietbus.results.origin import method_of, scenario_of
from quietbus.results.schema import DIMENSIONS, described, jitter_variables_of, variables_of
from quietbus.scenario import Scenario

STATUSES = ("complete", "stopped", "interrupted")
TEXTS = ("scenario", "mount", "method", "status")  # attributes without which a run is none
PACKED = 1100  # no file holds more bytes for each of its own
HEAP = b"GCOL\x01\0\0\0"  # how global heaps of HDF5 begin
UNIT = 1e-3  # by which a quaternion's length may differ from one
OPEN = ("jitter_change_error",)  # may be infinite, where nothing bounds the error


def check_file_parts(stored: h5py.File, size: int) -> None:
    """Refuse a file that reaches for other files, or holds more than its size can.

    Args:
        size: of the file [bytes].

    Raises:
        ValueError: what it holds that a run does not.
    """
    declared = 0
    for name in stored:
        link = stored.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"'{name}' is a link to elsewhere")
        item = stored[name]
        if isinstance(item, h5py.Dataset):
            if item.external or item.is_virtual:
                raise ValueError(f"'{name}' has its values in other files")
            declared += item.size * item.dtype.itemsize
    if declared > PACKED * size:
        raise ValueError(f"it declares {declared:.3g} bytes, and has {size}")


def check_heaps(file: BinaryIO, size: int) -> None:
    """Refuse a file with a damaged heap, in which HDF5 would search without end.

    A heap (format specification III.E) is a row of objects; free space is the object of number 0,
    whose size counts its own head. HDF5 (2.0) does not move on where that is zero.

    Raises:
        ValueError: such a heap.
    """
    if size == 0:
        return
    with mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ) as data:
        start = data.find(HEAP)
        while start >= 0:
            at = start + 16
            end = min(start + int.from_bytes(data[start + 8 : at], "little"), size)
            while at + 16 <= end:
                number = int.from_bytes(data[at : at + 2], "little")
                length = int.from_bytes(data[at + 8 : at + 16], "little")
                if number == 0 and length < 16:
                    raise ValueError("a heap of it is damaged")
                at += length if number == 0 else 16 + -(-length // 8) * 8
            start = data.find(HEAP, start + 1)


def check_run(run: xr.Dataset) -> None:
    """Refuse what is no run, or cannot be one.

    Raises:
        ValueError: all that is wrong with it, in one line.
    """
    _refuse_lack({"time", *variables_of(["bus"])} - set(run.variables))
    _refuse_lack(set(TEXTS) - set(run.attrs))
    wrong = [*_attributes(run), *_time(run)]
    if not wrong:
        scenario = _scenario(run)
        _refuse_lack(variables_of(scenario.bodies).keys() - set(run.variables))
        wrong += [*_sizes(run, scenario), *_variables(run)]
        if not wrong and method_of(run).jitter_apart:
            wrong += _harmonic(run, scenario)
    if wrong:
        more = f"; and {len(wrong) - 5} more" if len(wrong) > 5 else ""
        raise ValueError(f"not a sound run of quietbus: {'; '.join(wrong[:5])}{more}")


def _refuse_lack(missing: Set[Any]) -> None:
    if missing:
        raise ValueError(f"a NetCDF file, but not a run of quietbus: it has no {_list(missing)}")


def _attributes(run: xr.Dataset) -> Iterator[str]:
    for name in (*TEXTS, "stop_reason", "title", "quietbus_version", "solver", "created"):
        if not isinstance(run.attrs.get(name, ""), str):
            yield f"its attribute {name} is no text"
    known: dict[str, tuple[str, ...]] = {
        "mount": ("isolated", "rigid", "mixed"),
        "method": tuple(METHODS),
        "status": STATUSES,
    }
    for name, values in known.items():
        if isinstance(run.attrs[name], str) and run.attrs[name] not in values:
            yield f"{name}: expected {' or '.join(values)}, got {_short(run.attrs[name])}"


def _time(run: xr.Dataset) -> Iterator[str]:
    time = run["time"]
    if time.dims != ("time",) or time.dtype.kind != "f" or not time.size:
        yield f"time: expected a list of seconds, got {_kind(time)}"
        return
    values = time.to_numpy()
    if not np.all(np.isfinite(values)) or values[0] < 0.0:
        yield "time: expected finite values from 0 s on"
    elif np.any(np.diff(values) <= 0.0):
        at = int(np.argmax(np.diff(values) <= 0.0)) + 1
        yield f"time: expected values that grow; the one of index {at} does not"


def _scenario(run: xr.Dataset) -> Scenario:
    try:
        scenario = scenario_of(run)
    except ValueError as error:
        told = "; ".join(str(error).splitlines()[:3])
        raise ValueError(f"not a sound run of quietbus: {told}") from None
    if scenario.mount != run.attrs["mount"]:
        raise ValueError(
            f"not a sound run of quietbus: its mount is {run.attrs['mount']}, that of its scenario "
            f"{scenario.mount}"
        )
    return scenario


def _sizes(run: xr.Dataset, scenario: Scenario) -> Iterator[str]:
    expected: dict[str, Any] = {name: labels for name, (_, labels, _) in DIMENSIONS.items()}
    expected |= {"cmg": range(scenario.units.count), "leg": range(scenario.legs)}
    if method_of(run).jitter_apart:
        expected["order"] = scenario.units.orders
    for name, labels in expected.items():
        wanted = f"expected {len(labels)} of its scenario" if name in ("cmg", "leg") else "expected"
        if name not in run.coords:
            yield f"it has no labels {name}"
        elif run.sizes.get(name) != len(labels):
            yield f"{name}: {wanted}, got {run.sizes.get(name)}"
        elif list(run[name].to_numpy().tolist()) != list(labels):
            yield f"{name}: expected the labels {_list(labels)}, got {_short(run[name].to_numpy())}"
    last, end = float(run["time"][-1]), scenario.simulation.duration
    if last > end * (1.0 + 1e-9) + 1.0 / scenario.simulation.output_rate:
        yield f"time: expected up to {end:g} s, the duration of its scenario, got {last:g} s"


def _variables(run: xr.Dataset) -> Iterator[str]:
    for name in run.data_vars:
        variable, known = run[name], described(str(name))
        if known is None:
            continue
        dimensions, unit = known
        if variable.dims != dimensions or variable.dtype.kind != "f":
            yield f"{name}: expected numbers over {_list(dimensions)}, got {_kind(variable)}"
        elif variable.attrs.get("units") != unit:
            yield f"{name}: expected the unit {unit}, got {_short(variable.attrs.get('units'))}"
        elif name not in OPEN and not np.all(np.isfinite(variable.to_numpy())):
            yield f"{name}: expected finite values"
        elif dimensions[-1] == "quaternion":
            length = np.linalg.norm(variable.to_numpy(), axis=-1)
            if np.max(np.abs(length - 1.0)) > UNIT:
                yield f"{name}: expected unit quaternions"


def _harmonic(run: xr.Dataset, scenario: Scenario) -> Iterator[str]:
    """Amplitudes and phases of the outputs that every harmonic run has."""
    for name, (inner, _, _) in jitter_variables_of(scenario.bodies).items():
        if not {"point", "line"} & set(inner):
            for part in ("amplitude", "phase", "envelope", "worst_case", "rss", "rms"):
                if f"{name}_jitter_{part}" not in run:
                    yield f"it has no {name}_jitter_{part}"
    if "jitter_change_error" not in run:
        yield "it has no jitter_change_error"


def _list(values: Any) -> str:
    values = values if isinstance(values, tuple | list) else sorted(values)
    return ", ".join(str(value) for value in values)


def _kind(variable: xr.DataArray) -> str:
    return f"{variable.dtype} over {_list(tuple(variable.dims)) or 'nothing'}"


def _short(value: object) -> str:
    """A value for a message: one line, and not more than that."""
    text = ascii(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
