"""Fit of a measured speed-frequency map (waterfall) of one force or torque of a rotor.

A map is a one-sided power spectral density at each of several constant speeds. It is taken as

    S(Omega, f) = floor(f) + sum over orders h of  A_h(Omega)^2 / 2  *  w(f - h Omega / 2 pi)
    A_h(Omega) = C_h Omega^2 |T_h(Omega)|

with w the power that the spectrum's window spreads over the bins (its sum over bins times the bin
is one) and T the transmission of the rotor's mode on its bearings,

    T = (1 + d) / (1 + d - (w / w0)^2 + split Omega w / w0^2),  d = 2i damping w / w0,  w = h Omega

where ``split`` is 0 for a translation and for rocking plus or minus the rotor's spin over its
transverse inertia, for lines that turn with the rotor or against it (model/disturbance.py).

The floor is the same at every speed, or, where that fits better, noise at the rotor that its mode
lets pass. Orders are found one after the other as rays that stand out of the floor along most of
their way. Their lines' powers at each speed follow by summing bins, less the floor; coefficients
and mode are fitted to these powers by nonlinear least squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, least_squares
from scipy.signal import get_window
from scipy.special import digamma, polygamma

# half widths of a line [bins]; none: the whole line in the bin that is nearest to it
WINDOWS = {"none": 1, "hann": 3, "hamming": 3, "blackman": 4, "flattop": 6}
LEAST_SPEEDS = 8
_FARTHEST = 12  # [bins] up to which a strong line's leakage is looked for
_CAP = 3.0  # of the logarithm of line over floor: no single resonance makes a ray
_STANDS_OUT = 0.5  # mean of that logarithm along a ray
_SIGMAS = 6.0
_SHARE = 0.35  # of a ray's speeds that must be its own, not other rays'
_MODEL = 5e-3  # relative error that is granted to the power of every line
_FLOOR_POINTS = 24
_BEYOND = 20.0 * np.pi  # times the map's highest frequency [Hz]: an undamped frequency's limit
_STARTS = 8  # of the fit of a mode, the best of a grid
_TINY = 1e-13  # of the largest value: nothing measures less


class FitError(ValueError):
    """A map of which nothing can be fitted; the message says why."""


@dataclass(frozen=True, eq=False)
class Waterfall:
    """A measured map of one component."""

    component: str  # radial_force, axial_force, radial_torque or axial_torque
    speed: np.ndarray  # (n,) [rad/s] ascending
    frequency: np.ndarray  # (m,) [Hz] ascending, evenly spaced
    psd: np.ndarray  # (n, m) one-sided [N^2/Hz or N^2 m^2/Hz]
    window: str = "hann"  # of the spectra, one of WINDOWS

    @property
    def bin(self) -> float:
        """[Hz]"""
        return float((self.frequency[-1] - self.frequency[0]) / (len(self.frequency) - 1))

    @property
    def turns(self) -> np.ndarray:
        """Speed (n,) [Hz]."""
        return self.speed / (2.0 * np.pi)


@dataclass(frozen=True)
class Estimate:
    """A fitted number and its standard deviation."""

    value: float
    deviation: float


@dataclass(frozen=True)
class FittedOrder:
    """One ray."""

    order: Estimate
    coefficient: Estimate  # [kg m or kg m^2] amplitude over speed squared
    whirl: str  # "forward" or "backward"


@dataclass(frozen=True)
class FittedMode:
    """The rotor's mode on its bearings that the component excites."""

    frequency: Estimate  # [Hz] undamped, rotor still
    damping: Estimate  # [-] over critical
    split: Estimate | None  # [-] spin over transverse inertia of the rotor; None: a translation


@dataclass(frozen=True, eq=False)
class ComponentFit:
    """What a map says of one component."""

    measured: Waterfall
    orders: tuple[FittedOrder, ...]  # ascending
    mode: FittedMode | None
    floor_frequency: np.ndarray  # (k,) [Hz]
    floor: np.ndarray  # (k,) [as the map] straight between these on double-logarithmic paper
    floor_at_rotor: bool  # the mode shapes the noise too; else ``floor`` is what is measured
    averages: float  # of the spectra, from their scatter off the rays
    fitted: np.ndarray  # (n, m) as the map
    line_speed: tuple[np.ndarray, ...]  # per order: speeds (i,) [rad/s] at which its line was used
    line_amplitude: tuple[np.ndarray, ...]  # (i,) measured amplitude there
    line_error: float  # root mean square of measured over fitted amplitude, less one

    @property
    def residual_db(self) -> np.ndarray:
        """Measured over fitted (n, m) [dB]."""
        least = _TINY * np.max(self.measured.psd)
        return 10.0 * np.log10(np.maximum(self.measured.psd, least) / self.fitted)

    def amplitude(self, k: int, speed: np.ndarray) -> np.ndarray:
        """Fitted amplitude [N or N m] of order number k at speeds [rad/s]."""
        line = self.orders[k]
        return line.coefficient.value * speed**2 * self._passed(line, speed)

    def _passed(self, line: FittedOrder, speed: np.ndarray) -> np.ndarray:
        if self.mode is None:
            return np.ones_like(speed)
        split = self.mode.split.value if self.mode.split else 0.0
        w0 = 2.0 * np.pi * self.mode.frequency.value
        sign = 1.0 if line.whirl == "forward" else -1.0
        return transmission(line.order.value, speed, w0, self.mode.damping.value, sign * split)

    def whirl_hz(self, speed: np.ndarray) -> np.ndarray:
        """Undamped frequencies of the mode (branch, n) [Hz]: one, or backward and forward."""
        if self.mode is None:
            return np.zeros((0, len(speed)))
        w0 = 2.0 * np.pi * self.mode.frequency.value
        if self.mode.split is None:
            return np.full((1, len(speed)), w0) / (2.0 * np.pi)
        half = 0.5 * self.mode.split.value * speed
        root = np.sqrt(w0**2 + half**2)
        return np.stack([root - half, root + half]) / (2.0 * np.pi)

    @property
    def rotor_floor(self) -> np.ndarray:
        """Floor (k,) at the rotor, before its mode, which makes the measured level on average."""
        if self.mode is None or self.floor_at_rotor:
            return self.floor
        split = self.mode.split.value if self.mode.split else 0.0
        mode = (2.0 * np.pi * self.mode.frequency.value, self.mode.damping.value, split)
        passed = noise_passed(self.measured.speed, self.floor_frequency, *mode)
        return self.floor / np.exp(np.mean(np.log(passed), axis=0))

    def to_dict(self) -> dict[str, Any]:
        """Numbers and lists, for JSON."""
        both = lambda e: {"value": e.value, "deviation": e.deviation}  # noqa: E731
        return {
            "orders": [
                {
                    "order": both(line.order),
                    "coefficient": both(line.coefficient),
                    "whirl": line.whirl,
                    "speeds": len(speeds),
                }
                for line, speeds in zip(self.orders, self.line_speed, strict=True)
            ],
            "mode": self.mode
            and {
                "frequency_hz": both(self.mode.frequency),
                "damping": both(self.mode.damping),
                "split": self.mode.split and both(self.mode.split),
            },
            "floor": {
                "frequency_hz": self.floor_frequency.tolist(),
                "psd": self.floor.tolist(),
                "at": "rotor" if self.floor_at_rotor else "mount",
            },
            "averages": self.averages,
            "line_error": self.line_error,
        }


def transmission(
    order: np.ndarray | float, speed: np.ndarray, w0: float, damping: float, split: float
) -> np.ndarray:
    """Magnitude of T: what passes from the rotor to its mount at order times speed [rad/s]."""
    w = order * speed
    damper = 2j * damping * w / w0
    return np.abs((1.0 + damper) / (1.0 + damper - (w / w0) ** 2 + split * speed * w / w0**2))


def fit(measured: Waterfall, most: int = 20) -> ComponentFit:
    """Orders, coefficients, mode and broadband floor of a map.

    Args:
        most: number of orders that are looked for.

    Raises:
        FitError: too few speeds, or no order stands out.
    """
    n = len(measured.speed)
    if n < LEAST_SPEEDS:
        raise FitError(f"expected at least {LEAST_SPEEDS} speeds, got {n}")
    if not measured.psd.any():
        raise FitError("expected values above zero, got none but zeros")
    spread = _spread(measured.window)
    free = np.ones(measured.psd.shape, dtype=bool)  # bins that no ray has taken
    floor = _Floor(measured, free)
    found: list[float] = []
    while len(found) < most:
        order = _next_order(measured, floor, free)
        if order is None:
            break
        found.append(order)
        _take(measured, floor, free, order, spread)
        floor = _Floor(measured, free)
    if not found:
        raise FitError(
            "no order stands out of the floor along its ray; expected lines at multiples of the "
            "speed, and as speed the rotor's own"
        )
    lines = [_Line(measured, order) for order in sorted(found)]
    _measure(lines, floor)
    lines = [line for line in lines if len(line.at) >= 4]
    if not lines:
        raise FitError("the rays lie too close to each other for the width of a bin")
    result = _fit_lines(lines, floor, None, np.ones(len(lines)))
    at_rotor = False
    if measured.component != "axial_torque":
        tries = [
            _settled(lines, floor, start, whirl) for start, whirl in _search_mode(lines, measured)
        ]
        with_mode = min(tries, key=lambda tried: tried.criterion)
        if with_mode.criterion < result.criterion - 10.0:
            result = with_mode
            assert result.mode is not None
            passed = noise_passed(measured.speed, measured.frequency, *result.mode)
            inner = _Floor(measured, free, passed)
            at_rotor = inner.misfit < floor.misfit
            if at_rotor:
                floor = inner
                _measure(lines, floor)
                result = _settled(lines, floor, result.mode, result.whirl)
    return _assembled(measured, lines, floor, result, spread, at_rotor)


def noise_passed(
    speed: np.ndarray, frequency: np.ndarray, w0: float, damping: float, split: float
) -> np.ndarray:
    """Power (n, m) of noise at the rotor that reaches the mount: half of it turns either way."""
    turns = np.maximum(speed[:, None], 1e-9)
    h = 2.0 * np.pi * frequency / turns
    ways = [transmission(h, turns, w0, damping, sign * split) ** 2 for sign in (1.0, -1.0)]
    return 0.5 * (ways[0] + ways[1])


def _measure(lines: Sequence["_Line"], floor: "_Floor") -> None:
    for _ in range(4):
        for line in lines:
            line.measure(floor.at_bins, [other.order for other in lines if other is not line])


def _spread(window: str) -> np.ndarray:
    """Power of a line by distance from it, 0, 1/16, 2/16... bins; its sum over bins is one."""
    size, fine = 64, 16
    if window == "none":
        return np.repeat([1.0, 0.0], [fine // 2 + 1, size * fine // 2])
    values = get_window(window, size)
    power = np.abs(np.fft.fft(values, size * fine)[: fine * size // 2]) ** 2
    return power / (size * np.sum(values**2))


def _leakage(spread: np.ndarray, distance: np.ndarray) -> np.ndarray:
    return np.interp(np.abs(distance), np.arange(len(spread)) / 16.0, spread, right=0.0)


class _Floor:
    """Broadband floor, the same at every speed, from the bins that no ray has taken.

    Periodograms scatter like a chi-square; the mean of their logarithm is robust against what is
    not yet recognised as a ray, and its offset from the logarithm of the mean is known for the
    number of averages that the scatter tells.
    """

    def __init__(
        self, measured: Waterfall, free: np.ndarray, passed: np.ndarray | float = 1.0
    ) -> None:
        """``passed``: power (n, m) that a mode lets pass, where the noise arises at the rotor."""
        least = _TINY * np.max(measured.psd)
        logs = np.ma.array(np.log(np.maximum(measured.psd, least) / passed), mask=~free)
        middle = np.ma.median(logs, axis=0)
        deviation = np.ma.median(np.ma.abs(logs - middle), axis=0).filled(np.nan)
        known = np.isfinite(deviation)
        if not np.any(known):
            raise FitError("the rays cover the whole map; expected finer bins or fewer orders")
        self.scatter = float(max(np.nanmedian(deviation) / 0.6745, 1e-6))  # of the logarithm
        self.averages = _averages(self.scatter)
        inside = free & (np.abs(logs.data - middle.filled(0.0)) < 4.0 * self.scatter + 1e-9)
        count = inside.sum(axis=0)
        use = known & (count > 0) & (measured.frequency > 0.0)
        mean = np.sum(logs.data * inside, axis=0)[use] / count[use]
        offset = np.log(self.averages) - digamma(self.averages)
        x = np.log(measured.frequency[use])
        at = np.unique(
            np.searchsorted(x, np.linspace(x[0], x[-1], min(_FLOOR_POINTS, len(x)))).clip(
                0, len(x) - 1
            )
        )
        nodes = x[at]
        if len(nodes) < 2:
            raise FitError("expected a map with more frequencies")
        hats = np.array([np.interp(x, nodes, unit) for unit in np.eye(len(nodes))]).T
        weight = np.sqrt(count[use])[:, None]
        values = np.linalg.lstsq(weight * hats, weight[:, 0] * mean, rcond=None)[0] + offset
        self.frequency, self.psd = measured.frequency[use][at], np.exp(values)
        positive = np.maximum(measured.frequency, self.frequency[0])
        level = np.interp(np.log(positive), nodes, values)
        self.at_bins = np.exp(level) * passed * np.ones(measured.psd.shape)  # (n, m)
        self.misfit = float(np.mean(np.abs(logs - level + offset)))


def _averages(scatter: float) -> float:
    """Number of averages of a spectrum whose logarithm scatters so much: trigamma(K) = s^2."""
    high, low = polygamma(1, 0.5), polygamma(1, 1e6)
    if scatter**2 >= high:
        return 0.5
    if scatter**2 <= low:
        return 1e6
    return float(brentq(lambda k: polygamma(1, k) - scatter**2, 0.5, 1e6))


def _next_order(measured: Waterfall, floor: _Floor, free: np.ndarray) -> float | None:
    """The ray that stands out most, if any does."""
    turns, frequency, step = measured.turns, measured.frequency, measured.bin
    half = WINDOWS[measured.window]
    highest = frequency[-1] / np.quantile(turns, 0.3)
    lowest = (frequency[0] + (half + 1) * step) / turns[-1]
    candidates = np.arange(lowest, highest, 0.25 * step / turns[-1])
    where = np.multiply.outer(candidates, turns)
    bins = np.rint((where - frequency[0]) / step).astype(int)
    inside = (bins >= 0) & (bins < len(frequency)) & (where > frequency[0] + half * step)
    bins = np.where(inside, bins, 0)
    speeds = np.arange(len(turns))
    own = inside & free[speeds, bins]
    ratio = np.log(np.maximum(measured.psd / floor.at_bins, 1e-3))[speeds, bins]
    ratio = np.where(own, np.clip(ratio, -1.0, _CAP), 0.0)
    count, possible = own.sum(axis=1), inside.sum(axis=1)
    enough = (count >= 6) & (count >= _SHARE * possible) & (possible >= 0.3 * len(turns))
    score = np.where(enough, ratio.sum(axis=1) / np.maximum(count, 1), -np.inf)
    least = np.maximum(_STANDS_OUT, _SIGMAS * floor.scatter / np.sqrt(np.maximum(count, 1)))
    score = np.where(score > least, score, -np.inf)
    if not np.any(np.isfinite(score)):
        return None
    # among rays that stand out as far, the one with most power
    power = np.where(own, measured.psd[speeds, bins], 0.0).sum(axis=1)
    best = score > np.max(score) - 0.3
    return float(candidates[np.argmax(np.where(best, power, -1.0))])


def _take(
    measured: Waterfall, floor: _Floor, free: np.ndarray, order: float, spread: np.ndarray
) -> None:
    """Mark the bins of a ray as taken, as far as its leakage stands out of the floor."""
    step, half = measured.bin, WINDOWS[measured.window]
    envelope = np.maximum.accumulate(spread[::-1])[::-1][::16] / spread[0]
    for i, f in enumerate(order * measured.turns):
        k = (f - measured.frequency[0]) / step
        if not -half <= k <= len(measured.frequency) - 1 + half:
            continue
        near = (i, slice(max(int(k) - 1, 0), max(int(k) + 3, 0)))
        if measured.psd[near].size == 0:
            continue
        over = np.max(measured.psd[near] / floor.at_bins[near])
        leaks = int(np.searchsorted(-envelope, -0.5 / max(over, 1.0)))
        width = max(half, min(leaks, _FARTHEST)) + 1
        free[i, max(round(k) - width, 0) : max(round(k) + width + 1, 0)] = False


class _Line:
    """Power of one order's line at the speeds where it stands alone."""

    def __init__(self, measured: Waterfall, order: float) -> None:
        self.measured, self.order = measured, order
        self.deviation = 0.25 * measured.bin / measured.turns[-1]
        self.at = np.zeros(0, dtype=int)  # speeds
        self.power = np.zeros(0)  # A^2 / 2
        self.bins = 2 * WINDOWS[measured.window] + 1

    @property
    def speed(self) -> np.ndarray:
        return self.measured.speed[self.at]

    def measure(self, floor: np.ndarray, others: Sequence[float]) -> None:
        """Powers, and the order from the lines' centres."""
        m, step = self.measured, self.measured.bin
        half = WINDOWS[m.window]
        k = (self.order * m.turns - m.frequency[0]) / step
        alone = np.ones(len(k), dtype=bool)
        for other in others:
            alone &= np.abs(other - self.order) * m.turns > (2 * half + 1) * step
        inside = (k >= half + 1) & (k <= len(m.frequency) - 2 - half)
        self.at = np.flatnonzero(inside & alone)
        centre = np.rint(k[self.at]).astype(int)
        columns = centre[:, None] + np.arange(-half, half + 1)
        excess = (m.psd - floor)[self.at[:, None], columns]
        self.power = excess.sum(axis=1) * step
        self.noise = floor[self.at, centre] * step
        if not len(self.at):
            return
        clear = self.power > 6.0 * self.noise
        if clear.sum() < 3:
            return
        centres = (excess * m.frequency[columns]).sum(axis=1)[clear] / excess.sum(axis=1)[clear]
        error = step * (
            (0.3 if m.window == "none" else 0.02) + np.sqrt(self.noise[clear] / self.power[clear])
        )
        turns = m.turns[self.at][clear]
        weight = 1.0 / error**2
        total = np.sum(weight * turns**2)
        self.order = float(np.sum(weight * centres * turns) / total)
        scatter = np.sqrt(np.mean(((centres - self.order * turns) / error) ** 2))
        self.deviation = float(max(scatter, 0.1) / np.sqrt(total))


@dataclass
class _Result:
    """Parameters of all lines and, if there is one, of the mode."""

    coefficients: np.ndarray
    mode: np.ndarray | None  # w0 [rad/s], damping, split
    deviations: np.ndarray  # relative, in the order of the parameters
    whirl: np.ndarray
    criterion: float  # Bayesian information: less is better


def _passed(order: float, speed: np.ndarray, mode: np.ndarray | None, whirl: float) -> np.ndarray:
    if mode is None:
        return np.ones_like(speed)
    return transmission(order, speed, mode[0], mode[1], whirl * mode[2])


def _search_mode(
    lines: Sequence[_Line], measured: Waterfall
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Modes (w0, damping, split) and the lines' whirl (1, -1) near the best, from a grid."""
    found, rocks = [], measured.component == "radial_torque"
    lowest = max(measured.frequency[0], 2.0 * measured.bin)
    splits = np.linspace(0.2, 2.0, 10) if rocks else np.zeros(1)
    for w0 in 2.0 * np.pi * np.geomspace(lowest, measured.frequency[-1], 90):
        best = None
        for damping in np.geomspace(0.003, 0.3, 5):
            for split in splits:
                mode = np.array([w0, damping, split])
                costs = np.array([_misfits(line, mode, rocks) for line in lines])
                total = float(costs.min(axis=1).sum())
                if best is None or total < best[0]:
                    best = (total, mode, np.where(np.argmin(costs, axis=1) == 0, 1.0, -1.0))
        assert best is not None
        found.append(best)
    return [start[1:] for start in sorted(found, key=lambda start: start[0])[:_STARTS]]


def _settled(lines: Sequence[_Line], floor: _Floor, mode: np.ndarray, whirl: np.ndarray) -> _Result:
    """The fit from a start, its lines turning the way that fits better."""
    for _ in range(3):
        result = _fit_lines(lines, floor, mode, whirl)
        assert result.mode is not None
        mode = result.mode
        if mode[2] == 0.0:
            break
        costs = np.array([_misfits(line, mode, True) for line in lines])
        turned = np.where(np.argmin(costs, axis=1) == 0, 1.0, -1.0)
        if np.array_equal(turned, whirl):
            break
        whirl = turned
    return result


def _misfits(line: _Line, mode: np.ndarray, rocks: bool) -> list[float]:
    """``_misfit`` of a line that turns forward, and backward if that is something else."""
    return [_misfit(line, mode, whirl) for whirl in ((1.0, -1.0) if rocks else (1.0,))]


def _misfit(line: _Line, mode: np.ndarray, whirl: float) -> float:
    """How far a line's powers are from a mode's, whatever its coefficient."""
    good = line.power > 0.0
    power, speed = line.power[good], line.speed[good]
    if not len(power):
        return 0.0
    passed = _passed(line.order, speed, mode, whirl)
    difference = 0.5 * np.log(power) - np.log(speed**2 * passed)
    weight = 1.0 / (0.05**2 + (line.noise[good] / power) ** 2)
    middle = np.sum(weight * difference) / np.sum(weight)
    # a few wild points, such as near another ray, do not decide
    return float(np.sum(np.minimum(weight * (difference - middle) ** 2, 400.0)))


def _fit_lines(
    lines: Sequence[_Line], floor: _Floor, mode: np.ndarray | None, whirl: np.ndarray
) -> _Result:
    """Least squares of powers over their deviations, which are made of the fit before."""
    rocks = mode is not None and mode[2] > 0.0
    shape = [1.0] * len(lines)
    for k, line in enumerate(lines):
        unit = 0.5 * (line.speed**2 * _passed(line.order, line.speed, mode, whirl[k])) ** 2
        weight = 1.0 / (line.noise + _MODEL * np.max(line.power)) ** 2
        ratio = np.sum(weight * unit * line.power) / np.sum(weight * unit**2)
        shape[k] = np.sqrt(max(ratio, 1e-30))
    start = np.log(shape)
    if mode is not None:
        start = np.append(start, np.log(mode if rocks else mode[:2]))

    # the mode is sought where it shows, and a little beyond
    within = np.log(
        [[2.0 * np.pi * floor.frequency[0], 1e-4, 0.02], [_BEYOND * floor.frequency[-1], 1.0, 2.0]]
    )
    low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    low[len(lines) :], high[len(lines) :] = (ends[: len(start) - len(lines)] for ends in within)
    bounds = (low, high)
    start = np.clip(start, low + 1e-6, high - 1e-6)

    def powers(x: np.ndarray) -> list[np.ndarray]:
        at = None
        if mode is not None:
            tail = np.exp(x[len(lines) :])
            at = tail if rocks else np.append(tail, 0.0)
        return [
            0.5
            * (np.exp(x[k]) * line.speed**2 * _passed(line.order, line.speed, at, whirl[k])) ** 2
            for k, line in enumerate(lines)
        ]

    def deviations(x: np.ndarray) -> list[np.ndarray]:
        each = []
        for line, power in zip(lines, powers(x), strict=True):
            noise = (line.bins * line.noise**2 + 2.0 * power * line.noise) / floor.averages
            each.append(np.sqrt(noise + (_MODEL * power) ** 2 + (1e-9 * np.max(line.power)) ** 2))
        return each

    x, measured_powers = start, np.concatenate([line.power for line in lines])
    sigma = [
        np.sqrt((0.2 * np.maximum(line.power, line.noise)) ** 2 + line.bins * line.noise**2)
        for line in lines
    ]
    for _ in range(4):
        scale = np.concatenate(sigma)

        def residuals(x: np.ndarray, scale: np.ndarray = scale) -> np.ndarray:
            return (np.concatenate(powers(x)) - measured_powers) / scale

        solved = least_squares(residuals, x, bounds=bounds, loss="soft_l1", f_scale=3.0)
        x = solved.x
        sigma = deviations(x)
    scale = np.concatenate(sigma)
    error = (np.concatenate(powers(x)) - measured_powers) / scale
    robust = np.sum(2.0 * 9.0 * (np.sqrt(1.0 + error**2 / 9.0) - 1.0))
    count, free = len(error), max(len(error) - len(x), 1)
    J = solved.jac
    covariance = np.linalg.pinv(J.T @ J) * max(robust / free, 1.0)
    penalty = 2.0 * np.sum(np.log(scale)) + len(x) * np.log(count)
    tail = np.exp(x[len(lines) :])
    at = None if mode is None else tail if rocks else np.append(tail, 0.0)
    return _Result(
        np.exp(x[: len(lines)]),
        at,
        np.sqrt(np.maximum(np.diag(covariance), 0.0)),
        whirl,
        float(robust + penalty),
    )


def _assembled(
    measured: Waterfall,
    lines: Sequence[_Line],
    floor: _Floor,
    result: _Result,
    spread: np.ndarray,
    at_rotor: bool,
) -> ComponentFit:
    orders, relative = [], result.deviations
    for k, (line, coefficient) in enumerate(zip(lines, result.coefficients, strict=True)):
        turns_back = result.mode is not None and result.whirl[k] < 0.0
        orders.append(
            FittedOrder(
                Estimate(line.order, line.deviation),
                Estimate(float(coefficient), float(coefficient * relative[k])),
                "backward" if turns_back else "forward",
            )
        )
    mode = None
    if result.mode is not None:
        w0, damping, split = (float(value) for value in result.mode)
        tail = relative[len(lines) :]
        mode = FittedMode(
            Estimate(w0 / (2.0 * np.pi), float(w0 * tail[0] / (2.0 * np.pi))),
            Estimate(damping, float(damping * tail[1])),
            Estimate(split, float(split * tail[2])) if split > 0.0 else None,
        )
    fitted = floor.at_bins.copy()
    errors = []
    for k, line in enumerate(lines):
        passed = _passed(line.order, measured.speed, result.mode, result.whirl[k])
        power = 0.5 * (result.coefficients[k] * measured.speed**2 * passed) ** 2
        distance = measured.frequency - (line.order * measured.turns)[:, None]
        fitted += power[:, None] * _leakage(spread, distance / measured.bin) / measured.bin
        clear = line.power > 20.0 * line.noise
        errors.append(np.sqrt(line.power[clear] / power[line.at][clear]) - 1.0)
    return ComponentFit(
        measured,
        tuple(orders),
        mode,
        floor.frequency,
        floor.psd,
        at_rotor,
        floor.averages,
        fitted,
        tuple(line.speed for line in lines),
        tuple(np.sqrt(2.0 * np.maximum(line.power, 0.0)) for line in lines),
        float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
        if np.concatenate(errors).size
        else 0.0,
    )
