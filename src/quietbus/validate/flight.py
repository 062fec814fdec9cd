"""The same flight by both programs: direct solver and conservation laws."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from quietbus.dynamics.closed_loop import rotor_angles
from quietbus.dynamics.invariants import (
    angular_momentum_N,
    kinetic_energy,
    linear_momentum_N,
    strut_energy,
)
from quietbus.dynamics.state import State
from quietbus.model.satellite import Satellite
from quietbus.model.variants import without_disturbance
from quietbus.reference.motion import Motion
from quietbus.solve.direct import Scheme, Solution, Tolerances, integrate
from quietbus.validate.subject import Check, Subject, apart
from quietbus.validate.trajectory import fly, lossless
from quietbus.validate.translate import BUS, PLATE, state_of

TOLERANCES = Tolerances(1e-11, 1e-13)
SAMPLES = 20  # beside the start


@dataclass(frozen=True)
class Flight:
    """Both programs' flights from one start; times from 0."""

    start: State
    times: np.ndarray  # (n,) [s]
    theirs: list[Motion]
    ours: Solution


def ended(solution: Solution, count: int) -> str:
    """Why a solution does not have this many instants, or nothing if it does."""
    found = len(solution.time)
    return solution.stopped or ("" if found == count else f"{found} of {count} instants computed")


def fly_both(subject: Subject, start: Motion, duration: float) -> Flight:
    """Fly the scenario, as it is, from a start."""
    state = state_of(subject.satellite, start)
    ours = _direct(subject.satellite, state, duration)
    times = np.arange(SAMPLES + 1) * (duration / SAMPLES)
    return Flight(state, times, subject.reference.fly(start, times), ours)


def _direct(satellite: Satellite, state: State, duration: float) -> Solution:
    # in pieces, as longer runs are
    piece = duration / 2.5
    scheme = Scheme(piece=piece, states=True, joint_forces=satellite.mount == "isolated")
    return integrate(satellite, state, duration, SAMPLES / duration, TOLERANCES, scheme)


def check_flight(subject: Subject, flight: Flight) -> Check:
    """Everything that a run of the direct solver reports."""
    reference = subject.reference
    at = [reference.at(t, m) for t, m in zip(flight.times, flight.theirs, strict=True)]
    moved = {name: np.array([vars(m)[name] for m in flight.theirs]) for name in vars(at[0].rates)}
    theirs = {
        "bus_position": moved["p_NX_N"][:, BUS],
        "bus_velocity": moved["v_NX_N"][:, BUS],
        "bus_attitude": moved["q_NX"][:, BUS],
        "bus_rate": moved["w_NX_X"][:, BUS],
        "platform_position": moved["p_NX_N"][:, PLATE] - moved["p_NX_N"][:, BUS],
        "platform_velocity": moved["v_NX_N"][:, PLATE],
        "platform_attitude": moved["q_NX"][:, PLATE],
        "platform_rate": moved["w_NX_X"][:, PLATE],
        "gimbal_angle": moved["gimbal_angle"],
        "gimbal_rate": moved["gimbal_rate"],
        "leg_stroke": np.array([i.stroke for i in at]),
        "leg_force": np.array([i.strut_force for i in at]),
        "control_torque": np.array([i.decisions.torque for i in at]),
        "attitude_error": np.array([i.decisions.attitude_error for i in at]),
        "singularity_measure": np.array([[i.decisions.singularity] for i in at]),
    }
    if subject.satellite.mount == "rigid":  # the struts do not move
        del theirs["leg_stroke"], theirs["leg_force"]
    error, early = np.nan, ended(flight.ours, len(flight.times))
    if not early:
        found = flight.ours.outputs
        ours = {name: np.asarray(getattr(found, name)) for name in theirs}
        ours["platform_position"] = ours["platform_position"] - ours["bus_position"]
        ours["singularity_measure"] = ours["singularity_measure"][:, None]
        for name in ("bus_attitude", "platform_attitude"):
            same = np.sign(np.sum(ours[name] * theirs[name], axis=1, keepdims=True))
            ours[name] = same * ours[name]
        if found.rotor_speed is not None:
            names = ("rotor_angle", "rotor_speed", "rotor_torque")
            theirs |= {name: moved[name] for name in names[:2]}
            theirs["rotor_torque"] = np.array([i.rotor_torque for i in at])
            ours |= {name: np.asarray(getattr(found, name)) for name in names}
        if found.joint_forces is not None:
            for name in ("spherical_force", "universal_force"):
                theirs[name] = np.array([vars(i.joints)[name] for i in at])
                ours[name] = np.asarray(getattr(found.joint_forces, name))
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
    free = replace(without_disturbance(satellite), loads=(), motor=satellite.motor)
    if satellite.loads or satellite.disturbance is not None:
        ours = _direct(free, flight.start, float(flight.times[-1]))

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
    locked, at_rest = (
        lossless(without_disturbance(subject.satellite)),
        replace(start, gimbal_rate=jnp.zeros_like(start.gimbal_rate), rotor=None),
    )
    states = fly(locked, at_rest, jnp.asarray(flight.times))
    energy = over_time(_energy, locked, flight.times, states)
    return Check(
        "energy",
        "damping and friction off, CMGs locked: sum over all bodies and springs in "
        f"{flight.times[-1]:.2g} s, no loads",
        float(np.max(np.abs(energy - energy[0])) / energy[0]),
        1e-9,
    )


def _energy(satellite: Satellite, phi: Array, state: State) -> Array:
    return kinetic_energy(satellite, phi, state) + strut_energy(satellite, state)


def over_time(
    quantity: Callable[[Satellite, Array, State], Array],
    satellite: Satellite,
    times: np.ndarray,
    states: State,
) -> np.ndarray:
    """A function of satellite, rotor angles and state at every time of a flight."""
    return np.asarray(_over_time(quantity, satellite, jnp.asarray(times), states))


@eqx.filter_jit
def _over_time(quantity, satellite, times, states):
    def at(t, state):
        return quantity(satellite, rotor_angles(satellite, t, state), state)

    return jax.vmap(at)(times, states)
