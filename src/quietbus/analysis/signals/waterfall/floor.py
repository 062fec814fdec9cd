"""Broadband floor of a map, and where the lines' leakage hides it."""

import numpy as np
from scipy.optimize import brentq
from scipy.special import digamma, polygamma

from quietbus.analysis.signals.waterfall.measured import FitError, Waterfall

_POINTS = 24
_SEEN = 0.3  # leakage over measured: below it a bin shows the floor
_SCATTER_OF_ONE = float(np.sqrt(polygamma(1, 1.0)))  # of the logarithm of a single periodogram
_SIGMAS = 6.0
_FIXED = float(np.log(2.0))  # of the logarithm: what stands so far out of the floor is a line
_PASSES = 3  # of the smooth floor, without fixed lines
_ENOUGH = 60  # bins that tell a scatter
_STIFF = 1e-2  # of the floor's bends, in weights of one bin: decides only where no bin does


class Floor:
    """Broadband floor, the same at every speed (or shaped by a mode), from bins without lines.

    Periodograms scatter like a chi-square; the mean of their logarithm is robust against what is
    not yet recognised as a line, and its offset from the logarithm of the mean is known for the
    number of averages that the scatter tells. Where leakage covers the floor at every speed, it is
    bounded from above by the lowest that was measured there.

    Args:
        free: bins (n, m) that no line's main lobe covers.
        leak: lines' leakage (n, m) into all bins, as the map, without its nulls.
        passed: power (n, m) that modes let pass, where the noise arises at the rotor.
    """

    def __init__(
        self,
        measured: Waterfall,
        free: np.ndarray,
        leak: np.ndarray | float = 0.0,
        passed: np.ndarray | float = 1.0,
    ) -> None:
        if not np.any(free):
            raise FitError("the rays cover the whole map; expected finer bins or fewer orders")
        power = measured.positive
        shows = free & (leak < _SEEN * power)
        logs = np.ma.array(np.log(power / passed), mask=~shows)
        count = shows.sum(axis=0)
        middle = np.ma.median(logs, axis=0).filled(np.nan)
        deviation = np.ma.median(np.ma.abs(logs - middle), axis=0).filled(np.nan)
        known = (count >= 3) & (measured.frequency > 0.0)
        if shows[:, known].sum() >= _ENOUGH:
            rows = np.median(count[known])
            few = rows / (rows - 0.8)  # of a median deviation from a median (Croux and Rousseeuw)
            scatter = max(np.median(deviation[known]) / 0.6745 * few, 1e-6)
            self.scatter = float(min(scatter, _SCATTER_OF_ONE))
            self.averages = _averages(self.scatter)
        else:  # nothing to count averages by: as few as there can be
            known[:] = False
            self.averages, self.scatter = 1.0, _SCATTER_OF_ONE
        offset = np.log(self.averages) - digamma(self.averages)
        inside = shows & (np.abs(logs.data - middle) < 4.0 * self.scatter + 1e-9)
        number = inside.sum(axis=0)
        known &= number > 0
        mean = np.sum(np.where(inside, logs.data, 0.0), axis=0)[known] / number[known]

        at = measured.frequency > 0.0
        x = np.log(measured.frequency[at])
        if len(x) < 2:
            raise FitError("expected a map with more frequencies")
        ends = np.linspace(x[0], x[-1], min(_POINTS, len(x)))
        places = np.unique(np.searchsorted(x, ends).clip(0, len(x) - 1))
        nodes = x[places]
        least = np.quantile(np.where(free, power / passed, np.inf), 0.2, axis=0)[at]
        least = np.where(np.isfinite(least), least, np.min((power / passed), axis=0)[at])
        bound = _at_nodes(x, nodes, np.log(least)) + offset
        values, bounded = bound, np.ones(len(nodes), dtype=bool)
        fixed = np.zeros(measured.psd.shape[1])
        if np.any(known):
            xk, weight = np.log(measured.frequency[known]), number[known].astype(float)
            # lines of a fixed frequency, such as the mains', are no part of the smooth floor
            limit = np.maximum(_SIGMAS * self.scatter / np.sqrt(weight), _FIXED)
            often = weight >= 0.5 * len(measured.speed)
            stands = np.zeros(len(xk), dtype=bool)
            for _ in range(_PASSES):
                told = _smooth(xk[~stands], nodes, mean[~stands], weight[~stands])
                stands = often & (mean - np.interp(xk, nodes, told) > limit)
            fixed[known] = np.where(stands, mean - np.interp(xk, nodes, told), 0.0)
            bounded = weight @ _hats(xk, nodes) < 3.0
            values = np.where(bounded, bound, told + offset)
        self.frequency = measured.frequency[at][places]
        self.psd, self.bounded = np.exp(values), bounded
        self.fixed = measured.frequency[fixed > 0.0]  # [Hz] lines at every speed the same
        positive = np.log(np.maximum(measured.frequency, self.frequency[0]))
        level = np.interp(positive, nodes, values)
        hidden = np.interp(positive, nodes, bounded.astype(float)) > 0.0  # (m,)
        self.hidden = hidden & ~known
        self.at_bins = np.exp(level + fixed) * passed * np.ones(measured.psd.shape)  # (n, m)
        use = shows & (measured.frequency > 0.0)
        spread = np.abs(np.log(power / passed) - level - fixed + offset)[use]
        self.misfit = float(np.mean(spread)) if spread.size else np.inf

    @property
    def expected(self) -> np.ndarray:
        """What is taken off (n, m) where lines are measured: of a bound, the half."""
        return self.at_bins * np.where(self.hidden, 0.5, 1.0)

    def under(self, lines: np.ndarray) -> np.ndarray:
        """Floor and lines (n, m); where lines hide the floor, the larger."""
        return np.where(self.hidden, np.maximum(self.at_bins, lines), self.at_bins + lines)


def _hats(x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    return np.array([np.interp(x, nodes, unit) for unit in np.eye(len(nodes))]).T


def _smooth(x: np.ndarray, nodes: np.ndarray, mean: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Values at nodes of what is straight between them, by weighted least squares."""
    hats, bends = _hats(x, nodes), _STIFF * _second_differences(nodes)
    normal = hats.T @ (weight[:, None] * hats) + bends.T @ bends
    return np.linalg.lstsq(normal, hats.T @ (weight * mean), rcond=None)[0]


def _second_differences(x: np.ndarray) -> np.ndarray:
    """Bends (k - 2, k) of what is straight between points."""
    k = len(x)
    rows = np.zeros((max(k - 2, 0), k))
    for i in range(k - 2):
        left, right = x[i + 1] - x[i], x[i + 2] - x[i + 1]
        rows[i, i : i + 3] = [right, -(left + right), left]
        rows[i] /= left + right
    return rows


def _at_nodes(x: np.ndarray, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Median of what lies nearest to each node."""
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    nearest = np.searchsorted(middles, x)
    return np.array([np.median(values[nearest == i]) for i in range(len(nodes))])


def _averages(scatter: float) -> float:
    """Number of averages of a spectrum whose logarithm scatters so much: trigamma(K) = s^2."""
    if scatter**2 <= polygamma(1, 1e6):
        return 1e6
    if scatter >= _SCATTER_OF_ONE:
        return 1.0
    return float(brentq(lambda k: polygamma(1, k) - scatter**2, 1.0, 1e6))
