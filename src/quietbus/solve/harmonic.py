"""The harmonic solver: the slow motion in time, and at every instant the steady jitter about it.

The slow motion is integrated with the rotors' imbalance averaged over their turns. At each output
instant the response to every order of every rotor follows from one complex linear solve with the
equations of small vibration about the slow motion (``solve.along``).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import jax
import numpy as np

from quietbus.dynamics.disturbance_response import ripple_lines, ripple_orders
from quietbus.dynamics.rotor_response import orders_of
from quietbus.dynamics.state import State
from quietbus.dynamics.views import NOTHING_SEEN, View
from quietbus.model.satellite import Satellite
from quietbus.solve.along import INSTANTS, Along, at_one, instant
from quietbus.solve.direct import SLOW, Reached, Scheme, Solution, Tolerances, integrate
from quietbus.solve.noise import Broadband, noise_spectra, noisy
from quietbus.solve.periodic import without_jitter
from quietbus.solve.transient import Modes, Transient, transient
from quietbus.solve.validity import (
    SLOW_CHANGE,
    growing,
    refuse_resonance,
    ripple_said,
    second_order,
    total,
    where_speeds_change,
)

TOLERANCES = Tolerances(1e-7, 1e-9)  # of the slow motion
LOOKS = 8  # instants at the most at which the modes are computed


@dataclass(frozen=True)
class Jitter:
    """Steady response to each order of each rotor along a motion.

    A deviation is ``Re(sum amplitude * exp(1j * h * phi))`` over rotors and orders, where
    phi is the slow motion's rotor angle.
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
    jitter, done = respond(satellite, slow, view, second)
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
    small, _ = at_one(satellite, slow.final, slow.time[-1])
    return growing(np.linalg.eigvals(small.state_matrix()), 0.0)


def respond(
    satellite: Satellite,
    slow: Solution,
    view: View,
    progress: Callable[[float], None] | None = None,
) -> tuple[Jitter, int]:
    """Jitter along a slow motion, and for how many instants it was computed before Ctrl-C.

    Args:
        slow: the motion, with its states.
    """
    time, states = slow.time, slow.states
    assert states is not None
    along = Along(satellite, time, states)
    amplitudes: dict[str, np.ndarray] = {}
    poses: list[np.ndarray] = []
    ripple: list[dict[str, np.ndarray]] = []
    looks = np.unique(np.linspace(0, len(time) - 1, LOOKS).astype(int))
    speeds = np.asarray(slow.outputs["rotor_speed"])
    ripples_there = len(ripple_orders(satellite)) > 0
    bases: dict[int, Modes] = {}
    based = np.union1d(looks, where_speeds_change(speeds))
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
            if ripples_there:
                lines = ripple_lines(satellite, small, view)
                ripple.append({name: np.asarray(v)[: len(these)] for name, v in lines.items()})
            for base in np.intersect1d(based, these).tolist():
                bases[base] = Modes.of(instant(small, base - start))
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
    orders = np.array(orders_of(satellite))
    missing = transient(
        satellite, time[:done], np.concatenate(poses), speeds[:done], orders, bases, view
    )
    second = second_order(satellite, amplitudes)
    missing = Transient(
        missing.bus_rate + second * total(amplitudes["bus_rate"]),
        missing.line_of_sight + second[:, None] * total(amplitudes["line_of_sight"]),
    )
    sizes = total(amplitudes["bus_rate"])
    error = missing.bus_rate / np.where(sizes > 0.0, sizes, 1.0)
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
    grows = growing(last.eigenvalues, 1.0 / max(float(time[-1]), 1e-9))
    if grows:
        said.append(f"the slow motion is unstable: {grows}")
    said += ripple_said(satellite, np.asarray(slow.outputs["gimbal_rate"])[:done])
    noise = _broadband(satellite, looked, view)
    return Jitter(amplitudes, error, missing, tuple(said), ripples, noise), done


def _broadband(satellite, looked, view) -> Broadband | None:
    """Spectra of the response to noise at the looks, if there is noise."""
    if not noisy(satellite):
        return None
    instants = np.array(sorted(looked))
    modes = [looked[k] for k in instants.tolist()]
    small = jax.tree.map(lambda *each: np.stack(each), *(each.small for each in modes))
    eigenvalues = np.concatenate([each.eigenvalues for each in modes])
    return Broadband(instants, *noise_spectra(satellite, small, eigenvalues, view))
