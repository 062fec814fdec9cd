"""Both programs at the start and at arbitrary instants: accelerations, control, joint forces."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from quietbus.dynamics.closed_loop import control_signals, evaluate, state_rate
from quietbus.dynamics.outputs import outputs
from quietbus.model.satellite import Satellite
from quietbus.reference.motion import Motion
from quietbus.reference.satellite import Instant
from quietbus.validate.motions import random_motion, random_times
from quietbus.validate.subject import Check, Subject, apart
from quietbus.validate.translate import motion_of, state_of


def check_start(subject: Subject) -> Check:
    """The state at t = 0."""
    theirs, ours = subject.reference.initial(), motion_of(subject.satellite, subject.state)
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
            _each(_decisions(theirs), ours[1], 1e-12),
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
    if satellite.mount == "isolated":
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
    if subject.satellite.cluster.drive is not None:
        return 0.0
    speed = np.max(np.abs(subject.reference.mechanism.units.speed))
    fastest = max(subject.scenario.cluster.orders) * speed
    return 4e-15 * float(fastest) * subject.scenario.simulation.duration


@eqx.filter_jit
def _evaluated(satellite, times, states):
    """Accelerations, decisions, what is reported, joint forces: by name, (n, ...)."""

    def at(t, state):
        _, a = evaluate(satellite, t, state)
        signals, rate = control_signals(satellite, t, state), state_rate(satellite, t, state)
        found = outputs(satellite, t, state, with_joint_forces=satellite.mount == "isolated")
        accelerations = {"v of bus": a.v_B, "w of bus": a.w_B}
        accelerations |= {"v of plate": a.v_P, "w of plate": a.w_P}
        decisions = {
            "attitude_error": signals.attitude_error_B,
            "torque": signals.torque_B,
            "integral_rate": rate.error_integral,
            "gimbal_acceleration": rate.gimbal_rate,
            "rotor_acceleration": 0.0 * rate.gimbal_rate
            if rate.rotor is None
            else rate.rotor.speed,
            "singularity": found.singularity_measure,
            "torque_share": jnp.ones(()) if signals.torque_share is None else signals.torque_share,
            "q_NX": jnp.stack([rate.q_NB, rate.q_NP]),
        }
        reported = {"stroke": found.leg_stroke, "strut_force": found.leg_force}
        if found.rotor_torque is not None:
            reported["rotor_torque"] = found.rotor_torque
        joints = {} if found.joint_forces is None else vars(found.joint_forces)
        return accelerations, decisions, reported, joints

    return jax.vmap(at)(times, states)


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


def _decisions(theirs: Sequence[Instant]) -> list[dict]:
    names = ["attitude_error", "torque", "integral_rate", "rotor_acceleration"]
    names += ["singularity", "torque_share"]
    return [
        {name: getattr(at.decisions, name) for name in names}
        | {
            "gimbal_acceleration": at.rates.gimbal_rate,
            "q_NX": at.rates.q_NX,
        }
        for at in theirs
    ]


def _reported(theirs: Sequence[Instant], satellite: Satellite) -> list[dict]:
    """On a rigid mount the struts do not move."""
    names = ["rotor_torque"] if satellite.cluster.drive is not None else []
    if satellite.mount == "isolated":
        names += ["stroke", "strut_force"]
    return [{name: getattr(at, name) for name in names} for at in theirs]


def _joints(theirs: Sequence[Instant]) -> list[dict]:
    return [vars(at.joints) for at in theirs]
