"""The verbs of quietbus: load, build, solve, and give labelled results."""

import concurrent.futures
import threading
import time
import warnings
from collections.abc import Callable
from typing import Literal

import xarray as xr

from quietbus.build import build_initial_state, build_satellite
from quietbus.results import aliasing, to_dataset
from quietbus.scenario import Scenario, load_scenario
from quietbus.solve.direct import Tolerances, integrate

Mount = Literal["isolated", "rigid"]
METHODS = ("direct",)


class QuietbusWarning(UserWarning):
    """Something in a run that the user should know before trusting its numbers."""


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
    joint_forces: bool = False,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Simulate a scenario.

    Args:
        scenario: a scenario, the path of a scenario file, or a built-in's name.
        method: "direct": the nonlinear equations, every rotor turn resolved.
        mount: "isolated" or "rigid", instead of the scenario's own.
        duration: [s], instead of the scenario's own.
        joint_forces: also give the constraint forces in the legs' joints (isolated mount only).
        progress: called with the simulated time reached [s].

    Returns:
        The run, as described in docs/results.md. After Ctrl-C it holds what was computed, with
        ``status`` "interrupted" among its attributes, and a QuietbusWarning is given.

    Raises:
        ScenarioError: the scenario is not valid.
        ValueError: an unknown method or mount.
        SimulationError: the run diverged; what was computed until then is in its ``run``.
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}; got {method!r}")
    scenario = _as_run(scenario, mount, duration)
    warning = aliasing(scenario)
    if warning:
        warnings.warn(warning, QuietbusWarning, stacklevel=2)
    run = _direct(scenario, joint_forces, progress)
    if run.attrs["status"] == "stopped":
        raise SimulationError(run.attrs["stop_reason"], run)
    if run.attrs["status"] == "interrupted":
        warnings.warn(run.attrs["stop_reason"], QuietbusWarning, stacklevel=2)
    return run


def compare(
    scenario: Scenario | str,
    *,
    duration: float | None = None,
    progress: Callable[[Mount, float], None] | None = None,
) -> dict[Mount, xr.Dataset]:
    """The same scenario on both mounts, side by side on two cores.

    Runs that could not be finished are returned as far as they came; their ``status`` tells.

    Args:
        duration: [s], instead of the scenario's own.
        progress: called with the mount and the simulated time reached [s].
    """
    mounts: tuple[Mount, ...] = ("isolated", "rigid")
    stop = threading.Event()

    def run(mount: Mount) -> xr.Dataset:
        def tell(t: float) -> None:
            if progress is not None:
                progress(mount, t)
            if stop.is_set():
                raise KeyboardInterrupt

        return _direct(_as_run(scenario, mount, duration), False, tell)

    warning = aliasing(_as_run(scenario, None, duration))
    if warning:
        warnings.warn(warning, QuietbusWarning, stacklevel=2)
    with concurrent.futures.ThreadPoolExecutor(len(mounts)) as pool:
        futures = {mount: pool.submit(run, mount) for mount in mounts}
        try:
            concurrent.futures.wait(futures.values())
        except KeyboardInterrupt:
            stop.set()
        return {mount: future.result() for mount, future in futures.items()}


def _as_run(scenario: Scenario | str, mount: Mount | None, duration: float | None) -> Scenario:
    """The scenario with what the caller asks for instead of its own values."""
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    if mount not in (None, "isolated", "rigid"):
        raise ValueError(f"mount must be 'isolated' or 'rigid', got {mount!r}")
    wanted = {"isolator.mount": mount, "simulation.duration": duration}
    return scenario.with_overrides({k: v for k, v in wanted.items() if v is not None})


def _direct(
    scenario: Scenario, joint_forces: bool, progress: Callable[[float], None] | None
) -> xr.Dataset:
    if joint_forces and scenario.isolator.mount == "rigid":
        raise ValueError(
            "joint_forces needs mount 'isolated': on a rigid mount the legs' forces are not "
            "determined, since the plate is held by the mount and not by the legs"
        )
    started = time.perf_counter()
    satellite = build_satellite(scenario)
    settings = scenario.simulation
    solution = integrate(
        satellite,
        build_initial_state(scenario, satellite),
        settings.duration,
        settings.output_rate,
        Tolerances(settings.tolerances.relative, settings.tolerances.absolute),
        joint_forces,
        progress,
    )
    return to_dataset(scenario, solution, time.perf_counter() - started)
