"""Shape of a line in a spectrum: what a window makes of a sinusoid, side lobes and all.

A sinusoid of power p at the (fractional) bin b gives the periodogram of N samples, in every bin k,

    p |W(k - b)|^2 / (N sum w^2),   W(d) = sum over n of  w_n exp(-2 pi i d n / N)

and the same about its negative frequency -b; the sum over all bins is p (Harris 1978). W is the
transform of the window's samples, so it is exact for any window, with the aliases of its side
lobes. If the speed changes while a spectrum is averaged, the line is the mean over the bins that
it passes.
"""

import re
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.signal import get_window

ONE_BIN = "none"  # no window's shape: a line is in the bin that is nearest to it, whole
_WIDEST = 12  # [bins] a main lobe's half width, at most
_FINE, _COARSE = 64, 8  # points of a bin
_LARGEST = 2**21  # points of the tables
_LEAST_SIZE = 64  # samples of a spectrum


def window_name(text: str) -> str:
    """A window as we write it: SciPy's name and its parameters, ``hann``, ``tukey 0.25``.

    Args:
        text: as people write it: ``tukey 0.25``, ``('tukey', 0.25)``, ``tukey(0.25)``, ``none``.

    Raises:
        ValueError: SciPy has no such window, or needs other parameters.
    """
    name, *parameters = re.findall(r"[^\s,;()\[\]'\"]+", text.lower()) or ["?"]
    shown = " ".join([name, *parameters])
    if shown != ONE_BIN:
        _samples(shown, _LEAST_SIZE)
    return shown


def _samples(window: str, size: int) -> np.ndarray:
    """Samples (size,) of a window named as by ``window_name``."""
    name, *texts = window.split()
    try:
        numbers = [None if text == "none" else float(text) for text in texts]
        given = (name, numbers) if name == "general_cosine" else (name, *numbers)
        values = np.asarray(get_window(given if texts else name, size), dtype=float)
    except (ValueError, TypeError, ArithmeticError) as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(
            f"expected '{ONE_BIN}' or a window of scipy.signal.get_window with its parameters, "
            f"such as hann or tukey 0.25, got '{window}' ({why.rstrip('.')})"
        ) from None
    if values.shape != (size,) or not np.all(np.isfinite(values)) or abs(values.sum()) < 1e-9:
        raise ValueError(f"window '{window}': its samples have no finite sum above zero")
    return values


class LineShape:
    """Power of lines in the bins of a spectrum.

    Args:
        window: as by ``window_name``.
        size: samples of a segment; side lobes wrap around at this many bins.
    """

    def __init__(self, window: str, size: int) -> None:
        self.window, self.size = window, max(size, _LEAST_SIZE)
        self._per_bin = int(np.clip(_LARGEST // self.size, _COARSE, _FINE))
        if window == ONE_BIN:
            self.noise_bandwidth, self.half = 1.0, 1
            return
        w = _samples(window, self.size)
        scale = 1.0 / np.sqrt(self.size * np.sum(w**2))
        n = np.arange(self.size)
        spectrum = np.fft.fft(w * scale, self.size * self._per_bin)
        # turned about the window's middle the transform is smooth, and real if w is symmetric
        middle = np.sum(n * w**2) / np.sum(w**2)
        d = np.arange(len(spectrum) // 2 + 1) / self._per_bin
        self._table = spectrum[: len(d)] * np.exp(2j * np.pi * d * middle / self.size)
        self.noise_bandwidth = float(self.size * np.sum(w**2) / np.sum(w) ** 2)
        # correlation of noise in bins k and l: transform of w^2 at k - l
        lags = np.fft.fft(w**2, self.size)[: 2 * _WIDEST + 3] / np.sum(w**2)
        self._correlation = np.abs(lags)
        self.half = self._half()

    def _half(self) -> int:
        """Half width of the main lobe, up to its first null, and a bin more."""
        lobe = np.abs(self._table[: _WIDEST * self._per_bin])
        rises = np.flatnonzero((np.diff(lobe) > 0.0) & (lobe[1:] < 0.1 * lobe[0]))
        first = rises[0] / self._per_bin if len(rises) else _WIDEST
        return int(min(np.ceil(first - 0.25) + 1, _WIDEST))

    @cached_property
    def _envelope(self) -> np.ndarray:
        """Largest power within half a bin, by distance, in steps of a table's point."""
        power = np.abs(self._table) ** 2
        around = maximum_filter1d(power, self._per_bin + 1, mode="nearest")
        return np.maximum(around, 1e-300)

    def amplitude(self, distance: np.ndarray) -> np.ndarray:
        """|W|, normalised, by distance [bins]."""
        if self.window == ONE_BIN:
            return np.where((distance >= -0.5) & (distance < 0.5), 1.0, 0.0)
        at = self._folded(distance) * self._per_bin
        below = np.minimum(at.astype(int), len(self._table) - 2)
        part = at - below
        return np.abs((1.0 - part) * self._table[below] + part * self._table[below + 1])

    def _folded(self, distance: np.ndarray) -> np.ndarray:
        wrapped = np.abs(distance) % self.size
        return np.minimum(wrapped, self.size - wrapped)

    def power(self, distance: np.ndarray, smear: np.ndarray | float = 0.0) -> np.ndarray:
        """Share of a line's power in a bin by its distance [bins] from the line.

        Args:
            smear: [bins] that the line passes during the averaging, broadcast with ``distance``.
        """
        widest = float(np.max(smear))
        if widest <= 0.0:
            return self.amplitude(distance) ** 2
        steps = int(np.ceil(4.0 * widest)) + 2
        offsets = (np.arange(steps) + 0.5) / steps - 0.5
        parts = [self.amplitude(distance + offset * smear) ** 2 for offset in offsets]
        return np.mean(parts, axis=0)

    def envelope(self, distance: np.ndarray, smear: np.ndarray | float = 0.0) -> np.ndarray:
        """``power`` without its nulls: the largest within half a bin, or the half of the smear."""
        if self.window == ONE_BIN:
            return self.amplitude(distance) ** 2
        nearest = np.maximum(np.abs(distance) - 0.5 * np.asarray(smear), 0.0)
        at = np.rint(self._folded(nearest) * self._per_bin).astype(int)
        return self._envelope[np.minimum(at, len(self._envelope) - 1)]

    def line(self, bins: np.ndarray, at: np.ndarray, smear: np.ndarray | float = 0.0) -> np.ndarray:
        """Share of a line's power (n, m) in bins (m,), the line at (n,) [bins from 0 Hz].

        Both frequencies of the line, the positive and the negative, add in power: their phases
        differ from segment to segment. No line lies beyond half the sample rate.
        """
        there = at[:, None] <= 0.5 * self.size
        own = self.power(bins - at[:, None], smear)
        if self.window == ONE_BIN:
            return there * own
        return there * (own + self.power(bins + at[:, None], smear))

    def tolerance(
        self, bins: np.ndarray, at: np.ndarray, smear: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """``line`` without its nulls."""
        there = at[:, None] <= 0.5 * self.size
        own = self.envelope(bins - at[:, None], smear)
        if self.window == ONE_BIN:
            return there * own
        return there * (own + self.envelope(bins + at[:, None], smear))

    def sum_variances(self, distance: np.ndarray) -> tuple[float, float]:
        """What noise does to the sum of neighbouring bins (k,), by distance from a line [bins].

        Returns:
            Variance of the sum of noise alone, of unit power in a bin, and of its products with
            a line of unit power; of one segment.
        """
        if self.window == ONE_BIN:
            return float(len(distance)), 2.0
        count = len(distance)
        lags = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
        R = self._correlation[np.minimum(lags, len(self._correlation) - 1)]
        # signs of the side lobes matter little beside the main lobe's
        a = self.amplitude(distance)
        return float(np.sum(R**2)), float(2.0 * a @ R @ a)


def segment_size(frequency: np.ndarray, sample_rate: float | None = None) -> int:
    """Samples of a segment whose spectrum has these frequencies [Hz], evenly spaced.

    Without the sample rate [Hz] the last frequency is taken as half of it.
    """
    step = (frequency[-1] - frequency[0]) / (len(frequency) - 1)
    return int(np.rint((sample_rate or 2.0 * frequency[-1]) / step))


def known_windows() -> Sequence[str]:
    """Windows that lines are compared with, the common ones first."""
    common = ["hann", "boxcar", "hamming", "flattop", "blackman", "blackmanharris", "nuttall"]
    others = ["bartlett", "cosine", "bohman", "parzen", "barthann", "lanczos", "taylor"]
    tukey = [f"tukey {alpha:.4g}" for alpha in (0.25, 0.5, 0.1, *np.arange(1, 20) / 20)]
    kaiser = [f"kaiser {beta:g}" for beta in (5.0, 8.6, 14.0, *range(2, 21))]
    narrow = [f"chebwin {decibels}" for decibels in (60, 80, 100, 120)]
    slepian = [f"dpss {width:g}" for width in (2, 2.5, 3, 4)]
    return list(dict.fromkeys([*common, *others, *tukey, *kaiser, *narrow, *slepian, ONE_BIN]))
