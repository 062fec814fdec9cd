"""Waterfalls of sines and white noise as a laboratory makes them, without the package."""

import numpy as np
from scipy.signal import welch

RATE, SEGMENT = 1024.0, 1024


def map_of(lines, window, noise, rpm, modes=(), seconds=16, change=0.0, seed=1):
    """Welch's spectra (speed, frequency) of a force.

    Args:
        lines: (order, coefficient over (rad/s)^2).
        window: as SciPy's ``welch`` takes it.
        noise: RMS.
        modes: in series, each its frequency [Hz] and damping.
        change: of speed within a row [rpm], at a constant rate.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE)) / RATE
    rows = []
    for speed in np.asarray(rpm) * np.pi / 30:
        x = rng.normal(0.0, noise, len(t))
        angle = speed * t + change * np.pi / 30 * (0.5 * t**2 / t[-1] - 0.5 * t)
        for order, coefficient in lines:
            f, through = order * speed / (2 * np.pi), 1.0
            for natural, damping in modes:
                d = 2j * damping * f / natural
                through *= abs((1 + d) / (1 + d - (f / natural) ** 2))
            size = coefficient * speed**2 * through
            x += size * np.cos(order * angle + rng.uniform(0, 2 * np.pi))
        frequency, psd = welch(x, RATE, window, SEGMENT)
        rows.append(psd)
    return frequency, np.array(rows)
