"""The state of a bus with one plate and one cluster, by the names that the tests' formulas have."""

from types import SimpleNamespace
from typing import NamedTuple

import jax.numpy as jnp

from quietbus.dynamics.equations import accelerations, moving
from quietbus.dynamics.state import BodyState, State
from quietbus.model.element import Own, Rates

_BODIES = {"B": "bus", "P": "plate"}
_FIELDS = {
    "p_N{}_N": "p_NX_N",
    "q_N{}": "q_NX",
    "v_N{}_N": "v_NX_N",
    "w_N{0}_{0}": "w_NX_X",
}
# name: (element, field of its own)
_OWN = {
    "gimbal_angle": ("cluster", "y"),
    "gimbal_rate": ("cluster", "y_rate"),
    "rotor_angle": ("cluster", "y"),
    "rotor_speed": ("cluster", "y_rate"),
    "error_integral": ("control", "z"),
}


def two_bodies(**named) -> State:
    """A state; without the plate's motion, of a plate that is welded to the bus."""
    bodies = {}
    for letter, name in _BODIES.items():
        fields = {field: said.format(letter) for said, field in _FIELDS.items()}
        if all(said in named for said in fields.values()):
            values = {field: jnp.asarray(named[said]) for field, said in fields.items()}
            bodies[name] = BodyState(**values)
    own = {"cluster": {}, "control": {"z": jnp.zeros(3)}}
    for said, (element, field) in _OWN.items():
        if said in named:
            own[element][field] = jnp.asarray(named[said], dtype=float)
    return State(bodies, {name: Own.of(**fields) for name, fields in own.items()})


def names_of(state: State) -> dict[str, jnp.ndarray]:
    """What ``two_bodies`` makes the state of."""
    found = {}
    for letter, name in _BODIES.items():
        if name in state.bodies:
            for said, field in _FIELDS.items():
                found[said.format(letter)] = getattr(state.bodies[name], field)
    found["gimbal_angle"], found["gimbal_rate"] = (
        state.own["cluster"].y,
        state.own["cluster"].y_rate,
    )
    found["error_integral"] = state.own["control"].z
    return found


def seen(value):
    """The same of a state or of its rate, as attributes; of a welded plate nothing."""
    return SimpleNamespace(**names_of(value))


def changed(state: State, **named) -> State:
    """The state with some of its parts changed."""
    known = names_of(state)
    kept = {name: value for name, value in named.items() if name in known or name in _OWN}
    return two_bodies(**known | kept)


class Accelerations(NamedTuple):
    """Of both bodies, inertial components."""

    v_B: jnp.ndarray
    w_B: jnp.ndarray
    v_P: jnp.ndarray
    w_P: jnp.ndarray


def accelerations_of(satellite, state, driven=None, forces=None) -> Accelerations:
    """Accelerations at a state.

    Args:
        driven: accelerations of what the cluster drives.
        forces: (4, 3) on plate (force, torque about its origin) and bus, inertial.
    """
    now = moving(satellite, jnp.zeros(()), state)
    own = now.own["cluster"]
    rates = {"cluster": Rates(jnp.zeros_like(own.y) if driven is None else driven, own.z)}
    extra = jnp.zeros(12)
    if forces is not None:
        plate, bus = jnp.asarray(forces).reshape(2, 6)
        extra = jnp.concatenate([bus, plate])
    found = accelerations(satellite, now, rates, extra)
    (v_B, w_B), (v_P, w_P) = (
        found[now.layout.rows(name)].reshape(2, 3) for name in ("bus", "plate")
    )
    return Accelerations(v_B, w_B, v_P, w_P)
