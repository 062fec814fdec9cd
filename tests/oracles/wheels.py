"""Signals of a made-up wheel on a force table, made in time without the package."""

import numpy as np
from scipy.signal import lfilter, welch

RATE, SEGMENT = 1024.0, 2048


def transmission(frequency, natural, damping, split, turns):
    """(k + i w c) / (k - m w^2 +- Is Omega w + i w c), frequencies in Hz."""
    d = 2j * damping * frequency / natural
    return (1 + d) / (1 + d - (frequency / natural) ** 2 + split * turns * frequency / natural**2)


def measured(lines, mode, turns, noise, seconds=32.0, seed=0, coloured=False):
    """Welch's spectra (speed, frequency) of sums of sines and white noise.

    Args:
        lines: (order, coefficient over (rad/s)^2, whirl 1 or -1).
        mode: frequency [Hz], damping, spin over transverse inertia; or None.
        turns: speeds [Hz].
        noise: one-sided PSD; ``coloured``: of a first-order filter with its corner at 100 Hz.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE)) / RATE
    rows = []
    for turn in turns:
        x = rng.normal(0.0, np.sqrt(noise * RATE / 2), len(t))
        if coloured:
            pole = np.exp(-2 * np.pi * 100.0 / RATE)
            x = lfilter([1 - pole], [1, -pole], x)
        for order, coefficient, whirl in lines:
            passed = 1.0
            if mode is not None:
                passed = abs(transmission(order * turn, mode[0], mode[1], whirl * mode[2], turn))
            size = coefficient * (2 * np.pi * turn) ** 2 * passed
            x += size * np.cos(2 * np.pi * order * turn * t + rng.uniform(0, 2 * np.pi))
        frequency, psd = welch(x, RATE, "hann", SEGMENT, detrend=False)
        rows.append(psd)
    return frequency, np.array(rows)
