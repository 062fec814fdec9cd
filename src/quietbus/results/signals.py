"""Time signals of harmonic runs, every rotor turn resolved."""

import numpy as np
import xarray as xr
from scipy.interpolate import CubicHermiteSpline, make_interp_spline

from quietbus.arguments import positive, vector
from quietbus.results.origin import refuse_no_run
from quietbus.results.schema import jitter_of, told
from quietbus.scenario.limits import MOST_SAMPLES


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
    refuse_no_run(run)
    end = "_jitter_phase"
    known = [str(each).removesuffix(end) for each in run.data_vars if str(each).endswith(end)]
    if name not in known:
        raise ValueError(
            f"the run has no jitter of {name!r}; "
            + (f"it has that of {', '.join(known)}" if known else "its method is not 'harmonic'")
        )
    time = run["time"].to_numpy()
    positive("span", span)
    if rate is not None:
        positive("rate", rate)
    around = float(time[-1] - span / 2 if around is None else vector("around", [around], 1)[0])
    if not time[0] <= around <= time[-1] or not span > 0.0:
        raise ValueError(
            f"expected a stretch of positive length around a time from {time[0]:g} s to "
            f"{time[-1]:g} s; got {span:g} s around {around:g} s"
        )
    speed = run["rotor_speed"].to_numpy()
    orders = run["order"].to_numpy()
    fastest = max(orders) * np.max(np.abs(speed)) / (2.0 * np.pi)
    rate = 40.0 * max(fastest, 1.0) if rate is None else rate
    if span * rate > MOST_SAMPLES:
        raise ValueError(f"rate: expected at most {MOST_SAMPLES / span:.3g} Hz, got {rate:g}")
    first, last = max(time[0], around - span / 2), min(time[-1], around + span / 2)
    t = first + np.arange(int((last - first) * rate) + 1) / rate
    amplitude, shift = (run[f"{name}_jitter_{part}"] for part in ("amplitude", "phase"))
    at = _interpolated(time, amplitude.to_numpy() * np.exp(1j * shift.to_numpy()), t)
    if len(time) == 1:
        angle = run["rotor_angle"].to_numpy() + (t - time)[:, None] * speed
    else:
        angle = CubicHermiteSpline(time, run["rotor_angle"].to_numpy(), speed)(t)
    turn = np.exp(1j * angle[..., None] * orders)
    inner = amplitude.dims[3:]
    values = np.sum((at * turn.reshape(*turn.shape, *[1] * len(inner))).real, axis=(1, 2))
    if "ripple" in run.dims:
        values = values + _ripple_signal(run, name, t)
    meaning = f"jitter of {jitter_of(name)[2]}"
    if name in run and run[name].dims[1:] == inner:
        values, meaning = values + _interpolated(time, run[name].to_numpy(), t), told(name)[2]
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
