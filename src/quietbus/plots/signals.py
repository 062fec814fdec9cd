"""What the pictures show of a run, in the units of the pictures."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from quietbus.analysis.residual import residual
from quietbus.analysis.spectrum import Spectrum, amplitude_spectrum, detrended
from quietbus.results import aliasing, scenario_of

AXES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "yaw")
TREND = 1.0  # [s] of the end of a run over which the slow motion is fitted, as in its summary
BLURRED = 6  # bins, half the main lobe of the spectrum's window
SPECTRUM = 10.0  # [s] at most, of the end of a run


def heading(run: xr.Dataset, what: str) -> str:
    """Title of a picture of a run."""
    return f"{what} ({run.attrs['title']}{cut_short(run)})"


def cut_short(run: xr.Dataset) -> str:
    """That a run ended before its time, and when; empty if it did not."""
    status = run.attrs.get("status", "complete")
    return "" if status == "complete" else f", {status} at {run['time'].to_numpy()[-1]:.4g} s"


def degrees(run: xr.Dataset, name: str) -> np.ndarray:
    """A variable of a run, from rad to deg or from rad/s to deg/s."""
    return np.rad2deg(run[name].to_numpy())


def euler_angles(run: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """[roll, pitch, yaw] (n, 3) [deg] of the bus and of its target, without jumps by a turn."""
    attitude = Rotation.from_quat(run["bus_attitude"].to_numpy(), scalar_first=True)
    half = 0.5 * run["attitude_error"].to_numpy()  # vector part of the error quaternion
    scalar = np.sqrt(np.clip(1.0 - np.sum(half**2, axis=1), 0.0, None))
    error = Rotation.from_quat(np.column_stack([scalar, half]), scalar_first=True)
    bus, target = (
        np.unwrap(rotation.as_euler("ZYX", degrees=True)[:, ::-1], period=360.0, axis=0)
        for rotation in (attitude, attitude * error.inv())
    )
    return bus, target + 360.0 * np.round((bus[0] - target[0]) / 360.0)


def rotor_frequencies(run: xr.Dataset) -> tuple[float, float]:
    """Slowest and fastest turning rotor [Hz]; zeros if none turns."""
    speeds = [abs(unit.rotor.speed) for unit in scenario_of(run).cluster.placed() if unit.rotor]
    turning = [speed / (2.0 * np.pi) for speed in speeds if speed] or [0.0]
    return min(turning), max(turning)


@dataclass(frozen=True)
class Jitter:
    """Vibration of the bus over the last turns of the rotors, its slow motion taken off."""

    start: float  # [s]
    time: np.ndarray  # (n,) [ms] after the start
    rate: np.ndarray  # (n, 3) [deg/s]
    peak: np.ndarray  # (3,) [deg/s] as in the run's summary


def jitter(run: xr.Dataset) -> Jitter:
    """Jitter over ten turns of the slowest rotor, a smooth curve through the samples.

    Raises:
        ValueError: the run cannot show it; the message says why.
    """
    warning = aliasing(scenario_of(run))
    if warning:
        raise ValueError(warning.partition(". ")[0])
    time = run["time"].to_numpy()
    rates = degrees(run, "bus_rate")
    rest = residual(time, rates, TREND)
    last = time >= time[-1] - TREND
    rate = make_interp_spline(time[last], detrended(time[last], rates[last]), k=3)
    slowest, _ = rotor_frequencies(run)
    first, end = rest.window
    start = max(first, end - (10.0 / slowest if slowest else 0.1))
    fine = np.linspace(start, end, 1000)
    return Jitter(
        start=start,
        time=1e3 * (fine - start),
        rate=rate(fine),
        peak=rest.jitter_peak,
    )


def rate_spectrum(run: xr.Dataset) -> tuple[Spectrum, float]:
    """Amplitudes [deg/s] of the bus rate, and the span [s] of the run's end that they are from.

    The span is half the run, 10 s at most; the lowest bins, which the window blurs, are left out.

    Raises:
        ValueError: too few samples.
    """
    time = run["time"].to_numpy()
    span = min(SPECTRUM, 0.5 * (time[-1] - time[0]))
    last = time >= time[-1] - span
    lines = amplitude_spectrum(time[last], degrees(run, "bus_rate")[last])
    return Spectrum(lines.frequency[BLURRED:], lines.amplitude[BLURRED:]), span
