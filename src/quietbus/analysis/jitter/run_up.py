"""A run in which the rotors' speed changes, against the map of the jitter at constant speeds.

The amplitude of one order is followed through the run: the signal, sampled anew at equal rotor
angles, is multiplied with the order's conjugate and averaged over some turns under a Hann window.
What is slower, the motion that the changing momentum causes say, is taken off by the same window
before. A quasi-steady run has the map's amplitude at its speed. One that passes a resonance fast
lags behind: its peak is lower and comes at a higher speed (F. M. Lewis 1932, "Vibration during
acceleration through a critical speed").
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.signal import fftconvolve

from quietbus.analysis.jitter.sweep import SpeedSweep
from quietbus.arguments import choice, vector

TURNS = 4.0  # of the rotor that one amplitude is taken from; tells orders apart by 0.5
SAMPLES = 32  # a turn and order
LEAST_RATE = 4.0  # samples of the signal a period of the line


@dataclass(frozen=True, eq=False)
class RunUp:
    """Amplitude of one order in a run and in the map, over the run's time."""

    order: float
    time: np.ndarray  # (n,) [s]
    speed: np.ndarray  # (n,) [rad/s]
    amplitude: np.ndarray  # (n, axis) of the run
    quasi_steady: np.ndarray  # (n, axis) of the map at these speeds

    def peaks(self, axis: int) -> dict[str, float]:
        """Largest amplitudes of run and map, and the speeds [rad/s] at which they are."""
        run, steady = (int(np.argmax(a[:, axis])) for a in (self.amplitude, self.quasi_steady))
        return {
            "amplitude": float(self.amplitude[run, axis]),
            "speed": float(self.speed[run]),
            "quasi_steady_amplitude": float(self.quasi_steady[steady, axis]),
            "quasi_steady_speed": float(self.speed[steady]),
        }

    @property
    def error(self) -> np.ndarray:
        """Largest difference over the largest amplitude of the map (axis,) [-]."""
        difference = np.max(np.abs(self.amplitude - self.quasi_steady), axis=0)
        return difference / np.maximum(np.max(self.quasi_steady, axis=0), 1e-300)


def compare_run_up(
    run: xr.Dataset, sweep: SpeedSweep, mount: str, order: float = 1.0, signal: str = "bus_rate"
) -> RunUp:
    """The run's amplitude of an order against the map's, rotors of one speed.

    Args:
        run: with ``rotor_speed`` (time), or (time, cmg) alike for all, and ``signal`` (time, axis).
        sweep: map of the same satellite that reaches the run's speeds.
        mount: of the run.

    Raises:
        ValueError: rotors of different speeds, speeds beyond the map, an order that the map lacks,
            or samples too few for the line.
    """
    choice("mount", mount, ("isolated", "rigid"))
    if not isinstance(run, xr.Dataset) or not {"rotor_speed", "time"} <= set(run.variables):
        raise ValueError("run: expected a run with a run-up, which has rotor_speed over time")
    choice("signal", signal, [str(name) for name in run.data_vars])
    vector("order", [order], 1)
    if order not in sweep.orders:
        listed = ", ".join(f"{known:g}" for known in sweep.orders)
        raise ValueError(f"expected an order of the map, one of {listed}; got {order:g}")
    speed = run["rotor_speed"].transpose("time", ...).to_numpy()
    if speed.ndim == 2:
        if np.ptp(np.abs(speed), axis=1).max() > 1e-6 * np.abs(speed).max():
            raise ValueError("expected rotors of one speed; the run's differ")
        speed = speed[:, 0]
    speed = np.abs(speed)
    values = np.abs(sweep.together(mount)[:, sweep.orders.index(order)])
    return follow(
        run["time"].to_numpy(),
        speed,
        run[signal].transpose("time", ...).to_numpy(),
        sweep.speed,
        values,
        order,
    )


def follow(
    time: ArrayLike,
    speed: ArrayLike,
    signal: ArrayLike,
    map_speed: ArrayLike,
    map_amplitude: ArrayLike,
    order: float = 1.0,
) -> RunUp:
    """Follow an order through a signal, and take the map's amplitude at the same speeds.

    Args:
        time: (n,) [s], evenly spaced.
        speed: (n,) [rad/s] positive.
        signal: (n, axis).
        map_speed: (k,) [rad/s] ascending.
        map_amplitude: (k, axis) at these speeds.

    Raises:
        ValueError: speeds that are not positive or beyond the map, or samples too few for the line.
    """
    time, speed, signal = (np.asarray(a, dtype=float) for a in (time, speed, signal))
    map_speed, map_amplitude = np.asarray(map_speed), np.asarray(map_amplitude)
    if not np.all(speed > 0.0):
        raise ValueError("expected speeds above zero; cut the run where its rotors stand")
    if speed.max() > map_speed[-1] * (1.0 + 1e-9) or speed.min() < map_speed[0]:
        raise ValueError(
            f"expected a map from {speed.min():.6g} to {speed.max():.6g} rad/s, the run's speeds; "
            f"it goes from {map_speed[0]:.6g} to {map_speed[-1]:.6g}"
        )
    rate, line = (len(time) - 1) / (time[-1] - time[0]), order * speed.max() / (2.0 * np.pi)
    if rate < LEAST_RATE * line:
        raise ValueError(
            f"expected at least {LEAST_RATE * line:.4g} samples a second for a line of "
            f"{line:.4g} Hz, got {rate:.4g}"
        )
    angle = order * cumulative_trapezoid(speed, time, initial=0.0)
    count = int(SAMPLES * angle[-1] / (2.0 * np.pi)) + 1
    periods = TURNS * max(order, 1.0)
    width = int(SAMPLES * periods) + 1
    if count < 3 * width:
        raise ValueError(f"expected at least {3 * periods:g} periods of the line in the run")
    even = np.arange(count) * 2.0 * np.pi / SAMPLES
    when = CubicSpline(angle, time)(even)
    window = np.hanning(width + 2)[1:-1, None]
    window = window / window.sum()
    inner = slice(width // 2, count - width // 2)
    again = CubicSpline(time, signal)(when)
    slow = fftconvolve(again, window, mode="valid", axes=0)  # the line has no share in it
    turned = (again[inner] - slow) * np.exp(-1j * even[inner])[:, None]
    amplitude = 2.0 * np.abs(fftconvolve(turned, window, mode="valid", axes=0))
    middle = slice(2 * (width // 2), count - 2 * (width // 2))
    at = np.interp(when[middle], time, speed)
    steady = CubicSpline(map_speed, map_amplitude)(at)
    return RunUp(order, when[middle], at, amplitude, steady)
