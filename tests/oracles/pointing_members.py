"""Jitter and contrast by their definitions, from windows of motion drawn point by point in time.

Shares nothing with quietbus: Gaussian noise is drawn from its autocovariance at the nodes of a
window, the straight line is fitted to each window by least squares, and what is left is averaged.
"""

from itertools import pairwise

import numpy as np


def autocovariance(t, frequency, density):
    """(n, n) of a density (f,), linear between frequencies, at times (n,): exact integrals."""
    lag = np.abs(t[:, None] - t)
    f = np.concatenate(
        [
            np.linspace(a, b, 3 + int(48.0 * np.ptp(t) * (b - a)), endpoint=False)
            for a, b in pairwise(frequency)
        ]
    )
    f = np.append(f, frequency[-1])
    step = np.diff(f)
    weights = 0.5 * (np.append(step, 0.0) + np.append(0.0, step))  # trapezoid's
    power = weights * np.interp(f, frequency, density)
    unique, back = np.unique(np.round(lag, 12), return_inverse=True)
    values = np.zeros(len(unique))
    for start in range(0, len(f), 500):
        part = slice(start, start + 500)
        values += np.cos(2 * np.pi * np.outer(unique, f[part])) @ power[part]
    return values[back].reshape(lag.shape)


def draw(t, parts, count, rng):
    """Noise (count, n, c) of independent parts (frequency, density (f,), covariance (c, c))."""
    total = 0.0
    for frequency, density, covariance in parts:
        size, axes = np.linalg.eigh(autocovariance(t, frequency, density))
        keep = size > 1e-11 * size[-1]
        root = axes[:, keep] * np.sqrt(size[keep])
        scale, turn = np.linalg.eigh(covariance)
        across = turn * np.sqrt(np.maximum(scale, 0.0))
        normal = rng.standard_normal((count, root.shape[1], len(covariance)))
        total = total + root @ normal @ across.T
    return total


def nodes(window, highest):
    """Times (n,) about the middle and weights of a window for motion up to a frequency [Hz]."""
    count = int(12 + 4.2 * window * highest)
    x, w = np.polynomial.legendre.leggauss(count)
    return 0.5 * window * x, 0.5 * w


def about_line(t, w, y):
    """Covariance (count, c, c) of what a straight line leaves of windows, and smear (count, c)."""
    window = 2.0 * np.max(np.abs(t))
    y = y - np.einsum("n,knc->kc", w, y)[:, None]
    slope = np.einsum("n,knc->kc", w * t, y) / (w @ t**2)
    rest = y - slope[:, None] * t[:, None]
    return np.einsum("n,kna,knb->kab", w, rest, rest), slope, window


def jitter(t, w, y):
    """(count,)"""
    return np.sqrt(np.trace(about_line(t, w, y)[0], axis1=1, axis2=2))


def loss(t, w, y, window, spatial_frequency):
    """(count,) of Gaussian jitter and smear, in the worst of 180 directions."""
    covariance, slope, _ = about_line(t, w, y)
    angle = np.pi * np.arange(180) / 180
    way = np.column_stack([np.cos(angle), np.sin(angle)]) if y.shape[2] == 2 else np.ones((1, 1))
    variance = np.einsum("da,kab,db->kd", way, covariance, way)
    drift = window * slope @ way.T
    kept = np.exp(-2 * (np.pi * spatial_frequency) ** 2 * variance)
    return 1.0 - np.min(kept * np.abs(np.sinc(drift * spatial_frequency)), axis=1)
