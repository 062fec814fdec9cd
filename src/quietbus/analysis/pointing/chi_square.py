"""Weighted sums of chi-squares: the mean square of Gaussian motion with something known on it.

``Q = sum lambda_i (x_i + m_i)^2`` with standard normal x has the cumulants
``2^(k-1) (k-1)! c_k``, ``c_k = sum lambda_i^k (1 + k m_i^2)``. Pearson's approximation is a shifted
and scaled chi-square with the same first three (Imhof 1961).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammainc, gammaincinv, ndtr, ndtri

CLOSE = 1e-3  # relative: as far as the bounds are good where parts are drawn
NORMAL = 2e5  # degrees of freedom: beyond, a normal distribution


class UnsoundStatisticError(ArithmeticError):
    """A statistic that contradicts its own mean and variance, and is withheld."""


@dataclass(frozen=True)
class MeanSquare:
    """Distributions (n,), of which one is drawn."""

    c1: np.ndarray  # mean
    c2: np.ndarray  # half the variance
    c3: np.ndarray  # an eighth of the third cumulant

    @property
    def freedom(self) -> np.ndarray:
        """Degrees of freedom (n,) of the chi-square; none where nothing varies."""
        cube = np.minimum(np.maximum(self.c2, 0.0) / self._scale, 1.0) ** 3
        third = np.minimum(self.c3 / self._scale**1.5, 1.0) ** 2
        return np.asarray(cube / np.maximum(third, cube / NORMAL + 1e-300))

    @property
    def _scale(self) -> float:
        return max(float(np.max(self.c2, initial=0.0)), 1e-300)

    def below(self, value: np.ndarray | float) -> np.ndarray:
        """Probability (n,) of at most so much (n or 1)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = (value - self.c1) / np.sqrt(np.maximum(self.c2, 0.0))
        l = self.freedom
        by_normal = ndtr(steps / np.sqrt(2.0))
        turned = np.where(np.isfinite(steps), l + steps * np.sqrt(l), 0.0)
        by_chi_square = gammainc(0.5 * np.maximum(l, 1e-3), 0.5 * np.maximum(turned, 0.0))
        fixed = (self.c2 <= 0.0) | (l == 0.0)
        found = np.where(l < 0.9 * NORMAL, by_chi_square, by_normal)
        return np.where(fixed, self.c1 <= value, found)

    @property
    def moments(self) -> tuple[float, float]:
        """Mean and variance of all n together."""
        return float(np.mean(self.c1)), float(np.mean(2.0 * self.c2) + np.var(self.c1))

    def each(self, probability: np.ndarray) -> np.ndarray:
        """Quantiles (n,) of each distribution at its own probability (n,)."""
        l = np.maximum(self.freedom, 1e-3)
        few = np.minimum(l, NORMAL)
        by_chi_square = (2.0 * gammaincinv(0.5 * few, probability) - few) / np.sqrt(few)
        by_normal = np.sqrt(2.0) * ndtri(probability)
        steps = np.where(l < 0.9 * NORMAL, by_chi_square, by_normal)
        varies = self.c2 > 0.0
        spread = np.sqrt(np.where(varies, self.c2, 0.0)) * np.where(varies, steps, 0.0)
        return np.asarray(np.maximum(0.0, self.c1 + spread))

    def check(self) -> None:
        """Refuse moments that no sum of chi-squares has, which needs one degree of freedom or more.

        Of any weights ``c2 <= c1^2`` and ``c3^2 <= c2^3``.

        Raises:
            UnsoundStatisticError: says which.
        """
        slack = 1.0 + 1e-3
        if not all(np.all(np.isfinite(c)) for c in (self.c1, self.c2, self.c3)):
            raise UnsoundStatisticError("the moments of a mean square are not finite")
        tiny = 1e-12 * self._scale
        if np.any(self.c2 > slack * self.c1**2 + tiny) or np.any(self.c1 < 0.0):
            raise UnsoundStatisticError(
                "a mean square varies more than one degree of freedom allows"
            )
        if np.any(self.c3**2 > slack * self.c2**3 + tiny**3):
            raise UnsoundStatisticError(
                "a mean square is more skewed than one degree of freedom allows"
            )


def joined(parts: Sequence[MeanSquare]) -> MeanSquare:
    """All distributions of several."""
    return MeanSquare(*(np.concatenate([getattr(p, c) for p in parts]) for c in ("c1", "c2", "c3")))


def quantile(confidence: float, whole: MeanSquare, rest: MeanSquare, known: np.ndarray) -> float:
    """Of mean squares, each as likely, from what remains once their largest parts are known.

    Args:
        whole: (n,) distributions, for the bounds.
        rest: (m,) what remains.
        known: (m,) the parts that are known.

    Raises:
        UnsoundStatisticError: outside what mean and variance allow.
    """
    whole.check()
    low, high = bounds(confidence, *whole.moments)
    end = high * (1.0 + CLOSE)
    if end <= 0.0:
        return 0.0

    def off(value: float) -> float:
        return float(np.mean(rest.below(value * end - known))) - confidence

    start = max(0.0, low * (1.0 - CLOSE) / end - 1e-12)
    if off(start) > 0.0 or off(1.0) < 0.0:
        raise UnsoundStatisticError(
            f"a mean square at {confidence:g} lies outside {low:g} to {high:g}, which its mean and "
            "variance allow"
        )
    return end * float(brentq(off, start, 1.0, xtol=1e-10, rtol=1e-7))


def bounds(confidence: float, mean: float, variance: float) -> tuple[float, float]:
    """Cantelli's: between which a quantile lies, whatever the distribution."""
    sigma, odds = math.sqrt(max(variance, 0.0)), math.sqrt(confidence / (1.0 - confidence))
    return mean - sigma / odds, mean + sigma * odds
