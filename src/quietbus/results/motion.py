"""The bus's motion in a run as one looks at it, in degrees: angles, jitter, spectrum, lines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from quietbus.analysis.jitter.combine import SAME_FREQUENCY, combine
from quietbus.analysis.signals.residual import residual
from quietbus.analysis.signals.spectrum import Spectrum, amplitude_spectrum, detrended
from quietbus.results import aliasing, method_of, scenario_of
from quietbus.solve.validity import SLOW_CHANGE

TREND = 1.0  # [s] of the end of a run over which the slow motion is fitted, as in its summary
BLURRED = 6  # bins, half the main lobe of the spectrum's window
SPECTRUM = 10.0  # [s] at most, of the end of a run
LIMIT_OF_CHANGE = SLOW_CHANGE  # [-] of ``jitter_change_error``, above which it says too little
NOISE = 1e-10  # [deg/s] jitter smaller than this is none


def is_harmonic(run: xr.Dataset) -> bool:
    """Whether a run holds slow motion and jitter apart, instead of every rotor turn."""
    return method_of(run).jitter_apart


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
    """Slowest and fastest turning rotor [Hz]; zeros if none turns.

    Of rotors whose speed changes, at the end of the run that its spectrum is from.
    """
    time = run["time"].to_numpy()
    last = time >= time[-1] - _spectrum_span(time)
    speeds = np.abs(run["rotor_speed"].to_numpy()[last]).ravel().tolist()
    turning = [speed / (2.0 * np.pi) for speed in speeds if speed] or [0.0]
    return min(turning), max(turning)


def _spectrum_span(time: np.ndarray) -> float:
    """Length [s] of the end of a run that its spectrum is from."""
    return float(min(SPECTRUM, 0.5 * (time[-1] - time[0])))


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
    span = _spectrum_span(time)
    last = time >= time[-1] - span
    lines = amplitude_spectrum(time[last], degrees(run, "bus_rate")[last])
    return Spectrum(lines.frequency[BLURRED:], lines.amplitude[BLURRED:]), span


@dataclass(frozen=True)
class RotorLines:
    """Lines of the bus rate at the orders of the rotors."""

    amplitude: np.ndarray  # (cmg, order, axis) [deg/s] complex, as ``combine`` takes it
    frequency: np.ndarray  # (cmg, order) [rad/s], of either sign
    phase: np.ndarray  # (cmg, order) [rad] at t = 0
    orders: tuple[float, ...]

    def by_frequency(self) -> list[list[tuple[int, int]]]:
        """Lines (cmg, order) of each frequency, from the lowest to the highest."""
        size = np.abs(self.frequency)
        groups: list[list[tuple[int, int]]] = []
        for flat in np.argsort(size, axis=None, kind="stable"):
            line = divmod(int(flat), size.shape[1])
            first = size[groups[-1][0]] if groups else -1.0
            if size[line] - first <= SAME_FREQUENCY * abs(first):
                groups[-1].append(line)
            else:
                groups.append([line])
        return [sorted(group) for group in groups]

    def together(self, group: Sequence[tuple[int, int]]) -> np.ndarray:
        """Amplitude (axis,) [deg/s] of lines of one frequency, added with their phases."""
        j, k = np.array(group).T
        only = np.zeros_like(self.amplitude)
        only[j, k] = self.amplitude[j, k]
        return combine(only, self.frequency, self.phase).envelope

    def name(self, group: Sequence[tuple[int, int]]) -> str:
        """``1Ω, 100 Hz`` for lines of one frequency."""
        orders = sorted({self.orders[k] for _, k in group})
        hz = abs(self.frequency[group[0]]) / (2.0 * np.pi)
        return f"{', '.join(f'{order:g}Ω' for order in orders)}, {hz:.5g} Hz"


def last_lines(run: xr.Dataset) -> RotorLines:
    """Lines at the end of a harmonic run."""
    last = run.isel(time=-1)
    amplitude, shift = (
        last[f"bus_rate_jitter_{part}"].transpose("cmg", "order", "axis").to_numpy()
        for part in ("amplitude", "phase")
    )
    orders = last["order"].to_numpy()
    speed, phase = last["rotor_speed"].to_numpy(), last["rotor_angle"].to_numpy()
    return RotorLines(
        np.rad2deg(amplitude) * np.exp(1j * shift),
        np.outer(speed, orders),
        np.outer(phase, orders),
        tuple(orders.tolist()),
    )
