"""Root mean squares of lines together, by their definition: the mean over a second."""

import numpy as np
import pytest

from quietbus.analysis.jitter.combine import RMS_TIME, combine

TIMES = np.array([0.0, 3.7, 41.0])
SIZE = np.array([1.0 + 0.5j, 0.6 - 0.2j, 0.3j])
PHASE = np.array([0.4, 2.0, 5.0])


def by_definition(frequency, time):
    """RMS over RMS_TIME about a time of the sum of the lines."""
    s = np.linspace(-0.5, 0.5, 200_001) * RMS_TIME
    turn = np.exp(1j * (PHASE[:, None] + np.outer(frequency, time + s)))
    return np.sqrt(np.mean((SIZE @ turn).real ** 2))


def together(frequency, times):
    """The same by ``combine``, of three rotors with one order."""
    amplitude = np.broadcast_to(SIZE[:, None, None], (len(times), 3, 1, 1))
    found = combine(amplitude, np.array(frequency)[:, None], PHASE[:, None], times)
    return found.rms[:, 0]


@pytest.mark.parametrize("beat", [0.0, 0.02, 0.3, 2.0])
def test_lines_that_beat_more_slowly_than_the_time_are_coherent(beat):
    """Nearly equal speeds: what the rotors stand to each other counts, and it changes slowly."""
    frequency = 200.0 * np.pi + np.array([0.0, beat, -beat])
    expected = [by_definition(frequency, t) for t in TIMES]
    np.testing.assert_allclose(together(frequency, TIMES), expected, rtol=3e-3)


def test_a_rotor_that_turns_backwards_counts_with_the_others():
    frequency = np.array([200.0 * np.pi, -200.0 * np.pi + 0.2, 200.0 * np.pi])
    expected = [by_definition(frequency, t) for t in TIMES]
    np.testing.assert_allclose(together(frequency, TIMES), expected, rtol=3e-3)


def test_lines_far_apart_are_independent():
    found = together([300.0, 420.0, 610.0], TIMES)
    np.testing.assert_allclose(found, np.sqrt(0.5 * np.sum(np.abs(SIZE) ** 2)), rtol=1e-12)


def test_further_lines_of_gimbals_that_turn_alike_add_with_their_phases():
    """Ripple, 300 a turn at 0.2 rad/s: of two gimbals alike, and of two that turn oppositely."""
    none = combine(np.zeros((1, 1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
    for rate in (1.0, -1.0):
        frequency, angle = 60.0 * np.array([1.0, rate]), np.array([0.3, 0.9 * rate])
        lines = np.array([[2.0], [2.0]])
        found = none.with_lines(lines, frequency, angle).rms[0]
        assert found == pytest.approx(np.abs(2.0 * (1.0 + np.exp(0.6j))) / np.sqrt(2.0))
    apart = none.with_lines(lines, np.array([60.0, 70.0]), angle).rms[0]
    assert apart == pytest.approx(2.0)
