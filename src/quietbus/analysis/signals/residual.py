"""What is left of a rate once the manoeuvre is over: jitter and slow remainder."""

from dataclasses import dataclass

import numpy as np
import scipy  # which loads its parts when they are used

from quietbus.analysis.signals.spectrum import detrended

RESOLVING = 2.56  # samples per period that a line needs to be seen, the practice of vibration test
FINER = 8  # band-limited interpolation for the peak, which seldom falls on a sample


@dataclass(frozen=True)
class Residual:
    """Residual motion over the last part of a run, per axis."""

    window: tuple[float, float]  # [s] that the figures are taken over
    jitter_peak: np.ndarray  # (axis,) largest deviation from the slow motion
    jitter_rms: np.ndarray  # (axis,)
    slow: np.ndarray  # (axis,) largest value of the slow motion


def residual(time: np.ndarray, signal: np.ndarray, window: float = 1.0) -> Residual:
    """Split the last ``window`` [s] of a signal in slow motion and jitter.

    The slow motion is the cubic that fits best under a Hann weight; jitter is what remains in the
    middle half of the window, where the fit has no ends to bend at. A cubic over one second follows
    what an attitude loop does (below 1 Hz) and leaves a line at 10 Hz or more untouched. The peak
    is that of the band-limited signal between the samples.

    Args:
        time: (n,) [s], evenly spaced.
        signal: (n, axis).

    Raises:
        ValueError: the signal is shorter than the window, or has fewer than eight samples in it.
    """
    length = time[-1] - time[0]
    if length < window * (1.0 - 1e-9):
        raise ValueError(
            f"not shown: the run lasts {length:.4g} s, a residual is of the last {window:g} s"
        )
    last = time >= time[-1] - window
    if np.count_nonzero(last) < 8:
        raise ValueError(
            f"not shown: the last {window:g} s hold {np.count_nonzero(last)} samples, "
            "a residual needs 8"
        )
    t, values = time[last], signal[last]
    jitter = detrended(t, values)
    slow = values - jitter
    middle = np.abs(np.linspace(-1.0, 1.0, len(t))) <= 0.5
    fine = scipy.signal.resample_poly(jitter, FINER, 1)[: FINER * (len(t) - 1) + 1]
    between = np.abs(np.linspace(-1.0, 1.0, len(fine))) <= 0.5
    return Residual(
        window=(float(t[middle][0]), float(t[middle][-1])),
        jitter_peak=np.max(np.abs(fine[between]), axis=0),
        jitter_rms=np.sqrt(np.mean(jitter[middle] ** 2, axis=0)),
        slow=np.max(np.abs(slow[middle]), axis=0),
    )


def shows(output_rate: float, frequency: float) -> bool:
    """Whether samples at ``output_rate`` [Hz] show a line at ``frequency`` [Hz]."""
    return output_rate >= RESOLVING * frequency
