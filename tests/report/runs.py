"""Runs made of closed forms, so that pages of all kinds are made at once."""

import numpy as np
import xarray as xr

from quietbus.results.schema import DIMENSIONS, VARIABLES
from quietbus.scenario import load_scenario

SLOW, ROTOR = 1e-3, 100.0  # [rad/s], [Hz]
ORDERS = (1, 2)


def synthetic(
    mount="isolated",
    count=4001,
    rate=1000.0,
    cmgs=4,
    legs=6,
    status="complete",
    reason="",
    **changes,
):
    """A run whose bus turns slowly about roll and vibrates at the rotors' frequency.

    Args:
        changes: further fields of the scenario, ``__`` for a dot.
    """
    overrides = {"isolator.mount": mount, "simulation.output_rate": rate}
    overrides |= {name.replace("__", "."): value for name, value in changes.items()}
    scenario = load_scenario("zhang2012").with_overrides(overrides)
    time = np.arange(count) / rate
    sizes = {"axis": 3, "quaternion": 4, "cmg": cmgs, "leg": legs}
    data = {}
    for name, (dimensions, unit, meaning) in VARIABLES.items():
        shape = (count, *(sizes[dimension] for dimension in dimensions))
        values = 1e-3 * np.sin(np.arange(np.prod(shape)).reshape(shape))
        data[name] = (("time", *dimensions), values, {"units": unit, "long_name": meaning})
    half, zero = 0.5 * SLOW * time, 0.0 * time
    data["bus_attitude"] = (
        ("time", "quaternion"),
        np.column_stack([np.cos(half), np.sin(half), zero, zero]),
    )
    data["attitude_error"] = (("time", "axis"), np.column_stack([2 * np.sin(half), zero, zero]))
    wave = 1e-5 * np.sin(2.0 * np.pi * ROTOR * time + 0.3)
    data["bus_rate"] = (("time", "axis"), np.column_stack([SLOW + wave, wave, 2.0 * wave]))
    attributes = {
        "title": f"{scenario.name}, {mount}",
        "scenario": scenario.to_yaml(),
        "mount": mount,
        "method": "direct",
        "status": status,
        "stop_reason": reason,
        "quietbus_version": "0.0.1",
        "solver": "by hand",
        "relative_tolerance": 1e-7,
        "wall_time_s": 12.345,
        "created": "2012-03-04T05:06:07+00:00",
    }
    turned = 2.0 * np.pi * ROTOR * time[:, None] * np.ones(cmgs)
    data["rotor_speed"] = (("time", "cmg"), np.full((count, cmgs), 2.0 * np.pi * ROTOR))
    data["rotor_angle"] = (("time", "cmg"), turned)
    for name in ("bus_attitude", "attitude_error", "bus_rate", "rotor_speed", "rotor_angle"):
        data[name] += ({"units": VARIABLES[name][1], "long_name": VARIABLES[name][2]},)
    data["platform_attitude"] = data["bus_attitude"]
    labels = {name: values for name, (_, values, _) in DIMENSIONS.items()}
    labels |= {"cmg": np.arange(cmgs), "leg": np.arange(legs)}
    return xr.Dataset(data, {"time": time} | labels, attributes)


def harmonic():
    """A run of the slow motion every 0.1 s with amplitudes of the jitter beside it."""
    run = synthetic(count=201, rate=10.0)
    run.attrs["method"] = "harmonic"
    run["bus_rate"] = (("time", "axis"), np.full((201, 3), SLOW))
    share = np.array([1.0, 0.8, 0.6, 0.4])[:, None, None] * np.array([1.0, 0.01])[:, None]
    amplitude = 1e-6 * share * np.array([1.0, 2.0, 3.0]) * np.ones((201, 1, 1, 1))
    dimensions = ("time", "cmg", "order", "axis")
    run["bus_rate_jitter_amplitude"] = (dimensions, amplitude, {"units": "rad/s"})
    run["bus_rate_jitter_phase"] = (dimensions, 0.0 * amplitude, {"units": "rad"})
    combined = {
        "envelope": 0.9 * amplitude.sum(axis=(1, 2)),
        "worst_case": amplitude.sum(axis=(1, 2)),
        "rss": np.sqrt((amplitude**2).sum(axis=(1, 2))),
        "rms": np.sqrt((amplitude**2).sum(axis=(1, 2)) / 2.0),
    }
    for name, values in combined.items():
        described = {"units": "rad/s", "long_name": f"{name}, as made by hand"}
        run[f"bus_rate_jitter_{name}"] = (("time", "axis"), values, described)
    return run.assign_coords(order=list(ORDERS))
