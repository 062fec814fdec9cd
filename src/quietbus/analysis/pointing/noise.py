"""Gaussian noise in image motion: its covariance in a metric, quantiles, largest values.

The noise has zero mean, is independent of slow motion and lines, and is stationary but for a
spectrum that changes slowly, linearly between the looks (docs/theory.md, section 16).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from quietbus.analysis.pointing.chi_square import UnsoundStatisticError, bounds
from quietbus.analysis.pointing.windows import Metric, table_weights

ANGLES = 2**15  # of directions, over all deviations together
NARROW = 1e-4  # of the larger variance: the smaller counts as this in a rate of crossing
CIRCLE = 4096
SAMPLED = 0.02  # of the logarithm of a probability, by which few directions may err


@dataclass(frozen=True)
class Noise:
    """One-sided spectral densities of noise by its contributors, independent of each other.

    Between two components it is the real part of the cross-spectrum; quadrature does not enter
    covariances.
    """

    time: np.ndarray  # (look,) [s]
    frequency: np.ndarray  # (f,) [Hz] increasing; linear in between, zero outside
    density: np.ndarray  # (look, f, part, c, c) [rad^2/Hz]
    names: tuple[str, ...]  # (part,)

    @classmethod
    def none(cls, components: int) -> "Noise":
        """Noise that nothing contributes to."""
        density = np.zeros((1, 2, 0, components, components))
        return cls(np.zeros(1), np.array([0.0, 1.0]), density, ())

    def component(self, i: int) -> "Noise":
        """Of one image component alone."""
        return replace(self, density=self.density[..., i : i + 1, i : i + 1])

    def at(self, t: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Values (n, ...) at times [s] from those at the looks (look, ...); constant outside."""
        return np.tensordot(self._shares(t), values, axes=1)

    def mean_at(self, t: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The mean of ``at`` over the times."""
        return np.tensordot(self._shares(t).mean(axis=0), values, axes=1)

    def _shares(self, t: np.ndarray) -> np.ndarray:
        """(n, look)"""
        own = np.eye(len(self.time))
        return np.stack([np.interp(t, self.time, column) for column in own], axis=-1)

    def products(self, weights: np.ndarray) -> np.ndarray:
        """Mean products (look, part, c, c) under weights (f,) of the table."""
        return np.einsum("f,lfpab->lpab", weights, self.density)

    def weighted(
        self, metric: Metric, share: Callable[[np.ndarray], np.ndarray], moment: int = 0
    ) -> np.ndarray:
        """Mean products (look, part, c, c) of a metric's share of the noise.

        Args:
            share: of frequencies [Hz].
            moment: 2 gives those of the time derivative.
        """
        turning = lambda f: (2.0 * np.pi * f) ** moment * share(f)  # noqa: E731
        weights = table_weights(self.frequency, turning, metric.span, metric.above)
        return self.products(weights)


def root(covariance: np.ndarray) -> np.ndarray:
    """(..., c, c) whose product with its own transpose is the covariance."""
    size, axes = np.linalg.eigh(covariance)
    return np.asarray(axes * np.sqrt(np.maximum(size, 0.0))[..., None, :])


def beyond(radius: float, deviation: np.ndarray, spread: np.ndarray, m: int = 1) -> np.ndarray:
    """Probabilities (n, m) that deviations with Gaussian noise are further out than a radius.

    Of two components each is for one direction of the noise, and their mean is the probability: in
    polar coordinates of the noise the distance integrates in closed form.

    Args:
        deviation: (n, c).
        spread: (n, c, c) ``root`` of the noise's covariances.
        m: directions for each deviation, evenly apart, shifted from one deviation to the next.
    """
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        if deviation.shape[1] == 1:
            d, s = deviation, np.maximum(np.abs(spread[:, 0]), 1e-300)
            return np.asarray(ndtr((d - radius) / s) + ndtr(-(d + radius) / s))
        shift = (np.arange(len(deviation)) * 0.6180339887498949)[:, None] % 1.0
        angle = 2.0 * np.pi * (np.arange(m) + shift) / m
        way = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        a = np.einsum("nab,nmb->nma", spread, way)
        square = np.maximum(np.sum(a**2, axis=2), 1e-300)
        half = np.einsum("na,nma->nm", deviation, a)
        rest = (np.sum(deviation**2, axis=1) - radius**2)[:, None]
        inside = half**2 - square * rest
        step = np.sqrt(np.maximum(inside, 0.0))
        leaves = np.exp(-0.5 * ((step - half) / square) ** 2)
        enters = np.exp(-0.5 * ((-step - half) / square) ** 2)
        outside = np.where((inside <= 0.0) | (half >= 0.0), 1.0, 1.0 - enters + leaves)
        return np.where(rest <= 0.0, leaves, outside)


def quantile(
    confidence: float, deviation: np.ndarray, spread: np.ndarray, angles: int = ANGLES
) -> float:
    """Radius within which all deviations (n, c), each with its noise, together stay so often.

    Args:
        angles: directions of the noise that are looked at, of all deviations together.

    Raises:
        UnsoundStatisticError: outside what mean and variance of the square allow.
    """
    m = int(np.clip(angles // len(deviation), 2, CIRCLE))
    low, high = bounds(confidence, *square_moments(deviation, spread))
    start, end = math.sqrt(max(low, 0.0)) * (1.0 - 1e-6), math.sqrt(max(high, 0.0)) * (1.0 + 1e-6)
    if end <= 0.0:
        return 0.0

    def off(r: float) -> float:
        out = float(np.mean(beyond(r * end, deviation, spread, m)))
        return float(np.log(max(out, 1e-300) / (1.0 - confidence)))

    if off(start / end) < -SAMPLED or off(1.0) > SAMPLED:
        raise UnsoundStatisticError(
            f"a deviation at {confidence:g} lies outside {start:g} to {end:g}, which mean and "
            "variance of its square allow"
        )
    if off(start / end) <= 0.0:
        return start
    return (
        end * float(brentq(off, start / end, 1.0, xtol=1e-6, rtol=1e-6))
        if off(1.0) < 0.0
        else float(end)
    )


def square_moments(deviation: np.ndarray, spread: np.ndarray) -> tuple[float, float]:
    """Mean and variance of the squared length of deviations (n, c) with their noise, together."""
    covariance = spread @ spread.swapaxes(1, 2)
    mean = np.sum(deviation**2, axis=1) + np.trace(covariance, axis1=1, axis2=2)
    own = 2.0 * np.sum(covariance**2, axis=(1, 2))
    crossed = 4.0 * np.einsum("na,nab,nb->n", deviation, covariance, deviation)
    return float(np.mean(mean)), float(np.mean(own + crossed) + np.var(mean))


def largest(
    probability: np.ndarray, covariance: np.ndarray, moving: np.ndarray, duration: float
) -> np.ndarray:
    """Radius (q,) that noise does not leave during a time [s], with probabilities (q,).

    Rice's mean number of crossings outwards, taken as independent of each other: Poisson's
    ``P(inside at first) exp(-crossings)``.

    Args:
        covariance: (n, c, c) of the noise at some times, evenly apart.
        moving: (n, c, c) of its time derivative.
    """
    sigma = np.sqrt(np.max(np.trace(covariance, axis1=1, axis2=2)))
    if sigma == 0.0:
        return np.zeros(np.shape(probability))
    r = sigma * np.linspace(0.0, 12.0, 481)
    none = np.zeros((1, covariance.shape[1]))
    out = np.array([np.mean(beyond(x, none, root(covariance[:1]), CIRCLE)) for x in r])
    rate = np.mean([_crossings(r, *each) for each in zip(covariance, moving, strict=True)], axis=0)
    kept = np.maximum.accumulate(np.log(np.maximum(1.0 - out, 1e-300)) - duration * rate)
    # beyond the most frequent crossings the logarithm rises, so that the radius follows from it
    return np.asarray(np.interp(np.log(probability), kept, r))


def _crossings(r: np.ndarray, covariance: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Mean number per second of crossings of a radius outwards (r,), value and rate independent."""
    if len(covariance) == 1:
        variance, rate = covariance[0, 0], moving[0, 0]
        if variance <= 0.0:
            return np.zeros(len(r))
        return np.asarray(np.sqrt(rate / variance) / np.pi * np.exp(-0.5 * r**2 / variance))
    size, axes = np.linalg.eigh(covariance)
    if size[-1] <= 0.0:
        return np.zeros(len(r))
    size = np.maximum(size, NARROW * size[-1])
    angle = 2.0 * np.pi * np.arange(CIRCLE) / CIRCLE
    own = np.stack([np.cos(angle), np.sin(angle)])
    speed = np.sqrt(np.maximum(np.einsum("ak,ab,bk->k", own, axes.T @ moving @ axes, own), 0.0))
    precision = np.sum(own**2 / size[:, None], axis=0)
    density = np.exp(-0.5 * np.outer(r**2, precision)) / (2.0 * np.pi * np.sqrt(np.prod(size)))
    step = 2.0 * np.pi / CIRCLE
    return np.asarray(r * step * (density @ speed) / np.sqrt(2.0 * np.pi))
