"""The direct solver: the nonlinear equations in time, every rotor turn resolved.

Diffrax with error control, and with steps that resolve the fastest line. In pieces, so that
progress can be shown, a run can be stopped, and the step sequence does not depend on the output
rate. The harmonic solver's slow motion is integrated here too, with the imbalance averaged over the
rotors' turns.
"""

from collections.abc import Callable
from dataclasses import dataclass

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from quietbus.dynamics.closed_loop import state_rate, tidy
from quietbus.dynamics.outputs import Outputs, geometry_margin, outputs
from quietbus.dynamics.state import State
from quietbus.model.satellite import Satellite
from quietbus.programs import compiled
from quietbus.solve.integrator import diffeqsolve
from quietbus.solve.resolved_steps import ResolvingController, fastest_line

STEPS_PER_CALL = 4096  # at the most, so that a stiff run too can be watched and stopped
SAME_INSTANT = 1e-9  # [s] instants closer than this are one


@dataclass(frozen=True)
class Tolerances:
    """Error control of the integrator, on the root mean square over the state in SI units."""

    relative: float = 1e-8
    absolute: float = 1e-10


@dataclass(frozen=True)
class Scheme:
    """What is integrated and how."""

    averaged: bool = False  # the imbalance averaged over the rotors' turns
    solver: type[diffrax.AbstractSolver] = diffrax.Dopri8
    piece: float = 1.0  # [s] integrated between two looks at the clock
    joint_forces: bool = False  # among the outputs
    states: bool = False  # kept beside the outputs


SLOW = Scheme(averaged=True, solver=diffrax.Tsit5, piece=25.0, states=True)


@dataclass(frozen=True)
class Solution:
    """A run, whole or up to where it stopped."""

    time: np.ndarray  # (n,) [s]
    outputs: Outputs  # NumPy arrays with time as the first axis
    states: State | None  # likewise, if asked for
    final: State  # at the end of the last whole piece
    steps: int
    rejected: int
    stopped: str | None  # why the run ended early, None if it did not
    interrupted: bool  # the user stopped it


@dataclass(frozen=True)
class Reached:
    """How far a run has come, and all that is needed to go on as if it had never stopped."""

    time: float  # [s] at the end of a whole piece
    step: float  # [s] to try next
    state: State
    steps: int
    rejected: int
    kept: tuple[Outputs, State | None]  # at the output instants before, time as the first axis


def integrate(
    satellite: Satellite,
    initial: State,
    duration: float,
    output_rate: float,
    tolerances: Tolerances | None = None,
    scheme: Scheme | None = None,
    progress: Callable[[float], None] | None = None,
    keep: Callable[[Reached], None] | None = None,
    start: Reached | None = None,
) -> Solution:
    """Integrate from t = 0 to ``duration`` [s], with outputs every 1/``output_rate`` [Hz].

    A run that diverges or leaves the legs' geometry, and one that the user interrupts, returns
    what it has computed and says why it stopped.

    Args:
        progress: called with the time reached [s] after every piece.
        keep: called before that with what has been reached.
        start: what an earlier run with the same arguments had reached, to go on from there.
    """
    tolerances, scheme = tolerances or Tolerances(), scheme or Scheme()
    count = int(np.floor(duration * output_rate * (1.0 + 1e-12))) + 1
    time = np.arange(count) / output_rate
    finish = max(duration, time[-1])  # the last instant may lie a rounding past the duration
    # a power of two, so that output rates share compiled programs
    size = max(64, 1 << (int(np.ceil(scheme.piece * output_rate)) + 1).bit_length())
    store: list[np.ndarray] = []
    state, t, done = initial, 0.0, 0
    steps = rejected = 0
    step = 1e-4
    if start is not None:
        state, t, step = start.state, start.time, start.step
        steps, rejected = start.steps, start.rejected
        before, structure = jax.tree.flatten(start.kept)
        done = len(before[0])
        store = _room(count, before)
    stopped, interrupted = None, False
    try:
        while t < finish and not stopped:
            end = _end_of_piece(t, finish, scheme.piece)
            last = np.searchsorted(time, end, side="right" if end == finish else "left")
            due = time[done:last]
            ts = np.full(size, end)
            ts[: len(due)] = due
            piece = _piece(satellite, state, t, end, step, ts, tolerances, scheme)
            leaves, structure = jax.tree.flatten(piece.kept)
            arrays = [np.asarray(leaf) for leaf in leaves]
            store = store or _room(count, [leaf[:0] for leaf in arrays])
            valid = int(np.sum(np.asarray(piece.valid)[: len(due)]))
            for whole, part in zip(store, arrays, strict=True):
                whole[done : done + valid] = part[:valid]
            done += valid
            steps, rejected = steps + int(piece.steps), rejected + int(piece.rejected)
            stopped = _reason(piece)
            if not stopped:
                reached = float(piece.time_reached)
                step = 0.9 * (reached - t) / max(int(piece.steps) - int(piece.rejected), 1)
                state, t = piece.final, reached
                if keep is not None:
                    kept = jax.tree.unflatten(structure, [whole[:done] for whole in store])
                    keep(Reached(t, step, state, steps, rejected, kept))
                if progress is not None:
                    progress(t)
    except KeyboardInterrupt:
        stopped, interrupted = f"interrupted by the user at t = {t:g} s", True
    if not store:
        raise KeyboardInterrupt
    reported, states = jax.tree.unflatten(structure, [whole[:done] for whole in store])
    return Solution(time[:done], reported, states, state, steps, rejected, stopped, interrupted)


def _room(count: int, before: list[np.ndarray]) -> list[np.ndarray]:
    """Arrays for all output instants, the first of them filled."""
    room = [np.empty((count, *part.shape[1:])) for part in before]
    for whole, part in zip(room, before, strict=True):
        whole[: len(part)] = part
    return room


def _end_of_piece(t: float, finish: float, piece: float) -> float:
    """The end of the piece begun, or the finish where little would be left after that."""
    end = piece * (np.floor(t / piece + SAME_INSTANT) + 1.0)
    return finish if end > finish - 1e-6 else float(end)


class _Piece(eqx.Module):
    kept: tuple[Outputs, State | None]
    valid: Array  # which output instants were reached
    final: State
    time_reached: Float[Array, ""]
    margin: Float[Array, ""]
    sound: Array  # the end or the allowed number of steps was reached, with finite values
    steps: Array
    rejected: Array


def _piece(satellite, state, t0, t1, step, ts, tolerances, scheme) -> _Piece:
    numbers = (t0, t1, step, ts, tolerances.relative, tolerances.absolute)
    # of one type: Python's numbers and NumPy's would each have a program traced
    arrays = tuple(jnp.asarray(number, dtype=float) for number in numbers)
    return jax.block_until_ready(_compiled_piece(satellite, state, arrays, scheme))


@compiled
def _compiled_piece(satellite, state, numbers, scheme) -> _Piece:
    t0, t1, step, ts, rtol, atol = numbers
    satellite = satellite.averaged() if scheme.averaged else satellite.prepared()
    y0, unravel = ravel_pytree(state)

    @jax.jit  # traced once for the integrator's many uses of it
    def rate(t, y, args):  # noqa: ARG001
        return ravel_pytree(state_rate(satellite, t, unravel(y)))[0]

    def left_geometry(t, y, args, **kwargs):  # noqa: ARG001
        return geometry_margin(satellite, unravel(y)) <= 0.0

    # the slow motion's steps are as long as the solver's stability lets them be: a steadier
    # controller wastes fewer there
    pcoeff, icoeff = (0.2, 0.3) if scheme.averaged else (0.0, 1.0)
    controller: diffrax.AbstractAdaptiveStepSizeController = diffrax.PIDController(
        rtol=rtol, atol=atol, pcoeff=pcoeff, icoeff=icoeff, dtmin=1e-9, force_dtmin=False
    )
    if not scheme.averaged:
        line = fastest_line(satellite, unravel)
        controller = ResolvingController(controller, line)
    finish = t1
    corners = [element.corners() for element in satellite.elements]
    if sum(len(corner) for corner in corners):
        jumps = _apart(jnp.sort(jnp.concatenate(corners)), t0, t1)
        # the last stage of the last step must not see what lies beyond a corner at the end
        finish = jnp.where(jnp.any(jumps == t1), jnp.nextafter(t1, t0), t1)
        jumps = jnp.where(jumps == t1, jnp.inf, jumps)
        controller = diffrax.ClipStepSizeController(controller, jump_ts=jumps)
    solution = diffeqsolve(
        diffrax.ODETerm(rate),
        scheme.solver(),
        t0,
        finish,
        jnp.minimum(step, finish - t0),
        y0,
        saveat=diffrax.SaveAt(
            subs=[diffrax.SubSaveAt(ts=jnp.minimum(ts, finish)), diffrax.SubSaveAt(t1=True)]
        ),
        stepsize_controller=controller,
        event=diffrax.Event(left_geometry),
        adjoint=diffrax.ForwardMode(),
        max_steps=STEPS_PER_CALL,
        throw=False,
    )
    saved, (last,) = solution.ys
    time_reached = jnp.where(solution.ts[1][0] == finish, t1, solution.ts[1][0])
    valid = (ts <= time_reached) & jnp.all(jnp.isfinite(saved), axis=1)
    ended = (solution.result == diffrax.RESULTS.successful) | (
        solution.result == diffrax.RESULTS.max_steps_reached
    )
    states = jax.vmap(lambda y: tidy(unravel(y)))(saved)
    reported = jax.vmap(lambda t, s: outputs(satellite, t, s, scheme.joint_forces))(ts, states)
    final = tidy(unravel(last))
    return _Piece(
        kept=(reported, states if scheme.states else None),
        valid=valid,
        final=final,
        time_reached=time_reached,
        margin=geometry_margin(satellite, final),
        sound=ended & jnp.all(jnp.isfinite(last)) & (time_reached > t0),
        steps=solution.stats["num_steps"],
        rejected=solution.stats["num_rejected_steps"],
    )


def _apart(jumps, t0, t1):
    """Sorted corners with those at one instant made equal, so that no step is vanishingly short."""
    previous = jnp.concatenate([jnp.full(1, -jnp.inf), jumps[:-1]])
    jumps = jnp.where(jumps - previous < SAME_INSTANT, previous, jumps)
    for end in (t0, t1):
        jumps = jnp.where(jnp.abs(jumps - end) < SAME_INSTANT, end, jumps)
    return jumps


def _reason(piece: _Piece) -> str | None:
    """Why a piece ended before its time, in words for the user."""
    t = float(piece.time_reached)
    if bool(piece.sound):
        return None
    bus = piece.final.bus
    others = "".join(
        f", {name} {_show(body.p_NX_N - bus.p_NX_N)} m from the bus"
        for name, body in piece.final.bodies.items()
        if body is not bus
    )
    driven = "".join(
        f", {name} driven at {_show(own.y_rate)} rad/s"
        for name, own in piece.final.own.items()
        if len(own.y)
    )
    where = f"at t = {t:.6g} s, bus rate {_show(bus.w_NX_X)} rad/s{others}{driven}"
    if float(piece.margin) <= 0.0:
        return (
            f"a leg reached the end of its geometry (length near zero, or a universal joint in "
            f"line with its leg) {where}. Likely: struts too soft for the load, or an unstable loop"
        )
    return (
        f"the motion diverged: the step size fell below 1e-9 s or a value was not finite, {where}. "
        "Likely: an unstable control loop (see `quietbus analyze`), a singular cluster with "
        "steering by pseudo_inverse, or a strut that the tolerances cannot resolve"
    )


def _show(vector) -> str:
    return "[" + ", ".join(f"{value:.4g}" for value in np.asarray(vector)) + "]"
