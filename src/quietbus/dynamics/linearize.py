"""The exact linearisation of the nonlinear satellite, by automatic differentiation.

No second set of matrices is written: the equations of motion, with the rotors' imbalance averaged
out, are differentiated at an operating point. The state is minimal (three attitude parameters a
body) and split so that what cannot matter is seen: nothing depends on the satellite's position
and velocity as a whole, which come last.

All deviations are in the frame that turns with the satellite's steady rate, whose axes are the
bus axes at the operating point:

    bus_attitude      rotation vector of the bus from its operating attitude [rad]
    plate_position    origin of P from the bus mass centre, deviation [m]; alike for other bodies
    plate_attitude    rotation vector of the plate [rad]
    bus_rate, plate_velocity (relative to the bus), plate_rate
    what elements have of their own: gimbal_angle, gimbal_rate; of reaction wheels rotor_speed;
    NAME_memory of struts with memory
    bus_velocity, bus_position
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.dynamics.closed_loop import attitudes, commanded, initial_state, nominal_arounds
from quietbus.dynamics.equations import Moving, accelerations, moving, rates_of
from quietbus.dynamics.linear_model import LinearModel
from quietbus.dynamics.outputs import joined
from quietbus.dynamics.state import BodyState, State
from quietbus.model.control import Actuators
from quietbus.model.element import Own
from quietbus.model.report import AXIS
from quietbus.model.satellite import BUS, CONTROL, Satellite
from quietbus.model.steering import PseudoInverse, Steering
from quietbus.model.unit import rotor_centres_P
from quietbus.programs import compiled_for_few_runs
from quietbus.spatial.rotation import (
    quaternion_conjugate,
    quaternion_multiply,
    quaternion_to_matrix,
    quaternion_to_rotation_vector,
    rotation_vector_to_quaternion,
)
from quietbus.spatial.vector import cross

AXES = ("x", "y", "z")
Actuation = Literal["servo", "ideal"]
NEWTON_STEPS = 20
SINGULAR = 1e9  # [rad/s per N m] gimbal rates for a torque, above which there is no steering
PIVOT = "rotor_angle"  # nothing depends on the angles of rotors whose imbalance is averaged


Parts = list[tuple[tuple[str, str], tuple[str, ...]]]  # (kind, of whom) and names


class OperatingPointError(ValueError):
    """A motion about which there is no linear model; the message says why."""


class OperatingPoint(NamedTuple):
    """Where to linearise: a steady motion."""

    rate: np.ndarray | Array  # (3,) [rad/s] steady rate of the whole satellite, bus frame
    gimbal_angle: np.ndarray | Array  # (cmg,) [rad] of all units


class Pose(eqx.Module):
    """Where things are at the operating point."""

    p_BX_B: dict[str, Float[Array, "3"]]  # [m] of every body but the bus
    q_BX: dict[str, Float[Array, "4"]]
    own: dict[str, Own]  # of the elements; driven rates are those of the nominal motion


class Rows(NamedTuple):
    """Names and sizes of the parts of the state, in their order."""

    names: tuple[tuple[str, ...], ...]
    keys: tuple[tuple[str, str], ...]  # (kind, of whom) of each part

    @property
    def flat(self) -> tuple[str, ...]:
        """All names."""
        return tuple(name for part in self.names for name in part)

    def cut(self, x: Array) -> dict[tuple[str, str], Array]:
        """A vector by parts."""
        ends = np.cumsum([len(part) for part in self.names])[:-1]
        return dict(zip(self.keys, jnp.split(x, ends), strict=True))

    def joined(self, parts: Mapping[tuple[str, str], Array]) -> Array:
        """Parts as a vector."""
        return jnp.concatenate([parts[key] for key in self.keys])

    def where(self, *keys: tuple[str, str]) -> list[int]:
        """Rows of parts, one after the other."""
        found: list[int] = []
        starts = np.cumsum([0, *(len(part) for part in self.names)])
        for key in keys:
            k = self.keys.index(key)
            found += range(starts[k], starts[k + 1])
        return found


def linearize(
    satellite: Satellite,
    point: OperatingPoint,
    actuator: Actuation = "servo",
    points: Mapping[str, np.ndarray] | None = None,
) -> LinearModel:
    """Linear model of the uncontrolled satellite about a steady motion.

    Inputs (each with _x _y _z): ``bus_force``, ``bus_torque``, ``plate_force``, ``plate_torque``
    (about each body's origin; of other bodies under their names), ``cmg<j>_force``,
    ``cmg<j>_torque`` at the rotor centres, ``control_torque``; and ``gimbal_rate_command_<j>``, of
    reaction wheels ``rotor_torque_command_<j>``. Outputs: the states, ``leg_stroke_<i>``,
    ``leg_force_<i>``, ``bus_acceleration`` and ``<name>_acceleration`` of further points.

    Args:
        satellite: its controller and loads are left out; its steering law, at the operating point,
            turns ``control_torque`` into commands.
        point: gimbal angles and steady rate.
        actuator: "servo": control torque by gimbal motion through the servo, or by the wheels.
            "ideal": control torque acts on what carries the actuators as it is asked for, gimbals
            held and rotors at constant speed.
        points: further points of the bus [m], bus frame, by name.

    Raises:
        OperatingPointError: no equilibrium (what accelerates, and how fast), or no steering there.
    """
    further = {name: jnp.asarray(p, dtype=float) for name, p in (points or {}).items()}
    at = OperatingPoint(jnp.asarray(point.rate, float), jnp.asarray(point.gimbal_angle, float))
    internal = replace(satellite, others=tuple(e for e in satellite.others if not e.external))
    pose = _nominal(internal, jnp.asarray(at.gimbal_angle))
    (A, B, C, D), outputs = _at_equilibrium(internal, at.rate, pose, further)
    rows, inputs = state_rows(internal, pose), input_rows(internal)
    states = rows.flat
    torque = inputs.where(("torque", CONTROL))
    command = inputs.where(*(key for key in inputs.keys if key[0] == "command"))
    if actuator == "servo":
        steering = steering_commands(internal, at.gimbal_angle)
        B[:, torque], D[:, torque] = B[:, command] @ steering, D[:, command] @ steering
        unmoved: tuple[str, ...] = (PIVOT,)
    else:
        B[:, command] = D[:, command] = 0.0
        unmoved = tuple(states[i] for i in rows.where(*(k for k in rows.keys if k[0][0] == "y")))
    kept = [i for i, name in enumerate(states) if not name.startswith(unmoved or ("?",))]
    seen = [i for i, name in enumerate(outputs) if not name.startswith(PIVOT)]
    return LinearModel(
        A[np.ix_(kept, kept)],
        B[kept],
        C[np.ix_(seen, kept)],
        D[seen],
        tuple(states[i] for i in kept),
        inputs.flat,
        tuple(outputs[i] for i in seen),
    )


def _axes(name: str) -> tuple[str, ...]:
    return tuple(f"{name}_{axis}" for axis in AXES)


def state_rows(satellite: Satellite, pose: Pose) -> Rows:
    """The parts of the state."""
    others = [name for name in satellite.free if name != BUS]
    parts: Parts = [(("attitude", BUS), _axes("bus_attitude"))]
    for name in others:
        parts += [
            (("position", name), _axes(f"{name}_position")),
            (("attitude", name), _axes(f"{name}_attitude")),
        ]
    parts.append((("rate", BUS), _axes("bus_rate")))
    for name in others:
        parts += [
            (("velocity", name), _axes(f"{name}_velocity")),
            (("rate", name), _axes(f"{name}_rate")),
        ]
    first, driven = 0, {}
    for element in satellite.elements:
        driven[element.name] = element.driven_names(first)
        first += element.count
    for kind, which in (("y", 0), ("y_rate", 1)):
        for name in pose.own:
            parts.append(((kind, name), tuple(names[which] for names in driven[name])))
    for kind, said in (("q", "coordinate"), ("u", "coordinate_rate"), ("z", "memory")):
        for name, own in pose.own.items():
            count = len(getattr(own, kind))
            parts.append(((kind, name), tuple(f"{name}_{said}_{i}" for i in range(count))))
    parts += [
        (("velocity", BUS), _axes("bus_velocity")),
        (("position", BUS), _axes("bus_position")),
    ]
    return Rows(tuple(names for _, names in parts), tuple(key for key, _ in parts))


def input_rows(satellite: Satellite) -> Rows:
    """The parts of the input."""
    parts: Parts = []
    for body in satellite.bodies:
        parts += [
            (("force", body.name), _axes(f"{body.name}_force")),
            (("torque", body.name), _axes(f"{body.name}_torque")),
        ]
    for j in range(satellite.count):
        parts += [
            (("force", f"cmg{j}"), _axes(f"cmg{j}_force")),
            (("torque", f"cmg{j}"), _axes(f"cmg{j}_torque")),
        ]
    parts.append((("torque", CONTROL), _axes("control_torque")))
    first = 0
    for element in satellite.elements:
        for actuator in satellite.actuators:
            if actuator.name == element.name:
                names = tuple(actuator.command_names(first))
                parts.append((("command", actuator.name), names))
        first += element.count
    return Rows(tuple(names for _, names in parts), tuple(key for key, _ in parts))


@compiled_for_few_runs
def _nominal(satellite: Satellite, gimbal_angle: Array) -> Pose:
    unit = jnp.array([1.0, 0.0, 0.0, 0.0])
    state = initial_state(satellite, unit, jnp.zeros(3), gimbal_angle)
    p = {name: motion.p for name, motion in satellite.nominal().items() if name != BUS}
    q = {BUS: unit}
    for mount in satellite.mounts:
        q[mount.body] = quaternion_multiply(q[mount.base], mount.q_BX)
    own = {name: each for name, each in state.own.items() if name != CONTROL}
    return Pose(p, {name: each for name, each in q.items() if name != BUS}, own)


def _chart(
    satellite: Satellite,
    rate: Float[Array, "3"],
    pose: Pose,
    x: Mapping[tuple[str, str], Array],
) -> State:
    """The state at deviation x, in the frame that turns with the satellite."""
    p_B = x["position", BUS]
    v_B = x["velocity", BUS] + cross(rate, p_B)
    q_B = rotation_vector_to_quaternion(x["attitude", BUS])
    bodies = {BUS: BodyState(p_B, q_B, v_B, rate + x["rate", BUS])}
    for name in satellite.free:
        if name == BUS:
            continue
        q = quaternion_multiply(rotation_vector_to_quaternion(x["attitude", name]), pose.q_BX[name])
        r = pose.p_BX_B[name] + x["position", name]
        w = quaternion_to_matrix(q).T @ (rate + x["rate", name])
        v = v_B + x["velocity", name] + cross(rate, r)
        bodies[name] = BodyState(p_B + r, q, v, w)
    own = {
        name: Own(*(getattr(each, k) + x[k, name] for k in ("q", "u", "y", "y_rate", "z")))
        for name, each in pose.own.items()
    }
    own[CONTROL] = Own.of(z=satellite.control.controller.start())
    return State(bodies, own)


def _system(
    satellite: Satellite,
    rate: Float[Array, "3"],
    pose: Pose,
    points: Mapping[str, Float[Array, "3"]],
    x: Float[Array, " x"],
    u: Float[Array, " u"],
) -> tuple[Float[Array, " x"], dict[str, Float[Array, " k"]]]:
    """dx/dt and the outputs by name, nonlinear; ``control_torque`` acts as it is."""
    rows, inputs = state_rows(satellite, pose), input_rows(satellite)
    state = _chart(satellite, rate, pose, rows.cut(x))
    now = moving(satellite, jnp.zeros(()), state)
    given = inputs.cut(u)
    commands = {name: value for (kind, name), value in given.items() if kind == "command"}
    rates = commanded(satellite, now, commands)
    a = accelerations(satellite, now, rates, _forces(satellite, now, given))
    moved = _rates(satellite, rate, pose, state, now, rates, a)
    outputs = _outputs(satellite, rate, pose, state, now, rates, a, moved, points)
    return rows.joined(moved), outputs


def _forces(satellite: Satellite, now: Moving, given: Mapping[tuple[str, str], Array]) -> Array:
    """The inputs' forces on all speeds."""
    layout = now.layout
    force = {name: jnp.zeros(size) for name, size in layout.parts}
    for body in satellite.bodies:
        R = now.motions[body.name].R_AX
        both = (R @ given["force", body.name], R @ given["torque", body.name])
        force[body.name] = jnp.concatenate(both)
    for cluster, mine in satellite.numbered():
        (carrier,) = now.around(cluster).hosts
        numbers = range(mine.start, mine.stop)
        forces = jnp.stack([given["force", f"cmg{j}"] for j in numbers])
        torques = jnp.stack([given["torque", f"cmg{j}"] for j in numbers])
        angle = cluster.at(now.t, now.own).gimbal.angle
        torques = torques + jnp.cross(rotor_centres_P(cluster.units, angle), forces)
        both = (carrier.R_AX @ jnp.sum(forces, axis=0), carrier.R_AX @ jnp.sum(torques, axis=0))
        name = cluster.hosts[0]
        force[name] = force[name] + jnp.concatenate(both)
    for name, share in _carriers(satellite, now).items():
        force[name] = force[name].at[3:].add(share @ given["torque", CONTROL])
    return jnp.concatenate([force[name] for name, _ in layout.parts])


def _carriers(satellite: Satellite, now: Moving) -> dict[str, Float[Array, "3 3"]]:
    """Parts of a torque that the bodies take which carry actuators: all of it where it is one.

    Several share it as their actuators can, least squares of full commands.
    """
    units = (*satellite.actuators, *satellite.clusters)
    names = dict.fromkeys(element.hosts[0] for element in units)
    if len(names) < 2:
        return dict.fromkeys(names, jnp.eye(3))
    able = {name: jnp.zeros((3, 3)) for name in names}
    for actuator in satellite.actuators:
        authority = actuator.authority(now.around(actuator))
        axes = authority.torque * authority.axes_A
        able[actuator.hosts[0]] = able[actuator.hosts[0]] + axes @ axes.T
    whole = jnp.linalg.pinv(sum(able.values(), jnp.zeros((3, 3))))
    return {name: own @ whole for name, own in able.items()}


def _rates(satellite, rate, pose, state, now, rates, a) -> dict[tuple[str, str], Array]:
    """dx/dt by parts."""
    bus, layout = now.motions[BUS], now.layout
    R_B, bus_speed = bus.R_AX, bus.v - cross(rate, state.bus.p_NX_N)
    a_B, dw_B = a[layout.rows(BUS)].reshape(2, 3)
    found = {
        ("attitude", BUS): state.bus.w_NX_X - R_B.T @ rate,
        ("rate", BUS): R_B.T @ dw_B,
        ("velocity", BUS): a_B - cross(rate, bus.v) - cross(rate, bus_speed),
        ("position", BUS): bus_speed,
    }
    for name in satellite.free:
        if name == BUS:
            continue
        body = now.motions[name]
        dv, dw = a[layout.rows(name)].reshape(2, 3)
        v_rel = body.v - bus.v
        turning = _turning(rate, bus, body)
        found["position", name] = turning
        found["attitude", name] = body.w - rate
        found["velocity", name] = dv - a_B - cross(rate, v_rel) - cross(rate, turning)
        found["rate", name] = dw - cross(rate, body.w)
    for name in pose.own:
        own = state.own[name]
        found["q", name], found["u", name] = own.u, a[layout.own(name)]
        found["y", name], found["y_rate", name] = own.y_rate - pose.own[name].y_rate, rates[name].y
        found["z", name] = rates[name].z
    return found


def _turning(rate, bus, body):
    """Velocity of a body's origin relative to the bus's, seen in the turning frame."""
    return body.v - bus.v - cross(rate, body.p - bus.p)


def _outputs(
    satellite, rate, pose, state, now, rates, a, moved, points
) -> dict[str, Float[Array, " k"]]:
    """Outputs by the names of their components' common part."""
    bus, layout = now.motions[BUS], now.layout
    found: dict[str, Array] = {}
    found["bus_attitude"] = quaternion_to_rotation_vector(state.bus.q_NX)
    names = [body.name for body in satellite.bodies if body.name != BUS]
    quaternions = attitudes(satellite, state)
    for name in names:
        tilt = quaternion_multiply(quaternions[name], quaternion_conjugate(pose.q_BX[name]))
        found[f"{name}_position"] = now.motions[name].p - bus.p - pose.p_BX_B[name]
        found[f"{name}_attitude"] = quaternion_to_rotation_vector(tilt)
    found["bus_rate"] = state.bus.w_NX_X - rate
    for name in names:
        found[f"{name}_velocity"] = _turning(rate, bus, now.motions[name])
        found[f"{name}_rate"] = now.motions[name].w - rate
    rows = state_rows(satellite, pose)
    for key, labels in zip(rows.keys, rows.names, strict=True):
        kind, name = key
        if kind in ("q", "u", "y", "y_rate", "z") and labels:
            value = getattr(state.own[name], kind) - getattr(pose.own[name], kind)
            found |= {label: value[i][None] for i, label in enumerate(labels)}
    found["bus_velocity"], found["bus_position"] = moved["position", BUS], state.bus.p_NX_N
    report = [
        output
        for element in satellite.elements
        for output in element.report(
            now.around(element), rates_of(rates, element), layout.gathered(element, a)
        )
        if output.quantity.vibrates
    ]
    dimensions = {quantity.name: quantity.dimensions for quantity, _ in report}
    for name, value in joined(report).items():
        each = dimensions[name]
        for index in np.ndindex(value.shape[: len(each) - (each[-1:] == AXIS)]):
            found["_".join([name, *map(str, index)])] = jnp.atleast_1d(value[index])
    R_B, w_B = bus.R_AX, bus.w
    a_B, dw_B = a[layout.rows(BUS)].reshape(2, 3)
    for name, p in {BUS: jnp.zeros(3), **points}.items():
        r = R_B @ p
        found[f"{name}_acceleration"] = R_B.T @ (a_B + cross(dw_B, r) + cross(w_B, cross(w_B, r)))
    return found


def _at_equilibrium(satellite, rate, pose, points):
    """A, B, C, D where all bodies are in equilibrium, and the outputs' names.

    Newton's method on poses, own coordinates and memories: struts may be preloaded, or in the field
    of a steady turn.
    """
    rows = state_rows(satellite, pose)
    free = [name for name in satellite.free if name != BUS]
    unknown = rows.where(
        *(key for name in free for key in (("position", name), ("attitude", name))),
        *((kind, name) for name in pose.own for kind in ("q", "z")),
    )
    for _ in range(NEWTON_STEPS):
        *numbers, names = _derivatives(satellite, rate, pose, points)
        matrices, rates = jax.device_get(numbers)
        unbalance = _against_bus(rows, free, pose, rates)
        if np.all(np.abs(unbalance) < 1e-11):
            break
        step = np.linalg.solve(_against_bus(rows, free, pose, matrices[0])[:, unknown], -unbalance)
        pose = _moved(
            pose,
            dict(zip(free, step[: 6 * len(free)].reshape(-1, 6), strict=True)),
            step[6 * len(free) :],
        )
    _check_equilibrium(rates[rows.where(("rate", BUS))], unbalance)
    return tuple(np.array(matrix) for matrix in matrices), names


@compiled_for_few_runs
def _moved(pose, steps, own_step):
    """Other poses: displacements and rotation vectors of the bodies, bus axes, and own parts."""
    p, q, own = dict(pose.p_BX_B), dict(pose.q_BX), dict(pose.own)
    for name, step in steps.items():
        q[name] = quaternion_multiply(rotation_vector_to_quaternion(step[3:]), q[name])
        p[name] = p[name] + step[:3]
    first = 0
    for name, each in own.items():
        m, n = len(each.q), len(each.z)
        moved = (each.q + own_step[first : first + m], each.z + own_step[first + m : first + m + n])
        own[name] = eqx.tree_at(lambda o: (o.q, o.z), each, moved)
        first += m + n
    return Pose(p, q, own)


def _against_bus(rows: Rows, free: list[str], pose: Pose, values: np.ndarray) -> np.ndarray:
    """Accelerations relative to the bus and own rates, from rows ordered as the state."""
    bus = values[rows.where(("rate", BUS))]
    found = [values[:0]]
    for name in free:
        found.append(values[rows.where(("velocity", name))])
        found.append(values[rows.where(("rate", name))] - bus)
    for name in pose.own:
        found += [values[rows.where(("u", name))], values[rows.where(("z", name))]]
    return np.concatenate(found)


@compiled_for_few_runs
def _derivatives(satellite, rate, pose, points):
    """A, B, C, D and dx/dt in a pose, and the outputs' names."""
    averaged = satellite.averaged()
    sizes: dict[str, int] = {}

    def system(x, u):
        rates, outputs = _system(averaged, rate, pose, points, x, u)
        sizes.update({name: len(value) for name, value in outputs.items()})
        return (rates, jnp.concatenate(list(outputs.values()))), rates

    x = jnp.zeros(len(state_rows(satellite, pose).flat))
    u = jnp.zeros(len(input_rows(satellite).flat))
    ((A, B), (C, D)), rates = jax.jacfwd(system, argnums=(0, 1), has_aux=True)(x, u)
    names = (_axes(name) if n == 3 else (name,) for name, n in sizes.items())
    return (A, B, C, D), rates, tuple(label for each in names for label in each)


def platform_inertia(
    satellite: Satellite, gimbal_angle: np.ndarray, name: str
) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass [kg], mass centre [m] and inertia about it [kg m^2] of a body with what it carries.

    Its own axes, imbalance averaged over the rotors' turns.

    Args:
        gimbal_angle: (cmg,) of all units [rad].
        name: of the body.
    """
    M = np.asarray(_carried_mass(satellite, jnp.asarray(gimbal_angle, float), name))
    mass = M[0, 0]
    center = np.array([M[5, 1], M[3, 2], M[4, 0]]) / mass
    own = M[3:, 3:] - mass * (center @ center * np.eye(3) - np.outer(center, center))
    return float(mass), center, own


@compiled_for_few_runs
def _carried_mass(satellite, gimbal_angle, name):
    """Mass matrix on the speeds of a body of itself and what it alone carries, its axes."""
    satellite = satellite.averaged()
    unit = jnp.array([1.0, 0.0, 0.0, 0.0])
    state = initial_state(satellite, unit, jnp.zeros(3), gimbal_angle)
    now = moving(satellite, jnp.zeros(()), state).along(name)
    own = [e.mass(now.around(e)) for e in satellite.elements if e.hosts == (name,)]
    return jnp.sum(jnp.stack(own), axis=0)


def steering_commands(satellite: Satellite, gimbal_angle: np.ndarray | Array) -> np.ndarray:
    """Commands (command, 3) of all actuators by control torque, bus axes.

    Raises:
        OperatingPointError: steering gives no finite rates at these gimbal angles.
    """
    commands = np.asarray(_steering_matrix(satellite, jnp.asarray(gimbal_angle)))
    if not np.all(np.abs(commands) < SINGULAR):
        raise OperatingPointError(
            "the cluster is singular at these gimbal angles, or its rotors stand still: steering "
            "gives no finite gimbal rates. Expected other gimbal angles, a robust steering law, "
            'or actuator="ideal"'
        )
    return commands


@compiled_for_few_runs
def _steering_matrix(satellite, gimbal_angle):
    unit, zero = jnp.array([1.0, 0.0, 0.0, 0.0]), jnp.zeros(())
    state = initial_state(satellite, unit, jnp.zeros(3), gimbal_angle)
    actuators = Actuators(satellite.actuators, nominal_arounds(satellite, zero, state))
    law: Steering = satellite.control.steering
    law = law if law.acts else PseudoInverse()
    axes = actuators.axes_B

    def commands(torque):
        return jnp.concatenate(actuators.split(law.rates(axes, torque / actuators.torque, zero)))

    return jax.vmap(commands, out_axes=1)(jnp.eye(3))


def _check_equilibrium(bus: np.ndarray, others: np.ndarray) -> None:
    if not np.all(np.abs(others) < 1e-8):
        raise OperatingPointError(
            "the operating point is not an equilibrium: no pose of the plate was found in which "
            f"the struts hold it; it would accelerate with {_listed(others)} m/s^2, rad/s^2. "
            "Expected struts whose free lengths fit the geometry, or a slower rate"
        )
    if not np.all(np.abs(bus) < 1e-8):
        raise OperatingPointError(
            "the operating point is not an equilibrium: the bus would accelerate with "
            f"{_listed(bus)} rad/s^2. Expected a steady rate of zero, or one about which the total "
            "angular momentum (rotors included) does not turn"
        )


def _listed(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.3g}" for value in values) + "]"
