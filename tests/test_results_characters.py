"""Texts in files of runs have a fixed length, and come back as they were."""

import h5py
import numpy as np
import pytest
import xarray as xr

from quietbus.results import save_run
from quietbus.results.characters import LONGEST


@pytest.mark.parametrize("text", ["name: näher am Kreisel, 3 µm", "x" * (LONGEST + 1), ""])
def test_texts_are_characters(tmp_path, text):
    run = xr.Dataset(
        {"rate": (("time", "axis"), np.eye(3), {"units": "rad/s", "long_name": "°/s µ"})},
        {"axis": ["x", "y", "zz"], "time": ("time", np.arange(3.0), {"units": "s"})},
        {"scenario": text, "mount": "rigid", "number": 3.5},
    )
    before = run.copy(deep=True)
    save_run(run, tmp_path / "run.nc")
    xr.testing.assert_identical(run, before)  # and its own attributes are untouched
    with h5py.File(tmp_path / "run.nc") as stored:
        assert stored["axis"].dtype == np.dtype("S1")
        for place, name in ((stored["rate"], "units"), (stored["rate"], "long_name"),
                            (stored, "mount"), (stored, "scenario")):  # fmt: skip
            length = h5py.check_string_dtype(place.attrs.get_id(name).dtype).length
            fixed = name != "scenario" or 0 < len(text.encode()) <= LONGEST
            assert (length is not None) == fixed
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as found:
        assert found.load().attrs == run.attrs
        assert found["rate"].attrs == run["rate"].attrs
        assert found["axis"].values.tolist() == ["x", "y", "zz"]
