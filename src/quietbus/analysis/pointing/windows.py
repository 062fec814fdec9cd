"""What an exposure window makes of motion at a frequency: gains and weights of pointing metrics.

Over a window of length T the motion is projected on Legendre polynomials. ``exp(i w s)``, s from
the window's middle, has the coefficients ``i^n (2 n + 1) j_n(u)`` with ``u = w T / 2`` and the
spherical Bessel functions j_n, and ``sum (2 n + 1) j_n^2 = 1``. Order 0 is the mean, order 1 the
smear, the rest is jitter (docs/theory.md, section 16).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import spherical_jn

SMALL = 1.0  # [rad] u below which differences of nearly equal numbers become sums
TERMS = np.arange(14)  # of those sums: j_14(1) is 1e-18
DRIFTS = ("PDE", "PRE", "windowed_stability", "stability")
MEANS = ("MPE", "displacement")
INSTANTS = ("APE", "stability")  # without a window
LINEAR = ("APE", *MEANS, "smear", *DRIFTS, "RPE")  # a deviation with a direction
METRICS = (
    *("APE", "MPE", "RPE", "PDE", "PRE"),
    *("displacement", "smear", "jitter", "windowed_stability", "stability"),
    *("rms", "MTF_loss"),
)


@dataclass(frozen=True)
class Metric:
    """A pointing metric and its times.

    Raises:
        ValueError: an unknown name, or a time or frequency that the metric needs is missing.
    """

    name: str  # one of METRICS
    window: float = 0.0  # [s] exposure
    tau: float = 0.0  # [s] from one window to the next
    above: float = 0.0  # [Hz] lowest frequency that counts
    spatial_frequency: float = 0.0  # [cycles/rad]

    def __post_init__(self) -> None:
        if self.name not in METRICS:
            known = ", ".join(METRICS)
            raise ValueError(f"metric: expected one of {known}; got {self.name!r}")
        needs = {
            "window": self.name not in (*INSTANTS, "rms"),
            "tau": self.name in DRIFTS,
            "spatial_frequency": self.name == "MTF_loss",
        }
        for field, needed in needs.items():
            value = getattr(self, field)
            if needed and not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{self.name}: expected a positive {field}, got {value!r}")
        if self.name == "stability" and self.window:
            raise ValueError("stability has no window: of two windows it is windowed_stability")
        if not (np.isfinite(self.above) and self.above >= 0.0):
            raise ValueError(f"{self.name}: expected a frequency for above, got {self.above!r}")

    @property
    def span(self) -> float:
        """[s] from the beginning of the first window to the end of the last."""
        return self.window + (self.tau if self.name in DRIFTS else 0.0)

    def with_window(self, window: float) -> "Metric":
        """The same metric over windows of another length [s]."""
        return Metric(self.name, window, self.tau, self.above, self.spatial_frequency)


def bessel(n: int, u: np.ndarray) -> np.ndarray:
    """Spherical Bessel function j_n of a real argument of either sign."""
    u = np.asarray(u, dtype=float)
    values: np.ndarray = spherical_jn(n, np.abs(u))
    return np.where(u < 0.0, (-1.0) ** n, 1.0) * values


def left_over(a: np.ndarray, b: np.ndarray, first: int) -> np.ndarray:
    """Mean over the window of what two oscillations have in common from order ``first`` on.

    ``sum over n >= first of (2 n + 1) j_n(a) j_n(b)``; for first = 0 it is j_0(a - b).

    Args:
        a, b: half the phase that each turns through in the window [rad].
    """
    a, b = np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float))
    term = lambda n: (2 * n + 1) * bessel(n, a) * bessel(n, b)  # noqa: E731
    few = sum((term(n) for n in TERMS[first:]), np.zeros(a.shape))
    rest = bessel(0, a - b) - sum((term(n) for n in range(first)), np.zeros(a.shape))
    return np.where(np.maximum(np.abs(a), np.abs(b)) < SMALL, few, rest)


def weight(metric: Metric, frequency_hz: np.ndarray) -> np.ndarray:
    """What share of the mean square at a frequency [Hz] a metric's mean square has.

    Of ``MTF_loss`` it is the share of the motion within the window, smear and jitter.
    """
    f = np.asarray(frequency_hz, dtype=float)
    u = np.pi * f * metric.window
    match metric.name:
        case "APE":
            return np.ones_like(f)
        case "rms":
            return np.where(f >= metric.above, 1.0, 0.0)
        case "RPE" | "MTF_loss":
            return left_over(u, u, 1)
        case "jitter":
            return left_over(u, u, 2)
        case _:
            return np.abs(gain(metric, f)) ** 2


def gain(metric: Metric, frequency_hz: np.ndarray, at: np.ndarray | float = 0.0) -> np.ndarray:
    """Complex gain of a metric in ``LINEAR`` on exp(i w t), phase as in the middle of its span.

    Args:
        at: where in the window the instant of an RPE lies, -0.5 to 0.5 of its length; broadcast
            against the frequencies.
    """
    f = np.asarray(frequency_hz, dtype=float)
    u = np.pi * f * metric.window
    match metric.name:
        case "APE":
            return np.ones_like(f, dtype=complex)
        case "MPE" | "displacement":
            return bessel(0, u) + 0j
        case "smear":
            return 6j * bessel(1, u)
        case "PDE" | "PRE" | "windowed_stability" | "stability":
            return 2j * np.sin(np.pi * f * metric.tau) * bessel(0, u)
        case "RPE":
            return np.exp(2j * u * np.asarray(at)) - bessel(0, u)
        case _:
            raise ValueError(f"{metric.name} is not a linear metric")


def largest_change(metric: Metric, amplitude: float) -> float:
    """Bound on how much motion of an amplitude [rad], at whatever frequency, adds to a metric.

    The gains' largest values; of ``MTF_loss`` the slopes of exp(-2 pi^2 nu^2 s^2) by jitter s and
    of sin(x)/x, x = pi nu b, by smear b.
    """
    if metric.name == "MTF_loss":
        slope = 2.0 * np.pi * np.exp(-0.5) * np.sqrt(0.5) + np.pi * STEEPEST * SMEARED
        return float(min(1.0, metric.spatial_frequency * slope * amplitude))
    gains = {"smear": SMEARED, "RPE": 2.0, "jitter": np.sqrt(0.5), "rms": np.sqrt(0.5)}
    gains |= dict.fromkeys(DRIFTS, 2.0)
    return float(gains.get(metric.name, 1.0)) * amplitude


SMEARED = 2.62  # largest of 6 j_1
STEEPEST = 0.437  # largest slope of sin(x)/x


def mean_square_of_density(
    metric: Metric, frequency_hz: np.ndarray, density: np.ndarray
) -> np.ndarray:
    """Mean square of a metric of random motion, from its one-sided power spectral density.

    Args:
        frequency_hz: (f,) increasing; the density is linear in between and zero outside.
        density: (f, ...) [unit^2/Hz].

    Raises:
        ValueError: a table that is not increasing, finite and non-negative, or too long a window
            for its range of frequencies (more than MOST_PERIODS).
    """
    f, S = checked_density(frequency_hz, density)
    share = lambda x: weight(metric, x)  # noqa: E731
    return np.tensordot(table_weights(f, share, metric.span, metric.above), S, axes=1)


MOST_PERIODS = 500_000
PIECES = 8  # in a period of the longest time, for three points of Gauss each


def table_weights(
    frequency_hz: np.ndarray,
    share: Callable[[np.ndarray], np.ndarray],
    span: float,
    corner: float = 0.0,
) -> np.ndarray:
    """Weights (f,) of a table, linear in between, in its integral times a share.

    Args:
        share: of frequencies [Hz].
        frequency_hz, span, corner: as of ``table_nodes``.
    """
    f = np.asarray(frequency_hz, dtype=float)
    at, weights = table_nodes(f, span, corner)
    value = weights * share(at)
    left = np.clip(np.searchsorted(f, at, side="right") - 1, 0, len(f) - 2)
    part = (at - f[left]) / (f[left + 1] - f[left])
    below = np.bincount(left, (1.0 - part) * value, len(f))
    return below + np.bincount(left + 1, part * value, len(f))


def table_nodes(
    frequency_hz: np.ndarray, span: float, corner: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and weights of a quadrature over a table, by Gauss's in small pieces.

    Args:
        frequency_hz: (f,) increasing.
        span: [s] what is integrated oscillates with periods of 1/span or longer.
        corner: frequency [Hz] at which it may jump.

    Raises:
        ValueError: a span of too many periods.
    """
    f = np.asarray(frequency_hz, dtype=float)
    finest = 1.0 / (PIECES * max(span, 1.0 / f[-1]))
    pieces = np.maximum(1, np.ceil(np.diff(f) / finest)).astype(int)
    if span * f[-1] > MOST_PERIODS:
        raise ValueError(
            f"a window of {span:g} s has too many periods of {f[-1]:g} Hz to integrate over"
        )
    edges = [
        np.linspace(a, b, n, endpoint=False) for a, b, n in zip(f[:-1], f[1:], pieces, strict=True)
    ]
    if f[0] < corner < f[-1]:
        edges.append(np.array([corner]))
    x = np.unique(np.concatenate([*edges, f[-1:]]))
    nodes, weights = np.polynomial.legendre.leggauss(3)
    half = 0.5 * np.diff(x)[:, None]
    at = (0.5 * (x[1:] + x[:-1]))[:, None] + half * nodes
    return at.ravel(), (half * weights).ravel()


def checked_density(frequency_hz: np.ndarray, density: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A table of a one-sided power spectral density as arrays, if it is one."""
    f, S = np.asarray(frequency_hz, float), np.asarray(density, float)
    if f.ndim != 1 or len(f) < 2 or len(S) != len(f):
        raise ValueError("a density needs two or more frequencies and a value for each")
    if not (np.all(np.isfinite(f)) and np.all(np.isfinite(S))):
        raise ValueError("a density's frequencies and values have to be finite")
    if f[0] < 0.0 or np.any(np.diff(f) <= 0.0) or np.any(S < 0.0):
        raise ValueError("a density needs increasing frequencies and no negative values")
    return f, S
