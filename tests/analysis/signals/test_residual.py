"""Jitter and slow motion at the end of a run, of signals made of both."""

import numpy as np
import pytest

from quietbus.analysis.signals.residual import RESOLVING, residual, shows

TIME = np.linspace(0.0, 3.0, 601)  # 200 Hz
CUBIC = np.polynomial.Polynomial([0.3, -0.2, 0.5, -0.1])


def wave(frequency, amplitude=1.0, phase=0.4):
    return amplitude * np.sin(2.0 * np.pi * frequency * TIME + phase)


def test_a_cubic_is_slow_motion_and_nothing_else():
    found = residual(TIME, CUBIC(TIME)[:, None])
    assert found.jitter_peak == pytest.approx(0.0, abs=1e-12)
    middle = np.linspace(*found.window, 200)
    assert found.slow == pytest.approx(np.max(np.abs(CUBIC(middle))), rel=1e-3)


def test_a_line_on_a_cubic_is_jitter_with_its_amplitude():
    signal = np.column_stack([CUBIC(TIME) + wave(31.0, 2.0), wave(20.0, 1e-3)])
    found = residual(TIME, signal)
    assert found.jitter_peak == pytest.approx([2.0, 1e-3], rel=5e-3)
    assert found.jitter_rms == pytest.approx(np.array([2.0, 1e-3]) / np.sqrt(2.0), rel=2e-2)


def test_the_peak_lies_between_the_samples():
    """A line at a third of the output rate: no sample comes nearer than 0.87 of it."""
    line = np.cos(2.0 * np.pi * 200.0 / 3.0 * TIME + np.pi / 6.0)
    assert np.max(np.abs(line)) == pytest.approx(np.sqrt(0.75), rel=1e-9)
    assert residual(TIME, line[:, None]).jitter_peak == pytest.approx(1.0, rel=1e-2)


def test_what_was_before_the_last_part_does_not_count():
    before = np.where(TIME < 1.9, 1e3, 0.0)
    quiet = residual(TIME, (before + wave(31.0))[:, None])
    assert quiet.jitter_peak == pytest.approx(1.0, rel=5e-3)
    assert quiet.window[0] >= 2.0


@pytest.mark.parametrize(
    ("time", "message"),
    [(np.linspace(0.0, 0.5, 100), "lasts 0.5 s"), (np.linspace(0.0, 2.0, 12), "hold 6 samples")],
)
def test_too_little_is_refused(time, message):
    with pytest.raises(ValueError, match=message):
        residual(time, np.zeros((len(time), 1)))


def test_samples_show_what_turns_slowly_enough():
    assert shows(256.0, 100.0)
    assert not shows(255.0, 100.0)
    assert RESOLVING > 2.0  # Nyquist
