"""Image motion: a sampled signal, and on top of it lines of known amplitude and noise."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.interpolate import make_interp_spline

from quietbus.analysis.pointing.noise import Noise
from quietbus.analysis.signals.spectrum import detrended

SAME_FREQUENCY = 1e-9  # relative: lines closer than this are one
MOST_NODES = 4_000_000  # values of a signal looked at in all windows together
NODES = 2  # Gauss points in each interval between samples
FEWEST_NODES = 12  # in a window
MOST_ORDERS = 40  # of a signal in a window that are kept


@dataclass(frozen=True)
class WindowParts:
    """A signal in windows: mean, smear (slope times length), and what is left of either."""

    mean: np.ndarray  # (window, c)
    smear: np.ndarray  # (window, c)
    about_mean: np.ndarray  # (window, c, c) mean product of deviations from the mean
    about_line: np.ndarray  # (window, c, c) mean product of deviations from mean and slope
    coefficients: np.ndarray  # (window, order, c) of Legendre polynomials of mean square one


@dataclass(frozen=True)
class SampledSignal:
    """A signal between and at its samples: the quintic spline through them."""

    time: np.ndarray  # (n,) [s] evenly spaced
    values: np.ndarray  # (n, c)

    def __post_init__(self) -> None:
        if self.time.ndim != 1 or self.values.ndim != 2 or len(self.time) != len(self.values):
            raise ValueError("a signal needs times (n,) and values (n, components)")
        if len(self.time) < 2 or not np.all(np.isfinite(self.values)):
            raise ValueError("a signal needs two or more samples, all finite")
        steps = np.diff(self.time)
        if steps[0] <= 0.0 or np.ptp(steps) > 1e-3 * steps[0]:
            raise ValueError("a signal's samples have to be evenly spaced in time")

    @property
    def rate(self) -> float:
        """[Hz]"""
        return float((len(self.time) - 1) / (self.time[-1] - self.time[0]))

    @cached_property
    def _spline(self):
        degree = next(k for k in (5, 3, 1) if k < len(self.time))
        return make_interp_spline(self.time, self.values, k=degree)

    def at(self, t: np.ndarray) -> np.ndarray:
        """Values (..., c) at times [s] within the samples."""
        return np.asarray(self._spline(t))

    def windows(self, centers: np.ndarray, length: float) -> WindowParts:
        """Windows of ``length`` [s] about ``centers`` (window,) [s], by Gauss's quadrature.

        Coefficients from order 1, the smear, as far as the samples in a window tell them.
        """
        panels = max(FEWEST_NODES // NODES, int(np.ceil(length * self.rate)))
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        edges = np.linspace(-0.5, 0.5, panels + 1)
        x = (0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * nodes / panels).ravel()
        w = np.tile(0.5 * weights / panels, panels)
        powers = legvander(2.0 * x, min(panels, MOST_ORDERS)) * np.sqrt(w)[:, None]
        # orthonormal in these nodes, so that no coefficient has anything of another's
        own, sign = np.linalg.qr(powers)
        legendre = ((own * np.sign(np.diag(sign))).T * np.sqrt(w))[1:]
        parts = []
        step = max(1, MOST_NODES // (8 * len(x)))
        for start in range(0, len(centers), step):
            y = self.at(centers[start : start + step, None] + length * x)
            mean = np.einsum("q,kqc->kc", w, y)
            smear = 12.0 * np.einsum("q,kqc->kc", w * x, y)
            y = y - mean[:, None]
            straight = y - smear[:, None] * x[:, None]
            coefficients = legendre @ y
            products = (_product(w, each) for each in (y, straight))
            parts.append((mean, smear, *products, coefficients))
        return WindowParts(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def how_many(self, length: float, most: int) -> int:
        """Windows of a length [s] that can be looked at, ``most`` at most."""
        nodes = max(FEWEST_NODES, NODES * int(np.ceil(length * self.rate)))
        return int(np.clip(MOST_NODES // nodes, 64, most))

    def mean_square_above(self, frequency_hz: float, start: float, end: float) -> np.ndarray:
        """(c, c) mean product of what lies at or above a frequency, from start to end [s].

        A line's power is spread by a Hann window over two bins on either side, so that the
        result is sharp to two over the stretch's length [Hz].

        Raises:
            ValueError: fewer than 16 samples, or a frequency that the samples cannot show.
        """
        here = (self.time >= start - 1e-9) & (self.time <= end + 1e-9)
        t, y = self.time[here], self.values[here]
        if frequency_hz >= 0.5 * self.rate:
            return np.zeros((y.shape[1], y.shape[1]))
        if len(t) < 16:
            raise ValueError(
                f"a spectrum needs 16 samples, from {start:g} s to {end:g} s there are {len(t)}"
            )
        if frequency_hz > 0.0:
            y = detrended(t, y)
        w = np.hanning(len(y) + 1)[:-1, None]
        f = np.fft.rfftfreq(len(y), 1.0 / self.rate)
        X = np.fft.rfft(w * y, axis=0)[f >= frequency_hz]
        f = f[f >= frequency_hz]
        sides = np.where((f == 0.0) | (f > 0.5 * self.rate * (1.0 - 1e-9)), 1.0, 2.0)
        total = np.einsum("f,fa,fb->ab", sides, X, X.conj()).real
        return np.asarray(total / (len(y) * np.sum(w**2)))


def _product(w: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Mean product (window, c, c) of values (window, node, c) under weights (node,)."""
    return np.asarray(np.einsum("kqa,kqb->kab", w[:, None] * y, y))


@dataclass(frozen=True)
class Lines:
    """Lines ``Re(amplitude exp(i (phase + frequency t)))`` whose amplitudes may change slowly.

    A rotor's random turn by delta shifts its line of order h by ``h delta``.
    """

    amplitude: np.ndarray  # (n, line, c) complex, at the signal's times
    frequency: np.ndarray  # (line,) [rad/s], of either sign
    phase: np.ndarray  # (line,) [rad] at t = 0, phases as given
    rotor: np.ndarray  # (line,) number of the rotor
    order: np.ndarray  # (line,)

    @classmethod
    def none(cls, signal: SampledSignal) -> "Lines":
        """No lines."""
        nothing, nobody = np.zeros(0), np.zeros(0, int)
        amplitude = np.zeros((len(signal.time), 0, signal.values.shape[1]), complex)
        return cls(amplitude, nothing, nothing, nobody, nothing)

    @property
    def names(self) -> tuple[str, ...]:
        """Who makes each line: ``rotor 0, 1Ω``."""
        return tuple(f"rotor {j}, {h:g}Ω" for j, h in zip(self.rotor, self.order, strict=True))

    @cached_property
    def groups(self) -> np.ndarray:
        """(line,) number of the frequency that a line has, by rising frequency."""
        ascending, back = np.unique(np.abs(self.frequency), return_inverse=True)
        new = np.diff(ascending, prepend=-np.inf) > SAME_FREQUENCY * ascending
        return (np.cumsum(new) - 1)[back]

    @cached_property
    def frequency_hz(self) -> np.ndarray:
        """(group,) [Hz]"""
        f = np.abs(self.frequency) / (2.0 * np.pi)
        return np.array([f[self.groups == g][0] for g in range(self.count)])

    @property
    def count(self) -> int:
        """Number of groups."""
        return int(self.groups.max()) + 1 if len(self.groups) else 0

    def together(self, phasors: np.ndarray) -> np.ndarray:
        """Phasors (..., group, c) of each frequency from those of the lines (..., line, c)."""
        folded = np.where((self.frequency < 0.0)[:, None], phasors.conj(), phasors)
        sums = [folded[..., self.groups == g, :].sum(axis=-2) for g in range(self.count)]
        shape = (*phasors.shape[:-2], 0, phasors.shape[-1])
        return np.stack(sums, axis=-2) if sums else np.zeros(shape, complex)


@dataclass(frozen=True)
class ImageMotion:
    """Motion of an image: a signal, and on top of it lines and noise.

    Of a harmonic run the signal is the slow motion; a direct run has all of it in the signal.
    """

    signal: SampledSignal
    lines: Lines | None = None
    noise: Noise | None = None

    @property
    def apart(self) -> bool:
        """Whether lines are known apart from the signal, as of a harmonic run."""
        return self.lines is not None

    @property
    def noisy(self) -> bool:
        """Whether there is noise."""
        return self.noise is not None

    @cached_property
    def known_lines(self) -> Lines:
        """Lines known apart from the signal; there may be none."""
        return self.lines or Lines.none(self.signal)

    @cached_property
    def known_noise(self) -> Noise:
        """The noise; it may have no contributors."""
        return self.noise or Noise.none(self.signal.values.shape[1])

    def component(self, i: int) -> "ImageMotion":
        """Component i of the image motion alone."""
        signal = replace(self.signal, values=self.signal.values[:, i : i + 1])
        return ImageMotion(
            signal,
            self.lines and replace(self.lines, amplitude=self.lines.amplitude[..., i : i + 1]),
            self.noise and self.noise.component(i),
        )

    def phasors(self, t: np.ndarray) -> np.ndarray:
        """(time, line, c) of the lines at times [s], phases as given."""
        lines, time = self.known_lines, self.signal.time
        right = np.clip(np.searchsorted(time, t), 1, len(time) - 1)
        part = ((t - time[right - 1]) / (time[right] - time[right - 1]))[:, None, None]
        amplitude = (1.0 - part) * lines.amplitude[right - 1] + part * lines.amplitude[right]
        turn = np.exp(1j * (lines.phase + np.outer(t, lines.frequency)))
        return np.asarray(amplitude * turn[..., None])
