"""Solutions as labelled data, with units, meanings and provenance."""

import datetime
import importlib.metadata
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from quietbus.analysis.jitter.combine import combine
from quietbus.dynamics.outputs import Outputs
from quietbus.model.report import Quantity
from quietbus.results.origin import text_of
from quietbus.results.schema import (
    COMBINED,
    DIMENSIONS,
    PAIRS,
    jitter_of,
    per_hertz,
    told,
)
from quietbus.results.task import Task
from quietbus.scenario import Scenario
from quietbus.solve.direct import SLOW, Scheme, Solution
from quietbus.solve.harmonic import HarmonicSolution, Jitter


def to_dataset(
    task: Task,
    solution: Solution | HarmonicSolution,
    wall_time: float,
    quantities: Mapping[str, Quantity] | None = None,
) -> xr.Dataset:
    """A run as a dataset.

    Args:
        task: what the run was asked for.
        wall_time: [s].
        quantities: that parts of users' own kinds tell, by name.
    """
    scenario, points, lines_of_sight = task.scenario, task.points, task.lines_of_sight
    jitter = solution.jitter if isinstance(solution, HarmonicSolution) else None
    if isinstance(solution, HarmonicSolution):
        solution = solution.slow
    known = quantities or {}
    data = {
        name: _variable(values, *told(name, known)) for name, values in solution.outputs.items()
    }
    if jitter is not None:
        data |= _jitter_variables(scenario, solution, jitter)
    counted = {"cmg": solution.outputs["rotor_angle"], "leg": solution.outputs["leg_stroke"]}
    coordinates = {
        "time": ("time", solution.time, {"units": "s", "long_name": "time"}),
        **{
            name: (dimension, values, {"long_name": meaning})
            for name, (dimension, values, meaning) in DIMENSIONS.items()
        },
        **{
            name: (name, np.arange(values.shape[1]), {"long_name": f"number of the {name}"})
            for name, values in counted.items()
        },
    }
    if jitter is not None:
        if jitter.ripple is not None:
            lines = list(scenario.units.ripple)
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
            list(scenario.units.orders),
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
        "title": f"{scenario.name}, {scenario.mount}",
        "scenario": text_of(scenario),
        "mount": scenario.mount,
        "method": task.method.word,
        "status": status,
        "stop_reason": solution.stopped or "",
        "quietbus_version": importlib.metadata.version("quietbus"),
        "solver": f"diffrax {importlib.metadata.version('diffrax')} {scheme.solver.__name__}",
        "relative_tolerance": task.tolerances.relative,
        "absolute_tolerance": task.tolerances.absolute,
        "steps": solution.steps,
        "rejected_steps": solution.rejected,
        "wall_time_s": wall_time,
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }
    return xr.Dataset(data, coordinates, attributes)


def _rotor_lines(scenario: Scenario, outputs: Outputs) -> tuple[np.ndarray, np.ndarray]:
    """Frequency and phase of each order (n, cmg, order)."""
    orders = np.array(scenario.units.orders)
    speed, angle = (np.asarray(outputs[name]) for name in ("rotor_speed", "rotor_angle"))
    return speed[..., None] * orders, angle[..., None] * orders


def _jitter_variables(scenario: Scenario, solution: Solution, jitter: Jitter) -> dict[str, Any]:
    """Amplitudes, phases and what combines them, of every output that has components."""
    frequency, angle = _rotor_lines(scenario, solution.outputs)
    data = {
        "jitter_change_error": _variable(
            jitter.change_error,
            (),
            "1",
            "estimated error of the jitter, by change and by second order",
        )
    }
    if jitter.missing.line_of_sight.size:
        data["line_of_sight_change_error"] = _variable(
            jitter.missing.line_of_sight,
            ("line",),
            "rad",
            "estimated error of a line of sight's jitter, by change and by second order",
        )
    for name, values in jitter.amplitudes.items():
        if not values.size:
            continue
        inner, unit, meaning = jitter_of(name)
        of = f"jitter of the {meaning}"
        dimensions = ("cmg", "order", *inner)
        data[f"{name}_jitter_amplitude"] = _variable(
            np.abs(values), dimensions, unit, f"{of}: amplitude"
        )
        data[f"{name}_jitter_phase"] = _variable(
            np.angle(values), dimensions, "rad", f"{of}: phase against order times rotor angle"
        )
        flat = values.reshape(*values.shape[:3], -1)
        combined = combine(flat, frequency, angle, solution.time)
        if jitter.ripple is not None:
            lines = jitter.ripple[name]
            data |= _ripple_variables(name, lines, inner, unit, of)
            combined = combined.with_lines(
                lines.reshape(len(lines), -1, flat.shape[-1]),
                *_turning_gimbals(scenario, solution.outputs),
            )
        if jitter.broadband is not None:
            psd = jitter.broadband.psd[name]
            data[f"{name}_psd"] = (
                ("look", "frequency", "cmg", *inner),
                psd,
                {"units": per_hertz(unit), "long_name": f"{of}: one-sided PSD by rotor noise"},
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
                "units": per_hertz("rad"),
                "long_name": "real part of the one-sided cross-spectrum of two components of a "
                "line of sight's jitter by rotor noise",
            },
        )
    return data


def _turning_gimbals(scenario: Scenario, outputs: Outputs) -> tuple[np.ndarray, np.ndarray]:
    """Frequency [rad/s] and phase [rad] of each line (n, line) of the gimbal motors."""
    multiples = np.array(scenario.units.ripple)
    gimbals = (np.asarray(outputs[name]) for name in ("gimbal_rate", "gimbal_angle"))
    rate, angle = ((values[..., None] * multiples).reshape(len(values), -1) for values in gimbals)
    return rate, angle


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


def _variable(values, dimensions, unit, meaning):
    return ("time", *dimensions), values, {"units": unit, "long_name": meaning}
