"""The amplitude spectrum against sines, whose amplitudes are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quietbus.analysis.signals.spectrum import amplitude_spectrum, detrended

RATE = 1000.0  # [Hz]


@settings(deadline=None)
@given(
    frequency=st.floats(10.0, 490.0),
    amplitude=st.floats(1e-9, 1e3),
    phase=st.floats(0.0, 6.28),
    count=st.integers(1000, 1301),
)
def test_a_sine_reads_its_amplitude_wherever_it_lies_between_bins(
    frequency, amplitude, phase, count
):
    time = np.arange(count) / RATE
    lines = amplitude_spectrum(time, amplitude * np.sin(2 * np.pi * frequency * time + phase))
    top = np.argmax(lines.amplitude)
    assert lines.frequency[top] == pytest.approx(frequency, abs=RATE / count)
    assert lines.amplitude[top] == pytest.approx(amplitude, rel=1e-3)


def test_columns_keep_their_own_lines():
    time = np.arange(2000) / RATE
    signal = np.column_stack([np.sin(2 * np.pi * 100 * time), 3 * np.cos(2 * np.pi * 200 * time)])
    lines = amplitude_spectrum(time, signal)
    at = [np.argmin(abs(lines.frequency - f)) for f in (100.0, 200.0)]
    assert lines.amplitude[at] == pytest.approx(np.diag([1.0, 3.0]), abs=1e-3)


@pytest.mark.parametrize("count", [1000, 1001])
def test_a_weak_line_stands_out_of_a_slow_motion_a_million_times_larger(count):
    time = 5.0 + np.arange(count) / RATE
    slow = np.exp(-0.1 * time)
    lines = amplitude_spectrum(time, slow + 1e-6 * np.sin(2 * np.pi * 100.3 * time))
    fast = lines.frequency > 20.0
    assert np.max(lines.amplitude[fast]) == pytest.approx(1e-6, rel=1e-3)
    assert lines.frequency[-1] == pytest.approx(RATE / 2, abs=RATE / count)


def test_alternating_samples_read_their_amplitude_at_half_the_rate():
    lines = amplitude_spectrum(np.arange(256) / RATE, 2.0 * (-1.0) ** np.arange(256))
    assert lines.amplitude[-1] == pytest.approx(2.0, rel=1e-3)


def test_a_cubic_has_nothing_left_once_detrended():
    time = 100.0 + np.arange(1000) / RATE
    cubic = 3.0 - 2.0 * time + 0.5 * time**2 - 0.01 * time**3
    assert np.max(abs(detrended(time, cubic))) < 1e-9 * np.max(abs(cubic))


@pytest.mark.parametrize(
    ("time", "signal", "message"),
    [
        (np.arange(2.0), np.zeros(2), "needs 16"),
        (np.arange(32.0) ** 2, np.zeros(32), "evenly"),
        (np.arange(32.0), np.full(32, np.nan), "finite"),
    ],
)
def test_what_has_no_spectrum_is_refused(time, signal, message):
    with pytest.raises(ValueError, match=message):
        amplitude_spectrum(time, signal)
