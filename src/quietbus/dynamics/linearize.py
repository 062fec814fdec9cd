"""The exact linearisation of the nonlinear satellite, by automatic differentiation.

No second set of matrices is written: the equations of motion, with the rotors' imbalance averaged
out, are differentiated at an operating point. The state is minimal (three attitude parameters a
body) and split so that what cannot matter is seen: nothing depends on the satellite's position
and velocity as a whole, which come last.

All deviations are in the frame that turns with the satellite's steady rate, whose axes are the
bus axes at the operating point:

    bus_attitude      rotation vector of the bus from its operating attitude [rad]
    plate_position    origin of P from the bus mass centre, deviation [m]
    plate_attitude    rotation vector of the plate [rad]
    bus_rate, plate_velocity (relative to the bus), plate_rate
    gimbal_angle, gimbal_rate; of reaction wheels rotor_speed instead
    bus_velocity, bus_position
"""

import functools
from collections.abc import Mapping
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.dynamics.closed_loop import torque_axes
from quietbus.dynamics.equations import Accelerations, Wrench, accelerations, plate_motion
from quietbus.dynamics.kinematics import leg_motion
from quietbus.dynamics.state import State
from quietbus.model.cmg import ClusterMoments, ControlMomentGyro
from quietbus.model.rotor import RotorState, WheelMotors
from quietbus.model.satellite import Satellite
from quietbus.model.steering import PseudoInverse
from quietbus.spatial.inertia import point_inertia
from quietbus.spatial.rotation import (
    quaternion_conjugate,
    quaternion_multiply,
    quaternion_to_matrix,
    quaternion_to_rotation_vector,
    rotation_vector_to_quaternion,
)

AXES = ("x", "y", "z")
Actuator = Literal["servo", "ideal"]


class LinearModel(NamedTuple):
    """``dx/dt = A x + B u``, ``y = C x + D u`` with names for every row and column."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def select(
        self, inputs: list[str] | None = None, outputs: list[str] | None = None
    ) -> "LinearModel":
        """The model with some inputs and outputs only; a name without axis takes all three.

        Raises:
            KeyError: a name that the model does not have, with the ones it has.
        """
        columns = _indices(self.inputs, inputs, "input")
        rows = _indices(self.outputs, outputs, "output")
        return self._replace(
            B=self.B[:, columns],
            C=self.C[rows],
            D=self.D[np.ix_(rows, columns)],
            inputs=tuple(self.inputs[i] for i in columns),
            outputs=tuple(self.outputs[i] for i in rows),
        )

    def internal(self) -> "LinearModel":
        """The model without the satellite's position and velocity as a whole.

        Nothing depends on them; outputs that are them are dropped.
        """
        kept = [i for i, name in enumerate(self.states) if not name.startswith(_AS_A_WHOLE)]
        gone = [i for i, name in enumerate(self.states) if name.startswith(_AS_A_WHOLE)]
        rows = [i for i in range(len(self.outputs)) if not np.any(self.C[i, gone])]
        return self._replace(
            A=self.A[np.ix_(kept, kept)],
            B=self.B[kept],
            C=self.C[np.ix_(rows, kept)],
            D=self.D[rows],
            states=tuple(self.states[i] for i in kept),
            outputs=tuple(self.outputs[i] for i in rows),
        )

    def response(self, frequency_hz: np.ndarray) -> np.ndarray:
        """Frequency response (frequency, output, input) at frequencies [Hz]."""
        s = 2j * np.pi * np.atleast_1d(frequency_hz)[:, None, None]
        resolvent = np.linalg.solve(s * np.eye(len(self.A)) - self.A, self.B.astype(complex))
        return self.C @ resolvent + self.D

    def to_control(self):
        """A ``control.StateSpace`` with these names."""
        import control  # slow to load, and not needed to integrate

        return control.StateSpace(
            self.A,
            self.B,
            self.C,
            self.D,
            states=list(self.states),
            inputs=list(self.inputs),
            outputs=list(self.outputs),
            remove_useless_states=False,
        )


_AS_A_WHOLE = ("bus_velocity", "bus_position")


def _indices(names: tuple[str, ...], wanted: list[str] | None, kind: str) -> list[int]:
    if wanted is None:
        return list(range(len(names)))
    found: list[int] = []
    for name in wanted:
        match = [i for i, known in enumerate(names) if known == name or known[:-2] == name]
        if not match:
            raise KeyError(f"no {kind} '{name}'; the model has {', '.join(names)}")
        found += match
    return found


def clamped(satellite: Satellite) -> Satellite:
    """The satellite with a bus so heavy (1e12 times) that the base does not move."""
    heavy = (1e12 * satellite.bus.mass, 1e12 * satellite.bus.I_BBcm_B)
    return eqx.tree_at(lambda s: (s.bus.mass, s.bus.I_BBcm_B), satellite, heavy)


def platform_inertia(
    satellite: Satellite, gimbal_angle: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass [kg], mass centre [m] and inertia about it [kg m^2] of the plate with its CMGs.

    Plate axes, imbalance averaged over the rotors' turns.
    """
    mass, c, J = (np.asarray(value) for value in _platform_moments(satellite, gimbal_angle))
    center = c / mass
    own = J - mass * (center @ center * np.eye(3) - np.outer(center, center))
    return float(mass), center, own


@eqx.filter_jit
def _platform_moments(satellite, gimbal_angle):
    still = jnp.zeros(len(satellite.cluster.rotor_mass))
    moments = ClusterMoments.expand(satellite.cluster).averaged()
    carried = moments.at(jnp.asarray(gimbal_angle), still, still, still)
    plate = satellite.plate
    J = carried.J + plate.I_PPcm_P + point_inertia(plate.mass, plate.p_PPcm_P)
    return carried.mass + plate.mass, carried.c + plate.mass * plate.p_PPcm_P, J


class OperatingPointError(ValueError):
    """A motion about which there is no linear model; the message says why."""


class OperatingPoint(NamedTuple):
    """Where to linearise: a steady motion."""

    rate: np.ndarray | Array  # (3,) [rad/s] steady rate of the whole satellite, bus frame
    gimbal_angle: np.ndarray | Array  # (cmg,) [rad]


def linearize(
    satellite: Satellite,
    point: OperatingPoint,
    actuator: Actuator = "servo",
    points: Mapping[str, np.ndarray] | None = None,
) -> LinearModel:
    """Linear model of the uncontrolled satellite about a steady motion.

    Inputs (each with _x _y _z): ``bus_force``, ``bus_torque``, ``plate_force``, ``plate_torque``
    (about each body's origin), ``cmg<j>_force``, ``cmg<j>_torque`` at the rotor centres,
    ``control_torque``; and ``gimbal_rate_command_<j>``, of reaction wheels
    ``rotor_torque_command_<j>``. Outputs: the states, ``leg_stroke_<i>``,
    ``leg_force_<i>``, ``bus_acceleration`` and ``<name>_acceleration`` of further points.

    Args:
        satellite: its controller and loads are left out; its steering law, at the operating point,
            turns ``control_torque`` into gimbal rate commands.
        point: gimbal angles and steady rate.
        actuator: "servo": control torque by gimbal motion through the servo, or by the wheels.
            "ideal": control torque acts on the plate as it is asked for, gimbals held and rotors
            at constant speed.
        points: further points of the bus [m], bus frame, by name.

    Raises:
        OperatingPointError: no equilibrium (what accelerates, and how fast), or no steering there.
    """
    further = {name: jnp.asarray(p, dtype=float) for name, p in (points or {}).items()}
    rigid = satellite.mount == "rigid"
    at = OperatingPoint(jnp.asarray(point.rate, float), jnp.asarray(point.gimbal_angle, float))
    A, B, C, D = _at_equilibrium(satellite, at, further)
    n_cmg, n_leg = len(satellite.cluster.rotor_mass), len(satellite.legs.stiffness)
    wheels = satellite.cluster.wheels
    states, inputs, outputs = _names(n_cmg, n_leg, tuple(further), wheels)
    torque, command = slice(-3 - n_cmg, -n_cmg), slice(-n_cmg, None)
    if actuator == "servo":
        steering = steering_commands(satellite, at.gimbal_angle)
        B[:, torque], D[:, torque] = B[:, command] @ steering, D[:, command] @ steering
    else:
        B[:, command] = D[:, command] = 0.0
    if rigid:
        kept = [i for i, name in enumerate(states) if not name.startswith("plate_")]
        A, B, C = A[np.ix_(kept, kept)], B[kept], C[:, kept]
        states = tuple(states[i] for i in kept)
    if wheels:  # nothing depends on the angles of rotors whose imbalance is averaged
        kept = [i for i, name in enumerate(outputs) if not name.startswith("rotor_angle")]
        C, D, outputs = C[kept], D[kept], tuple(outputs[i] for i in kept)
    unmoved = ("gimbal_", "rotor_") if actuator == "ideal" else ("rotor_angle",)
    if wheels or actuator == "ideal":
        kept = [i for i, name in enumerate(states) if not name.startswith(unmoved)]
        A, B, C = A[np.ix_(kept, kept)], B[kept], C[:, kept]
        states = tuple(states[i] for i in kept)
    return LinearModel(A, B, C, D, states, inputs, outputs)


def _names(n_cmg: int, n_leg: int, points: tuple[str, ...], wheels: bool):
    kinds, command = ("gimbal_angle", "gimbal_rate"), "gimbal_rate_command"
    if wheels:
        kinds, command = ("rotor_angle", "rotor_speed"), "rotor_torque_command"
    spread = lambda names: [f"{name}_{axis}" for name in names for axis in AXES]  # noqa: E731
    units = [f"{kind}_{j}" for kind in kinds for j in range(n_cmg)]
    states = (
        spread(["bus_attitude", "plate_position", "plate_attitude"])
        + spread(["bus_rate", "plate_velocity", "plate_rate"])
        + units
        + spread(["bus_velocity", "bus_position"])
    )
    inputs = (
        spread(["bus_force", "bus_torque", "plate_force", "plate_torque"])
        + [f"cmg{j}_{kind}_{a}" for j in range(n_cmg) for kind in ("force", "torque") for a in AXES]
        + spread(["control_torque"])
        + [f"{command}_{j}" for j in range(n_cmg)]
    )
    legs = [f"{kind}_{i}" for kind in ("leg_stroke", "leg_force") for i in range(n_leg)]
    accelerated = spread(["bus_acceleration", *(f"{name}_acceleration" for name in points)])
    return tuple(states), tuple(inputs), tuple(states + legs + accelerated)


def _chart(satellite: Satellite, at: OperatingPoint, x: Float[Array, " x"]) -> State:
    """The state at deviation x, in the frame that turns with the satellite.

    Wheels have their angles and speeds where CMGs have those of the gimbals.
    """
    n = len(satellite.cluster.rotor_mass)
    cuts = np.cumsum([3, 3, 3, 3, 3, 3, n, n, 3])
    theta_B, r, theta_P, w_B, v_rel, w_P, gamma, gamma_rate, v_B, p_B = jnp.split(x, cuts)
    rate, rotor = at.rate, None
    if satellite.cluster.wheels:
        rotor = RotorState(gamma, satellite.cluster.rotor_speed + gamma_rate)
        gamma = gamma_rate = jnp.zeros(n)
    q_B, q_P = rotation_vector_to_quaternion(theta_B), rotation_vector_to_quaternion(theta_P)
    q_P = quaternion_multiply(q_P, satellite.q_BP)
    r = satellite.p_BP_B + r
    if satellite.mount == "rigid":
        R_B = quaternion_to_matrix(q_B)
        q_P, r = quaternion_multiply(q_B, satellite.q_BP), R_B @ satellite.p_BP_B
        w_P, v_rel = R_B @ (rate + w_B) - rate, R_B @ jnp.cross(rate + w_B, satellite.p_BP_B)
        v_rel = v_rel - jnp.cross(rate, r)
    R_P = quaternion_to_matrix(q_P)
    v_B = v_B + jnp.cross(rate, p_B)
    return State(
        p_NB_N=p_B,
        q_NB=q_B,
        p_NP_N=p_B + r,
        q_NP=q_P,
        v_NB_N=v_B,
        w_NB_B=jnp.asarray(rate + w_B),
        v_NP_N=v_B + v_rel + jnp.cross(rate, r),
        w_NP_P=R_P.T @ (rate + w_P),
        gimbal_angle=jnp.asarray(at.gimbal_angle + gamma),
        gimbal_rate=gamma_rate,
        error_integral=jnp.zeros(3),
        rotor=rotor,
    )


def _rates_and_outputs(
    satellite: Satellite,
    moments: ClusterMoments,
    at: OperatingPoint,
    points: Mapping[str, Float[Array, "3"]],
    x: Float[Array, " x"],
    u: Float[Array, " u"],
) -> tuple[Float[Array, " x"], Float[Array, " y"]]:
    """dx/dt and the outputs, nonlinear; ``control_torque`` acts on the plate as it is."""
    state, rate = _chart(satellite, at, x), at.rate
    n = len(satellite.cluster.rotor_mass)
    cuts = np.cumsum([3, 3, 3, 3, 6 * n, 3])
    bus_force, bus_torque, plate_force, plate_torque, at_cmgs, torque, command = jnp.split(u, cuts)
    plates = plate_motion(state)
    R_B, R_P = plates.R_NB, plates.R_NP
    cmg_force, cmg_torque = jnp.split(at_cmgs.reshape(n, 6), 2, axis=1)
    wrench = Wrench(
        force_P=R_P @ (plate_force + jnp.sum(cmg_force, axis=0)),
        torque_P=R_P
        @ (
            plate_torque
            + jnp.sum(cmg_torque, axis=0)
            + jnp.sum(jnp.cross(_rotor_centres_P(satellite, state.gimbal_angle), cmg_force), axis=0)
        )
        + torque,
        force_B=R_B @ bus_force,
        torque_B=R_B @ bus_torque,
    )
    phi = jnp.zeros(n)  # of no effect: the moments are averaged over it
    moved = unit_acceleration = satellite.servo.bandwidth * (command - state.gimbal_rate)
    spin_up, unit_rate = None, state.gimbal_rate
    if state.rotor is not None:
        spin_up = unit_acceleration = command / satellite.cluster.I_RRcm_R[:, 0, 0]
        moved, unit_rate = jnp.zeros(n), state.rotor.speed - satellite.cluster.rotor_speed
    a = accelerations(satellite, state, phi, moved, wrench, moments, spin_up)

    v_rel = plates.v_P - plates.v_B
    turning = v_rel - jnp.cross(rate, plates.p_BP)  # of P about B, seen in the turning frame
    bus_speed = plates.v_B - jnp.cross(rate, state.p_NB_N)
    x_rate = jnp.concatenate(
        [
            state.w_NB_B - R_B.T @ rate,
            turning,
            plates.w_P - rate,
            R_B.T @ a.w_B,
            a.v_P - a.v_B - jnp.cross(rate, v_rel) - jnp.cross(rate, turning),
            a.w_P - jnp.cross(rate, plates.w_P),
            unit_rate,
            unit_acceleration,
            a.v_B - jnp.cross(rate, plates.v_B) - jnp.cross(rate, bus_speed),
            bus_speed,
        ]
    )
    return x_rate, _outputs(satellite, at, state, a, points, turning, bus_speed)


def _outputs(satellite, at, state, a: Accelerations, points, turning, bus_speed):
    plates = plate_motion(state)
    legs = leg_motion(satellite.legs, plates)
    R_B, w_B = plates.R_NB, plates.w_B
    q_tilt = quaternion_multiply(state.q_NP, quaternion_conjugate(satellite.q_BP))
    unit_angle, unit_rate = state.gimbal_angle - at.gimbal_angle, state.gimbal_rate
    if state.rotor is not None:
        unit_angle = state.rotor.angle
        unit_rate = state.rotor.speed - satellite.cluster.rotor_speed
    arms = [jnp.zeros(3), *(R_B @ p for p in points.values())]
    return jnp.concatenate(
        [
            quaternion_to_rotation_vector(state.q_NB),
            plates.p_BP - satellite.p_BP_B,
            quaternion_to_rotation_vector(q_tilt),
            state.w_NB_B - at.rate,
            turning,
            plates.w_P - at.rate,
            unit_angle,
            unit_rate,
            bus_speed,
            state.p_NB_N,
            legs.length - satellite.legs.nominal_length,
            satellite.legs.strut_force(legs.length, legs.length_rate),
            *(
                R_B.T @ (a.v_B + jnp.cross(a.w_B, r) + jnp.cross(w_B, jnp.cross(w_B, r)))
                for r in arms
            ),
        ]
    )


def _rotor_centres_P(satellite, gimbal_angle):
    cluster = satellite.cluster
    R_PG = eqx.filter_vmap(ControlMomentGyro.R_PG)(cluster, gimbal_angle)
    return cluster.p_PC_P + jnp.einsum("jab,jb->ja", R_PG, cluster.p_CR_G)


def _at_equilibrium(satellite, at, points):
    """A, B, C, D where the plate is in equilibrium.

    Newton's method on the plate's pose: struts may be preloaded, or in the field of a steady turn.
    """
    for _ in range(NEWTON_STEPS):
        matrices, rates = jax.device_get(_jacobians()(satellite, at, points))
        unbalance = _plate_against_bus(rates)
        if satellite.mount == "rigid":
            unbalance[:] = 0.0
        if np.all(np.abs(unbalance) < 1e-11):
            break
        step = np.linalg.solve(_plate_against_bus(matrices[0])[:, 3:9], -unbalance)
        satellite = _moved(satellite, step)
    _check_equilibrium(rates[9:12], unbalance)
    return tuple(np.array(matrix) for matrix in matrices)


NEWTON_STEPS = 20


@eqx.filter_jit
def _moved(satellite, step):
    """The satellite with another pose of its plate: displacement and rotation vector, bus axes."""
    q_BP = quaternion_multiply(rotation_vector_to_quaternion(step[3:]), satellite.q_BP)
    pose = (satellite.p_BP_B + step[:3], q_BP)
    return eqx.tree_at(lambda s: (s.p_BP_B, s.q_BP), satellite, pose)


def _plate_against_bus(rows):
    """Accelerations of the plate relative to the bus, from rows ordered as the state."""
    return np.concatenate([rows[12:15], rows[15:18] - rows[9:12]])


@functools.cache
def _jacobians():
    """``_derivatives``, compiled with little optimisation: it runs once or a few times.

    Compilation takes a fifth of the time; a run takes 2 ms instead of 1.
    """
    options = {"xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 0}
    try:
        jax.jit(lambda: jnp.zeros(()), compiler_options=options)()
    except jax.errors.JaxRuntimeError:  # an XLA that does not know them
        options = {}
    return eqx.filter_jit(_derivatives, compiler_options=options)  # type: ignore[call-overload]


def _derivatives(satellite, at, points):
    """A, B, C, D and dx/dt with the plate in the pose that is its nominal one here."""
    n = len(satellite.cluster.rotor_mass)
    moments = ClusterMoments.expand(satellite.cluster).averaged()

    def system(x, u):
        rates, outputs = _rates_and_outputs(satellite, moments, at, points, x, u)
        return (rates, outputs), rates

    x, u = jnp.zeros(24 + 2 * n), jnp.zeros(15 + 7 * n)
    ((A, B), (C, D)), rates = jax.jacfwd(system, argnums=(0, 1), has_aux=True)(x, u)
    return (A, B, C, D), rates


def steering_commands(satellite: Satellite, gimbal_angle: np.ndarray | Array) -> np.ndarray:
    """Gimbal rate or rotor torque commands (cmg, 3) by control torque, bus axes.

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


SINGULAR = 1e9  # [rad/s per N m] gimbal rates for a torque, above which there is no steering


@eqx.filter_jit
def _steering_matrix(satellite, gimbal_angle):
    axes, h_rms = torque_axes(satellite, gimbal_angle)
    law = satellite.steering or PseudoInverse()
    wanted = -quaternion_to_matrix(satellite.q_BP) / h_rms  # a row for each axis of the torque
    commands = jax.vmap(lambda w: law.rates(axes, w, jnp.zeros(())))(wanted).T
    drive = satellite.cluster.drive
    if isinstance(drive, WheelMotors):
        return commands * jnp.broadcast_to(drive.weights, len(commands))[:, None]
    return commands


def _check_equilibrium(bus: np.ndarray, plate: np.ndarray) -> None:
    if not np.all(np.abs(plate) < 1e-8):
        raise OperatingPointError(
            "the operating point is not an equilibrium: no pose of the plate was found in which "
            f"the struts hold it; it would accelerate with {_listed(plate)} m/s^2, rad/s^2. "
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
