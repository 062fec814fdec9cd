"""Noise in the windows of one metric: of deviations exactly, of mean squares by two moments."""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincinv, ndtri

from quietbus.analysis.noise import Noise, largest, quantile, root
from quietbus.analysis.windows import (
    Metric,
    bessel,
    gain,
    table_nodes,
    weight,
)

INSTANTS = np.linspace(0.0, 0.5, 17)  # of an RPE, in shares of the window from its middle
TIMES = 5  # in a stretch, at which the noise's largest value is looked at
MOST_ORDERS = 60  # of Legendre polynomials in a window; longer ones hold many periods
MORE_ORDERS = 14  # beyond half the phase of the highest frequency
PER_WINDOW = 4.0  # independent values of a mean square in one length of a window, at most
NORMAL = 1e5  # a gamma distribution of so large a shape is a normal one


class DeviationNoise:
    """Of a metric that is linear in the motion: Gaussian, like the noise."""

    def __init__(
        self,
        noise: Noise,
        metric: Metric,
        centers: np.ndarray,
        at: np.ndarray,
        stretch: tuple[float, float],
    ):
        self.noise, self.metric, (start, end) = noise, metric, stretch
        self.duration = max(0.0, end - start - metric.span)
        half = 0.5 * metric.span
        self.times = np.linspace(start + half, start + half + self.duration, TIMES)
        if metric.name == "RPE":
            each = np.stack([self._products(instant) for instant in INSTANTS])
            inside = np.stack([noise.at(centers, one) for one in each])  # (instant, n, c, c)
            place = np.abs(at) / INSTANTS[1]
            left = np.minimum(place.astype(int), len(INSTANTS) - 2)
            part, n = (place - left)[:, None, None], np.arange(len(centers))
            self.covariance = (1.0 - part) * inside[left, n] + part * inside[left + 1, n]
        else:
            self.covariance = noise.at(centers, self._products(0.0))
        self.spread = root(self.covariance)

    def _products(self, instant: float, moment: int = 0) -> np.ndarray:
        """(look, c, c) of all contributors together."""
        share = lambda f: np.abs(gain(self.metric, f, instant)) ** 2  # noqa: E731
        return self.noise.weighted(self.metric, share, moment).sum(axis=1)

    def quantile(
        self, confidence: float, deviation: np.ndarray, which: np.ndarray | slice
    ) -> float:
        """Of the length of deviations (n, c) in windows ``which`` with the noise on them."""
        return quantile(confidence, deviation, self.spread[which])

    def largest(self, probability: np.ndarray) -> np.ndarray:
        """Radius (q,) that the noise alone does not leave in the stretch, of an RPE at any instant.

        Of an RPE with the largest gain that each frequency has at any instant: an upper bound.
        """
        instants = INSTANTS[:, None] if self.metric.name == "RPE" else np.zeros((1, 1))

        def share(f):
            return np.max([np.abs(gain(self.metric, f, x)) ** 2 for x in instants], axis=0)

        value, moving = (
            self.noise.at(self.times, self.noise.weighted(self.metric, share, moment).sum(axis=1))
            for moment in (0, 2)
        )
        return largest(probability, value, moving, self.duration)


@dataclass(frozen=True)
class Luck:
    """What noise does in windows, or in the worst window of members."""

    probability: np.ndarray  # (n,) of a smaller mean square
    direction: np.ndarray  # (n, c) smear in shares of its standard deviation

    def of(self, which: np.ndarray | slice) -> "Luck":
        """In some of the windows."""
        return Luck(self.probability[which], self.direction[which])


class JitterNoise:
    """Of jitter and smear in windows, for metrics that are not linear.

    Mean square in a window has a distribution, which is taken as a gamma distribution with the
    right mean and variance (Satterthwaite, Patnaik): noise by itself, and with the lines.
    """

    def __init__(
        self,
        noise: Noise,
        metric: Metric,
        centers: np.ndarray,
        frequency_hz: np.ndarray,
        stretch: tuple[float, float],
        rng: np.random.Generator,
    ):
        (start, end), window = stretch, metric.window
        within = Metric("jitter", window)
        share = lambda f: weight(within, f)  # noqa: E731
        self.jitter = noise.at(centers, noise.weighted(within, share).sum(axis=1))
        drift = Metric("smear", window)
        share_of_drift = lambda f: weight(drift, f)  # noqa: E731
        drifts = noise.weighted(drift, share_of_drift).sum(axis=1)
        self.smear = root(noise.at(centers, drifts))
        size = np.trace(self.jitter, axis1=1, axis2=2)
        self.size = size / (np.mean(size) or 1.0)
        self.windows = 1.0 + PER_WINDOW * max(0.0, end - start - window) / window
        mean = np.mean(noise.at(centers, noise.density.sum(axis=2)), axis=0)  # (f, c, c)
        highest = np.pi * window * max(noise.frequency[-1], np.max(frequency_hz, initial=0.0))
        self.window, self.long = window, highest > MOST_ORDERS - MORE_ORDERS
        if self.long:
            self._many_periods(noise.frequency, mean, frequency_hz)
        else:
            orders = np.arange(2, int(np.ceil(highest)) + MORE_ORDERS)
            self._by_orders(noise.frequency, mean, frequency_hz, orders)
        n, c = len(centers), mean.shape[-1]
        even = (rng.permutation(n) + 0.5) / n
        self.luck = Luck(even, rng.standard_normal((n, c)))

    def _by_orders(
        self, f: np.ndarray, mean: np.ndarray, lines_hz: np.ndarray, orders: np.ndarray
    ) -> None:
        """Covariance of the coefficients of Legendre polynomials, over sqrt(2 n + 1)."""
        at, weights = table_nodes(f, self.window)
        density = np.stack(
            [np.interp(at, f, column) for column in mean.reshape(len(f), -1).T], axis=1
        ).reshape(len(at), *mean.shape[1:])
        scale = np.sqrt(2.0 * orders + 1.0)
        j = scale * np.stack([bessel(n, np.pi * at * self.window) for n in orders], axis=1)
        product = np.einsum("q,qab,qm,qn->ambn", weights, density, j, j, optimize=True)
        turn = (1j ** orders[:, None] * (-1j) ** orders).real  # no odd with an even one
        count = mean.shape[-1] * len(orders)
        self.covariance = (product * turn[:, None, :]).reshape(count, count)
        self.variance = 2.0 * np.sum(self.covariance**2)
        u = np.pi * lines_hz * self.window
        self.lines = np.stack(
            [1j**n * k * bessel(n, u) for n, k in zip(orders, scale, strict=True)]
        )

    def _many_periods(self, f: np.ndarray, mean: np.ndarray, lines_hz: np.ndarray) -> None:
        """The mean square varies by int S^2 df / T; with a line by its power times S / T."""
        a, b = mean[:-1], mean[1:]
        squares = np.sum((a * a + a * b + b * b) / 3.0, axis=(1, 2))
        self.variance = float(np.diff(f) @ squares) / self.window
        flat = mean.reshape(len(f), -1)
        at = [np.interp(lines_hz, f, column, left=0.0, right=0.0) for column in flat.T]
        self.covariance = np.stack(at, axis=-1).reshape(-1, *mean.shape[1:]) / self.window

    def factor(
        self,
        known: np.ndarray,
        z: np.ndarray,
        which: np.ndarray | slice,
        luck: Luck,
    ) -> np.ndarray:
        """What noise makes (n,) of the expected jitter's mean square, one in the mean.

        Args:
            known: (n,) mean square of slow motion and lines.
            z: (n, group, c) phasors of the lines.
        """
        size = self.size[which]
        if self.long:
            crossed = np.einsum("nga,gab,ngb->n", z, self.covariance, z.conj()).real
        else:
            seen = np.einsum("nga,mg->nam", z, self.lines).real.reshape(len(z), -1)
            crossed = 4.0 * np.einsum("ni,ni->n", seen @ self.covariance, seen)
        variance = size**2 * self.variance + size * crossed
        mean = known + np.trace(self.jitter[which], axis1=1, axis2=2)
        some = variance > 0.0
        shape = mean**2 / np.where(some, variance, 1.0)
        p = luck.probability
        by_gamma = gammaincinv(np.minimum(shape, NORMAL), p) / np.minimum(shape, NORMAL)
        by_normal = 1.0 + ndtri(p) / np.sqrt(np.maximum(shape, NORMAL))
        return np.where(some, np.where(shape < NORMAL, by_gamma, by_normal), 1.0)

    def worst(self, probability: np.ndarray, rng: np.random.Generator) -> Luck:
        """For members (n,): values that all their windows stay below with these probabilities.

        Jitter and smear are taken to be at their worst together, and all parts of a window, a
        quarter long each, as independent: an upper bound.
        """
        one = probability ** (1.0 / self.windows)
        components = self.smear.shape[-1]
        way = rng.standard_normal((len(one), components))
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        radius = np.sqrt(2.0 * gammaincinv(0.5 * components, one))
        return Luck(one, radius[:, None] * way)
