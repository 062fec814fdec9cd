"""What the parts share: the satellite, its linear study and its flights, computed once."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.signal import resample_poly

from quietbus import api
from quietbus.analysis.signals.residual import FINER, residual
from quietbus.results import save_run
from quietbus.scenario import Scenario, load_scenario
from quietbus.studies.linear import Study

if TYPE_CHECKING:
    from quietbus.reproduce.paper import Workshop

MOUNTS: tuple[api.Mount, ...] = ("rigid", "isolated")
Runs = dict[api.Mount, xr.Dataset]
OUTPUT_RATE = 500.0  # [Hz] five samples a turn, enough for the peak between samples
HARMONIC_RATE = 20.0  # [Hz]
KEPT = (
    "bus_rate",
    "bus_attitude",
    "attitude_error",
    "gimbal_angle",
    "leg_stroke",
    "singularity_measure",
)
ORDERS = np.array([1.0, 2.0])
TURN = np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)  # [rad] of the first order


@dataclass(frozen=True)
class Envelope:
    """A harmonic run: the slow rate and the peak of the jitter about it."""

    time: np.ndarray  # (n,) [s]
    slow_rate: np.ndarray  # (n, axis) [rad/s]
    peak: np.ndarray  # (n, axis) [rad/s]


@dataclass
class Bench:
    """The shared results of this paper's parts."""

    shop: "Workshop"

    @cached_property
    def study(self) -> Study:
        """Linear analysis at the scenario's gimbal angles."""
        return api.analyze("zhang2012")

    def flight(self, name: str) -> Runs:
        """The direct runs of a built-in scenario on both mounts, kept in the folder."""
        if name not in self._flights:
            self._flights[name] = self._kept_flight(name)
        return self._flights[name]

    @cached_property
    def _flights(self) -> dict[str, Runs]:
        return {}

    def _kept_flight(self, name: str) -> Runs:
        key = self.shop.key(type(self))
        paths = {mount: self.shop.store / f"{name}-{mount}.nc" for mount in MOUNTS}
        try:
            runs = {m: xr.load_dataset(path, engine="h5netcdf") for m, path in paths.items()}
            if all(run.attrs.get("fingerprint") == key for run in runs.values()):
                return runs
        except (OSError, ValueError, KeyError):
            pass  # not there, or cut short
        scenario = sampled(load_scenario(name))
        reached = dict.fromkeys(MOUNTS, 0.0)

        def progress(mount: api.Mount, t: float) -> None:
            reached[mount] = t
            self.shop.tell(f"flight {name}", min(reached.values()) / scenario.simulation.duration)

        whole = api.compare(scenario, progress=progress)
        for mount, run in whole.items():
            if run.attrs["status"] == "interrupted":
                raise KeyboardInterrupt
            if run.attrs["status"] != "complete":
                raise RuntimeError(f"{name}, {mount}: {run.attrs['stop_reason']}")
        runs = {mount: whole[mount][list(KEPT)] for mount in MOUNTS}
        for mount, run in runs.items():
            run.attrs["fingerprint"] = key
            save_run(run, paths[mount])
        return runs

    def envelope(self, name: str, mount: api.Mount) -> Envelope:
        """The harmonic run of a built-in scenario."""
        key = (name, mount)
        if key not in self._envelopes:
            duration = load_scenario(name).simulation.duration
            self._envelopes[key] = _envelope(
                name,
                mount,
                lambda t: self.shop.tell(f"harmonic solver, {name}, {mount}", t / duration),
            )
        return self._envelopes[key]

    @cached_property
    def _envelopes(self) -> dict[tuple[str, str], Envelope]:
        return {}

    def residual_rate(self, name: str, mount: api.Mount) -> np.ndarray:
        """(axis,) [rad/s] peak jitter of the bus rate in the last second of a flight."""
        run = self.flight(name)[mount]
        return residual(run["time"].to_numpy(), run["bus_rate"].to_numpy()).jitter_peak

    @cached_property
    def end_angles(self) -> np.ndarray:
        """(cmg,) [rad] gimbal angles at the end of the stabilisation."""
        return self.flight("zhang2012")["isolated"]["gimbal_angle"].to_numpy()[-1]


def sampled(scenario: Scenario) -> Scenario:
    """The scenario with as many samples as are kept."""
    return scenario.with_overrides({"simulation.output_rate": OUTPUT_RATE})


def _envelope(name: str, mount: api.Mount, progress: Callable[[float], None]) -> Envelope:
    run = api.simulate(
        name, method="harmonic", mount=mount, output_rate=HARMONIC_RATE, progress=progress
    )
    if run.attrs["status"] == "interrupted":
        raise KeyboardInterrupt
    size, phase = (run[f"bus_rate_jitter_{what}"].to_numpy() for what in ("amplitude", "phase"))
    peak = jitter_peak(size * np.exp(1j * phase), _phases(name))
    return Envelope(run["time"].to_numpy(), run["bus_rate"].to_numpy(), peak)


def _phases(name: str) -> np.ndarray:
    """(cmg,) [rad] of the rotors."""
    return np.asarray(load_scenario(name).units.phases(), float)


def jitter_peak(amplitudes: np.ndarray, phases: np.ndarray) -> np.ndarray:
    """Largest value per axis over a turn of the sum of all lines, rotors of equal speed.

    Args:
        amplitudes: (..., cmg, order, axis) complex.
        phases: (cmg,) [rad] of the rotors.

    Returns:
        (..., axis).
    """
    turned = np.exp(1j * ORDERS * phases[:, None])  # (cmg, order)
    lines = np.einsum("...joa,jo->...oa", amplitudes, turned)
    waves = np.exp(1j * ORDERS * TURN[:, None])  # (angle, order)
    return np.max(np.abs(np.einsum("...oa,to->...ta", lines, waves).real), axis=-2)


def jitter_of_flight(run: xr.Dataset, envelope: Envelope) -> tuple[np.ndarray, np.ndarray]:
    """Peak over each second of a direct run's deviation from its slow motion (second, axis).

    The slow motion is that of the harmonic run.

    Returns:
        The middle of each second [s], and the peaks [rad/s].
    """
    time, rate = run["time"].to_numpy(), run["bus_rate"].to_numpy()
    fine = resample_poly(rate - CubicSpline(envelope.time, envelope.slow_rate)(time), FINER, 1)
    block = int(FINER * OUTPUT_RATE)
    seconds = len(fine) // block
    peaks = np.abs(fine[: seconds * block].reshape(seconds, block, 3)).max(axis=1)
    return np.arange(seconds) + 0.5, peaks
