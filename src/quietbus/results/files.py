"""Files of runs: written, read and checked."""

import os
import pathlib
import warnings

import xarray as xr

from quietbus.results.schema import VARIABLES


def save_run(run: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a run as NetCDF-4; an old file of that name is replaced once the new one is whole."""
    path = pathlib.Path(path)
    partial = path.with_name(f".{path.name}.part")
    try:
        run.to_netcdf(partial, engine="h5netcdf")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def load_run(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a run that ``save_run`` or ``quietbus simulate -o`` has written.

    Raises:
        FileNotFoundError: no such file.
        ValueError: the file is not a run of quietbus.
    """
    if pathlib.Path(path).is_dir():
        raise ValueError(f"{path}: is a folder; expected the file of a run")
    if not pathlib.Path(path).is_file():
        raise FileNotFoundError(f"{path}: no such file")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of xarray, about files that are no runs anyway
            with xr.open_dataset(path, engine="h5netcdf") as stored:
                run = stored.load()
    except (OSError, ValueError, KeyError) as error:
        raise ValueError(f"{path}: not a NetCDF-4 file ({error})") from None
    missing = {"time", *VARIABLES} - set(run.variables) or {"scenario", "mount"} - set(run.attrs)
    if missing:
        listed = ", ".join(sorted(missing))
        raise ValueError(f"{path}: a NetCDF file, but not a run of quietbus: it has no {listed}")
    return run
