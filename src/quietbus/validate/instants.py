"""Both programs at the start and at arbitrary instants: accelerations, control, joint forces."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from quietbus.dynamics.closed_loop import evaluate, state_rate
from quietbus.dynamics.outputs import outputs
from quietbus.dynamics.rotor_response import orders_of
from quietbus.model.satellite import CONTROL, Satellite
from quietbus.programs import compiled_for_few_runs
from quietbus.reference.motion import Motion
from quietbus.reference.satellite import Instant
from quietbus.validate.motions import random_motion, random_times
from quietbus.validate.subject import Check, Subject, apart
from quietbus.validate.translate import (
    driven_by,
    holding_legs,
    motion_of,
    state_of,
)


def check_start(subject: Subject) -> Check:
    """The state at t = 0."""
    theirs, ours = subject.reference.initial(), motion_of(subject.satellite, 0.0, subject.state)
    return Check(
        "start",
        "both programs' state at t = 0, each from the scenario by itself",
        apart(vars(theirs), vars(ours), 1.0),
        1e-12,
    )


def check_instants(subject: Subject, count: int, rng: np.random.Generator) -> list[Check]:
    """At random times and motions: half of them tumbling, half near what the control follows.

    Loads and commands that have corners are looked at on both sides of these, too.
    """
    reference, satellite = subject.reference, subject.satellite
    duration = subject.scenario.simulation.duration
    pairs: list[tuple[float, Motion]] = []
    for i, t in enumerate(random_times(reference, count, duration, rng)):
        near = None if i % 2 else float(10.0 ** rng.uniform(-4.0, -1.0))
        pairs.append((t, random_motion(reference, t, rng, near)))
    theirs = [reference.at(t, motion) for t, motion in pairs]
    states = [state_of(satellite, motion) for _, motion in pairs]
    stacked = jax.tree.map(lambda *each: jnp.stack(each), *states)
    times = jnp.array([t for t, _ in pairs])
    ours = jax.tree.map(np.asarray, _evaluated(satellite, times, stacked))
    said = f"{len(pairs)} random states and times against MuJoCo"
    checks = [
        Check(
            "accelerations",
            f"{said}: legs with mass and joint friction, control, motors and loads at work",
            _each(_accelerations(theirs, reference.mechanism.names), ours[0]),
            1e-9 + _rounding(subject),
        ),
        Check(
            "control",
            "controller, steering, servos and motors at these states, by a second program",
            _each(_decisions(theirs, satellite), ours[1], 1e-12),
            1e-9,
        ),
    ]
    reported = _reported(theirs, satellite)
    if reported[0]:
        checks.append(
            Check(
                "struts and motors",
                "strokes and forces of the struts, torques of the rotors' motors at these states",
                _each(reported, ours[2], 1e-6),
                1e-9,
            )
        )
    if theirs[0].joints is not None:
        checks.append(
            Check(
                "joint forces",
                "constraint forces and moments in the legs' joints at these states",
                _each(_joints(theirs), ours[3], 1e-6),
                1e-8,
            )
        )
    return checks


def _rounding(subject: Subject) -> float:
    """What rounding of the rotors' angles may do: they are large at the end of a long run."""
    reference = subject.reference
    turn = np.abs(reference.control.prescribed(subject.scenario.simulation.duration)[0])
    prescribed = ~reference.mechanism.units.wheel | reference.control.runs_up
    fastest = max(orders_of(subject.satellite)) * np.max(turn[prescribed], initial=0.0)
    return 4e-15 * float(fastest)


@compiled_for_few_runs
def _evaluated(satellite, times, states):
    """Accelerations, decisions, what is reported, joint forces: by name, (n, ...)."""
    legs = holding_legs(satellite)

    def at(t, state):
        found = evaluate(satellite, t, state)
        rate, told = state_rate(satellite, t, state), outputs(satellite, t, state, detailed=True)
        accelerations: dict[str, Array] = {}
        for body in satellite.bodies:
            rows = found.u_rate[found.now.layout.rows(body.name)]
            accelerations |= {f"v of {body.name}": rows[:3], f"w of {body.name}": rows[3:]}
        gimbals, rotors = driven_by(satellite, t, state, found.rates)
        memory_rate = rate.own[CONTROL].z
        decisions = {
            "attitude_error": found.decision.error_B,
            "torque": found.decision.torque_B,
            "integral_rate": memory_rate if len(memory_rate) else jnp.zeros(3),
            "gimbal_acceleration": gimbals,
            "rotor_acceleration": rotors,
            "singularity": told["singularity_measure"],
            "torque_share": found.decision.torque_share,
        }
        decisions |= {f"q of {name}": body.q_NX for name, body in rate.bodies.items()}
        reported = {}
        if np.any(legs):
            reported["stroke"] = told["leg_stroke"][legs]
            reported["strut_force"] = told["leg_force"][legs]
        if not satellite.steady:
            reported["rotor_torque"] = told["rotor_torque"]
        return accelerations, decisions, reported, {n: told[n] for n in JOINTS if n in told}

    return jax.vmap(at)(times, states)


JOINTS = ("spherical_force", "universal_force", "universal_moment", "universal_axis")


def _each(theirs: Sequence[dict], ours: dict, least: float = 1e-300) -> float:
    """Largest difference at any instant, relative to the value at that instant."""
    errors = [
        apart(at, {name: values[i] for name, values in ours.items()}, least)
        for i, at in enumerate(theirs)
    ]
    return float(np.max(errors))


def _accelerations(theirs: Sequence[Instant], names: Sequence[str]) -> list[dict]:
    return [
        {f"v of {name}": each for name, each in zip(names, at.accelerations.v, strict=True)}
        | {f"w of {name}": each for name, each in zip(names, at.accelerations.w, strict=True)}
        for at in theirs
    ]


def _decisions(theirs: Sequence[Instant], satellite: Satellite) -> list[dict]:
    names = ["attitude_error", "torque", "integral_rate", "rotor_acceleration"]
    names += ["singularity", "torque_share"]
    free = {body.name: i for i, body in enumerate(satellite.bodies) if body.name in satellite.free}
    return [
        {name: getattr(at.decisions, name) for name in names}
        | {"gimbal_acceleration": at.rates.gimbal_rate}
        | {f"q of {name}": at.rates.q_NX[number] for name, number in free.items()}
        for at in theirs
    ]


def _reported(theirs: Sequence[Instant], satellite: Satellite) -> list[dict]:
    """Of struts that move, and of motors where rotors change their speeds."""
    legs, found = holding_legs(satellite), []
    for at in theirs:
        told = {"rotor_torque": at.rotor_torque} if not satellite.steady else {}
        if np.any(legs):
            told |= {"stroke": at.stroke[legs], "strut_force": at.strut_force[legs]}
        found.append(told)
    return found


def _joints(theirs: Sequence[Instant]) -> list[dict]:
    return [vars(at.joints) for at in theirs]
