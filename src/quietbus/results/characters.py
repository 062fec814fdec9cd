"""Texts of runs as characters of a fixed length (NC_CHAR), which every reader of NetCDF knows.

Those of any length (NC_STRING), which h5netcdf writes by itself, older versions of MATLAB cannot
read.
"""

import h5py
import numpy as np
import xarray as xr

LONGEST = 60_000  # [bytes] HDF5's attributes take 64 kB; longer texts keep any length


def as_characters(run: xr.Dataset) -> xr.Dataset:
    """The run with its text coordinates and attributes encoded as characters."""
    encoded = run.copy()
    encoded.attrs = _attributes(run.attrs)
    for name, variable in encoded.variables.items():
        variable.attrs = _attributes(run.variables[name].attrs)
        if variable.dtype.kind in "UO":
            variable.encoding = {"dtype": "S1"}
    return encoded


def _attributes(attributes: dict[str, object]) -> dict[str, object]:
    return {
        name: _characters(value) if isinstance(value, str) else value
        for name, value in attributes.items()
    }


def _characters(text: str) -> object:
    raw = text.encode()
    if not 0 < len(raw) <= LONGEST:
        return text
    return np.array(raw, dtype=h5py.string_dtype("utf-8", len(raw)))
