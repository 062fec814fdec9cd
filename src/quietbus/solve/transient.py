"""What the steady response leaves out of the jitter where it changes: the modes' transient.

The harmonic solver takes each line as the steady response ``x_s`` to the forces of the instant. The
true deviation is ``Re((x_s + y) exp(i h phi))``, where the transient y obeys

    dy/dt = (A - i h Omega) y - dx_s/dt

A being the state matrix of the controlled satellite (docs/theory.md, section 14). Far from a mode y
is what the amplitude lags behind; past a mode that a line has crossed it is the mode's ring-down.
It is followed here mode by mode: exactly for matrices that stay and forces that change evenly
between two outputs, so that a mode may be crossed, or ring many times, in between.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import comb, factorial

import numpy as np

from quietbus.dynamics.vibration import Vibration
from quietbus.dynamics.views import View, images
from quietbus.model.satellite import Satellite

SEGMENT = 512  # instants at the most that are followed in one go
CHIRP = 0.1  # [rad] phase that a changing speed may turn beyond an even one's in a step
NOTHING = 1e-9  # of the largest line: lines that are left out
# modes slower than this share of a line's frequency lag behind, but ring in the slow motion alone
SLOW_MODE = 0.01
SLIGHT = 1e-5  # [rad/s] damping of all speeds, so that a free body's rest and drift are two modes
SPREAD = 1.0  # of it, from memory to memory, so that ones that are alike are modes each


@dataclass(frozen=True)
class Transient:
    """Size of what is missing in the jitter: sums over all lines."""

    bus_rate: np.ndarray  # (n,) [rad/s]
    line_of_sight: np.ndarray  # (n, line) [rad]


def transient(
    satellite: Satellite,
    time: np.ndarray,
    xi: np.ndarray,
    speeds: np.ndarray,
    orders: np.ndarray,
    bases: Mapping[int, "Modes"],
    view: View,
) -> Transient:
    """The transient along a motion that starts without one.

    Args:
        time: (n,) [s], evenly spaced.
        xi: (n, cmg, order, m) steady response of the free bodies to each line.
        speeds: (n, cmg) of the rotors [rad/s].
        orders: (order,)
        bases: modes by the number of their instant; each serves the instants that it is nearest to.
        view: lines of sight.
    """
    count, lines = len(time), xi.shape[1] * xi.shape[2]
    s = 1j * (speeds[:, :, None] * orders).reshape(count, lines)
    xi = xi.reshape(count, lines, xi.shape[-1])
    sizes = np.max(np.abs(xi), axis=(0, 2))
    some = sizes > NOTHING * np.max(sizes, initial=0.0)
    s, xi = s[:, some], xi[:, some]
    seen = np.asarray(view.line_of_sight)
    rate, image = np.zeros(count), np.zeros((count, len(seen)))
    step = (time[-1] - time[0]) / max(count - 1, 1)
    y = None
    for start, end, base in _segments(count, bases):
        modes, here = bases[base], slice(start, end + 1)
        around = slice(max(start - 1, 0), end + 2)  # slopes need a neighbour
        at = s[:1] if np.all(s == s[0]) else s[around]  # one for all where speeds stay
        p = _steady(modes, xi[around], at)
        z = _followed(modes, step, at, p, y, (around.start < start, around.stop <= count))
        rate[here] = _size(z, _bus_rate(modes.small) @ modes.V, 1)
        if len(seen):
            image[here] = _size(z, _images(satellite, modes.small, view) @ modes.V, len(seen))
        y = z[-1] @ modes.V.T
    return Transient(rate, image)


@dataclass(frozen=True)
class Modes:
    """States by modes, x = V q, and back by W."""

    small: Vibration  # whose modes they are (NumPy)
    eigenvalues: np.ndarray  # (m,) [rad/s]
    V: np.ndarray  # (m, m)
    W: np.ndarray  # (m, m)

    @classmethod
    def of(cls, small: Vibration) -> "Modes":
        """Of equations of small vibration (NumPy)."""
        A, n = small.state_matrix(), len(small.M)
        damped = A.copy()
        damped[np.arange(n, 2 * n), np.arange(n, 2 * n)] -= SLIGHT
        own = np.arange(2 * n, len(A))  # memories alike, in a row, have no modes each of its own
        damped[own, own] -= SLIGHT * (2.0 + SPREAD * np.arange(len(own)))
        V = np.linalg.eig(damped)[1]
        W = np.linalg.inv(V)
        return cls(small, np.sum(W * (A @ V).T, axis=1), V, W)  # undamped to second order


def _segments(count: int, bases: Mapping[int, Modes]) -> list[tuple[int, int, int]]:
    """First and last instant of each stretch, the last being the next one's first; its base."""
    instants = np.array(sorted(bases))
    middles = (instants[1:] + instants[:-1]) // 2
    edges = np.unique(np.concatenate([middles, np.arange(0, count - 1, SEGMENT), [0, count - 1]]))
    edges = edges[edges < count]
    if len(edges) == 1:
        return [(0, 0, int(instants[0]))]
    nearest = [instants[np.argmin(np.abs(instants - 0.5 * (a + b)))] for a, b in pairwise(edges)]
    return [(int(a), int(b), int(k)) for (a, b), k in zip(pairwise(edges), nearest, strict=True)]


def _steady(modes: Modes, xi: np.ndarray, s: np.ndarray) -> np.ndarray:
    """p = W x_s (n, line, m) of responses xi (n, line, 12) at s (n or 1, line)."""
    W, small = modes.W, modes.small
    n, (ny, nz) = len(small.M), _memories(small)
    by_pose = W[:, :n] + s[..., None, None] * W[:, n : 2 * n]
    if ny + nz:
        answer = _answer(small, s)
        by_y, by_rate, by_z = np.split(W[:, 2 * n :], [ny, 2 * ny], axis=1)
        by_y = by_y + s[..., None, None] * by_rate
        columns = np.array(small.memory.layout.columns)
        by_pose[..., columns] += by_y @ answer[..., :ny, :] + by_z @ answer[..., ny:, :]
    if len(s) == 1:
        return np.swapaxes(np.swapaxes(xi, 0, 1) @ np.swapaxes(by_pose[0], 1, 2), 0, 1)
    return (by_pose @ xi[..., None])[..., 0]


def _answer(small: Vibration, s: np.ndarray) -> np.ndarray:
    """``Vibration.answer`` at many s (n, line) in NumPy; of rotors that stand still nothing."""
    memory, (ny, nz) = small.memory, _memories(small)
    standing = s == 0.0
    s = np.where(standing, 1j, s)[..., None, None]
    turns = len(memory.layout.columns) // 3
    turn = np.kron(np.eye(turns), np.asarray(small.turning))
    given = memory.by_pose + memory.by_rate @ (s * np.eye(3 * turns) + turn)
    by_z = np.broadcast_to(memory.by_z, (*s.shape[:-2], ny + nz, nz))
    back = np.concatenate([memory.by_y + s * memory.by_y_rate, by_z], axis=-1)
    own = np.concatenate([np.repeat(s[..., 0] ** 2, ny, -1), np.repeat(s[..., 0], nz, -1)], -1)
    found = np.linalg.solve(own[..., None] * np.eye(ny + nz) - back, given)
    return np.where(standing[..., None, None], 0.0, found)


def _memories(small: Vibration) -> tuple[int, int]:
    """Numbers of driven coordinates and of first-order memories."""
    return small.memory.layout.driven, small.memory.layout.kept


def _bus_rate(small: Vibration) -> np.ndarray:
    """(3, m): deviation of the bus's rate by states."""
    n, rows = len(small.M), small.rows
    matrix = np.zeros((3, _states(small)))
    matrix[:, rows] = np.asarray(small.turning)
    matrix[:, n + rows.start : n + rows.stop] = np.eye(3)
    return matrix


def _images(satellite: Satellite, small: Vibration, view: View) -> np.ndarray:
    """(line, 3, m): motion of images by states."""
    each = np.stack(images(satellite, small, view, small.projection))
    return np.pad(each, ((0, 0), (0, 0), (0, _states(small) - len(small.M))))


def _states(small: Vibration) -> int:
    """Number of states."""
    ny, nz = _memories(small)
    return 2 * len(small.M) + 2 * ny + nz


def _size(z: np.ndarray, output: np.ndarray, count: int) -> np.ndarray:
    """(n,) or (n, count): lengths of outputs (count, 3, m) of z (n, line, m), over all lines."""
    values = z @ output.reshape(3 * count, -1).T
    lengths = np.linalg.norm(values.reshape(*values.shape[:2], count, 3), axis=3).sum(axis=1)
    return lengths if output.ndim == 3 else lengths[:, 0]


def _followed(
    modes: Modes,
    step: float,
    s: np.ndarray,
    p: np.ndarray,
    y: np.ndarray | None,
    neighbours: tuple[bool, bool],
) -> np.ndarray:
    """Transient W y (n, line, m), from its first value y (line, m) or none.

    With q = W (x_s + y) and p = W x_s each mode obeys dq/dt = mu q - mu p, mu = eigenvalue - s. A
    resonance is in p as it is in 1/mu, so that mu p is even where p has its peak: a cubic in each
    interval.

    Args:
        step: [s] from instant to instant.
        s: (n or 1, line) [rad/s].
        p: (n, line, m).
        neighbours: whether s and p have one more instant before the first and after the last.
    """
    mu = modes.eigenvalues - s[..., None]
    every, within = p, slice(int(neighbours[0]), len(p) - int(neighbours[1]))
    p = p[within]
    z = np.zeros_like(p)
    if y is not None:
        z[0] = y @ modes.W.T
    if len(p) > 1:
        before, after = (mu, mu) if len(s) == 1 else (mu[within][:-1], mu[within][1:])
        turned, weights = _weights(before, after, step)
        f = _extended(-mu * every, neighbours)
        gained = turned * p[:-1]
        gained -= p[1:]
        for k, weight in enumerate(weights):
            gained += weight * f[k : len(gained) + k]
        middle = 0.5 * (before + after)
        slow = np.abs(modes.eigenvalues) < SLOW_MODE * np.abs(middle)
        lag = np.diff(p, axis=0)
        lag /= step * middle
        np.copyto(gained, lag, where=slow)
        factors = np.broadcast_to(np.where(slow, 0.0, turned), gained.shape)
        for now, following, factor, more in zip(z[:-1], z[1:], factors, gained, strict=True):
            np.multiply(now, factor, out=following)
            following += more
    return z


def _extended(f: np.ndarray, neighbours: tuple[bool, bool]) -> np.ndarray:
    """f (n, ...), n > 1, with one instant more, on a parabola, at either end that has none."""
    first, last = f[:3], f[-1:-4:-1]
    beyond = lambda e: (3.0 * (e[0] - e[1]) + e[2] if len(e) > 2 else 2.0 * e[0] - e[1])[None]  # noqa: E731
    parts = [beyond(first)] * (not neighbours[0]) + [f] + [beyond(last)] * (not neighbours[1])
    return np.concatenate(parts) if len(parts) > 1 else f


def _weights(before: np.ndarray, after: np.ndarray, step: float):
    """Over each interval: exp of the integral of mu, even in time, and weights.

    They are of f at four instants, the interval's ends being the middle two, in what f adds to q:
    a cubic, its slopes being those of parabolas.
    """
    change = np.max(np.abs(after - before), initial=0.0) * step
    parts = max(1, int(np.ceil(np.sqrt(change / (8.0 * CHIRP)))))
    h, n = step / parts, 1.0 / parts
    turned, moments = np.ones((1, 1, 1)), [np.zeros((1, 1, 1))] * 4
    for i in range(parts):
        x = i * n
        once, *phi = _exponentials(h * (before + (i + 0.5) * n * (after - before)))
        local = [h * phi[0], h * n * phi[1], 2.0 * h * n**2 * phi[2], 6.0 * h * n**3 * phi[3]]
        powers = [  # of the share of the interval that is past, about x
            sum(comb(k, j) * x ** (k - j) * local[j] for j in range(k + 1)) for k in range(4)
        ]
        moments = [once * old + new for old, new in zip(moments, powers, strict=True)]
        turned = once * turned
    even, first, second, third = moments
    rise = 3.0 * second - 2.0 * third  # Hermite's cubics
    start, end = 0.5 * (first - 2.0 * second + third), 0.5 * (third - second)  # of slopes
    return turned, (-start, even - rise - end, rise + start, end)


def _exponentials(x: np.ndarray) -> list[np.ndarray]:
    """phi_0 to phi_4: exp(x), (exp(x) - 1) / x, (exp(x) - 1 - x) / x^2 and so on."""
    small = np.abs(x) < 1.0
    safe = np.where(small, 1.0, x)
    last = sum(np.where(small, x, 0.0) ** k / factorial(k + 4) for k in range(18))
    found = [np.exp(x)]
    for k in range(4):
        found.append((found[-1] - 1.0 / factorial(k)) / safe)
    if np.any(small):  # backwards, without loss of digits
        for k in (4, 3, 2, 1):
            found[k] = np.where(small, last, found[k])
            last = x * last + 1.0 / factorial(k - 1)
    return found
