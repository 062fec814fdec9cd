"""The verbs of quietbus: load, build, solve, and give labelled results."""

import concurrent.futures
import os
import pathlib
import threading
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from quietbus.arguments import array, choice, flag, function, listing, mapping, positive, vector
from quietbus.build import build_initial_state, build_satellite
from quietbus.dynamics.linearize import Actuator, LinearModel, OperatingPoint
from quietbus.dynamics.linearize import linearize as linearize_satellite
from quietbus.processes import start_computing
from quietbus.results import (
    aliasing,
    delivery_notes,
    rotor_notes,
    scenario_of,
    summarize,
    to_dataset,
)
from quietbus.results.checkpoint import Checkpoint
from quietbus.results.dataset import slow_tolerances
from quietbus.results.size import check_space
from quietbus.results.task import Task
from quietbus.scenario import LineOfSight, Problem, Scenario, ScenarioError, load_scenario
from quietbus.scenario.plausibility import implausible
from quietbus.scenario.pointing import NO_REQUIREMENTS
from quietbus.scenario.wheels import WheelCluster
from quietbus.solve.direct import Reached, Scheme, Tolerances, integrate
from quietbus.solve.harmonic import integrate_harmonic, on_periodic_solution
from quietbus.solve.noise import with_noise
from quietbus.studies.jitter import JitterStudy
from quietbus.studies.jitter import worst_over_phases as worst_phases_at_rest
from quietbus.studies.linear import Study
from quietbus.studies.platforms import PlatformStudy
from quietbus.studies.resolution import refuse_coarse_output, refuse_coarse_tolerance, unseen
from quietbus.studies.verification import Verification, check_requirements

Mount = Literal["isolated", "rigid"]
METHODS = ("direct", "harmonic")
HARMONIC_RATE = 10.0  # [Hz] of the outputs of a harmonic run, unless asked for otherwise


Notes = tuple[str, ...]


class QuietbusWarning(UserWarning):
    """Something in a run that the user should know before trusting its numbers."""


class ImplausibleValue(QuietbusWarning):
    """A value of a scenario that no satellite has; most often its unit was left out."""


class SimulationError(RuntimeError):
    """A run that could not be finished; ``run`` holds what was computed until then."""

    def __init__(self, message: str, run: xr.Dataset):
        super().__init__(message)
        self.run = run


def simulate(
    scenario: Scenario | str,
    method: str = "direct",
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
        method: "direct": the nonlinear equations, every rotor turn resolved. "harmonic": the slow
            motion, and at every output instant the steady response to every order of every rotor.
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
    choice("method", method, METHODS)
    flag("joint_forces", joint_forces)
    flag("resume", resume)
    function("progress", progress)
    points = mapping("points", points, "points of the bus")
    lines_of_sight = mapping("lines_of_sight", lines_of_sight, "directions or sensitivities")
    if method == "harmonic":
        if joint_forces:
            raise ValueError("joint_forces needs method 'direct'")
        rate = HARMONIC_RATE if output_rate is None else output_rate
        scenario = _as_run(scenario, mount, duration, rate)
        _tell_implausible(scenario)
        task = _harmonic_task(scenario, points, lines_of_sight)
        run, notes = _kept(_harmonic, task, progress, checkpoint, resume)
    else:
        if points or lines_of_sight:
            raise ValueError("points and lines_of_sight need method 'harmonic'")
        scenario = _as_run(scenario, mount, duration, output_rate)
        _tell_implausible(scenario)
        refuse_coarse_output(scenario)
        task = Task(scenario, "direct", joint_forces)
        run, notes = _kept(_direct, task, progress, checkpoint, resume)
        notes += tuple(filter(None, [aliasing(scenario)]))
    for note in (*notes, *rotor_notes(run), *delivery_notes(run)):
        warnings.warn(note, QuietbusWarning, stacklevel=2)
    if run.attrs["status"] == "stopped":
        raise SimulationError(run.attrs["stop_reason"], run)
    if method == "direct":
        aliased = _aliased(scenario, run)
        if aliased:
            raise SimulationError(aliased, run)
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
    scenario = _as_run(scenario, None, duration)
    mounts: tuple[Mount, ...] = ("isolated", "rigid")
    stop, troubles = threading.Event(), list[str]()

    def run(mount: Mount) -> xr.Dataset:
        def tell(t: float) -> None:
            if progress is not None:
                progress(mount, t)
            if stop.is_set():
                raise KeyboardInterrupt

        task = Task(_as_run(scenario, mount, None), "direct")
        done, said = _kept(_direct, task, tell, (checkpoints or {}).get(mount), resume)
        troubles.extend(said)
        return done

    _tell_implausible(scenario)
    refuse_coarse_output(scenario)
    warning = aliasing(scenario)
    if warning:
        warnings.warn(warning, QuietbusWarning, stacklevel=2)
    with concurrent.futures.ThreadPoolExecutor(len(mounts)) as pool:
        futures = {mount: pool.submit(run, mount) for mount in mounts}
        try:
            concurrent.futures.wait(futures.values())
        except KeyboardInterrupt:
            stop.set()
        runs: dict[str, xr.Dataset] = {}
        for mount, future in futures.items():
            runs[mount] = future.result()
    for trouble in troubles:
        warnings.warn(trouble, QuietbusWarning, stacklevel=2)
    for name, done in runs.items():
        aliased = _aliased(scenario, done)
        for note in (*filter(None, [aliased]), *rotor_notes(done), *delivery_notes(done)):
            warnings.warn(f"{name}: {note}", QuietbusWarning, stacklevel=2)
    return runs


def worst_over_phases(run: xr.Dataset) -> np.ndarray | None:
    """(3,) jitter of the bus rate [rad/s] at the end of a run for the worst rotor phases.

    The sum of the amplitudes of all rotors' lines, noise left out: of a harmonic run as it is, of
    a direct one by the harmonic view of the satellite at rest, with the gimbal angles and rotor
    speeds of the end. None where there is no such steady motion.
    """
    scenario = scenario_of(run)
    if run.attrs["method"] == "harmonic":
        return summarize(run).worst_phases_rate
    last = run.isel(time=-1)
    speed = last["rotor_speed"].to_numpy() if "rotor_speed" in run else None
    angles = last["gimbal_angle"].to_numpy()
    return worst_phases_at_rest(scenario, run.attrs["mount"], angles, speed)


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
    scenario = _as_run(scenario, None, None)
    _tell_implausible(scenario)
    return Study(scenario, _gimbal_angles(scenario, gimbal_angle))


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
    scenario = _as_run(scenario, None, None)
    _tell_implausible(scenario)
    return JitterStudy(scenario, _gimbal_angles(scenario, gimbal_angle))


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
    loaded = tuple(_as_run(scenario, None, None) for scenario in several)
    for each in loaded:
        _tell_implausible(each)
    if not loaded:
        raise ValueError("scenarios: expected one or more, one for each platform, got none")
    given: list[Any] = [None] * len(loaded)
    if gimbal_angles is not None:
        given = listing("gimbal_angles", gimbal_angles, "lists of angles")
    if len(given) != len(loaded):
        raise ValueError(
            f"gimbal_angles: expected {len(loaded)} lists, one for each scenario, got {len(given)}"
        )
    angles = (_gimbal_angles(s, own) for s, own in zip(loaded, given, strict=True))
    return PlatformStudy(loaded, tuple(angles))


def verify(
    scenario: Scenario | str,
    method: str = "harmonic",
    mount: Mount | None = None,
    *,
    duration: float | None = None,
    output_rate: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Verification:
    """The scenario's pointing requirements, each with value, margin and verdict.

    Args:
        scenario: a scenario, the path of a scenario file, or a built-in's name.
        method: "harmonic": slow motion and lines, over all rotor phases. "direct": one run with
            every rotor turn resolved, the only member of its ensemble.
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
    choice("method", method, METHODS)
    function("progress", progress)
    scenario = _as_run(scenario, mount, duration, None if method == "harmonic" else output_rate)
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
    actuator: Actuator = "servo",
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
    scenario = _as_run(scenario, mount, None)
    choice("actuator", actuator, ("servo", "ideal"))
    points = mapping("points", points, "points of the bus")
    _tell_implausible(scenario)
    return linearize_satellite(
        build_satellite(scenario),
        OperatingPoint(
            vector("rate", np.zeros(3) if rate is None else rate, 3),
            _gimbal_angles(scenario, gimbal_angles),
        ),
        actuator,
        {name: vector(f"points[{name!r}]", p, 3) for name, p in points.items()},
    )


def _tell_implausible(scenario: Scenario) -> None:
    for note in implausible(scenario):
        warnings.warn(note, ImplausibleValue, stacklevel=3)


def _aliased(scenario: Scenario, run: xr.Dataset) -> str:
    """What the output rate could not show, as the run tells, or nothing."""
    speeds = run["rotor_speed"].to_numpy() if "rotor_speed" in run else None
    return unseen(scenario, run["gimbal_rate"].to_numpy(), speeds)


def _gimbal_angles(scenario: Scenario, angles: ArrayLike | None) -> np.ndarray:
    count = scenario.cluster.count
    if angles is not None and isinstance(scenario.cluster, WheelCluster):
        raise ValueError("gimbal angles: expected none, since reaction wheels have no gimbals")
    own = scenario.cluster.gimbal_angles or np.zeros(count)
    return vector("gimbal angles", own if angles is None else angles, count)


def _sensitivity(name: str, given: ArrayLike) -> np.ndarray:
    """(3, 12) of a direction, or of a matrix with zero rows for what it does not have."""
    values = array(name, given, "3 numbers, or one to three rows of 12")
    if values.ndim < 2:
        direction = vector(name, given, 3)
        if not np.any(direction):
            raise ValueError(f"{name}: expected a direction, got zero")
        return LineOfSight(direction=tuple(direction / np.linalg.norm(direction))).matrix()
    if values.ndim != 2 or not 1 <= len(values) <= 3 or values.shape[1] != 12:
        raise ValueError(f"{name}: expected one to three rows of 12 numbers, got {values.shape}")
    if not np.any(values):
        raise ValueError(f"{name}: expected a matrix that is not zero")
    return np.pad(values, ((0, 3 - len(values)), (0, 0)))


def _as_run(
    scenario: Scenario | str,
    mount: Mount | None,
    duration: float | None,
    output_rate: float | None = None,
) -> Scenario:
    """The scenario with what the caller asks for instead of its own values."""
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    if mount is not None:
        choice("mount", mount, ("isolated", "rigid"))
    if duration is not None and not isinstance(duration, str):  # a text may have a unit
        positive("duration", duration)
    if output_rate is not None and not isinstance(output_rate, str):
        positive("output_rate", output_rate)
    start_computing()
    wanted = {
        "isolator.mount": mount,
        "simulation.duration": duration,
        "simulation.output_rate": output_rate,
    }
    changes = {path: value for path, value in wanted.items() if value is not None}
    return scenario.with_overrides(changes) if changes else scenario


class _Keeping:
    """Where a run begins, and what becomes of what it reaches."""

    def __init__(self, file: Checkpoint | None, start: Reached | None):
        self.file, self.start, self.begun = file, start, time.perf_counter()

    @property
    def keep(self) -> Callable[[Reached], None] | None:
        return None if self.file is None else self.file.keep

    def wall_time(self) -> float:
        """[s] that the run has taken, before a resumption too."""
        return time.perf_counter() - self.begun if self.file is None else self.file.wall_time


def _kept(
    solve: Callable[[Task, Callable[[float], None] | None, _Keeping], tuple[xr.Dataset, Notes]],
    task: Task,
    progress: Callable[[float], None] | None,
    checkpoint: str | os.PathLike[str] | None,
    resume: bool,
) -> tuple[xr.Dataset, Notes]:
    """The run, kept in a checkpoint while it goes, and what the user should know of it."""
    if checkpoint is None:
        if resume:
            raise ValueError("resume needs a checkpoint")
        return solve(task, progress, _Keeping(None, None))
    check_space(checkpoint, task)
    if resume and pathlib.Path(checkpoint).exists():
        file, start = Checkpoint.resume(checkpoint, task)
    else:
        file, start = Checkpoint.create(checkpoint, task), None
    try:
        run, notes = solve(task, progress, _Keeping(file, start))
    finally:
        file.close()
        if not file.rows:
            pathlib.Path(checkpoint).unlink(missing_ok=True)
    if file.trouble:
        notes += (f"{checkpoint}: holds only a part of the run: {file.trouble}",)
    return run, notes


def _direct(
    task: Task, progress: Callable[[float], None] | None, keeping: _Keeping
) -> tuple[xr.Dataset, Notes]:
    scenario = task.scenario
    if task.joint_forces and scenario.isolator.mount == "rigid":
        raise ValueError(
            "joint_forces needs mount 'isolated': on a rigid mount the legs' forces are not "
            "determined, since the plate is held by the mount and not by the legs"
        )
    satellite = build_satellite(scenario)
    settings = scenario.simulation
    state = build_initial_state(scenario, satellite)
    refuse_coarse_tolerance(scenario, satellite, state)
    if scenario.initial.steady and keeping.start is None:
        state = on_periodic_solution(satellite, state)
    solution = integrate(
        with_noise(satellite, scenario.cluster.seeds, settings.duration),
        state,
        settings.duration,
        settings.output_rate,
        Tolerances(settings.tolerances.relative, settings.tolerances.absolute),
        Scheme(joint_forces=task.joint_forces),
        progress,
        keeping.keep,
        keeping.start,
    )
    return to_dataset(scenario, solution, keeping.wall_time()), ()


def _harmonic_task(
    scenario: Scenario,
    points: Mapping[str, ArrayLike],
    lines_of_sight: Mapping[str, ArrayLike],
) -> Task:
    at = {name: vector(f"points[{name!r}]", p, 3) for name, p in points.items()}
    own = {name: line.matrix() for name, line in scenario.lines_of_sight.items()}
    given = own | dict(lines_of_sight)
    lines = {name: _sensitivity(f"lines_of_sight[{name!r}]", each) for name, each in given.items()}
    return Task(scenario, "harmonic", points=at, lines_of_sight=lines)


def _harmonic(
    task: Task, progress: Callable[[float], None] | None, keeping: _Keeping
) -> tuple[xr.Dataset, Notes]:
    scenario = task.scenario
    satellite = build_satellite(scenario)
    solution = integrate_harmonic(
        satellite,
        build_initial_state(scenario, satellite),
        scenario.simulation.duration,
        scenario.simulation.output_rate,
        steady=scenario.initial.steady,
        view=task.view(),
        tolerances=slow_tolerances(scenario),
        progress=progress,
        keep=keeping.keep,
        start=keeping.start,
    )
    points, lines = task.points, task.lines_of_sight
    run = to_dataset(scenario, solution, keeping.wall_time(), points, lines)
    return run, solution.jitter.warnings
