"""Signals in exposure windows, and lines, against integrals in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from quietbus.analysis.pointing.motion import ImageMotion, Lines, SampledSignal
from quietbus.analysis.pointing.noise import Noise

TIME = np.linspace(0.0, 2.0, 201)
CENTERS = np.array([0.4, 1.0, 1.55])
T = 0.3  # [s] window


def signal_of(*functions):
    return SampledSignal(TIME, np.column_stack([f(TIME) for f in functions]))


def test_a_quintic_is_known_between_its_samples():
    quintic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 0.2])
    at = np.array([0.0031, 1.2345, 1.999])
    assert signal_of(quintic).at(at)[:, 0] == pytest.approx(quintic(at), rel=1e-12)


def test_windows_of_a_parabola():
    """x^2 about m: mean m^2 + T^2/12, slope times length 2 m T, and T^4/180 about the line.

    Two Gauss points between samples have products of four powers of time to 1e-6.
    """
    parts = signal_of(lambda t: t**2).windows(CENTERS, T)
    assert parts.mean[:, 0] == pytest.approx(CENTERS**2 + T**2 / 12.0, rel=1e-12)
    assert parts.smear[:, 0] == pytest.approx(2.0 * CENTERS * T, rel=1e-12)
    assert parts.about_line[:, 0, 0] == pytest.approx(np.full(3, T**4 / 180.0), rel=1e-5)
    smear = parts.smear[:, 0] ** 2 / 12.0  # mean square of a straight line about its middle
    assert parts.about_mean[:, 0, 0] == pytest.approx(smear + T**4 / 180.0, rel=1e-5)


def test_windows_of_a_sine():
    """Mean by sinc, smear by 6 j_1: of a sine about its zero crossing."""
    w, u = 2.0 * np.pi, np.pi * T
    center = np.array([1.0])
    signal = signal_of(lambda t: np.sin(w * t), lambda t: np.cos(w * t))
    parts = signal.windows(center, T)
    assert parts.mean[0] == pytest.approx([0.0, np.sin(u) / u], abs=1e-6)
    j1 = np.sin(u) / u**2 - np.cos(u) / u
    assert parts.smear[0] == pytest.approx([6.0 * j1, 0.0], abs=1e-6)
    # coefficients of mean square one, from the first order on
    assert parts.coefficients[0, 0] == pytest.approx([np.sqrt(3.0) * j1, 0.0], abs=1e-6)


def test_products_of_two_components():
    """About their means, of t and t^2 around 1: T^2/12 and 2 T^2/12 in common."""
    parts = signal_of(lambda t: t, lambda t: t**2).windows(np.array([1.0]), T)
    assert parts.about_mean[0, 0] == pytest.approx([T**2 / 12.0, T**2 / 6.0], rel=1e-9)


@pytest.mark.parametrize(("above", "kept"), [(0.0, 4.5 + 1.0), (5.0, 4.5), (30.0, 0.0)])
def test_mean_square_of_lines_above_a_frequency(above, kept):
    signal = signal_of(
        lambda t: 3.0 * np.sin(40.0 * np.pi * t) + np.sqrt(2.0) * np.cos(2 * np.pi * t)
    )
    found = signal.mean_square_above(above, 0.0, 2.0)
    assert found[0, 0] == pytest.approx(kept, rel=2e-2, abs=2e-2)


def test_frequencies_beyond_the_samples_hold_nothing():
    assert signal_of(np.sin).mean_square_above(50.0, 0.0, 2.0) == 0.0


@pytest.mark.parametrize(
    ("time", "values", "message"),
    [
        (TIME, np.zeros((3, 1)), "times"),
        (TIME[:1], np.zeros((1, 1)), "two or more samples"),
        (TIME[:2], np.full((2, 1), np.nan), "finite"),
        (np.array([0.0, 1.0, 3.0]), np.zeros((3, 1)), "evenly spaced"),
    ],
)
def test_signals_that_are_none_are_refused(time, values, message):
    with pytest.raises(ValueError, match=message):
        SampledSignal(time, values)


def lines_of(frequency_hz, amplitude, rotor=None):
    n = len(frequency_hz)
    return Lines(
        amplitude=np.broadcast_to(amplitude, (len(TIME), n, 1)),
        frequency=2.0 * np.pi * np.array(frequency_hz),
        phase=np.linspace(0.0, 1.0, n),
        rotor=np.arange(n) if rotor is None else rotor,
        order=np.ones(n),
    )


def test_lines_that_turn_either_way_at_one_frequency_are_one():
    """Re of the sum of phasors is the sum of the lines, whichever way they turn."""
    lines = lines_of([90.0, -90.0, 30.0], np.array([[1.0 + 1.0j], [0.5j], [2.0]]))
    motion = ImageMotion(signal_of(np.zeros_like), lines)
    assert lines.frequency_hz == pytest.approx([30.0, 90.0])
    at = np.array([0.2, 0.2 + 1e-3])
    each, together = (z[..., 0] for z in (motion.phasors(at), lines.together(motion.phasors(at))))
    assert np.sum(together.real, axis=1) == pytest.approx(np.sum(each.real, axis=1), rel=1e-12)
    # a step on, the phasors of the frequencies turn as they should
    turned = together[0] * np.exp(2j * np.pi * lines.frequency_hz * 1e-3)
    assert turned == pytest.approx(together[1], rel=1e-9)


def test_amplitudes_change_linearly_between_the_samples():
    lines = lines_of([0.0], 0.0)
    rising = replace(lines, amplitude=TIME[:, None, None] + 0j)
    motion = ImageMotion(signal_of(np.zeros_like), rising)
    assert motion.phasors(np.array([0.123]))[0, 0, 0] == pytest.approx(0.123, rel=1e-12)


def test_what_is_not_there_answers_with_nothing():
    motion = ImageMotion(signal_of(np.sin, np.cos))
    assert not motion.apart
    assert not motion.noisy
    assert motion.phasors(CENTERS).shape == (3, 0, 2)
    assert motion.known_lines.names == motion.known_noise.names == ()
    assert motion.known_lines.together(motion.phasors(CENTERS)).shape == (3, 0, 2)
    assert motion.known_noise.at(CENTERS, np.zeros((1, 0))).shape == (3, 0)


def test_one_component_of_everything():
    density = np.arange(1.0, 17.0).reshape(2, 2, 1, 2, 2)
    noise = Noise(np.array([0.0, 2.0]), np.array([0.0, 1.0]), density, ("rotor 0",))
    both = Lines(
        np.ones((201, 1, 2)) * [1.0, 2.0j], *np.zeros((2, 1)), np.zeros(1, int), np.ones(1)
    )
    motion = ImageMotion(signal_of(np.sin, np.cos), both, noise).component(1)
    assert motion.signal.values == pytest.approx(np.cos(TIME)[:, None])
    assert motion.known_lines.amplitude[0] == pytest.approx(np.array([[2.0j]]))
    assert motion.known_noise.density == pytest.approx(density[..., 1:, 1:])
