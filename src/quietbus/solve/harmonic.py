"""The harmonic solver: the slow motion in time, and at every instant the steady jitter about it.

The slow motion is integrated with the rotors' imbalance averaged over their turns. At each output
instant the response to every order of every rotor follows from one complex linear solve with the
equations of small vibration about the slow motion (``dynamics.vibration``).

The legs' part of these equations costs most and changes least. It is computed at some instants,
so dense that the path of the plate in the bus is straight in between, and interpolated.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from scipy.spatial.transform import Rotation

from quietbus.dynamics.closed_loop import evaluate, rotor_angles
from quietbus.dynamics.disturbance_response import ripple_lines
from quietbus.dynamics.state import State
from quietbus.dynamics.vibration import (
    NOTHING_SEEN,
    Vibration,
    View,
    leg_coefficients,
    linear_outputs,
    rotor_response,
    rotor_speeds,
    slow_motion,
    unit_acceleration,
    vibration,
    with_units_moved,
)
from quietbus.model.cmg import ClusterMoments
from quietbus.model.disturbance import orders_of
from quietbus.model.satellite import Satellite
from quietbus.model.variants import without_disturbance, without_noise
from quietbus.solve.direct import SLOW, Reached, Scheme, Solution, Tolerances, integrate
from quietbus.solve.noise import Broadband, noise_spectra
from quietbus.solve.transient import Modes, Transient, transient
from quietbus.spatial.rotation import (
    quaternion_multiply,
    quaternion_to_matrix,
    rotation_vector_to_quaternion,
)
from quietbus.spatial.vector import cross

TOLERANCES = Tolerances(1e-7, 1e-9)  # of the slow motion
LEG_ERROR = 1e-5  # [m, rad] of the plate's pose between the legs' linearisations
INSTANTS = 128  # responses per call, so that one program serves start and run, which can be stopped
LEG_INSTANTS = 16  # linearisations of the legs per call
LOOKS = 8  # instants at the most at which the modes are computed
SPEED_STEP = 0.005  # relative change of a speed after which the modes are computed anew
MOST_BASES = 256  # instants at the most at which they are, besides
SLOW_CHANGE = 0.05  # largest estimated error of the jitter that needs no warning
ON_A_MODE = 1e-8  # relative distance from a mode at which the response counts as infinite


class ResonanceError(ValueError):
    """An order of a rotor lies on an undamped mode, where no steady response exists."""


@dataclass(frozen=True)
class Jitter:
    """Steady response to each order of each rotor along a motion.

    A deviation is ``Re(sum amplitude * exp(1j * h * phi))`` over rotors and orders, where
    ``phi = rotor_phase + rotor_speed * t``, or the slow motion's rotor angle where speeds change.
    """

    amplitudes: dict[str, np.ndarray]  # (n, cmg, order, ...) by output, complex
    # (n,) what is missing in the bus's rate, as amplitudes change (``solve.transient``) and by
    # second order, over the sum of its lines
    change_error: np.ndarray
    missing: Transient  # the same in the outputs' units
    warnings: tuple[str, ...]
    # by gimbal motors, (n, cmg, line, ...); the phase is against line times gimbal angle
    ripple: dict[str, np.ndarray] | None = None
    broadband: Broadband | None = None


@dataclass(frozen=True)
class HarmonicSolution:
    """A harmonic run, whole or up to where it stopped."""

    slow: Solution
    jitter: Jitter


def integrate_harmonic(
    satellite: Satellite,
    initial: State,
    duration: float,
    output_rate: float,
    *,
    steady: bool = False,
    view: View = NOTHING_SEEN,
    tolerances: Tolerances = TOLERANCES,
    progress: Callable[[float], None] | None = None,
    keep: Callable[[Reached], None] | None = None,
    start: Reached | None = None,
    scheme: Scheme = SLOW,
) -> HarmonicSolution:
    """Slow motion and jitter from t = 0 to ``duration`` [s], every 1/``output_rate`` [Hz].

    Args:
        initial: the true state at t = 0, jitter included; if ``steady``, that of the slow motion.
        view: points and lines of sight at which to give the jitter too.
        progress: called with the time reached [s], first of the slow motion (counted half), then
            of the jitter.
        keep, start, scheme: of the slow motion, as of ``integrate``.

    Raises:
        ResonanceError: an order of a rotor lies on an undamped mode.
    """
    half = progress and (lambda t: progress(0.5 * t))
    if not steady and start is None:
        initial = without_jitter(satellite, initial)
    slow = integrate(
        satellite, initial, duration, output_rate, tolerances, scheme, half, keep, start
    )
    second = progress and (lambda t: progress(0.5 * (slow.time[-1] + t)))
    if slow.stopped and not slow.interrupted:
        slow = replace(slow, stopped=f"{slow.stopped}. {_growth(satellite, slow)}".strip())
    assert slow.states is not None
    jitter, done = respond(satellite, slow.time, slow.states, view, second)
    if done < len(slow.time):
        slow = _cut(slow, done)
    return HarmonicSolution(slow, jitter)


def _cut(slow: Solution, count: int) -> Solution:
    first = lambda tree: jax.tree.map(lambda leaf: leaf[:count], tree)  # noqa: E731
    time = slow.time[:count]
    said = f"interrupted by the user; jitter is known up to t = {time[-1]:g} s"
    return replace(
        slow,
        time=time,
        outputs=first(slow.outputs),
        states=first(slow.states),
        stopped=said,
        interrupted=True,
    )


def _growth(satellite: Satellite, slow: Solution) -> str:
    """Which mode grows where the slow motion went wrong."""
    final = jax.tree.map(lambda leaf: np.asarray(leaf)[None], slow.final)
    along = _Along(satellite, np.array([slow.time[-1]]), final)
    _, _, small = along.chunk(np.zeros(1, int), NOTHING_SEEN)
    return _growing(np.linalg.eigvals(_instant(small, 0).state_matrix()), 0.0)


def on_periodic_solution(satellite: Satellite, state: State) -> State:
    """The state at t = 0 with the steady jitter added, so that a direct run has no transient.

    To second order: the jitter's square has a mean, which moves the equilibrium, and multiples of
    rotor speed, which move the satellite too (docs/theory.md, section 14).
    """
    small, xi = _jitter_at(satellite, state)
    speed, phase = _rotors(satellite, state)
    first = _motions(satellite, small, xi, phase)
    second = [np.zeros_like(part) for part in first]
    speeds = np.abs(np.asarray(speed))
    orders = np.asarray(orders_of(satellite.disturbance))
    for one in np.unique(speeds[speeds > 0.0]):
        for base, together in _periods(orders):
            turns = max(TURNS, 4 * round(np.max(orders[together]) / base) + 4)
            chosen = (speeds == one)[:, None] & together
            square = _jitter_squared(satellite, state, small, xi, chosen, jnp.asarray(base), turns)
            moved = _answer_to_square(small, square, base * one)
            for part, more in zip(second, moved, strict=True):
                part += more
    return _displaced(satellite, state, *map(np.add, first, second))


def _periods(orders: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Orders that have a common period, by that of the group: the whole ones, each of the others.

    Products of lines of different groups have no mean and are left out.
    """
    whole = orders == np.round(orders)
    return [(1.0, whole), *((float(h), orders == h) for h in orders[~whole])]


def _answer_to_square(small: Vibration, square: Sequence[np.ndarray], speed: float):
    """Motion at t = 0, as of ``_motions``, that the jitter's square causes at multiples of speed.

    Args:
        square: over a turn's angles, accelerations (12,), gimbals' and rate of the integral.
    """
    turns = len(square[0])
    u_rate, gimbal, integral = (np.fft.rfft(part, axis=0) / turns for part in square)
    T, n, gimbals = small.projection, len(small.M), gimbal.shape[1]
    pushed = u_rate if T is None else u_rate[:, 6:]  # a rigid mount's follow those of the bus
    memory = np.concatenate([0.0 * gimbal, gimbal, integral], axis=1)
    if small.control is None:
        memory = memory[:, :0]
    A = small.state_matrix()
    whole = lambda xi: xi if T is None else T @ xi  # noqa: E731
    turning = np.asarray(small.turning)
    pose, pose_rate = np.zeros(12), np.zeros(12)
    moved = np.zeros(memory.shape[1])
    for m in range(turns // 2):
        b = np.concatenate([np.zeros(n), pushed[m], memory[m]])
        if m == 0:  # A is singular where nothing holds the satellite
            x = np.linalg.lstsq(A, -b.real, rcond=1e-13)[0]
        else:
            x = 2.0 * np.linalg.solve(1j * m * speed * np.eye(len(A)) - A, b)
        xi, rate = (whole(part).reshape(4, 3) for part in (x[:n], x[n : 2 * n]))
        pose = pose + xi.real.ravel()
        pose_rate = pose_rate + (rate + xi @ turning.T).real.ravel()
        moved = moved + x[2 * n :].real
    if small.control is None:
        moved = np.zeros(2 * gimbals + 3)
    return pose, pose_rate, *np.split(moved, [gimbals, 2 * gimbals])


def steady_speeds(satellite: Satellite, state: State) -> np.ndarray:
    """Amplitudes (cmg, order, 6) of the bus's velocity [m/s] and rate [rad/s] at t = 0."""
    states = jax.tree.map(lambda leaf: np.asarray(leaf)[None], state)
    _, xi, _ = _Along(satellite, np.zeros(1), states).chunk(np.zeros(1, int), NOTHING_SEEN)
    orders = np.asarray(orders_of(satellite.disturbance))
    speed = np.abs(np.outer(np.asarray(satellite.cluster.rotor_speed), orders))
    return speed[..., None] * np.abs(xi[0, ..., 6:])


def without_jitter(satellite: Satellite, state: State) -> State:
    """The slow motion's state at t = 0, from the true one."""
    small, xi = _jitter_at(satellite, state)
    return _moved_by(satellite, state, small, -xi)


@eqx.filter_jit
def _moved_by(satellite, state, small, xi):
    motions = _motions(satellite, small, xi, _rotors(satellite, state)[1])
    return _displaced(satellite, state, *motions)


def _rotors(satellite, state):
    """Speeds [rad/s] and angles [rad] of the rotors at t = 0."""
    return rotor_speeds(satellite, state), rotor_angles(satellite, jnp.zeros(()), state)


def _jitter_at(satellite: Satellite, state: State) -> tuple[Vibration, np.ndarray]:
    """Equations of small vibration at t = 0 and xi (cmg, order, 12)."""
    states = jax.tree.map(lambda leaf: np.asarray(leaf)[None], state)
    _, xi, small = _Along(satellite, np.zeros(1), states).chunk(np.zeros(1, int), NOTHING_SEEN)
    small = _instant(small, 0)
    modes = np.linalg.eigvals(small.state_matrix())
    refuse_resonance(satellite, "at t = 0 s", modes, np.asarray(small.slow.rotor_speed))
    return small, xi[0]


@eqx.filter_jit
def _motions(satellite, small, xi, phase):
    """Pose, its rate, gimbal angles, their rates and integral of jitter xi at rotor angles."""
    n = len(phase)

    def one(h, speed, phase, xi):
        s, now = 1j * h * speed, xi * jnp.exp(1j * h * phase)
        rate = now.reshape(4, 3) @ (s * jnp.eye(3) + small.turning).T
        memory = jnp.zeros(n + 3, complex)
        if small.control is not None:
            memory = small.memory(jnp.where(speed == 0.0, 1j, s)) @ now[9:]
        return now, rate.reshape(12), memory[:n], s * memory[:n], memory[n:]

    over_orders = jax.vmap(one, (0, None, None, 0))
    moved = jax.vmap(over_orders, (None, 0, 0, 0))(
        orders_of(satellite.disturbance), small.slow.rotor_speed, phase, xi
    )
    return tuple(jnp.sum(part.real, axis=(0, 1)) for part in moved)


@eqx.filter_jit
def _jitter_squared(satellite, state, small, xi, chosen, base, turns):
    """What rates have beyond first order in some lines, at equally spaced angles of a turn.

    Lines without a common period have no steady product, so that rotors of each speed, and groups
    of their orders, are taken by themselves. Accelerations (12,) are along bus axes.

    Args:
        chosen: (cmg, order) which lines.
        base: the order whose turn it is.
        turns: number of angles.
    """
    quiet, orders = without_disturbance(satellite), orders_of(satellite.disturbance)
    disturbance = satellite.disturbance
    first = 0 if disturbance is None else disturbance.imbalance_at[0]
    same = chosen[:, first]  # order 2 is in the group of order 1
    satellite = _with_lines(quiet, disturbance, chosen)
    moments = ClusterMoments.expand(satellite.cluster)
    averaged = moments.averaged()
    speed, phase = _rotors(satellite, state)
    R_BN = quaternion_to_matrix(state.q_NB).T
    some = lambda all_: all_.at[..., 1:].multiply(same[:, None, None])  # noqa: E731
    kinds = lambda m: (m.c_H, m.J, m.H_gimbal)  # noqa: E731
    shaking = eqx.tree_at(kinds, moments, tuple(map(some, kinds(moments))))
    xi = jnp.where(chosen[..., None], xi, 0.0)
    s = 1j * speed[:, None] * orders
    spin = jax.vmap(jax.vmap(lambda s: s * jnp.eye(3) + small.turning))(s)
    xi_rate = jnp.einsum("joab,jocb->joca", spin, xi.reshape(*xi.shape[:2], 4, 3))
    xi_second = jnp.einsum("joab,jocb->joca", spin, xi_rate).reshape(xi.shape)

    def rates(satellite, state, phi, moments):
        signals, a = evaluate(satellite, jnp.zeros(()), state, phi, moments)
        u_rate = jnp.stack([a.v_P, a.w_P, a.v_B, a.w_B]) @ R_BN.T
        return u_rate.reshape(12), unit_acceleration(satellite, signals), signals.integral_rate

    def beyond(turn):
        phi = phase + turn / base * jnp.sign(speed)
        now = _motions(satellite, small, xi, phi)
        true = rates(satellite, _displaced(satellite, state, *now), phi, shaking)
        still = rates(quiet, state, phi, averaged)
        # first order: time derivatives of the motion
        turned = jnp.exp(1j * phi[:, None] * orders)[..., None]
        accelerations = jnp.sum((xi_second * turned).real, axis=(0, 1))
        changing = _motions(satellite, small, xi * s[..., None], phi)
        known = (accelerations, changing[3], changing[4])
        return tuple(t - still_ - k for t, still_, k in zip(true, still, known, strict=True))

    return jax.vmap(beyond)(2.0 * jnp.pi / turns * jnp.arange(turns))


TURNS = 16  # angles at least over which products of orders, up to 2 here, are averaged


def _with_lines(quiet, disturbance, chosen):
    """The satellite with some lines of its rotors' disturbance only, without noise."""
    if disturbance is None:
        return quiet
    coefficient = jnp.where(chosen[..., None], disturbance.coefficient, 0.0)
    lines = replace(disturbance, coefficient=coefficient)
    return without_noise(replace(quiet, disturbance=lines))


def _displaced(
    satellite: Satellite, state: State, pose, pose_rate, angle, angle_rate, integral
) -> State:
    """The state moved by small (r_P, theta_P, r_B, theta_B) along bus axes and by the others."""
    R_NB, R_NP = quaternion_to_matrix(state.q_NB), quaternion_to_matrix(state.q_NP)
    r_P, theta_P, r_B, theta_B = pose.reshape(4, 3) @ R_NB.T
    v_P, w_P, v_B, w_B = pose_rate.reshape(4, 3) @ R_NB.T

    def turned(q, R, theta):
        return quaternion_multiply(q, rotation_vector_to_quaternion(R.T @ theta))

    def rate(R, theta, theta_rate):
        """Body axes turn with theta, so that to second order half a vector product comes off."""
        return R.T @ (theta_rate - 0.5 * cross(theta, theta_rate))

    moved = with_units_moved(satellite, state, angle, angle_rate)
    return replace(
        moved,
        p_NB_N=state.p_NB_N + r_B,
        q_NB=turned(state.q_NB, R_NB, theta_B),
        p_NP_N=state.p_NP_N + r_P,
        q_NP=turned(state.q_NP, R_NP, theta_P),
        v_NB_N=state.v_NB_N + v_B,
        w_NB_B=state.w_NB_B + rate(R_NB, theta_B, w_B),
        v_NP_N=state.v_NP_N + v_P,
        w_NP_P=state.w_NP_P + rate(R_NP, theta_P, w_P),
        error_integral=state.error_integral + integral,
    )


def respond(
    satellite: Satellite,
    time: np.ndarray,
    states: State,
    view: View,
    progress: Callable[[float], None] | None = None,
) -> tuple[Jitter, int]:
    """Jitter along a slow motion, and for how many instants it was computed before Ctrl-C.

    Args:
        time: (n,) [s].
        states: of the slow motion, with time as the first axis.
    """
    along = _Along(satellite, time, states)
    amplitudes: dict[str, np.ndarray] = {}
    poses: list[np.ndarray] = []
    ripple: list[dict[str, np.ndarray]] = []
    looks = np.unique(np.linspace(0, len(time) - 1, LOOKS).astype(int))
    speeds = np.asarray(rotor_speeds(satellite, states))
    speeds = np.broadcast_to(speeds, (len(time), speeds.shape[-1]))
    bases: dict[int, Modes] = {}
    based = np.union1d(looks, _where_speeds_change(speeds))
    done = 0
    try:
        for start in range(0, len(time), INSTANTS):
            these = np.arange(start, min(start + INSTANTS, len(time)))
            values, xi, small = along.chunk(these, view)
            poses.append(xi)
            for name, value in values.items():
                whole = amplitudes.setdefault(
                    name, np.empty((len(time), *value.shape[1:]), value.dtype)
                )
                whole[these] = value
            if satellite.motor is not None:
                lines = ripple_lines(satellite, small, view)
                ripple.append({name: np.asarray(v)[: len(these)] for name, v in lines.items()})
            for base in np.intersect1d(based, these).tolist():
                bases[base] = Modes.of(_instant(small, base - start))
            done = int(these[-1]) + 1
            if progress is not None:
                progress(float(time[done - 1]))
    except KeyboardInterrupt:
        if not done:
            raise
    amplitudes = {name: value[:done] for name, value in amplitudes.items()}
    ripples = None
    if ripple:
        ripples = {name: np.concatenate([part[name] for part in ripple]) for name in ripple[0]}
    looked = {look: bases[look] for look in looks.tolist() if look < done}
    for look, modes in looked.items():
        refuse_resonance(satellite, f"at t = {time[look]:g} s", modes.eigenvalues, speeds[look])
    states = jax.tree.map(lambda leaf: np.asarray(leaf)[:done], states)
    orders = np.asarray(orders_of(satellite.disturbance))
    missing = transient(time[:done], np.concatenate(poses), speeds[:done], orders, bases, view)
    second = _second_order(satellite, amplitudes)
    missing = Transient(
        missing.bus_rate + second * _total(amplitudes["bus_rate"]),
        missing.line_of_sight + second[:, None] * _total(amplitudes["line_of_sight"]),
    )
    total = _total(amplitudes["bus_rate"])
    error = missing.bus_rate / np.where(total > 0.0, total, 1.0)
    said = []
    if error.size and np.max(error) > SLOW_CHANGE:
        worst = int(np.argmax(error))
        said.append(
            f"the operating point moves fast against the damping of the nearest mode, or a mode "
            f"still rings: at t = {time[worst]:.4g} s the jitter may be wrong by "
            f"{100 * error[worst]:.2g} % "
            f"of all lines' sum (estimated; above {100 * SLOW_CHANGE:g} % use method 'direct')"
        )
    last = looked[max(looked)]
    growing = _growing(last.eigenvalues, 1.0 / max(float(time[-1]), 1e-9))
    if growing:
        said.append(f"the slow motion is unstable: {growing}")
    if satellite.motor is not None:
        index = satellite.motor.modulation(
            satellite.cluster, jnp.asarray(states.gimbal_rate)[:done], satellite.servo.bandwidth
        )
        if np.max(index) > SLOW_CHANGE:
            said.append(
                f"the gimbal motors' ripple turns the gimbals by up to {np.max(index):.2g} rad of "
                "its own phase: the jitter that it causes may be wrong by as much (above "
                f"{SLOW_CHANGE:g} rad use method 'direct')"
            )
    noise = _broadband(satellite, looked, view)
    return Jitter(amplitudes, error, missing, tuple(said), ripples, noise), done


def _broadband(satellite, looked, view) -> Broadband | None:
    """Spectra of the response to noise at the looks, if there is noise."""
    if satellite.disturbance is None or not satellite.disturbance.noisy:
        return None
    instants = np.array(sorted(looked))
    modes = [looked[k] for k in instants.tolist()]
    small = jax.tree.map(lambda *each: np.stack(each), *(each.small for each in modes))
    eigenvalues = np.concatenate([each.eigenvalues for each in modes])
    return Broadband(instants, *noise_spectra(satellite, small, eigenvalues, view))


def _instant(small: Vibration, k: int) -> Vibration:
    """The equations at one instant of a chunk (NumPy)."""
    return jax.tree.map(lambda leaf: np.asarray(leaf)[k], small)


Chunk = tuple[dict[str, np.ndarray], np.ndarray, Vibration]


class _Along:
    """Responses at instants of a slow motion; the legs' linearisation sampled as far as needed."""

    def __init__(self, satellite: Satellite, time: np.ndarray, states: State):
        self.satellite, self.time, self.states = satellite, time, states
        speeds = np.unique(np.asarray(satellite.cluster.rotor_speed))
        self.one_speed = states.rotor is None and len(speeds) == 1
        self._sample_legs()

    def chunk(self, instants: np.ndarray, view: View) -> Chunk:
        """Complex amplitudes (instant, cmg, order, ...) and the equations that they solve.

        Of the equations there may be more than instants, as the last one is repeated.
        """
        t, states = self._at(instants, INSTANTS)
        legs = self._legs(instants)
        legs = np.concatenate([legs, np.repeat(legs[-1:], len(t) - len(legs), axis=0)])
        values, xi, small = _compiled_chunk(self.satellite, t, states, legs, view, self.one_speed)
        count = len(instants)
        return {k: np.asarray(v)[:count] for k, v in values.items()}, np.asarray(xi)[:count], small

    def _at(self, instants, size):
        """Time and states at instants, the last one repeated to a size that programs share."""
        padded = np.concatenate([instants, np.repeat(instants[-1:], size - len(instants))])
        return self.time[padded], jax.tree.map(lambda leaf: leaf[padded], self.states)

    def _sample_legs(self):
        """Linearise the legs where interpolation between neighbours would not do."""
        self.nodes = _nodes(_configuration(self.satellite, self.states), LEG_ERROR)
        rows = []
        for start in range(0, len(self.nodes), LEG_INSTANTS):
            these = self.nodes[start : start + LEG_INSTANTS]
            values = _compiled_legs(self.satellite, *self._at(these, LEG_INSTANTS))
            rows.append(np.asarray(values)[: len(these)])
        self.values = np.concatenate(rows)

    def _legs(self, instants):
        """The legs' coefficients at instants, interpolated."""
        if len(self.nodes) == 1:
            return np.repeat(self.values, len(instants), axis=0)
        right = np.clip(np.searchsorted(self.nodes, instants), 1, len(self.nodes) - 1)
        left = right - 1
        span = self.nodes[right] - self.nodes[left]
        part = ((instants - self.nodes[left]) / span)[:, None]
        return (1.0 - part) * self.values[left] + part * self.values[right]


def _configuration(satellite: Satellite, states: State) -> np.ndarray:
    """What the legs' equations depend on (n, 12): pose of the plate in the bus, and rates.

    In shares of a metre, a radian, and of the slowest rotor's speed (of at least 10 rad/s).
    """
    bus, plate = (Rotation.from_quat(np.roll(q, -1, axis=1)) for q in (states.q_NB, states.q_NP))
    speeds = np.abs(np.asarray(rotor_speeds(satellite, states)))
    slowest = max(np.min(speeds[speeds > 0.0], initial=1e3), 10.0)
    return np.concatenate(
        [
            bus.inv().apply(states.p_NP_N - states.p_NB_N),
            (bus.inv() * plate).as_rotvec(),
            np.asarray(states.w_NB_B) / slowest,
            np.asarray(states.w_NP_P) / slowest,
        ],
        axis=1,
    )


def _nodes(path: np.ndarray, error: float) -> np.ndarray:
    """Instants between which a path (n, m) is straight to ``error``, ends included, ascending.

    A function of the path that is as curved as the square of its length is then interpolated as
    well: a stretch is no longer than ``sqrt(8 error)``.
    """
    last = len(path) - 1
    nodes, open_ = {0, last}, [(0, last)]
    while open_:
        a, b = open_.pop()
        if b - a < 2:
            continue
        part = np.arange(1, b - a) / (b - a)
        straight = path[a] + part[:, None] * (path[b] - path[a])
        off = np.max(np.abs(path[a + 1 : b] - straight), axis=1)
        middle = a + 1 + int(np.argmax(off))
        if np.max(off) <= error:
            if np.max(np.abs(path[b] - path[a])) <= np.sqrt(8.0 * error):
                continue
            middle = (a + b) // 2
        nodes.add(middle)
        open_ += [(a, middle), (middle, b)]
    return np.array(sorted(nodes))


@eqx.filter_jit
def _compiled_legs(satellite, t, states):
    """The legs' coefficients as one row per instant."""
    averaged = ClusterMoments.expand(satellite.cluster).averaged()

    def one(t, state):
        return ravel_pytree(
            leg_coefficients(satellite, slow_motion(satellite, t, state, averaged))
        )[0]

    return jax.vmap(one)(t, states)


@eqx.filter_jit
def _compiled_chunk(satellite, t, states, legs, view, one_speed):
    moments = ClusterMoments.expand(satellite.cluster)
    averaged = moments.averaged()

    def one(t, state, row):
        slow = slow_motion(satellite, t, state, averaged)
        example = jax.eval_shape(lambda: leg_coefficients(satellite, slow))
        _, unravel = ravel_pytree(jax.tree.map(lambda leaf: jnp.zeros(leaf.shape), example))
        small = vibration(satellite, slow, moments, unravel(row))
        xi = rotor_response(satellite, small, moments, one_speed)
        s = 1j * slow.rotor_speed[:, None] * orders_of(satellite.disturbance)
        views = jax.vmap(jax.vmap(lambda s, x: linear_outputs(satellite, small, s, x, view)))
        return views(s, xi), xi, small

    return jax.vmap(one)(t, states, legs)


def refuse_resonance(
    satellite: Satellite, where: str, eigenvalues: np.ndarray, speeds: np.ndarray | None = None
) -> None:
    """Raise ResonanceError if an order of a rotor lies on an undamped mode.

    Args:
        where: which operating point, for the message.
        eigenvalues: of the controlled satellite [rad/s].
        speeds: (cmg,) of the rotors [rad/s], instead of the nominal ones.
    """
    given = satellite.cluster.rotor_speed if speeds is None else speeds
    for j, speed in enumerate(np.asarray(given)):
        for h in np.asarray(orders_of(satellite.disturbance)):
            distance = np.min(np.abs(1j * h * speed - eigenvalues))
            if speed != 0.0 and distance < ON_A_MODE * abs(h * speed):
                raise ResonanceError(
                    f"order {h:g} of rotor {j} ({abs(h * speed) / (2 * np.pi):.6g} Hz) lies on an "
                    f"undamped mode of the satellite {where}: the steady jitter would be "
                    "infinite. Give the struts damping, or change the rotor's speed"
                )


def _total(amplitudes: np.ndarray) -> np.ndarray:
    """Lengths of vectors (n, cmg, order, ..., axis), summed over all lines."""
    return np.sum(np.linalg.norm(amplitudes, axis=-1), axis=(1, 2))


def _second_order(satellite: Satellite, amplitudes: dict[str, np.ndarray]) -> np.ndarray:
    """Share (n,) of the jitter that what is of second order in it may have.

    As much as the jitter changes the geometry that its equations are linear about: strokes over
    the legs' lengths, and turns.
    """
    stroke = np.sum(np.abs(amplitudes["leg_stroke"]), axis=(1, 2))
    turn = _total(amplitudes["bus_attitude"])
    return np.max(stroke / np.asarray(satellite.legs.nominal_length), axis=1) + turn


def _where_speeds_change(speeds: np.ndarray) -> np.ndarray:
    """Instants between which no rotor's speed (n, cmg) changes by much of the largest, ascending.

    None where speeds stay.
    """
    largest = np.max(np.abs(speeds)) or 1.0
    way = np.append(0.0, np.cumsum(np.max(np.abs(np.diff(speeds, axis=0)), axis=1)))
    step = max(SPEED_STEP * largest, way[-1] / MOST_BASES)
    return np.unique((way / step).astype(int), return_index=True)[1]


def _growing(eigenvalues: np.ndarray, least: float) -> str:
    """The fastest growing mode in words, or nothing if none grows faster than ``least`` [1/s]."""
    fastest = eigenvalues[np.argmax(eigenvalues.real)]
    if fastest.real <= max(least, 1e-9 * np.max(np.abs(eigenvalues))):
        return ""
    return (
        f"a mode at {abs(fastest.imag) / (2 * np.pi):.4g} Hz grows, e-fold in "
        f"{1 / fastest.real:.3g} s"
    )
