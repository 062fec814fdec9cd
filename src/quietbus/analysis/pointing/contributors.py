"""Mean square of an image motion by frequency, contributor by contributor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from quietbus.analysis.pointing.power import Density, LinePower
from quietbus.analysis.signals.spectrum import detrended

if TYPE_CHECKING:
    from quietbus.analysis.pointing.motion import ImageMotion
    from quietbus.analysis.pointing.power import Power


MOST_NAMED = 8  # contributors in a picture; the others are one
LEAST_SHARE = 1e-3  # of the RMS of all lines, that a line has to have to be named


def powers(motion: ImageMotion, stretch: tuple[float, float]) -> dict[str, Power]:
    """Mean square [rad^2] of an image motion by frequency: signal, each rotor's lines and noise.

    The signal's density is a periodogram with a Hann window, its cubic trend taken off.
    """
    signal, (start, end) = motion.signal, stretch
    here = (signal.time >= start - 1e-9) & (signal.time <= end + 1e-9)
    parts: dict[str, Power] = {}
    if np.count_nonzero(here) >= 16:
        y = detrended(signal.time[here], signal.values[here])
        w = np.hanning(len(y) + 1)[:-1, None]
        f = np.fft.rfftfreq(len(y), 1.0 / signal.rate)
        density = 2.0 * np.sum(np.abs(np.fft.rfft(w * y, axis=0)) ** 2, axis=1)
        density /= signal.rate * np.sum(w**2)
        name = "slow motion, less its cubic trend" if motion.apart else "motion"
        parts[name] = Density(f, density)
    lines, noise = motion.known_lines, motion.known_noise
    mean = np.mean(np.sum(0.5 * np.abs(lines.amplitude[here]) ** 2, axis=2), axis=0)
    f = np.abs(lines.frequency) / (2.0 * np.pi)
    least = LEAST_SHARE**2 * np.sum(mean)
    named = [i for i in np.argsort(-mean)[:MOST_NAMED] if mean[i] > least]
    for i in sorted(named):
        parts[f"{lines.names[i]}, {f[i]:.5g} Hz"] = LinePower(f[[i]], mean[[i]])
    others = np.setdiff1d(np.flatnonzero(mean > 0.0), named)
    if len(others) and np.sum(mean[others]) > least:
        parts["other lines"] = LinePower(f[others], mean[others])
    instants = signal.time[here] if np.any(here) else np.array([0.5 * (start + end)])
    trace = np.trace(noise.density, axis1=3, axis2=4)
    mean = np.mean(noise.at(instants, trace), axis=0)
    for name, density in zip(noise.names, mean.T, strict=True):
        if np.any(density > 0.0):
            parts[name] = Density(noise.frequency, density)
    return parts
