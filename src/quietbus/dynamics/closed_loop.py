"""The controlled satellite as one ordinary differential equation."""

from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.equations import Moving, accelerations, moving
from quietbus.dynamics.state import BodyState, State
from quietbus.model.control import Actuators, Decision
from quietbus.model.element import NOTHING, Around, Own, Rates
from quietbus.model.satellite import BUS, CONTROL, Satellite
from quietbus.spatial.rotation import (
    quaternion_multiply,
    quaternion_normalize,
    quaternion_rate,
    quaternion_to_matrix,
)
from quietbus.spatial.vector import cross, rotate


class Evaluation(eqx.Module):
    """What happens at one instant."""

    now: Moving
    decision: Decision
    rates: dict[str, Rates]  # of elements that have any, and of the control
    u_rate: Float[Array, " n"]  # [m/s^2, rad/s^2] of all speeds, inertial components


def nominal_arounds(satellite: Satellite, t: Float[Array, ""], state: State) -> list[Around]:
    """Where the actuators are with every body in its nominal pose, along bus axes."""
    nominal = satellite.nominal()
    return [
        Around(
            t,
            jnp.eye(3),
            tuple(nominal[host] for host in actuator.hosts),
            state.own.get(actuator.name, NOTHING),
        )
        for actuator in satellite.actuators
    ]


def decide(satellite: Satellite, t: Float[Array, ""], state: State) -> Decision:
    """What the attitude control commands, every body being taken in its nominal pose."""
    control, actuators = satellite.control, satellite.actuators
    measured = control.measured(t, state.bus.q_NX, state.bus.w_NX_X)
    obeying = Actuators(actuators, nominal_arounds(satellite, t, state))
    return control.decide(t, measured, state.own[CONTROL].z, obeying)


def drives(satellite: Satellite, now: Moving, decision: Decision) -> dict[str, Rates]:
    """What drives and memories do, by the names of those that have any."""
    commands = dict(zip(satellite.control.actuators, decision.commands, strict=True))
    rates = commanded(satellite, now, commands)
    rates[CONTROL] = Rates(now.own[CONTROL].y, decision.memory_rate)
    return rates


def commanded(
    satellite: Satellite, now: Moving, commands: Mapping[str, Float[Array, " command"]]
) -> dict[str, Rates]:
    """What elements do on commands by their names; the others are idle."""
    rates = {}
    for element in satellite.elements:
        if element.name in now.own:
            around = now.around(element)
            idle = jnp.zeros_like(around.own.y)
            rates[element.name] = element.rates(around, commands.get(element.name, idle))
    return rates


def evaluate(satellite: Satellite, t: Float[Array, ""], state: State) -> Evaluation:
    """Decisions, drives and accelerations at time t [s]."""
    now, decision = moving(satellite, t, state), decide(satellite, t, state)
    rates = drives(satellite, now, decision)
    return Evaluation(now, decision, rates, accelerations(satellite, now, rates))


def state_rate(satellite: Satellite, t: Float[Array, ""], state: State) -> State:
    """Time derivative of the state; of ``satellite.prepared()`` where it is asked for often."""
    found = evaluate(satellite, t, state)
    bodies, own = {}, {}
    for name, body in state.bodies.items():
        dv, dw = found.u_rate[found.now.layout.rows(name)].reshape(2, 3)
        R = found.now.motions[name].R_AX
        bodies[name] = BodyState(
            body.v_NX_N, quaternion_rate(body.q_NX, body.w_NX_X), dv, rotate(R.T, dw)
        )
    for name, mine in state.own.items():
        rates, u_rate = found.rates[name], found.u_rate[found.now.layout.own(name)]
        own[name] = Own(mine.u, u_rate, mine.y_rate, rates.y, rates.z)
    return State(bodies, own)


def initial_state(
    satellite: Satellite,
    q_NB: Float[Array, "4"],
    w_NB_B: Float[Array, "3"],
    gimbal_angle: Float[Array, " cmg"],
) -> State:
    """All bodies moving as one, each in its nominal pose, bus mass centre at rest at 0.

    Args:
        gimbal_angle: (cmg,) of the units of all clusters [rad]; of held gimbals it has no effect.
    """
    zero = jnp.zeros(3)
    own = satellite.start()
    for cluster, mine in satellite.numbered():
        if cluster.driven:
            own[cluster.name] = cluster.with_gimbal_angles(own[cluster.name], gimbal_angle[mine])
    bus = BodyState(zero, q_NB, zero, w_NB_B)
    return as_one_body(satellite, State({BUS: bus}, own))


def attitudes(satellite: Satellite, state: State) -> dict[str, Float[Array, "4"]]:
    """Attitude of every body, of welded ones too."""
    found = {name: body.q_NX for name, body in state.bodies.items()}
    for mount in satellite.mounts:
        if mount.welded:
            found[mount.body] = quaternion_multiply(found[mount.base], mount.q_BX)
    return found


def as_one_body(satellite: Satellite, state: State) -> State:
    """The state with all bodies in their nominal pose, moving with the bus as one."""
    bus = state.bus
    bodies, R_NB = {BUS: bus}, quaternion_to_matrix(bus.q_NX)
    w_N = R_NB @ bus.w_NX_X
    attitudes, places = {BUS: bus.q_NX}, {BUS: jnp.zeros(3)}
    for mount in satellite.mounts:
        base = quaternion_to_matrix(attitudes[mount.base])
        q = attitudes[mount.body] = quaternion_multiply(attitudes[mount.base], mount.q_BX)
        r = places[mount.body] = places[mount.base] + base @ mount.p_BX_B
        if not mount.welded:
            v = bus.v_NX_N + cross(w_N, r)
            w = quaternion_to_matrix(q).T @ w_N
            bodies[mount.body] = BodyState(bus.p_NX_N + r, q, v, w)
    return State(bodies, state.own)


def tidy(state: State) -> State:
    """The state with unit quaternions, as the equations keep them but for rounding."""
    q = lambda s: [body.q_NX for body in s.bodies.values()]  # noqa: E731
    return eqx.tree_at(q, state, [quaternion_normalize(each) for each in q(state)])
