"""Solutions as labelled data: names, units, provenance; NetCDF files; the numbers of a run."""

import dataclasses
import datetime
import importlib.metadata
import os
import pathlib
import warnings
from dataclasses import dataclass

import numpy as np
import xarray as xr

from quietbus.analysis.residual import residual, shows
from quietbus.scenario import Scenario
from quietbus.solve.direct import DirectSolution

AXES = ("x", "y", "z")
_DIMENSIONS = {
    "axis": ("axis", list(AXES), "component"),
    "quaternion": ("quaternion", ["w", "x", "y", "z"], "component, scalar first"),
}
# name: (dimensions after time, unit, meaning)
VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "bus_position": (("axis",), "m", "position of the bus mass centre, inertial frame"),
    "bus_velocity": (("axis",), "m/s", "velocity of the bus mass centre, inertial frame"),
    "bus_attitude": (("quaternion",), "1", "attitude of the bus in the inertial frame"),
    "bus_rate": (("axis",), "rad/s", "angular velocity of the bus, bus frame"),
    "platform_position": (("axis",), "m", "position of the upper plate's origin, inertial frame"),
    "platform_velocity": (("axis",), "m/s", "velocity of the upper plate's origin, inertial frame"),
    "platform_attitude": (
        ("quaternion",),
        "1",
        "attitude of the upper plate in the inertial frame",
    ),
    "platform_rate": (("axis",), "rad/s", "angular velocity of the upper plate, plate frame"),
    "gimbal_angle": (("cmg",), "rad", "gimbal angles"),
    "gimbal_rate": (("cmg",), "rad/s", "gimbal rates"),
    "leg_stroke": (("leg",), "m", "leg length less its nominal length"),
    "leg_force": (("leg",), "N", "force of spring and damper, tension positive"),
    "control_torque": (("axis",), "N m", "commanded torque on the bus, bus frame"),
    "attitude_error": (
        ("axis",),
        "rad",
        "twice the vector part of the shortest error quaternion, bus frame",
    ),
    "singularity_measure": (
        (),
        "1",
        "sqrt(det(A A^T)) of the cluster's torque directions, weighted by momentum",
    ),
}
JOINT_VARIABLES = {
    "spherical_force": (
        ("leg", "axis"),
        "N",
        "plate on leg at the spherical joint, inertial frame",
    ),
    "universal_force": (("leg", "axis"), "N", "base on leg at the universal joint, inertial frame"),
    "universal_moment": (("leg",), "N m", "base on leg at the universal joint, about its h axis"),
    "universal_axis": (("leg", "axis"), "1", "axis of the universal moment, inertial frame"),
}


def to_dataset(scenario: Scenario, solution: DirectSolution, wall_time: float) -> xr.Dataset:
    """A direct run as a dataset; ``scenario`` as it was run, mount included."""
    data = {
        name: _variable(getattr(solution.outputs, name), *VARIABLES[name]) for name in VARIABLES
    }
    joints = solution.outputs.joint_forces
    if joints is not None:
        data |= {
            name: _variable(getattr(joints, name), *description)
            for name, description in JOINT_VARIABLES.items()
        }
    counted = {"cmg": solution.outputs.gimbal_angle, "leg": solution.outputs.leg_stroke}
    coordinates = {
        "time": ("time", solution.time, {"units": "s", "long_name": "time"}),
        **{
            name: (dimension, values, {"long_name": meaning})
            for name, (dimension, values, meaning) in _DIMENSIONS.items()
        },
        **{
            name: (name, np.arange(values.shape[1]), {"long_name": f"number of the {name}"})
            for name, values in counted.items()
        },
    }
    tolerances = scenario.simulation.tolerances
    status = (
        "interrupted" if solution.interrupted else "stopped" if solution.stopped else "complete"
    )
    attributes = {
        "title": f"{scenario.name}, {scenario.isolator.mount}",
        "scenario": scenario.to_yaml(),
        "mount": scenario.isolator.mount,
        "method": "direct",
        "status": status,
        "stop_reason": solution.stopped or "",
        "quietbus_version": importlib.metadata.version("quietbus"),
        "solver": f"diffrax {importlib.metadata.version('diffrax')} Dopri8",
        "relative_tolerance": tolerances.relative,
        "absolute_tolerance": tolerances.absolute,
        "steps": solution.steps,
        "rejected_steps": solution.rejected,
        "wall_time_s": wall_time,
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }
    return xr.Dataset(data, coordinates, attributes)


def _variable(values, dimensions, unit, meaning):
    return ("time", *dimensions), values, {"units": unit, "long_name": meaning}


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


def scenario_of(run: xr.Dataset) -> Scenario:
    """The scenario that a run was made from."""
    return Scenario.from_yaml(run.attrs["scenario"], source="the run's scenario")


@dataclass(frozen=True)
class Summary:
    """The numbers of a run that an engineer asks for first."""

    residual_rate: np.ndarray | None  # (3,) [rad/s] peak jitter per axis at the end of the run
    residual_rate_rms: np.ndarray | None  # (3,) [rad/s]
    slow_rate: np.ndarray | None  # (3,) [rad/s] peak of the slow motion in the same window
    residual_note: str  # over which time, or why there is none
    pointing_error: float  # [rad] largest norm of the attitude error in the last second
    peak_gimbal_rate: float  # [rad/s]
    peak_stroke: float  # [m]
    peak_strut_force: float  # [N]
    minimum_singularity: float  # [-]

    def to_dict(self) -> dict[str, object]:
        """Numbers and lists, for JSON."""
        fields = dataclasses.asdict(self).items()
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in fields}


def summarize(run: xr.Dataset) -> Summary:
    """The numbers of a run (see ``Summary``)."""
    time = run["time"].to_numpy()
    peak = lambda name: float(np.max(np.abs(run[name].to_numpy())))  # noqa: E731
    error = np.linalg.norm(run["attitude_error"].to_numpy(), axis=1)
    jitter = rms = slow = None
    note = "not shown: the output rate is too low for the rotors"
    if not aliasing(scenario_of(run)):
        try:
            rest = residual(time, run["bus_rate"].to_numpy())
            jitter, rms, slow = rest.jitter_peak, rest.jitter_rms, rest.slow
            note = f"from t = {rest.window[0]:.4g} s to {rest.window[1]:.4g} s"
        except ValueError as too_short:
            note = str(too_short)
    return Summary(
        residual_rate=jitter,
        residual_rate_rms=rms,
        slow_rate=slow,
        residual_note=note,
        pointing_error=float(np.max(error[time >= time[-1] - 1.0])),
        peak_gimbal_rate=peak("gimbal_rate"),
        peak_stroke=peak("leg_stroke"),
        peak_strut_force=peak("leg_force"),
        minimum_singularity=float(run["singularity_measure"].min()),
    )


def aliasing(scenario: Scenario) -> str:
    """Why the output rate cannot show the rotors' lines, or an empty text if it can."""
    speeds = [abs(unit.rotor.speed) for unit in scenario.cluster.placed() if unit.rotor]
    fastest = max(speeds) / (2.0 * np.pi)
    rate = scenario.simulation.output_rate
    if shows(rate, fastest):
        return ""
    return (
        f"the output rate of {rate:g} Hz cannot show the rotors' {fastest:g} Hz: at least "
        f"{2.56 * fastest:g} Hz is needed, {10 * fastest:g} Hz shows it well. The motion is "
        "integrated with every turn resolved, but jitter in the output is aliased"
    )
