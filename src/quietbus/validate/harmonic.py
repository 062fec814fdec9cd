"""The rotors' lines: the harmonic solver and `jitter` against flights of the reference."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from quietbus.analysis.jitter.lines import AT_REST, rest_error, steady_jitter_once
from quietbus.dynamics.rotor_response import orders_of
from quietbus.dynamics.state import State
from quietbus.dynamics.vibration import Vibration
from quietbus.model.body import body_quantities
from quietbus.model.gimbal_motor import SmoothMotor
from quietbus.model.rotors import RunUp
from quietbus.model.satellite import BUS, Satellite
from quietbus.programs import compiled_for_few_runs
from quietbus.reference.platforms import blocks
from quietbus.reference.units import unit_data
from quietbus.solve.direct import SLOW, Tolerances
from quietbus.solve.harmonic import HarmonicSolution, integrate_harmonic
from quietbus.solve.periodic import on_periodic_solution
from quietbus.solve.validity import ResonanceError
from quietbus.validate.flight import SAMPLES, Flight, ended
from quietbus.validate.subject import Check, Subject, apart
from quietbus.validate.translate import motion_of, state_of

SMALL = 1e-9  # [rad] turn of the bus by all lines: what is of second order does not count
TURNS = 8  # of the slowest rotor
TIGHT = Tolerances(1e-10, 1e-14)  # of the slow motion
SLOPPY = 0.05  # share of the lines by which a moving satellite's may be off


def check_harmonic(subject: Subject, flight: Flight) -> list[Check]:
    """A run in motion, and the lines at rest; nothing where no rotor has lines."""
    at_rest, piece = subject.changed(_rest), float(flight.times[-1])
    amplitudes, _ = _jitter(at_rest)
    turn = _size(amplitudes["bus_attitude"][None])
    if turn == 0.0:
        return []
    small = at_rest.changed(lambda data: _scale(data, SMALL / turn if np.isfinite(turn) else 1.0))
    try:
        checks = _at_rest(small, piece, subject.scenario.initial.steady)
        # ripple is no line of a rotor, and lines of rotors that run up begin with nothing
        if all(
            isinstance(cluster.motor, SmoothMotor) and not isinstance(cluster.rotors, RunUp)
            for cluster in subject.satellite.clusters
        ):
            start = state_of(subject.satellite, flight.start)
            run = _run(subject.satellite, start, piece, piece)
            checks.insert(0, _in_motion(subject, flight, run))
    except ResonanceError:
        return []
    return checks


def _in_motion(subject: Subject, flight: Flight, run: HarmonicSolution) -> Check:
    error = np.nan
    if not ended(run.slow, len(flight.times)):
        name = body_quantities(BUS)["rate"].name
        amplitude = run.jitter.amplitudes[name]
        lines = _in_time(subject.satellite, flight.times, run.slow.states, amplitude)
        theirs = np.array([motion.w_NX_X[0] for motion in flight.theirs])
        off = np.asarray(run.slow.outputs[name]) + lines - theirs
        error = float(np.max(np.linalg.norm(off, axis=1)) / _size(amplitude))
    return Check(
        "harmonic run",
        "the same flight by the harmonic solver, slow motion and lines put together: the bus "
        "rate, relative to the lines; the bound contains the run's own estimate of its error",
        error,
        SLOPPY + float(np.max(run.jitter.change_error)),
    )


def _at_rest(subject: Subject, piece: float, steady: bool) -> list[Check]:
    """From rest: slow motion by the harmonic solver, lines by `jitter`.

    Args:
        piece: how long the run in motion is [s]; as its pieces are, its program serves.
        steady: start with the lines' own motion, so that they cause no transient.
    """
    satellite, reference = subject.satellite, subject.reference
    amplitudes, small = _jitter(subject)
    if not rest_error(small) <= AT_REST:
        return []
    speed = np.abs(reference.mechanism.units.speed)
    rate = SAMPLES / piece
    count = int(np.ceil(rate * TURNS * 2.0 * np.pi / np.min(speed[speed > 0.0])))
    times = np.arange(count + 1) / rate
    start = reference.initial()
    run = _run(satellite, state_of(satellite, start), times[-1], piece, steady)
    if steady:
        start = motion_of(
            satellite, 0.0, on_periodic_solution(satellite, state_of(satellite, start))
        )
    motions = reference.fly(start, times, 1e-10, 1e-16)
    theirs = {
        body_quantities(body.name)["rate"].name: np.array([m.w_NX_X[number] for m in motions])
        for number, body in enumerate(satellite.bodies)
    }
    error = np.nan
    if not ended(run.slow, len(times)):
        ours = {}
        for name in theirs:
            constant = np.broadcast_to(amplitudes[name], (len(times), *amplitudes[name].shape))
            lines = _in_time(satellite, times, run.slow.states, constant)
            ours[name] = np.asarray(run.slow.outputs[name]) + lines
        error = apart(theirs, ours)
    return [
        Check(
            "lines from rest",
            f"lines of `jitter`{'' if steady else ' and the transient that they cause'}, against "
            f"{TURNS} turns flown with MuJoCo, control on: rates of all bodies, imbalance scaled "
            "until it counts to first order only",
            error,
            1e-4,
        )
    ]


def _run(
    satellite: Satellite, start: State, duration: float, piece: float, steady: bool = False
) -> HarmonicSolution:
    """Sampled SAMPLES times in a piece, which keeps the program small."""
    return integrate_harmonic(
        satellite,
        start,
        duration,
        SAMPLES / piece,
        steady=steady,
        tolerances=TIGHT,
        scheme=replace(SLOW, piece=piece),
    )


def _in_time(
    satellite: Satellite, times: np.ndarray, states: State | None, amplitude: np.ndarray
) -> np.ndarray:
    """Sum of all lines (n, axis) for amplitudes (n, cmg, order, axis)."""
    assert states is not None
    phi = np.asarray(_rotor_angles(satellite, jnp.asarray(times), states))
    turned = np.exp(1j * phi[:, :, None] * np.asarray(orders_of(satellite)))
    return np.sum((amplitude * turned[..., None]).real, axis=(1, 2))


@compiled_for_few_runs
def _rotor_angles(satellite, times, states):
    def at(t, state):
        return jnp.concatenate([c.at(t, state.own).rotor.angle for c in satellite.clusters])

    return jax.vmap(at)(times, states)


def _size(amplitude: np.ndarray) -> float:
    """Largest norm of the sum of all lines' amplitudes (n, cmg, order, axis)."""
    return float(np.max(np.linalg.norm(np.sum(np.abs(amplitude), axis=(1, 2)), axis=-1)))


def _jitter(subject: Subject) -> tuple[dict[str, np.ndarray], Vibration]:
    """Amplitudes (cmg, order, ...) at rest, and the equations that they solve."""
    angle = jnp.asarray(subject.reference.mechanism.units.gimbal_angle)
    amplitudes, small = steady_jitter_once(subject.satellite, angle)
    return {name: np.asarray(each) for name, each in amplitudes.items()}, small


def _rest(data: dict[str, Any]) -> None:
    """Let a scenario's satellite rest at its target.

    Loads, guidance and run-up stay, doing nothing, so that programs do.
    """
    for load in data["loads"]:
        load["force"] = load["torque"] = [0.0] * 3
    data["initial"] = {"attitude": [0.0] * 3, "rate": [0.0] * 3, "steady": False}
    data["target"]["attitude"] = [0.0] * 3
    for block in blocks(data):
        cluster: Any = block.data
        cluster.pop("gimbal_motor", None)
        if "run_up" in cluster:
            speeds = [unit["rotor"]["speed"] for unit in unit_data(cluster)]
            cluster["run_up"].update(initial_speed=speeds, final_speed=speeds)


def _scale(data: dict[str, Any], scale: float) -> None:
    """Scale the lines of all rotors."""
    clusters = [block.data for block in blocks(data)]
    units = [unit for cluster in clusters for unit in cluster.get("units", [])]
    for rotor in [each["rotor"] for each in [*clusters, *units] if "rotor" in each]:
        for lines in [rotor, *((rotor.get("disturbance") or {}).get("orders") or [])]:
            for key in _LINES.intersection(lines):
                lines[key] *= scale


_LINES = {"static_imbalance", "dynamic_imbalance", "radial_force", "axial_force"}
_LINES |= {"radial_torque", "axial_torque"}
