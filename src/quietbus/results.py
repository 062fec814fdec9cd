"""Solutions as labelled data: names, units, provenance; NetCDF files; the numbers of a run."""

import dataclasses
import datetime
import importlib.metadata
import os
import pathlib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy.interpolate import CubicHermiteSpline, make_interp_spline

from quietbus.analysis.jitter import combine
from quietbus.analysis.residual import residual, shows
from quietbus.dynamics.outputs import Outputs
from quietbus.scenario import Scenario
from quietbus.scenario.wheels import WheelCluster
from quietbus.solve.direct import SLOW, Scheme, Solution
from quietbus.solve.harmonic import TOLERANCES, HarmonicSolution, Jitter

AXES = ("x", "y", "z")
PAIRS = ("yz", "zx", "xy")
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
# of runs whose rotor speeds change
ROTOR_VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "rotor_angle": (("cmg",), "rad", "rotor angles"),
    "rotor_speed": (("cmg",), "rad/s", "rotor speeds, relative to the unit's body"),
    "rotor_torque": (("cmg",), "N m", "torque of the motor on its rotor"),
    "torque_share": ((), "1", "part of the torque asked for that the wheels' limits leave"),
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
# of harmonic runs; name: (dimensions of a component, unit, meaning)
JITTER_VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "bus_rate": VARIABLES["bus_rate"],
    "bus_attitude": (("axis",), "rad", "rotation of the bus from its slow motion, bus frame"),
    "platform_rate": VARIABLES["platform_rate"],
    "leg_stroke": VARIABLES["leg_stroke"],
    "leg_force": VARIABLES["leg_force"],
    "point_acceleration": (
        ("point", "axis"),
        "m/s^2",
        "inertial acceleration of a point of the bus, bus frame",
    ),
    "line_of_sight": (
        ("line", "axis"),
        "rad",
        "motion of a line of sight, across it, bus frame",
    ),
}
COMBINED = {
    "envelope": "largest value as lines beat, phases as given",
    "worst_case": "sum of all amplitudes, any phases",
    "rss": "root of the sum of squares of all amplitudes",
    "rms": "root mean square in time, phases as given",
}


def to_dataset(
    scenario: Scenario,
    solution: Solution | HarmonicSolution,
    wall_time: float,
    points: Mapping[str, Any] | None = None,
    lines_of_sight: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """A run as a dataset.

    Args:
        scenario: as it was run, mount and output rate included.
        wall_time: [s].
        points, lines_of_sight: what a harmonic run looked at, by name.
    """
    jitter = solution.jitter if isinstance(solution, HarmonicSolution) else None
    tolerances: Any = scenario.simulation.tolerances
    if isinstance(solution, HarmonicSolution):
        solution, tolerances = solution.slow, TOLERANCES
    data = {
        name: _variable(getattr(solution.outputs, name), *VARIABLES[name]) for name in VARIABLES
    }
    data |= {
        name: _variable(getattr(solution.outputs, name), *description)
        for name, description in ROTOR_VARIABLES.items()
        if getattr(solution.outputs, name) is not None
    }
    joints = solution.outputs.joint_forces
    if joints is not None:
        data |= {
            name: _variable(getattr(joints, name), *description)
            for name, description in JOINT_VARIABLES.items()
        }
    if jitter is not None:
        data |= _jitter_variables(*_rotor_lines(scenario, solution.outputs), jitter)
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
    if jitter is not None:
        if jitter.ripple is not None:
            lines = list(_ripple_lines(scenario))
            meaning = "multiple of the gimbal angle"
            coordinates["ripple"] = ("ripple", lines, {"long_name": meaning})
        if jitter.broadband is not None:
            noise = jitter.broadband
            coordinates["look"] = (
                "look",
                solution.time[noise.instants],
                {"units": "s", "long_name": "time of a spectrum"},
            )
            coordinates["frequency"] = (
                "frequency",
                noise.frequency,
                {"units": "Hz", "long_name": "frequency"},
            )
            if noise.cospectrum.size:
                coordinates["pair"] = ("pair", list(PAIRS), {"long_name": "two components"})
        coordinates["order"] = (
            "order",
            list(scenario.cluster.orders),
            {"long_name": "multiple of rotor speed"},
        )
        for dimension, named in (("point", points), ("line", lines_of_sight)):
            if named:
                coordinates[dimension] = (dimension, list(named), {"long_name": dimension})
    status = (
        "interrupted" if solution.interrupted else "stopped" if solution.stopped else "complete"
    )
    scheme = Scheme() if jitter is None else SLOW
    attributes = {
        "title": f"{scenario.name}, {scenario.isolator.mount}",
        "scenario": scenario.to_yaml(),
        "mount": scenario.isolator.mount,
        "method": "direct" if jitter is None else "harmonic",
        "status": status,
        "stop_reason": solution.stopped or "",
        "quietbus_version": importlib.metadata.version("quietbus"),
        "solver": f"diffrax {importlib.metadata.version('diffrax')} {scheme.solver.__name__}",
        "relative_tolerance": tolerances.relative,
        "absolute_tolerance": tolerances.absolute,
        "steps": solution.steps,
        "rejected_steps": solution.rejected,
        "wall_time_s": wall_time,
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }
    return xr.Dataset(data, coordinates, attributes)


def _rotor_lines(scenario: Scenario, outputs: Outputs) -> tuple[np.ndarray, np.ndarray]:
    """Frequency and phase of each order (..., cmg, order), over time where speeds change."""
    (speed, phase), orders = _rotors(scenario), np.array(scenario.cluster.orders)
    if outputs.rotor_speed is not None:
        speed, phase = np.asarray(outputs.rotor_speed), np.asarray(outputs.rotor_angle)
    return speed[..., None] * orders, phase[..., None] * orders


def _jitter_variables(frequency: np.ndarray, angle: np.ndarray, jitter: Jitter) -> dict[str, Any]:
    """Amplitudes, phases and what combines them, of every output that has components."""
    data = {
        "jitter_change_error": _variable(
            jitter.change_error, (), "1", "estimated error of the jitter by the motion's change"
        )
    }
    for name, (inner, unit, meaning) in JITTER_VARIABLES.items():
        values = jitter.amplitudes[name]
        if not values.size:
            continue
        of = f"jitter of the {meaning}"
        dimensions = ("cmg", "order", *inner)
        data[f"{name}_jitter_amplitude"] = _variable(
            np.abs(values), dimensions, unit, f"{of}: amplitude"
        )
        data[f"{name}_jitter_phase"] = _variable(
            np.angle(values), dimensions, "rad", f"{of}: phase against order times rotor angle"
        )
        flat = values.reshape(*values.shape[:3], -1)
        combined = combine(flat, frequency, angle)
        if jitter.ripple is not None:
            lines = jitter.ripple[name]
            data |= _ripple_variables(name, lines, inner, unit, of)
            combined = combined.with_lines(lines.reshape(len(lines), -1, flat.shape[-1]))
        if jitter.broadband is not None:
            psd = jitter.broadband.psd[name]
            data[f"{name}_psd"] = (
                ("look", "frequency", "cmg", *inner),
                psd,
                {"units": _per_hertz(unit), "long_name": f"{of}: one-sided PSD by rotor noise"},
            )
            square = jitter.broadband.variance(name, len(values))
            combined = combined.with_noise(square.reshape(len(values), -1))
            data[f"{name}_noise_rms"] = _variable(
                np.sqrt(square), inner, unit, f"{of}: RMS of the rotors' noise"
            )
        for kind, said in COMBINED.items():
            whole = getattr(combined, kind).reshape(len(values), *values.shape[3:])
            data[f"{name}_jitter_{kind}"] = _variable(whole, inner, unit, f"{of}: {said}")
    if jitter.broadband is not None and jitter.broadband.cospectrum.size:
        data["line_of_sight_cospectrum"] = (
            ("look", "frequency", "cmg", "line", "pair"),
            jitter.broadband.cospectrum,
            {
                "units": _per_hertz("rad"),
                "long_name": "real part of the one-sided cross-spectrum of two components of a "
                "line of sight's jitter by rotor noise",
            },
        )
    return data


def _per_hertz(unit: str) -> str:
    return f"({unit})^2/Hz"


def _ripple_variables(
    name: str, lines: np.ndarray, inner: tuple[str, ...], unit: str, of: str
) -> dict[str, Any]:
    """Amplitudes and phases of what the gimbal motors cause."""
    dimensions = ("cmg", "ripple", *inner)
    return {
        f"{name}_ripple_amplitude": _variable(
            np.abs(lines), dimensions, unit, f"{of} by gimbal motors: amplitude"
        ),
        f"{name}_ripple_phase": _variable(
            np.angle(lines),
            dimensions,
            "rad",
            f"{of} by gimbal motors: phase against ripple times gimbal angle",
        ),
    }


def _ripple_lines(scenario: Scenario) -> tuple[int, ...]:
    """Multiples of the gimbal angle of the gimbal motors' lines, as of ``GimbalMotor.order``."""
    motor = scenario.cluster.gimbal_motor
    return motor.lines if motor else ()


def _rotors(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [rad/s] and phases [rad] of the rotors; zero where a unit has no rotor."""
    units = scenario.cluster.placed()
    speed = np.array([unit.rotor.speed if unit.rotor else 0.0 for unit in units])
    phase = np.array(scenario.cluster.rotor_phases or np.zeros(len(units)))
    return speed, phase


def reconstruct(
    run: xr.Dataset,
    name: str = "bus_rate",
    around: float | None = None,
    span: float = 0.1,
    rate: float | None = None,
) -> xr.DataArray:
    """The time signal of a harmonic run's output, every rotor turn resolved.

    Args:
        run: of method "harmonic".
        name: an output of which the run holds ``NAME_jitter_amplitude``.
        around: middle of the stretch [s]; by default its end is the run's.
        span: its length [s]; cut where the run begins or ends.
        rate: samples per second [Hz]; by default 40 per period of the fastest line.

    Returns:
        Slow motion and jitter together, or the jitter alone of what is only known as a deviation
        (``bus_attitude``, ``line_of_sight``, ``point_acceleration``; see its ``long_name``).
        Lines alone: of a broadband disturbance a run has spectra (``NAME_psd``), not a signal.

    Raises:
        ValueError: a run that is not harmonic, an unknown name, or times outside the run.
    """
    known = [each for each in JITTER_VARIABLES if f"{each}_jitter_phase" in run]
    if name not in known:
        raise ValueError(
            f"the run has no jitter of {name!r}; "
            + (f"it has that of {', '.join(known)}" if known else "its method is not 'harmonic'")
        )
    time = run["time"].to_numpy()
    around = float(time[-1] - span / 2) if around is None else around
    if not time[0] <= around <= time[-1] or not span > 0.0:
        raise ValueError(
            f"expected a stretch of positive length around a time from {time[0]:g} s to "
            f"{time[-1]:g} s; got {span:g} s around {around:g} s"
        )
    speed, phase = _rotors(scenario_of(run))
    if "rotor_speed" in run:
        speed = run["rotor_speed"].to_numpy()
    orders = run["order"].to_numpy()
    fastest = max(orders) * np.max(np.abs(speed)) / (2.0 * np.pi)
    rate = rate or 40.0 * max(fastest, 1.0)
    first, last = max(time[0], around - span / 2), min(time[-1], around + span / 2)
    t = first + np.arange(int((last - first) * rate) + 1) / rate
    amplitude, shift = (run[f"{name}_jitter_{part}"] for part in ("amplitude", "phase"))
    at = _interpolated(time, amplitude.to_numpy() * np.exp(1j * shift.to_numpy()), t)
    if "rotor_speed" not in run:
        angle = phase + np.outer(t, speed)
    elif len(time) == 1:
        angle = run["rotor_angle"].to_numpy() + (t - time)[:, None] * speed
    else:
        angle = CubicHermiteSpline(time, run["rotor_angle"].to_numpy(), speed)(t)
    turn = np.exp(1j * angle[..., None] * orders)
    inner = amplitude.dims[3:]
    values = np.sum((at * turn.reshape(*turn.shape, *[1] * len(inner))).real, axis=(1, 2))
    if "ripple" in run.dims:
        values = values + _ripple_signal(run, name, t)
    meaning = f"jitter of {JITTER_VARIABLES[name][2]}"
    if name in run and run[name].dims[1:] == inner:
        values, meaning = values + _interpolated(time, run[name].to_numpy(), t), VARIABLES[name][2]
    coordinates = {"time": t} | {d: run[d] for d in inner if d in run.coords}
    attributes = {"units": amplitude.attrs["units"], "long_name": meaning}
    return xr.DataArray(values, coordinates, ("time", *inner), name, attributes)


def _ripple_signal(run: xr.Dataset, name: str, t: np.ndarray) -> np.ndarray:
    """What the gimbal motors cause of an output at times t."""
    time = run["time"].to_numpy()
    amplitude, shift = (run[f"{name}_ripple_{part}"].to_numpy() for part in ("amplitude", "phase"))
    at = _interpolated(time, amplitude * np.exp(1j * shift), t)
    gamma = _interpolated(time, run["gimbal_angle"].to_numpy(), t)
    turn = np.exp(1j * gamma[..., None] * run["ripple"].to_numpy())
    inner = at.ndim - 3
    return np.sum((at * turn.reshape(*turn.shape, *[1] * inner)).real, axis=(1, 2))


def _interpolated(time, values, t):
    if len(time) == 1:
        return np.repeat(values, len(t), axis=0)
    return make_interp_spline(time, values, k=min(3, len(time) - 1))(t)


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


def has_gimbals(run: xr.Dataset) -> bool:
    """Whether the units of a run are CMGs, and not reaction wheels."""
    return not isinstance(scenario_of(run).cluster, WheelCluster)


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
    rotor_speeds: np.ndarray | None  # (2,) [rad/s] least and largest, where speeds change
    peak_rotor_torque: float | None  # [N m] likewise

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
    if run.attrs["method"] == "harmonic":
        last = time >= time[-1] - 1.0
        jitter = run["bus_rate_jitter_envelope"].to_numpy()[last].max(axis=0)
        rms = run["bus_rate_jitter_rms"].to_numpy()[last].max(axis=0)
        slow = np.abs(run["bus_rate"].to_numpy()[last]).max(axis=0)
        note = f"envelope from t = {time[last][0]:.4g} s to {time[-1]:.4g} s"
        if "bus_rate_noise_rms" in run:
            note += "; the rotors' noise is in the RMS alone"
    elif not aliasing(scenario_of(run)):
        try:
            rest = residual(time, run["bus_rate"].to_numpy())
            jitter, rms, slow = rest.jitter_peak, rest.jitter_rms, rest.slow
            note = f"from t = {rest.window[0]:.4g} s to {rest.window[1]:.4g} s"
        except ValueError as too_short:
            note = str(too_short)
    changing = "rotor_speed" in run
    speed = run["rotor_speed"].to_numpy() if changing else np.zeros(1)
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
        rotor_speeds=np.array([speed.min(), speed.max()]) if changing else None,
        peak_rotor_torque=peak("rotor_torque") if changing else None,
    )


def rotor_notes(run: xr.Dataset) -> list[str]:
    """What the user has to know of rotors whose speed changed, in words.

    Wheels at their limits, and speeds at which the output no longer shows the rotors' lines.
    """
    said: list[str] = []
    if "rotor_speed" not in run:
        return said
    scenario, time = scenario_of(run), run["time"].to_numpy()
    speeds = np.abs(run["rotor_speed"].to_numpy())
    if run.attrs["method"] == "direct" and not aliasing(scenario):
        said += filter(None, [aliasing(scenario, float(speeds.max()))])
    cluster = scenario.cluster
    if not isinstance(cluster, WheelCluster):
        return said
    for j, wheel in enumerate(cluster.placed()):
        limit = wheel.motor and wheel.motor.speed_limit
        reached = time[speeds[:, j] >= (1.0 - 1e-6) * (limit or np.inf)]
        if reached.size and cluster.run_up is None:
            said.append(
                f"wheel {j} reached its speed limit of {limit:.5g} rad/s at t = "
                f"{reached[0]:.4g} s: there it gives no torque that would take it further, and the "
                "satellite does not feel all that the control asks for"
            )
    if "torque_share" in run:
        share = run["torque_share"].to_numpy()
        cut = time[share < 1.0]
        if cut.size:
            said.append(
                f"the wheels' torque limit cut the torque to {100 * share.min():.3g} % of what was "
                f"asked for at the least, first at t = {cut[0]:.4g} s, in "
                f"{100 * cut.size / time.size:.3g} % of the outputs"
            )
    return said


def aliasing(scenario: Scenario, speed: float = 0.0) -> str:
    """Why the output rate cannot show the rotors' lines, or an empty text if it can.

    Args:
        speed: [rad/s] that a rotor has reached, if that is more than the scenario says.
    """
    speeds = [speed, *np.abs(_rotors(scenario)[0])]
    if scenario.cluster.run_up is not None:
        speeds += np.abs(scenario.cluster.run_up.speeds(tuple(speeds[1:]))).ravel().tolist()
    fastest = max(speeds) / (2.0 * np.pi)
    rate = scenario.simulation.output_rate
    if shows(rate, fastest):
        return ""
    return (
        f"the output rate of {rate:g} Hz cannot show the rotors' {fastest:g} Hz: at least "
        f"{2.56 * fastest:g} Hz is needed, {10 * fastest:g} Hz shows it well. The motion is "
        "integrated with every turn resolved, but jitter in the output is aliased"
    )
