"""Nyquist's counts and ranges of the gain, against poles of the closed loop and Pade's delays."""

import numpy as np
import pytest

from oracles.loops import INERTIA, PRINTED, RIGID, paper_loop, unstable_at, with_pade
from quietbus.analysis.control.loop import Loop
from quietbus.analysis.control.margins import analyze_loop
from quietbus.analysis.control.nyquist import nyquist_counts, stable_gain_range
from quietbus.analysis.control.pid import PID


@pytest.mark.parametrize("servo", [None, 20.0])
@pytest.mark.parametrize("damping", [20.0, 500.0, 3000.0])
def test_poles_lie_on_the_imaginary_axis_at_the_ends_of_the_range(damping, servo):
    loop = paper_loop(PRINTED.coefficients(20e3, damping), servo_bandwidth=servo)
    ends = [end for pair in stable_gain_range(loop) for end in pair if end]
    assert ends
    for end in ends:
        real = loop.closed_loop_poles(end).real
        assert np.min(np.abs(real)) < 1e-9
        assert np.max(real) < 1e-9


def test_a_range_may_have_two_parts():
    """Chosen so that poles leave, return and leave again; counted by the poles themselves."""
    loop = Loop(
        tuple(np.poly([-1, -1, -1 + 8j, -1 - 8j]).real),
        tuple(np.poly([0, 0, 0, -0.4 + 5j, -0.4 - 5j, -30, -30]).real),
    )
    result = analyze_loop(loop)
    gains = np.geomspace(1e-3, 1e8, 4000)
    stable = np.array([unstable_at(loop, gain) == 0 for gain in gains])
    inside = np.array(
        [any(a < g < (b or np.inf) for a, b in result.stable_gain_range) for g in gains]
    )
    assert np.array_equal(stable, inside)
    assert len(result.stable_gain_range) == 2


@pytest.mark.parametrize(
    ("numerator", "poles"),
    [
        ([1.0], [-1, -2]),
        ([-3.0], [-1, -2]),
        ([1.0], [0, -1]),
        ([-1.0], [0]),
        ([1.0, 1.0], [0, 0]),
        ([1.0, -1.0], [0, 0, -2]),
        ([1.0, 2.0, 1.0], [0, 0, 0]),
        ([-1.0, -2.0, -1.0], [0, 0, 0]),
        ([1.0, 3.0, 3.0, 1.0], [0, 0, 0, 0]),
        ([1.0], [0, 0, 0, 0, -1]),
        ([5.0, 1.0], [0, 1.0]),
        ([4.0], [2.0, -1.0]),
        ([1.0, 0.2], [1 + 2j, 1 - 2j, -3]),
        ([1.0, 1.0], [2j, -2j, 0]),
        ([-1.0, 1.0], [2j, -2j, 0]),
        ([1.0, 0.0, 4.0], [0, 0, -1, -1]),
        ([1.0, 0.0], [-1, -2, 1]),
    ],
)
@pytest.mark.parametrize("gain", [0.05, 0.7, 30.0])
def test_nyquist_count_is_the_number_of_unstable_poles(numerator, poles, gain):
    loop = Loop(tuple(numerator), tuple(np.poly(poles).real))
    counts = nyquist_counts(loop, gain)
    assert unstable_at(loop, gain) == counts.Z
    assert counts.N == counts.N1 - counts.N2
    assert counts.Z == counts.P - 2 * counts.N


def test_half_crossings_at_a_double_integrator():
    """The arc ends on the negative real axis and the plot turns back from it."""
    counts = nyquist_counts(paper_loop(pid=PID(200.0, 0.0, 2500.0)))
    assert (counts.N1, counts.N2, counts.N, counts.Z) == (0.5, 0.5, 0, 0)


@pytest.mark.parametrize("delay", [0.002, 0.02, 0.1, 0.4])
def test_range_with_delay_against_pade(delay):
    loop = paper_loop(delay=delay)
    exact, rational = stable_gain_range(loop), stable_gain_range(with_pade(loop))
    assert len(exact) == 1
    np.testing.assert_allclose(exact[0], rational[0], rtol=1e-5)


@pytest.mark.parametrize("delay", [0.02, 0.3])
@pytest.mark.parametrize("gain", [0.1, 2500.0, 8000.0, 2e4])
def test_nyquist_with_delay_against_poles_of_pade(delay, gain):
    loop = paper_loop(delay=delay)
    assert unstable_at(with_pade(loop), gain) == nyquist_counts(loop, gain).Z


def test_tiny_delay_limits_a_rigid_mount_far_beyond_its_poles():
    """kd/(I s) e^(-tau s) at high frequency: the limit is K = I pi/(2 tau)."""
    ((low, high),) = stable_gain_range(paper_loop(RIGID, PID(200.0, 0.0, 2500.0), delay=1e-6))
    assert low == 0.0
    assert high == pytest.approx(INERTIA * np.pi / 2e-6, rel=1e-5)


def test_long_delay_turns_are_all_found():
    """Far above the poles only the delay turns the phase: one passage per 2 pi / tau."""
    omega = analyze_loop(paper_loop(delay=20.0)).gain_margin_frequencies_hz
    turns = np.diff(omega)[np.array(omega[:-1]) > 10.0] * 20.0
    assert turns.size > 100
    np.testing.assert_allclose(turns, 1.0, atol=0.05)
