"""The verbs of quietbus: load, build, solve, and give labelled results."""

import concurrent.futures
import os
import threading
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from quietbus.arguments import choice, flag, function, listing, mapping, vector
from quietbus.asked import (
    Mount,
    QuietbusWarning,
    angles_asked,
    scenario_asked,
    task_asked,
    tell_implausible,
)
from quietbus.build import build_satellite, energy_notes
from quietbus.dynamics.linear_model import LinearModel
from quietbus.dynamics.linearize import Actuation, OperatingPoint
from quietbus.dynamics.linearize import linearize as linearize_satellite
from quietbus.methods import Direct, Method, as_method
from quietbus.results import method_of, scenario_of, summarize
from quietbus.runs import SimulationError, foreseen, remarks, solve, unshown
from quietbus.scenario import Problem, Scenario, ScenarioError
from quietbus.scenario.pointing import NO_REQUIREMENTS
from quietbus.studies.jitter import JitterStudy
from quietbus.studies.jitter import worst_over_phases as worst_phases_at_rest
from quietbus.studies.linear import Study
from quietbus.studies.platforms import PlatformStudy
from quietbus.studies.requirements import check_requirements
from quietbus.studies.verification import Verification


def simulate(
    scenario: Scenario | str,
    method: str | Method = "direct",
    mount: Mount | None = None,
    *,
    duration: float | None = None,
    output_rate: float | None = None,
    joint_forces: bool = False,
    points: Mapping[str, ArrayLike] | None = None,
    lines_of_sight: Mapping[str, ArrayLike] | None = None,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
) -> xr.Dataset:
    """Simulate a scenario.

    Args:
        scenario: a scenario, the path of a scenario file, or a built-in's name.
        method: "direct" or a ``Direct(...)``: the nonlinear equations, every rotor turn resolved.
            "harmonic" or a ``Harmonic(...)``: the slow motion, and at every output instant the
            steady response to every order of every rotor.
        mount: "isolated" or "rigid", instead of the scenario's own.
        duration: [s], instead of the scenario's own.
        output_rate: [Hz], instead of the scenario's own (direct) or 10 Hz (harmonic).
        joint_forces: also give the constraint forces in the legs' joints (direct, isolated mount).
        points: (3,) points of the bus [m], bus frame, by name, where the jitter of the
            acceleration is wanted (harmonic).
        lines_of_sight: what the jitter is wanted of, beside the scenario's own: by name a (3,)
            direction, bus frame, or a (1 to 3, 12) sensitivity as in docs/scenario.md (harmonic).
        progress: called with the simulated time reached [s].
        checkpoint: a file to which what is computed is added while the run goes, about every five
            seconds of wall time and at its end. ``load_run`` reads it, also when the program was
            killed. An older one of another run is replaced; this one stays: delete it when
            the run is in safety.
        resume: go on from ``checkpoint``, where the same run has left off; begin where there is
            none yet.

    Returns:
        The run, as described in docs/results.md. After Ctrl-C it holds what was computed, with
        ``status`` "interrupted" among its attributes, and a QuietbusWarning is given.

    Raises:
        ScenarioError: the scenario is not valid, or the output rate or tolerance of a direct run
            is too coarse for a declared disturbance.
        TypeError, ValueError: an argument of the wrong kind or value, by its name.
        CheckpointError: (a ValueError) to resume, a checkpoint that cannot be read or is of
            another run; to begin, one that holds a part of this very run.
        OutputError: (an OSError) the checkpoint cannot be begun, or its disk has no room.
        ResonanceError: an order of a rotor lies on an undamped mode (harmonic).
        SimulationError: the run diverged, or its output rate could not show the gimbal motors'
            ripple; what was computed until then is in its ``run``.
        KeyboardInterrupt: Ctrl-C before anything was computed.
    """
    method = as_method(method)
    flag("joint_forces", joint_forces)
    flag("resume", resume)
    function("progress", progress)
    points = mapping("points", points, "points of the bus")
    lines_of_sight = mapping("lines_of_sight", lines_of_sight, "directions or sensitivities")
    scenario = scenario_asked(scenario, mount, duration, method.output_rate(output_rate))
    tell_implausible(scenario)
    task = task_asked(scenario, method, joint_forces, points, lines_of_sight)
    run, notes = solve(task, progress, checkpoint, resume)
    for note in (*notes, *foreseen(task), *remarks(run)):
        warnings.warn(note, QuietbusWarning, stacklevel=2)
    failed = run.attrs["stop_reason"] if run.attrs["status"] == "stopped" else unshown(task, run)
    if failed:
        raise SimulationError(failed, run)
    if run.attrs["status"] == "interrupted":
        warnings.warn(run.attrs["stop_reason"], QuietbusWarning, stacklevel=2)
    return run


def compare(
    scenario: Scenario | str,
    *,
    duration: float | None = None,
    progress: Callable[[Mount, float], None] | None = None,
    checkpoints: Mapping[Mount, str | os.PathLike[str]] | None = None,
    resume: bool = False,
) -> dict[str, xr.Dataset]:
    """The same scenario on both mounts, side by side on two cores.

    Runs that could not be finished are returned as far as they came; their ``status`` tells.

    Args:
        duration: [s], instead of the scenario's own.
        progress: called with the mount and the simulated time reached [s].
        checkpoints: by mount, the file that keeps a run while it goes, as of ``simulate``.
        resume: go on from them, as of ``simulate``.
    """
    function("progress", progress)
    scenario = scenario_asked(scenario, duration=duration)
    tell_implausible(scenario)
    mounts: tuple[Mount, ...] = ("isolated", "rigid")
    tasks = {mount: task_asked(scenario_asked(scenario, mount), Direct()) for mount in mounts}
    files, tell = checkpoints or {}, progress or (lambda mount, t: None)  # noqa: ARG005
    stop = threading.Event()

    def run(mount: Mount) -> tuple[xr.Dataset, tuple[str, ...]]:
        def reached(t: float) -> None:
            tell(mount, t)
            if stop.is_set():
                raise KeyboardInterrupt

        return solve(tasks[mount], reached, files.get(mount), resume)

    for note in foreseen(tasks["isolated"]):
        warnings.warn(note, QuietbusWarning, stacklevel=2)
    with concurrent.futures.ThreadPoolExecutor(len(mounts)) as pool:
        futures = {mount: pool.submit(run, mount) for mount in mounts}
        try:
            concurrent.futures.wait(futures.values())
        except KeyboardInterrupt:
            stop.set()
        solved = {mount: future.result() for mount, future in futures.items()}
    for _, notes in solved.values():
        for note in notes:
            warnings.warn(note, QuietbusWarning, stacklevel=2)
    for mount, (done, _) in solved.items():
        for note in (*filter(None, [unshown(tasks[mount], done)]), *remarks(done)):
            warnings.warn(f"{mount}: {note}", QuietbusWarning, stacklevel=2)
    return {mount: done for mount, (done, _) in solved.items()}


def worst_over_phases(run: xr.Dataset) -> np.ndarray | None:
    """(3,) jitter of the bus rate [rad/s] at the end of a run for the worst rotor phases.

    The sum of the amplitudes of all rotors' lines, noise left out: of a harmonic run as it is, of
    a direct one by the harmonic view of the satellite at rest, with the gimbal angles and rotor
    speeds of the end. None where there is no such steady motion.
    """
    scenario = scenario_of(run)
    if method_of(run).jitter_apart:
        return summarize(run).worst_phases_rate
    last = run.isel(time=-1)
    angles, speed = (last[name].to_numpy() for name in ("gimbal_angle", "rotor_speed"))
    return worst_phases_at_rest(scenario, angles, speed)


def analyze(scenario: Scenario | str, gimbal_angle: ArrayLike | None = None) -> Study:
    """Linear analysis: channels, loops per axis and coupled, modes, transmissibility.

    Args:
        scenario: a scenario, the path of a scenario file, or a built-in's name.
        gimbal_angle: (cmg,) [rad] at which to analyse, instead of the scenario's own.

    Returns:
        The study; its parts are computed when asked for, ``to_dict()`` gives them all
        (docs/analysis.md).

    Raises:
        ScenarioError: the scenario is not valid.
        ValueError: a wrong number of gimbal angles, or ones for which there is no analysis.
    """
    scenario = scenario_asked(scenario)
    tell_implausible(scenario)
    return Study(scenario, angles_asked(scenario, gimbal_angle))


def jitter(scenario: Scenario | str, gimbal_angle: ArrayLike | None = None) -> JitterStudy:
    """Jitter with the satellite at rest, with the isolator and without, in milliseconds.

    Args:
        scenario: a scenario, the path of a scenario file, or a built-in's name.
        gimbal_angle: (cmg,) [rad] instead of the scenario's own.

    Returns:
        The study: amplitudes by rotor and order, combined figures, budget by kind of imbalance,
        worst gimbal angles, derivatives; ``to_dict()`` gives it all (docs/jitter.md).

    Raises:
        ScenarioError: the scenario is not valid.
        ValueError: a wrong number of gimbal angles, or a satellite that cannot rest.
        ResonanceError: an order of a rotor lies on an undamped mode.
    """
    scenario = scenario_asked(scenario)
    tell_implausible(scenario)
    study = JitterStudy(scenario, angles_asked(scenario, gimbal_angle))
    for note in energy_notes(scenario, study.satellite("isolated")):
        warnings.warn(note, QuietbusWarning, stacklevel=2)
    return study


def platforms(
    scenarios: Sequence[Scenario | str], gimbal_angles: Sequence[ArrayLike] | None = None
) -> PlatformStudy:
    """Jitter, modes and control of one bus with several platforms, one for each scenario.

    ``per_cmg_scenarios`` makes such scenarios of one with a single platform.

    Args:
        scenarios: each the bus with one platform and its CMGs (a scenario, a path, or a built-in's
            name); bus and control must be the same in all.
        gimbal_angles: (cmg,) [rad] for each scenario, instead of its own.

    Returns:
        The study, whose parts are computed when asked for (docs/platforms.md).

    Raises:
        ScenarioError: a scenario is not valid, or bus or control differ.
        ValueError: a wrong number of gimbal angles, or a satellite that cannot rest.
        ResonanceError: an order of a rotor lies on an undamped mode.
    """
    several = listing("scenarios", scenarios, "scenarios, one for each platform")
    loaded = tuple(scenario_asked(scenario) for scenario in several)
    for each in loaded:
        tell_implausible(each)
    if not loaded:
        raise ValueError("scenarios: expected one or more, one for each platform, got none")
    given: list[Any] = [None] * len(loaded)
    if gimbal_angles is not None:
        given = listing("gimbal_angles", gimbal_angles, "lists of angles")
    if len(given) != len(loaded):
        raise ValueError(
            f"gimbal_angles: expected {len(loaded)} lists, one for each scenario, got {len(given)}"
        )
    angles = (angles_asked(s, own) for s, own in zip(loaded, given, strict=True))
    return PlatformStudy(loaded, tuple(angles))


def verify(
    scenario: Scenario | str,
    method: str | Method = "harmonic",
    mount: Mount | None = None,
    *,
    duration: float | None = None,
    output_rate: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Verification:
    """The scenario's pointing requirements, each with value, margin and verdict.

    Args:
        scenario: a scenario, the path of a scenario file, or a built-in's name.
        method: "harmonic" or a ``Harmonic(...)``: slow motion and lines, over all rotor phases.
            "direct" or a ``Direct(...)``: one run with every rotor turn resolved, the only member
            of its ensemble.
        mount: "isolated" or "rigid", instead of the scenario's own.
        duration: [s], instead of the scenario's own.
        output_rate: [Hz], as of ``simulate``.
        progress: called with the simulated time reached [s].

    Returns:
        The verdicts; ``to_dict()`` gives them all (docs/pointing.md).

    Raises:
        ScenarioError: the scenario is not valid, has no requirements, or one with windows longer
            than the stretch that is judged.
        SimulationError: the run is not complete.
        ValueError, ResonanceError: as of ``simulate``.
    """
    method = as_method(method)
    function("progress", progress)
    scenario = scenario_asked(scenario, mount, duration, method.output_rate(output_rate))
    if not scenario.requirements:
        raise ScenarioError(scenario.name, [Problem(NO_REQUIREMENTS, ("requirements",))])
    check_requirements(scenario, method, scenario.simulation.duration)
    run = simulate(scenario, method, output_rate=output_rate, progress=progress)
    if run.attrs["status"] != "complete":
        raise SimulationError(f"the run is not complete: {run.attrs['stop_reason']}", run)
    return Verification(run)


def linearize(
    scenario: Scenario | str,
    rate: ArrayLike | None = None,
    gimbal_angles: ArrayLike | None = None,
    mount: Mount | None = None,
    actuator: Actuation = "servo",
    points: Mapping[str, ArrayLike] | None = None,
) -> LinearModel:
    """The uncontrolled satellite, linearised exactly; ``.to_control()`` makes a StateSpace of it.

    Inputs and outputs have names (``docs/analysis.md`` lists them).

    Args:
        scenario: a scenario, the path of a scenario file, or a built-in's name.
        rate: (3,) steady rate [rad/s], bus frame, about which to linearise; at rest by default.
        gimbal_angles: (cmg,) [rad] instead of the scenario's own.
        mount: "isolated" or "rigid", instead of the scenario's own.
        actuator: "servo": ``control_torque`` turns the gimbals, by the steering law and the servo.
            "ideal": it acts on the plate as it is, gimbals held.
        points: further points of the bus [m], bus frame, by name: their accelerations are outputs.

    Raises:
        ScenarioError: the scenario is not valid.
        ValueError: a value of the wrong kind or shape, or a point that is not an equilibrium.
    """
    scenario = scenario_asked(scenario, mount)
    choice("actuator", actuator, ("servo", "ideal"))
    points = mapping("points", points, "points of the bus")
    tell_implausible(scenario)
    return linearize_satellite(
        build_satellite(scenario),
        OperatingPoint(
            vector("rate", np.zeros(3) if rate is None else rate, 3),
            angles_asked(scenario, gimbal_angles),
        ),
        actuator,
        {name: vector(f"points[{name!r}]", p, 3) for name, p in points.items()},
    )
