"""The single-axis isolator against the paper's figure, python-control and a numerical search."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from quietbus.analysis.control.isolator import (
    CROSSING,
    SingleAxisIsolator,
    transmissibility,
    transmissibility_peak,
)

damping_ratios = st.floats(0.01, 20.0)


@pytest.mark.parametrize(("xi", "height"), [(0.1, 5.1228), (0.5, 1.4679), (1.0, 1.1547)])
def test_peaks_of_the_papers_figure(xi, height):
    """Fig. 1b."""
    assert round(float(transmissibility_peak(xi)[1]), 4) == height


@settings(deadline=None)
@given(damping_ratios)
def test_every_curve_passes_through_one_at_root_two(xi):
    assert transmissibility(CROSSING, xi) == pytest.approx(1.0, abs=1e-12)
    assert transmissibility(0.99 * CROSSING, xi) > 1.0 > transmissibility(1.01 * CROSSING, xi)


@settings(deadline=None)
@given(damping_ratios)
def test_closed_form_peak_is_the_largest_value(xi):
    gamma, height = transmissibility_peak(xi)
    found = minimize_scalar(
        lambda log_gamma: -transmissibility(np.exp(log_gamma), xi),
        bounds=(np.log(gamma) - 1.0, np.log(gamma) + 1.0),
        method="bounded",
        options={"xatol": 1e-10},
    )
    assert height == pytest.approx(transmissibility(gamma, xi), rel=1e-10)
    assert height == pytest.approx(-found.fun, rel=1e-9)


def test_small_damping_keeps_its_digits():
    """As xi falls the peak grows as 1/(2 xi), and r - 1 must not cancel."""
    assert transmissibility_peak(1e-9)[1] == pytest.approx(0.5e9, rel=1e-12)
    gamma, height = transmissibility_peak(0.0)
    assert gamma == 1.0
    assert np.isinf(height)


def test_damping_lowers_the_resonance_and_spoils_the_roll_off():
    gamma = np.array([1.0, 20.0])
    resonance, roll_off = transmissibility(gamma[:, None], np.array([0.1, 0.5, 1.0]))
    assert np.all(np.diff(resonance) < 0)
    assert np.all(np.diff(roll_off) > 0)


@settings(deadline=None)
@given(st.floats(0.1, 1e3), st.floats(1.0, 1e6), st.just(0.0) | st.floats(1e-3, 1e4))
def test_object_agrees_with_python_control(mass, stiffness, damping):
    isolator = SingleAxisIsolator(mass, stiffness, damping)
    omega = isolator.natural_frequency * np.array([0.1, 0.9, 3.0])
    expected = np.abs(control.tf([damping, stiffness], [mass, damping, stiffness])(1j * omega))
    np.testing.assert_allclose(np.abs(isolator.to_control()(1j * omega)), expected, rtol=1e-9)
    np.testing.assert_allclose(isolator.transmissibility(omega), expected, rtol=1e-9)


def test_peak_of_the_object_is_in_rad_per_s():
    """The z channel of the paper is a single-axis isolator of 20 kg: peak at 4.50 Hz."""
    omega, _ = SingleAxisIsolator(20.0, 20e3, 500.0).peak
    assert round(omega / (2 * np.pi), 2) == 4.50


@pytest.mark.parametrize("values", [(0.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, -1.0)])
def test_bad_values_are_refused(values):
    with pytest.raises(ValueError, match=r"mass|stiffness|damping"):
        SingleAxisIsolator(*values)
