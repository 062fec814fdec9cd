"""Gaussian noise within exposure windows: the distribution of jitter, and draws of its covariance.

A window's motion is its coefficients of Legendre polynomials; those of noise are Gaussian with a
covariance C, so that the mean square in a window is a weighted sum of chi-squares. Frequencies of
up to 14 periods in a window have their coefficients exactly; above, C acts on neighbouring
frequencies only (docs/theory.md, section 16.5).
"""

from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from scipy.special import ndtri
from scipy.stats import chi2, norm

from quietbus.analysis.pointing.chi_square import MeanSquare
from quietbus.analysis.pointing.noise import Noise, root
from quietbus.analysis.pointing.windows import Metric, bessel, weight
from quietbus.analysis.signals.density import Table

HALF_PHASE = 46.0  # [rad] pi f T up to which coefficients count exactly
ORDERS = np.arange(1, 61)  # of these; what is beyond them is nothing there
SCALE = np.sqrt(2.0 * ORDERS + 1.0)
LARGEST = 2  # parts of a mean square that are drawn
SPREAD = np.array([0.7548776662466927, 0.5698402909980532])  # even in the plane (Roberts)
FEWEST = 1.0  # degrees of freedom of each component


@cache
def half_phases() -> np.ndarray:
    """(k,) [rad] between which products of coefficients are straight, to 0.05 %."""
    fine = np.arange(1.0, HALF_PHASE + 0.1, np.pi / 128.0)
    return np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 1200)[:-1], fine])


@cache
def sizes() -> np.ndarray:
    """(order, k) of a unit line's coefficients, whose squares add to one."""
    return np.stack([k * bessel(int(n), half_phases()) for n, k in zip(ORDERS, SCALE, strict=True)])


def of_lines(lines_hz: np.ndarray, window: float) -> np.ndarray:
    """Coefficients (order, group) of unit phasors; none above the half phase."""
    u = np.pi * np.asarray(lines_hz, dtype=float) * window
    each = [1j**n * k * bessel(int(n), u) for n, k in zip(ORDERS, SCALE, strict=True)]
    return np.where(u > HALF_PHASE, 0.0, np.reshape(each, (len(ORDERS), len(u))))


@dataclass(frozen=True)
class Fortune:
    """What noise does in windows (n,), in standard measures."""

    principal: np.ndarray  # (n, principal) normal: of frequencies with few periods in a window
    smear: np.ndarray  # (n, c) normal: of the others
    wishart: np.ndarray  # (n, c, c) of mean one: their covariance
    crossed: np.ndarray  # (n, group, 2, c) normal: between them and lines

    def of(self, which: np.ndarray | slice) -> "Fortune":
        """In some of the windows."""
        parts = (self.principal, self.smear, self.wishart, self.crossed)
        return Fortune(*(part[which] for part in parts))


class WindowNoise:
    """Noise in the windows of ``jitter`` and ``MTF_loss``, and what it makes with all else.

    Its spectrum has one shape, the mean over the windows, and the size that it has in each.

    Args:
        window: [s]
        centers: (n,) [s]
        lines_hz: (group,) frequencies of the lines.
        slow: (n, order, c) coefficients of the slow motion, from order 1 on.
    """

    def __init__(
        self,
        noise: Noise,
        window: float,
        centers: np.ndarray,
        lines_hz: np.ndarray,
        slow: np.ndarray,
    ):
        self.noise, self.window, self.centers = noise, window, centers
        self.lines_hz, self.slow = lines_hz, slow
        self.jitter, self.drift = (
            noise.at(centers, noise.weighted(each, lambda f, m=each: weight(m, f)).sum(axis=1))  # type: ignore[misc]
            for each in (Metric("jitter", window), Metric("smear", window))
        )
        square = np.trace(self.jitter, axis1=1, axis2=2)
        self.mean_square = float(np.mean(square))
        self.size = square / (self.mean_square or 1.0)
        mean = noise.mean_at(centers, noise.density.sum(axis=2))
        self.components = mean.shape[-1]
        split = HALF_PHASE / (np.pi * window)
        whole = Table(noise.frequency, mean)
        self.low, self.above = whole.between(-1.0, split), whole.between(split, np.inf)
        self.near = whole.between(split - 2.0 / window, np.inf)  # as far as the high part sees
        self.many = np.pi * lines_hz * window > HALF_PHASE

    def along(self, direction: np.ndarray) -> "WindowNoise":
        """Of the motion along a direction (c,) alone."""
        density = np.einsum("a,lfpab,b->lfp", direction, self.noise.density, direction)
        noise = replace(self.noise, density=density[..., None, None])
        slow = (self.slow @ direction)[..., None]
        return WindowNoise(noise, self.window, self.centers, self.lines_hz, slow)

    @cached_property
    def covariance(self) -> np.ndarray:
        """C (order c, order c) of the low part's coefficients, from order 1 on."""
        return self._by_orders(0)

    def _by_orders(self, moment: int) -> np.ndarray:
        """Mean products of coefficients with the derivatives ``moment`` takes."""
        shared = self.low.shared(half_phases() / (np.pi * self.window), moment)
        turn = (1j ** ORDERS[:, None] * (-1j) ** ORDERS * (-1j) ** (moment % 2)).real
        product = np.einsum("mk,nk,kab->manb", sizes(), sizes(), shared, optimize=True)
        count = self.components * len(ORDERS)
        return np.asarray((product * turn[:, None, :, None]).reshape(count, count))

    @cached_property
    def jitters(self) -> np.ndarray:
        """C without smear."""
        return self.covariance[self.components :, self.components :]

    @cached_property
    def extra(self) -> np.ndarray:
        """What the high part adds to tr C^2 and tr C^3, with its neighbours below."""
        below = self.near.between(-1.0, HALF_PHASE / (np.pi * self.window))
        return self.near.local_moments(self.window) - below.local_moments(self.window)

    @cached_property
    def alone(self) -> tuple[float, float]:
        """tr C^2 and tr C^3 of all."""
        C = self.jitters
        square = C @ C
        return float(np.trace(square) + self.extra[0]), float(np.sum(square * C) + self.extra[1])

    @cached_property
    def local(self) -> np.ndarray:
        """(group, group, c, c) of C between lines by what the high part has at their frequencies.

        Above the half phase that is all of C.
        """
        f, T = self.lines_hz, self.window
        middle = 0.5 * (f[:, None] + f)
        both = (self.many[:, None] & self.many)[..., None, None]
        seen = np.where(both, self.near.smoothed(middle, T), self.above.smoothed(middle, T))
        alike = np.sinc((f[:, None] - f) * T) * (self.many[:, None] == self.many)
        return np.asarray(alike[..., None, None] * seen / (2.0 * T))

    @cached_property
    def crossing(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """m' C m and m' C^2 m of coefficients m of lines and slow motion, as polynomials in lines.

        Each of (2 group c, 2 group c) for real and imaginary parts, (n, 2 group c), and (n,).
        """
        c, f = self.components, self.lines_hz
        lines = of_lines(f, self.window)
        M = np.hstack([np.kron(part, np.eye(c)) for part in (lines.real, -lines.imag)])[c:]
        s = self.slow[:, 1:].reshape(len(self.slow), -1)
        own = np.einsum("ggab->gab", self.local)
        found = []
        for C, local in (
            (self.jitters, self.local),
            (self.jitters @ self.jitters, np.einsum("gab,ghbd->ghad", own, self.local)),
        ):
            count = c * len(f)
            high = 0.5 * local.swapaxes(1, 2).reshape(count, count)
            mine = C[:, : s.shape[1]]
            quadratic = M.T @ C @ M + np.kron(np.eye(2), 0.5 * (high + high.T))
            constant = np.einsum("ni,ij,nj->n", s, mine[: s.shape[1]], s, optimize=True)
            found.append((quadratic, s @ mine.T @ M, constant))
        return found

    def mean_squares(
        self, known: np.ndarray, z: np.ndarray, which: np.ndarray | slice
    ) -> MeanSquare:
        """Distributions of the jitter's mean square in windows ``which`` (n,).

        Args:
            known: (n,) mean square of slow motion and lines.
            z: (n, group, c) phasors of the lines.
        """
        zeta = np.concatenate([z.real, z.imag], axis=1).reshape(len(z), -1)
        crossed = [
            np.sum((zeta @ quadratic + 2.0 * linear[which]) * zeta, axis=1) + constant[which]
            for quadratic, linear, constant in self.crossing
        ]
        size, (c2, c3) = self.size[which], self.alone
        return MeanSquare(
            known + self.mean_square * size,
            size**2 * c2 + 2.0 * size * np.maximum(crossed[0], 0.0),
            size**3 * c3 + 3.0 * size**2 * np.maximum(crossed[1], 0.0),
        )

    @cached_property
    def largest_parts(self) -> tuple[np.ndarray, np.ndarray]:
        """Largest eigenvalues (k,) of C without smear, and their vectors (order c, k)."""
        size, axes = np.linalg.eigh(self.jitters)
        return size[: -LARGEST - 1 : -1], axes[:, : -LARGEST - 1 : -1]

    def conditioned(
        self, whole: MeanSquare, z: np.ndarray, which: np.ndarray | slice, draws: int
    ) -> tuple[MeanSquare, np.ndarray]:
        """The mean squares once the largest parts are drawn: what remains (m,), and these (m,).

        Pearson's approximation is good where many parts of a size add up, or one stands alone; in
        the lower tail of few unequal ones it is not.

        Args:
            whole: of windows ``which`` (n,).
            z: (n, group, c) phasors of the lines.
            draws: about m, evenly over the windows.
        """
        sizes, axes = self.largest_parts
        n, c = len(whole.c1), self.components
        lines = of_lines(self.lines_hz, self.window)[1:]
        own = axes.reshape(len(lines), c, -1)
        met = np.einsum("mg,mak,nga->nk", lines, own, z, optimize=True).real
        slow = self.slow[which][:, 1:]
        met = met + np.einsum("nma,mak->nk", slow, own[: slow.shape[1]])
        parts = self.size[which][:, None] * np.maximum(sizes, 0.0)
        c1 = whole.c1 - np.sum(parts + met**2, axis=1)
        c2 = whole.c2 - np.sum(parts**2 + 2.0 * parts * met**2, axis=1)
        c3 = whole.c3 - np.sum(parts**3 + 3.0 * parts**2 * met**2, axis=1)
        c1, c2 = np.maximum(c1, 0.0), np.maximum(c2, 0.0)
        c3 = np.clip(c3, 0.0, c2**1.5)
        each = int(np.ceil(draws / n))
        index = np.arange(n * each)[:, None]
        even = (0.5 + index * SPREAD[: len(sizes)]) % 1.0
        x = ndtri(np.clip(even, 1e-12, 1.0 - 1e-12)).reshape(n, each, -1)
        drawn = np.sum((np.sqrt(parts)[:, None] * x + met[:, None]) ** 2, axis=2)
        rest = MeanSquare(*(np.repeat(part, each) for part in (c1, c2, c3)))
        return rest, drawn.ravel()

    @cached_property
    def principal(self) -> np.ndarray:
        """(order c, principal) what the low part's coefficients are of standard normal ones."""
        found = root(self.covariance)
        power = np.sum(found**2, axis=0)
        return found[:, power > 1e-12 * max(float(np.sum(power)), 1e-300)]

    @cached_property
    def high(self) -> tuple[np.ndarray, np.ndarray]:
        """(c, c) mean covariance of jitter, and of smear, of the high part."""
        c = self.components
        C = self.covariance.reshape(len(ORDERS), c, len(ORDERS), c)
        low = np.einsum("manb,mn->ab", C[1:, :, 1:], np.eye(len(ORDERS) - 1))
        return (
            np.mean(self.jitter, axis=0) - low,
            np.mean(self.drift, axis=0) - 12.0 * C[0, :, 0],
        )

    def fortune(self, rng: np.random.Generator, n: int) -> Fortune:
        """Drawn for n windows, each by itself."""
        c = self.components
        square = float(np.sum(self.high[0] ** 2))
        freedom = max(c * FEWEST, square / max(float(self.extra[0]), 1e-12 * square, 1e-300))
        bartlett = np.zeros((n, c, c))
        for i in range(c):
            chi_square = rng.chisquare(max(freedom - i, 1e-3), n)
            bartlett[:, i, i] = np.sqrt(chi_square / freedom)
            bartlett[:, i, :i] = rng.standard_normal((n, i)) / np.sqrt(freedom)
        return Fortune(
            rng.standard_normal((n, self.principal.shape[1])),
            rng.standard_normal((n, c)),
            bartlett @ bartlett.swapaxes(1, 2),
            rng.standard_normal((n, len(self.lines_hz), 2, c)),
        )

    def drawn(
        self,
        covariance: np.ndarray,
        smear: np.ndarray,
        z: np.ndarray,
        which: np.ndarray | slice,
        fortune: Fortune,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Covariance of jitter (n, c, c), and smear (n, c), with noise.

        Args:
            covariance, smear: of slow motion and lines.
            z: (n, group, c) phasors of the lines.
            fortune: of these n windows.
        """
        n, c = smear.shape
        amplitude = np.sqrt(self.size[which])[:, None]
        x = (amplitude * (fortune.principal @ self.principal.T)).reshape(n, len(ORDERS), c)
        jitter, drift = (root(each) for each in self.high)
        smear = smear + 2.0 * np.sqrt(3.0) * x[:, 0] + amplitude * (fortune.smear @ drift.T)
        m = np.einsum("mg,nga->nma", of_lines(self.lines_hz, self.window)[1:], z).real
        slow = self.slow[which][:, 1:]
        m[:, : slow.shape[1]] += slow
        mixed = m.swapaxes(1, 2) @ x[:, 1:]
        for g, own in enumerate(np.einsum("ggab->gab", self.local)):
            turning = np.stack([z[:, g].real, z[:, g].imag], axis=2) / np.sqrt(2.0)
            mixed = mixed + amplitude[..., None] * (turning @ (fortune.crossed[:, g] @ root(own).T))
        added = x[:, 1:].swapaxes(1, 2) @ x[:, 1:]
        many = amplitude[..., None] ** 2 * (jitter @ fortune.wishart @ jitter.T)
        return covariance + added + mixed + mixed.swapaxes(1, 2) + many, smear

    def largest(self, chance: np.ndarray, duration: float) -> np.ndarray:
        """Probabilities (q,) that one window stays below what all in a time [s] do with ``chance``.

        Crossings upwards are as frequent as Rice has them for the mean square's own derivative, or
        as Slepian's process has them, the mean over a window of what is quick (whose rate Rice's
        formula exaggerates): the smaller of the two.
        """
        one = np.concatenate([np.linspace(0.0, 0.999, 1000)[1:], 1.0 - np.geomspace(1e-3, 1e-14)])
        c2, c3 = self.alone
        if c2 <= 0.0 or duration <= 0.0:
            return np.asarray(chance)
        freedom = min(c2**3 / c3**2, 1e12)
        scale = np.sqrt(c2 / freedom)  # of the chi-square
        x = chi2.ppf(one, freedom)
        speed = self.change * x / freedom
        rice = chi2.pdf(x, freedom) / scale * np.sqrt(speed / (2.0 * np.pi))
        steps = norm.ppf(one)
        slepian = np.maximum(steps, 1.0) * norm.pdf(steps) / self.window
        kept = np.log(one) - duration * np.minimum(rice, slepian)
        return np.asarray(np.interp(np.log(chance), np.maximum.accumulate(kept), one))

    @cached_property
    def change(self) -> float:
        """Mean square of the derivative of the jitter's mean square [1/s^2]."""
        c, T = self.components, self.window
        rate, mixed = (self._by_orders(moment)[c:, c:] for moment in (2, 1))
        slow = 4.0 * (np.sum(self.jitters * rate) - np.sum(mixed**2))
        quick, ends = self.high[0], self.low_end
        return float(slow + (4.0 * np.sum(quick**2) + 8.0 * np.sum(quick * ends)) / T**2)

    @cached_property
    def low_end(self) -> np.ndarray:
        """(c, c) mean covariance of the low part's jitter."""
        return np.asarray(np.mean(self.jitter, axis=0) - self.high[0])
