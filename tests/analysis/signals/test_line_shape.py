"""Shapes of lines against periodograms of sinusoids and of noise."""

import numpy as np
import pytest
from scipy.signal import get_window, periodogram

from quietbus.analysis.signals.waterfall import LineShape, segment_size, window_name

WINDOWS = [
    "hann",
    "hamming",
    "flattop",
    "boxcar",
    "tukey 0.25",
    "kaiser 8.6",
    "exponential none 99",
]
SIZE = 256


def scipy_window(name):
    first, *numbers = name.split()
    numbers = [None if number == "none" else float(number) for number in numbers]
    return (first, *numbers) if numbers else first


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("at", [40.0, 41.37, 6.5])
def test_a_line_is_the_periodogram_of_a_sinusoid_side_lobes_and_all(window, at):
    """Mean over two phases a quarter apart: the two frequencies' products fall out."""
    n = np.arange(SIZE)
    both = []
    for phase in (0.3, 0.3 + np.pi / 2):
        x = np.sqrt(2) * np.cos(2 * np.pi * at * n / SIZE + phase)  # of unit power
        both.append(periodogram(x, SIZE, scipy_window(window), detrend=False)[1])
    measured = np.mean(both, axis=0)[1:-1]  # one-sided: 0 Hz and the last bin are not doubled
    shape = LineShape(window, SIZE)
    bins = np.arange(1.0, SIZE / 2)
    told, widest = (each(bins, np.array([at]))[0] for each in (shape.line, shape.tolerance))
    assert np.all(np.abs(told - measured) < 2e-3 * (measured + widest) + 1e-13)
    assert np.all(widest > 0.99 * measured - 1e-13)


@pytest.mark.parametrize("window", ["hann", "boxcar", "flattop", "tukey 0.25"])
def test_a_smeared_line_is_the_mean_of_the_lines_it_passes(window):
    shape, bins = LineShape(window, SIZE), np.arange(1.0, SIZE / 2)
    passes = np.linspace(40.0, 44.0, 2001)
    mean = np.mean(shape.line(bins, passes), axis=0)
    assert shape.line(bins, np.array([42.0]), 4.0)[0] == pytest.approx(mean, rel=0.05, abs=2e-4)


@pytest.mark.parametrize("window", ["hann", "boxcar", "flattop"])
def test_what_noise_does_to_a_sum_of_bins(window):
    """Variances of noise alone and of its products with a line, by Monte Carlo."""
    rng = np.random.default_rng(3)
    w = get_window(window, SIZE)
    shape, at, n = LineShape(window, SIZE), 40.3, np.arange(SIZE)
    bins = np.arange(40 - shape.half, 41 + shape.half)
    noise = rng.normal(size=(20000, SIZE))  # power of a bin: 2 / SIZE
    line = np.cos(2 * np.pi * at * n / SIZE + rng.uniform(0, 2 * np.pi, (20000, 1)))
    scale = np.sqrt(2 / (SIZE * np.sum(w**2)))
    N, L = (np.fft.rfft(w * x)[:, bins] * scale for x in (noise, line))
    alone = np.var(np.sum(np.abs(N) ** 2, axis=1)) / (2 / SIZE) ** 2
    cross = np.var(np.sum(2 * np.real(L * np.conj(N)), axis=1)) / (2 / SIZE) / 0.5
    told = shape.sum_variances(bins - at)
    assert told == pytest.approx((alone, cross), rel=0.05)


def test_noise_bandwidths_are_harris_s():
    """Harris (1978), table 1."""
    for window, bandwidth in (("hann", 1.5), ("hamming", 1.36), ("boxcar", 1.0), ("none", 1.0)):
        assert LineShape(window, 4096).noise_bandwidth == pytest.approx(bandwidth, abs=0.005)
    assert LineShape("flattop", 4096).noise_bandwidth == pytest.approx(3.77, abs=0.01)


def test_windows_are_read_as_people_write_them():
    for text in ("tukey 0.25", "('tukey', 0.25)", "Tukey(0.25)", "tukey, 0.25"):
        assert window_name(text) == "tukey 0.25"
    assert window_name("none") == "none"
    for wrong in ("hen", "tukey x", "kaiser", "", "tukey 0.25 3"):
        with pytest.raises(ValueError, match="or a window of scipy"):
            window_name(wrong)


def test_a_segment_has_twice_the_bins_or_what_the_sample_rate_says():
    assert segment_size(np.arange(513.0)) == 1024
    assert segment_size(np.arange(10.0, 301.0), 1024.0) == 1024
