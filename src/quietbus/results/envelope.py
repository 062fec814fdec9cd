"""Jitter over the whole of a run, where the pictures for paper show its end only."""

import numpy as np
import scipy  # which loads its parts when they are used
import xarray as xr

from quietbus.analysis.signals.residual import FINER
from quietbus.results import aliasing, scenario_of
from quietbus.results.motion import TREND, degrees, rotor_frequencies

TURNS = 10  # of the slowest rotor, that the envelope looks at
_EDGE = 10  # samples at both ends that the interpolation between samples gets wrong


def jitter_over_time(run: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Bus rate less its slow motion, and how large it is from one instant to the next.

    The slow motion at an instant is the cubic, with the weight that ``residual`` uses, through the
    second around it. The envelope at an instant is the largest magnitude within a span around it,
    also between the samples: ten turns of the slowest rotor, 1 s at most.

    Returns:
        Time (n,) [s], without half a second at both ends of the run; jitter and envelope (n, 3)
        [deg/s]; the envelope's span [s].

    Raises:
        ValueError: the run cannot show it; the message says why.
    """
    warning = aliasing(scenario_of(run))
    if warning:
        raise ValueError(warning.partition(". ")[0])
    time = run["time"].to_numpy()
    step = (time[-1] - time[0]) / max(len(time) - 1, 1)
    half = round(0.5 * TREND / step) if step else 0
    left = half + _EDGE
    if len(time) <= 2 * left or half < _EDGE:
        raise ValueError("the run is too short, or its output too coarse")
    rates = degrees(run, "bus_rate")
    if not np.all(np.isfinite(rates)):
        raise ValueError("the bus rate has values that are not finite")
    slow = scipy.signal.oaconvolve(rates, _smoothing(half)[:, None], mode="valid", axes=0)
    jitter = rates[half : len(time) - half] - slow
    slowest, _ = rotor_frequencies(run)
    span = min(TURNS / slowest, TREND) if slowest else 0.1
    finer = (np.abs(scipy.signal.resample_poly(line, FINER, 1)) for line in jitter.T)
    between = [line.reshape(-1, FINER).max(axis=1) for line in finer]
    inside = slice(_EDGE, -_EDGE)
    envelope = scipy.ndimage.maximum_filter1d(
        np.column_stack(between)[inside], round(span / step) + 1, axis=0, mode="nearest"
    )
    return time[left:-left], jitter[inside], envelope, span


def _smoothing(half: int) -> np.ndarray:
    """Weights (2 half + 1,) whose sum with samples is their cubic's value in the middle."""
    x = np.linspace(-1.0, 1.0, 2 * half + 1)
    basis = np.polynomial.legendre.legvander(x, 3)
    weight = np.cos(0.5 * np.pi * x)
    return np.polynomial.legendre.legvander(np.zeros(1), 3)[0] @ (
        np.linalg.pinv(weight[:, None] * basis) * weight
    )
