"""Rational functions on the imaginary axis, against evaluation and closed forms."""

import math

import numpy as np
import pytest

from quietbus.analysis.control.rational import (
    even_odd,
    gain,
    minus_3db_frequency,
    peak,
    positive_roots,
    squared_gain,
)

OMEGA = np.array([0.0, 0.3, 1.0, 7.0])


@pytest.mark.parametrize("degree", range(6))
def test_even_and_odd_part_make_the_polynomial_again(degree):
    polynomial = np.random.default_rng(degree).normal(size=degree + 1)
    even, odd = (np.polynomial.Polynomial(part)(OMEGA**2) for part in even_odd(polynomial))
    value = np.polyval(polynomial, 1j * OMEGA)
    assert even + 1j * OMEGA * odd == pytest.approx(value, rel=1e-13)
    square = np.polynomial.Polynomial(squared_gain(polynomial))(OMEGA**2)
    assert square == pytest.approx(np.abs(value) ** 2, rel=1e-12)


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_positive_roots_are_those_that_the_polynomial_was_made_of(scale):
    others = [-3.0, 0.0, 1.0 + 2.0j, 1.0 - 2.0j]
    roots = scale * np.array([0.5, 2.0, 9.0, *others])
    found = positive_roots(np.poly(roots).real[::-1])
    assert found == pytest.approx(scale * np.array([0.5, 2.0, 9.0]), rel=1e-9)


def test_a_constant_has_no_roots():
    assert positive_roots([3.0]).size == positive_roots([0.0, 0.0]).size == 0


@pytest.mark.parametrize("zeta", [0.01, 0.2, 0.7])
def test_peak_of_an_oscillator(zeta):
    """Highest at w0 sqrt(1 - 2 zeta^2), where it is 1/(2 zeta sqrt(1 - zeta^2))."""
    w0 = 25.0
    at, height = peak([w0**2], [1.0, 2.0 * zeta * w0, w0**2])
    assert at == pytest.approx(w0 * math.sqrt(1.0 - 2.0 * zeta**2), rel=1e-6)
    assert height == pytest.approx(0.5 / (zeta * math.sqrt(1.0 - zeta**2)), rel=1e-12)


def test_a_well_damped_oscillator_is_highest_at_rest():
    assert peak([4.0], [1.0, 2.0 * 0.8 * 2.0, 4.0]) == (0.0, 1.0)


def test_an_undamped_oscillator_has_no_highest_gain():
    assert peak([9.0], [1.0, 0.0, 9.0]) == (pytest.approx(3.0), math.inf)


def test_a_lag_falls_by_3_db_at_its_corner():
    assert minus_3db_frequency([1.0], [0.25, 1.0]) == pytest.approx(4.0, rel=1e-12)
    assert minus_3db_frequency([2.0], [1.0]) is None  # a constant never falls


def test_the_first_of_several_falls_is_meant():
    """A notch falls below 3 dB, rises again, and a lag takes it down for good."""
    notch, lag = ([1.0, 0.0, 1.0], [1.0, 1.0, 1.0]), ([1.0], [0.01, 1.0])
    top, bottom = (np.convolve(a, b) for a, b in zip(notch, lag, strict=True))
    at = minus_3db_frequency(top, bottom)
    assert at < 1.0
    assert gain(top, bottom, at) == pytest.approx(math.sqrt(0.5), rel=1e-9)
