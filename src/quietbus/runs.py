"""A task solved by its method, kept in a checkpoint while it goes, and what is to be said of it."""

import functools
import os
import pathlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import xarray as xr

from quietbus.build import build_initial_state, build_satellite, energy_notes
from quietbus.methods import Direct, Harmonic, Method
from quietbus.results import aliasing, delivery_notes, rotor_notes, to_dataset
from quietbus.results.checkpoint import Checkpoint
from quietbus.results.size import check_space
from quietbus.results.task import Task
from quietbus.solve.direct import Reached, Scheme, Tolerances, integrate
from quietbus.solve.harmonic import integrate_harmonic
from quietbus.solve.noise import with_noise
from quietbus.solve.periodic import on_periodic_solution
from quietbus.studies.resolution import refuse_coarse_tolerance, unseen

Notes = tuple[str, ...]
Progress = Callable[[float], None]


class SimulationError(RuntimeError):
    """A run that could not be finished; ``run`` holds what was computed until then."""

    def __init__(self, message: str, run: xr.Dataset):
        super().__init__(message)
        self.run = run


@dataclass(frozen=True)
class _Keeping:
    """Where a run begins, and what becomes of what it reaches."""

    keep: Callable[[Reached], None] | None = None
    start: Reached | None = None
    begun: float = field(default_factory=time.perf_counter)  # the time before a resumption counts

    def wall_time(self) -> float:
        """[s] that the run has taken."""
        return time.perf_counter() - self.begun


def solve(
    task: Task,
    progress: Progress | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
) -> tuple[xr.Dataset, Notes]:
    """The run, and what the user should know of how it came about.

    Args:
        progress, checkpoint, resume: as of ``quietbus.simulate``.
    """
    if checkpoint is None:
        if resume:
            raise ValueError("resume needs a checkpoint")
        return _solve(task.method, task, progress, _Keeping())
    check_space(checkpoint, task)
    if resume and pathlib.Path(checkpoint).exists():
        file, start = Checkpoint.resume(checkpoint, task)
    else:
        file, start = Checkpoint.create(checkpoint, task), None
    try:
        run, notes = _solve(task.method, task, progress, _Keeping(file.keep, start, file.started))
    finally:
        file.close()
        if not file.rows:
            pathlib.Path(checkpoint).unlink(missing_ok=True)
    if file.trouble:
        notes += (f"{checkpoint}: holds only a part of the run: {file.trouble}",)
    return run, notes


@functools.singledispatch
def _solve(
    method: Method, task: Task, progress: Progress | None, keeping: _Keeping
) -> tuple[xr.Dataset, Notes]:
    raise NotImplementedError(f"no solver for {method}")


@_solve.register
def _(
    _method: Direct, task: Task, progress: Progress | None, keeping: _Keeping
) -> tuple[xr.Dataset, Notes]:
    scenario, tolerances = task.scenario, task.tolerances
    satellite = build_satellite(scenario)
    state = build_initial_state(scenario, satellite)
    refuse_coarse_tolerance(scenario, satellite, state, tolerances.absolute)
    if scenario.initial.steady and keeping.start is None:
        state = on_periodic_solution(satellite, state)
    solution = integrate(
        with_noise(satellite, scenario.units.seeds, scenario.simulation.duration),
        state,
        scenario.simulation.duration,
        scenario.simulation.output_rate,
        Tolerances(tolerances.relative, tolerances.absolute),
        Scheme(joint_forces=task.joint_forces),
        progress,
        keeping.keep,
        keeping.start,
    )
    run = to_dataset(task, solution, keeping.wall_time())
    return run, energy_notes(scenario, satellite)


@_solve.register
def _(
    _method: Harmonic, task: Task, progress: Progress | None, keeping: _Keeping
) -> tuple[xr.Dataset, Notes]:
    scenario, tolerances = task.scenario, task.tolerances
    satellite = build_satellite(scenario)
    solution = integrate_harmonic(
        satellite,
        build_initial_state(scenario, satellite),
        scenario.simulation.duration,
        scenario.simulation.output_rate,
        steady=scenario.initial.steady,
        view=task.view(),
        tolerances=Tolerances(tolerances.relative, tolerances.absolute),
        progress=progress,
        keep=keeping.keep,
        start=keeping.start,
    )
    run = to_dataset(task, solution, keeping.wall_time())
    return run, (*solution.jitter.warnings, *energy_notes(scenario, satellite))


def foreseen(task: Task) -> Notes:
    """What can be said of a run's output before it is made."""
    return () if task.method.jitter_apart else tuple(filter(None, [aliasing(task.scenario)]))


def remarks(run: xr.Dataset) -> Notes:
    """What the user should know of rotors and of the torque that was delivered."""
    return (*rotor_notes(run), *delivery_notes(run))


def unshown(task: Task, run: xr.Dataset) -> str:
    """What the output rate could not show, as only the run tells, or nothing."""
    if task.method.jitter_apart:
        return ""
    return unseen(task.scenario, run["gimbal_rate"].to_numpy(), run["rotor_speed"].to_numpy())
