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

from quietbus.dynamics.vibration import Vibration, View, image_motions

SEGMENT = 512  # instants at the most that are followed in one go
CHIRP = 0.1  # [rad] phase that a changing speed may turn beyond an even one's in a step
NOTHING = 1e-9  # of the largest line: lines that are left out
# modes slower than this share of a line's frequency lag behind, but ring in the slow motion alone
SLOW_MODE = 0.01
SLIGHT = 1e-5  # [rad/s] damping of all speeds, so that a free body's rest and drift are two modes


@dataclass(frozen=True)
class Transient:
    """Size of what is missing in the jitter: sums over all lines."""

    bus_rate: np.ndarray  # (n,) [rad/s]
    line_of_sight: np.ndarray  # (n, line) [rad]


def transient(
    time: np.ndarray,
    xi: np.ndarray,
    speeds: np.ndarray,
    orders: np.ndarray,
    bases: Mapping[int, Vibration],
    view: View,
) -> Transient:
    """The transient along a motion that starts without one.

    Args:
        time: (n,) [s].
        xi: (n, cmg, order, 12) steady response to each line.
        speeds: (n, cmg) of the rotors [rad/s].
        orders: (order,)
        bases: equations of small vibration (NumPy) by the number of their instant; each serves the
            instants that it is nearest to.
        view: lines of sight.
    """
    count, lines = len(time), xi.shape[1] * xi.shape[2]
    s = 1j * (speeds[:, :, None] * orders).reshape(count, lines)
    xi = xi.reshape(count, lines, 12)
    sizes = np.max(np.abs(xi), axis=(0, 2))
    some = sizes > NOTHING * np.max(sizes)
    s, xi = s[:, some], xi[:, some]
    seen = np.asarray(view.line_of_sight)
    rate, image = np.zeros(count), np.zeros((count, len(seen)))
    y = None
    for start, end, base in _segments(count, bases):
        small, here = bases[base], slice(start, end + 1)
        around = slice(max(start - 1, 0), end + 2)  # slopes need a neighbour
        steady = _states(small, xi[around], s[around])
        within = slice(start - around.start, end + 1 - around.start)
        modes = _Modes.of(small)
        z = _followed(modes, time[around], s[around], steady, y, within)
        rate[here] = _size(z, _bus_rate(small) @ modes.V, 1)
        if len(seen):
            image[here] = _size(z, seen @ _image_motions(small) @ modes.V, len(seen))
        y = z[-1] @ modes.V.T
    return Transient(rate, image)


@dataclass(frozen=True)
class _Modes:
    """x = V q: states by modes, and back by W."""

    eigenvalues: np.ndarray  # (m,) [rad/s]
    V: np.ndarray  # (m, m)
    W: np.ndarray  # (m, m)

    @classmethod
    def of(cls, small: Vibration) -> "_Modes":
        A, n = small.state_matrix(), len(small.M)
        speed = np.arange(n, 2 * n)
        A[speed, speed] -= SLIGHT
        eigenvalues, V = np.linalg.eig(A)
        return cls(eigenvalues, V, np.linalg.inv(V))


def _segments(count: int, bases: Mapping[int, Vibration]) -> list[tuple[int, int, int]]:
    """First and last instant of each stretch, the last being the next one's first; its base."""
    instants = np.array(sorted(bases))
    middles = (instants[1:] + instants[:-1]) // 2
    edges = np.unique(np.concatenate([middles, np.arange(0, count - 1, SEGMENT), [0, count - 1]]))
    edges = edges[edges < count]
    if len(edges) == 1:
        return [(0, 0, int(instants[0]))]
    nearest = [instants[np.argmin(np.abs(instants - 0.5 * (a + b)))] for a, b in pairwise(edges)]
    return [(int(a), int(b), int(k)) for (a, b), k in zip(pairwise(edges), nearest, strict=True)]


def _states(small: Vibration, xi: np.ndarray, s: np.ndarray) -> np.ndarray:
    """(n, line, m), as of ``state_matrix``, of responses xi (n, line, 12) at s (n, line)."""
    pose = xi if small.projection is None else xi[..., 6:]
    parts = [pose, s[..., None] * pose]
    if small.control is not None:
        at = s[:1] if np.all(s == s[0]) else s  # one solution for all where speeds stay
        memory = _memory(small, at) @ xi[..., 9:, None]
        gimbals = memory[..., :-3, 0]
        parts += [gimbals, s[..., None] * gimbals, memory[..., -3:, 0]]
    return np.concatenate(parts, axis=-1)


def _memory(small: Vibration, s: np.ndarray) -> np.ndarray:
    """``Vibration.memory`` at many s (n, line) in NumPy; of rotors that stand still nothing."""
    control = small.control
    assert control is not None
    standing = s == 0.0
    s = np.where(standing, 1j, s)[..., None, None]
    m = control.by_angle.shape[1]
    given = control.by_attitude + control.by_rate @ (s * np.eye(3) + _turning(small))
    answer = np.concatenate(
        [
            control.by_angle + s * control.by_angle_rate,
            np.broadcast_to(control.by_integral, (*s.shape[:-2], m + 3, 3)),
        ],
        axis=-1,
    )
    own = np.concatenate([np.repeat(s[..., 0] ** 2, m, -1), np.repeat(s[..., 0], 3, -1)], -1)
    found = np.linalg.solve(own[..., None] * np.eye(m + 3) - answer, given)
    return np.where(standing[..., None, None], 0.0, found)


def _turning(small: Vibration) -> np.ndarray:
    return np.cross(small.slow.plates.w_B, np.eye(3)).T


def _bus_rate(small: Vibration) -> np.ndarray:
    """(3, m): deviation of the bus's rate by states."""
    n, m = _sizes(small)
    matrix = np.zeros((3, m))
    matrix[:, n - 3 : n], matrix[:, 2 * n - 3 : 2 * n] = _turning(small), np.eye(3)
    return matrix


def _image_motions(small: Vibration) -> np.ndarray:
    """(12, m): what moves images by states."""
    whole = np.eye(12) if small.projection is None else small.projection
    return np.asarray(image_motions(small.slow.plates.p_BP)) @ whole @ np.eye(*_sizes(small))


def _sizes(small: Vibration) -> tuple[int, int]:
    """Numbers of displacements and of states."""
    n = len(small.M)
    return n, 2 * n + (0 if small.control is None else 2 * small.control.by_angle.shape[1] + 3)


def _size(z: np.ndarray, output: np.ndarray, count: int) -> np.ndarray:
    """(n,) or (n, count): lengths of outputs (count, 3, m) of z (n, line, m), over all lines."""
    values = z @ output.reshape(3 * count, -1).T
    lengths = np.linalg.norm(values.reshape(*values.shape[:2], count, 3), axis=3).sum(axis=1)
    return lengths if output.ndim == 3 else lengths[:, 0]


def _followed(
    modes: _Modes,
    time: np.ndarray,
    s: np.ndarray,
    steady: np.ndarray,
    y: np.ndarray | None,
    within: slice,
) -> np.ndarray:
    """Transient W y (n, line, m) ``within`` times, from its first value y (line, m) or none.

    With q = W (x_s + y) and p = W x_s each mode obeys dq/dt = mu q - mu p, mu = eigenvalue - s. A
    resonance is in p as it is in 1/mu, so that mu p is even where p has its peak: a cubic in each
    interval.
    """
    p = steady @ modes.W.T
    alike = np.all(s == s[0])
    mu = modes.eigenvalues - (s[:1] if alike else s)[..., None]
    f = -mu * p
    slope = np.gradient(f, time, axis=0, edge_order=2 if len(time) > 2 else 1)[within]
    f, p, time = f[within], p[within], time[within]
    z = np.zeros_like(p)
    if y is not None:
        z[0] = y @ modes.W.T
    if len(p) > 1:
        span = np.diff(time)
        if alike and np.ptp(span) <= 1e-9 * span[0]:
            span, mu = span[:1], np.repeat(mu, 2, axis=0)  # the same for all
        elif not alike:
            mu = mu[within]
        else:
            mu = np.repeat(mu, len(p), axis=0)
        turned, by_f, by_slope = _weights(mu, span[:, None, None])
        gained = turned * p[:-1]
        gained -= p[1:]
        for weight, values in zip(
            (*by_f, *by_slope), (f[:-1], f[1:], slope[:-1], slope[1:]), strict=True
        ):
            gained += weight * values
        middle = 0.5 * (mu[1:] + mu[:-1])
        slow = np.abs(modes.eigenvalues) < SLOW_MODE * np.abs(middle)
        gained = np.where(slow, np.diff(p, axis=0) / (span[:, None, None] * middle), gained)
        factors = np.broadcast_to(np.where(slow, 0.0, turned), gained.shape)
        for now, following, factor, more in zip(z[:-1], z[1:], factors, gained, strict=True):
            np.multiply(now, factor, out=following)
            following += more
    return z


def _weights(mu: np.ndarray, span: np.ndarray):
    """Over each interval: exp of the integral of mu, even in time, and weights.

    They are of f and of its slope, at either end, in what a cubic f adds to q.
    """
    change = np.max(np.abs(np.diff(mu, axis=0)) * span, initial=0.0)
    parts = max(1, int(np.ceil(np.sqrt(change / (8.0 * CHIRP)))))
    h, n = span / parts, 1.0 / parts
    turned, moments = np.ones((1, 1, 1)), [np.zeros((1, 1, 1))] * 4
    for i in range(parts):
        x = i * n
        once, *phi = _exponentials(h * (mu[:-1] + (i + 0.5) * n * (mu[1:] - mu[:-1])))
        local = [h * phi[0], h * n * phi[1], 2.0 * h * n**2 * phi[2], 6.0 * h * n**3 * phi[3]]
        powers = [  # of the share of the interval that is past, about x
            sum(comb(k, j) * x ** (k - j) * local[j] for j in range(k + 1)) for k in range(4)
        ]
        moments = [once * old + new for old, new in zip(moments, powers, strict=True)]
        turned = once * turned
    even, first, second, third = moments
    rise = 3.0 * second - 2.0 * third  # Hermite's cubics
    by_slope = span * (first - 2.0 * second + third), span * (third - second)
    return turned, (even - rise, rise), by_slope


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
