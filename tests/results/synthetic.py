"""A run of made-up numbers, valid in form: for tests of files, which need no flight."""

import numpy as np
import xarray as xr

import quietbus as qb
from quietbus.results.schema import DIMENSIONS, VARIABLES


def synthetic(count: int = 200, rate: float = 1000.0) -> xr.Dataset:
    """A direct run of the built-in scenario."""
    scenario = qb.load_scenario("zhang2012").with_overrides(
        {"simulation.duration": (count - 1) / rate, "simulation.output_rate": rate}
    )
    rng = np.random.default_rng(0)
    sizes = {"axis": 3, "quaternion": 4, "cmg": 4, "leg": 6}
    data = {}
    for name, (inner, unit, meaning) in VARIABLES.items():
        values = rng.normal(size=(count, *(sizes[d] for d in inner)))
        if inner == ("quaternion",):
            values /= np.linalg.norm(values, axis=1)[:, None]
        data[name] = (("time", *inner), values, {"units": unit, "long_name": meaning})
    coordinates = {"time": ("time", np.arange(count) / rate, {"units": "s", "long_name": "time"})}
    coordinates |= {
        name: (dimension, values, {"long_name": meaning})
        for name, (dimension, values, meaning) in DIMENSIONS.items()
    }
    coordinates |= {name: (name, np.arange(sizes[name]), {}) for name in ("cmg", "leg")}
    attributes = {
        "title": "synthetic",
        "scenario": scenario.to_yaml(),
        "mount": "isolated",
        "method": "direct",
        "status": "complete",
        "stop_reason": "",
        "quietbus_version": "0",
    }
    return xr.Dataset(data, coordinates, attributes)
