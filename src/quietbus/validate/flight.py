"""The same flight by both programs: direct solver and conservation laws."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.dynamics.invariants import (
    angular_momentum_N,
    energy,
    kinetic_energy,
    linear_momentum_N,
)
from quietbus.dynamics.state import State
from quietbus.model.body import body_quantities
from quietbus.model.disturbance import quiet_rotors
from quietbus.model.satellite import BUS, Satellite
from quietbus.model.variants import with_clusters, without_disturbance
from quietbus.programs import compiled_for_few_runs
from quietbus.reference.motion import Motion
from quietbus.solve.direct import Scheme, Solution, Tolerances, integrate
from quietbus.validate.subject import Check, Subject, apart
from quietbus.validate.trajectory import fly, lossless
from quietbus.validate.translate import holding_legs, state_of

TOLERANCES = Tolerances(1e-11, 1e-13)
SAMPLES = 20  # beside the start
MOTION = {"position": "p_NX_N", "velocity": "v_NX_N", "attitude": "q_NX", "rate": "w_NX_X"}


@dataclass(frozen=True)
class Flight:
    """Both programs' flights from one start; times from 0."""

    start: Motion
    times: np.ndarray  # (n,) [s]
    theirs: list[Motion]
    ours: Solution


def ended(solution: Solution, count: int) -> str:
    """Why a solution does not have this many instants, or nothing if it does."""
    found = len(solution.time)
    return solution.stopped or ("" if found == count else f"{found} of {count} instants computed")


def fly_both(subject: Subject, start: Motion, duration: float) -> Flight:
    """Fly the scenario, as it is, from a start."""
    ours = _direct(subject.satellite, state_of(subject.satellite, start), duration)
    times = np.arange(SAMPLES + 1) * (duration / SAMPLES)
    return Flight(start, times, subject.reference.fly(start, times), ours)


def _direct(satellite: Satellite, state: State, duration: float) -> Solution:
    # in pieces, as longer runs are
    scheme = Scheme(piece=duration / 2.5, states=True, joint_forces=True)
    return integrate(satellite, state, duration, SAMPLES / duration, TOLERANCES, scheme)


def check_flight(subject: Subject, flight: Flight) -> Check:
    """Everything that a run of the direct solver reports."""
    reference, satellite = subject.reference, subject.satellite
    at = [reference.at(t, m) for t, m in zip(flight.times, flight.theirs, strict=True)]
    moved = {name: np.array([vars(m)[name] for m in flight.theirs]) for name in vars(at[0].rates)}
    theirs = {
        "gimbal_angle": moved["gimbal_angle"],
        "gimbal_rate": moved["gimbal_rate"],
        "rotor_angle": moved["rotor_angle"],
        "rotor_speed": moved["rotor_speed"],
        "control_torque": np.array([i.decisions.torque for i in at]),
        "attitude_error": np.array([i.decisions.attitude_error for i in at]),
        "singularity_measure": np.array([[i.decisions.singularity] for i in at]),
    }
    legs = holding_legs(satellite)
    if np.any(legs):  # others' struts do not move
        theirs["leg_stroke"] = np.array([i.stroke[legs] for i in at])
        theirs["leg_force"] = np.array([i.strut_force[legs] for i in at])
    if not satellite.steady:
        theirs["rotor_torque"] = np.array([i.rotor_torque for i in at])
    if at[0].joints is not None:
        for name in ("spherical_force", "universal_force"):
            theirs[name] = np.array([vars(i.joints)[name] for i in at])
    quantities = {body.name: body_quantities(body.name) for body in satellite.bodies}
    for number, each in enumerate(quantities.values()):
        theirs |= {each[kind].name: moved[field][:, number] for kind, field in MOTION.items()}
    error, early = np.nan, ended(flight.ours, len(flight.times))
    if not early:
        ours = {name: np.asarray(flight.ours.outputs[name]) for name in theirs}
        ours["singularity_measure"] = ours["singularity_measure"][:, None]
        for name in ("leg_stroke", "leg_force"):
            if name in ours:
                ours[name] = ours[name][:, legs]
        for name, each in quantities.items():
            attitude, place = each["attitude"].name, each["position"].name
            same = np.sign(np.sum(ours[attitude] * theirs[attitude], axis=1, keepdims=True))
            ours[attitude] = same * ours[attitude]
            if name != BUS:
                for found in (theirs, ours):
                    found[place] = found[place] - found[quantities[BUS]["position"].name]
        error = apart(theirs, ours, 1e-9)
    said = f"; ended: {early}" if early else ""
    return Check(
        "flight",
        f"{flight.times[-1]:.2g} s of the scenario from a kicked start, every output of a "
        "direct run against MuJoCo's equations flown by SciPy: control, gimbals, loads as they "
        f"are{said}",
        error,
        1e-8,
    )


def check_momentum(subject: Subject, flight: Flight) -> list[Check]:
    """Linear and angular momentum of a flight under control, without loads."""
    satellite, ours = subject.satellite, flight.ours
    free = with_clusters(satellite, lambda c: replace(c, disturbance=quiet_rotors(c.count)))
    free = replace(free, others=tuple(e for e in satellite.others if not e.external))
    changed = jax.tree.structure(free) != jax.tree.structure(satellite)  # type: ignore[operator]
    if changed:
        ours = _direct(free, state_of(free, flight.start), float(flight.times[-1]))

    def both(*arguments):
        return jnp.stack([linear_momentum_N(*arguments), angular_momentum_N(*arguments)])

    error = np.full(2, np.nan)
    if not ended(ours, len(flight.times)):
        assert ours.states is not None
        values = over_time(both, free, flight.times, ours.states)
        drift = np.max(np.linalg.norm(values - values[0], axis=2), axis=0)
        error = drift / np.linalg.norm(values[0], axis=1)
    compares = f"sum over all bodies in {flight.times[-1]:.2g} s, control as it is, no loads"
    return [
        Check(name, compares, float(one), 1e-9)
        for name, one in zip(("linear momentum", "angular momentum"), error, strict=True)
    ]


def check_energy(subject: Subject, flight: Flight) -> Check:
    """Energy of a flight without damping, friction, rotor and gimbal motion."""
    start = flight.start
    locked = lossless(without_disturbance(subject.satellite))
    still = replace(start, gimbal_rate=0.0 * start.gimbal_rate)
    states = fly(locked, state_of(locked, still), jnp.asarray(flight.times))
    found = over_time(_energy, locked, flight.times, states)
    return Check(
        "energy",
        "damping and friction off, CMGs locked: sum over all bodies and springs in "
        f"{flight.times[-1]:.2g} s, no loads",
        float(np.max(np.abs(found - found[0])) / found[0]),
        1e-9,
    )


def _energy(satellite: Satellite, t: Float[Array, ""], state: State) -> Array:
    return kinetic_energy(satellite, t, state) + energy(satellite, t, state).stored


def over_time(
    quantity: Callable[[Satellite, Array, State], Array],
    satellite: Satellite,
    times: np.ndarray,
    states: State,
) -> np.ndarray:
    """A function of satellite, time and state at every time of a flight."""
    return np.asarray(_over_time(quantity, satellite, jnp.asarray(times), states))


@compiled_for_few_runs
def _over_time(quantity, satellite, times, states):
    return jax.vmap(lambda t, state: quantity(satellite, t, state))(times, states)
