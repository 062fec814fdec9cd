"""Polynomials and rational functions of s on the imaginary axis, by roots instead of grids."""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import polynomial as P
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Coefficients = tuple[float, ...]


def even_odd(polynomial: ArrayLike) -> tuple[Array, Array]:
    """Split p(j w) = E(w^2) + j w O(w^2).

    Args:
        polynomial: coefficients in descending powers of s.

    Returns:
        Coefficients of E and O in *ascending* powers of x = w^2.
    """
    ascending = np.asarray(polynomial, float)[::-1]
    even, odd = ascending[0::2].copy(), ascending[1::2].copy()
    even[1::2] *= -1.0
    odd[1::2] *= -1.0
    return even, odd if odd.size else np.zeros(1)


def squared_gain(polynomial: ArrayLike) -> Array:
    """abs(p(j w))^2 = E^2 + x O^2, ascending in x = w^2."""
    even, odd = even_odd(polynomial)
    return np.asarray(P.polyadd(P.polymul(even, even), P.polymulx(P.polymul(odd, odd))), float)


def positive_roots(ascending: ArrayLike, tolerance: float = 1e-6) -> Array:
    """Positive real roots of a polynomial, sorted.

    Args:
        ascending: coefficients in ascending powers.
        tolerance: imaginary part, relative to the root, that still counts as rounding.
    """
    coefficients = np.trim_zeros(np.asarray(ascending, float))
    if coefficients.size < 2:
        return np.empty(0)
    scale = abs(coefficients[0] / coefficients[-1]) ** (1.0 / (coefficients.size - 1))
    scaled = coefficients * scale ** np.arange(coefficients.size)
    roots = np.roots(scaled[::-1] / np.abs(scaled).max()) * scale
    real = (roots.real > 0) & (np.abs(roots.imag) <= tolerance * np.abs(roots))
    return np.array(sorted(roots.real[real].tolist()))


def gain(numerator: ArrayLike, denominator: ArrayLike, omega: ArrayLike) -> Array:
    """abs(N(j w) / D(j w)) at `omega` [rad/s]."""
    s = 1j * np.asarray(omega, float)
    with np.errstate(divide="ignore"):
        top, bottom = (np.polyval(np.asarray(p, float), s) for p in (numerator, denominator))
        return np.asarray(np.abs(top) / np.abs(bottom), float)


def peak(numerator: ArrayLike, denominator: ArrayLike) -> tuple[float, float]:
    """Frequency [rad/s] and height of the largest gain over all frequencies.

    Exact: the roots of (|N|^2)' |D|^2 = |N|^2 (|D|^2)', not a grid. Frequency 0 means that the
    gain is largest at rest; an undamped resonance gives inf.
    """
    undamped = [abs(root) for root in np.roots(denominator) if abs(root.real) <= 1e-12 * abs(root)]
    if undamped:
        return float(min(undamped)), math.inf
    top, bottom = squared_gain(numerator), squared_gain(denominator)
    slope = P.polysub(P.polymul(P.polyder(top), bottom), P.polymul(top, P.polyder(bottom)))
    omega = np.concatenate([[0.0], np.sqrt(positive_roots(slope))])
    gains = gain(numerator, denominator, omega)
    highest = int(np.argmax(gains))
    return float(omega[highest]), float(gains[highest])


def minus_3db_frequency(numerator: ArrayLike, denominator: ArrayLike) -> float | None:
    """Lowest frequency [rad/s] at which the gain has fallen to 1/sqrt(2) of that at rest."""
    half = 0.5 * gain(numerator, denominator, 0.0) ** 2
    crossings = positive_roots(P.polysub(squared_gain(numerator), half * squared_gain(denominator)))
    return float(math.sqrt(crossings[0])) if crossings.size else None
