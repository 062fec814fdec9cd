"""The same free flight by quietbus and by MuJoCo.

Both programs fly a satellite whose gimbals keep their rates, under a constant load. Legs are
massless struts, which MuJoCo knows as tendons: no constraint has to be closed, so its own
integrator applies.

Loads are (body, 2, 3) forces [N] and torques [N m] about the bodies' origins, inertial.
"""

from dataclasses import replace

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float
from scipy.linalg import block_diag, eigh

from quietbus.dynamics.closed_loop import state_rate
from quietbus.dynamics.state import State
from quietbus.model.cluster import Cluster
from quietbus.model.controller import NoController
from quietbus.model.element import Rates
from quietbus.model.gimbals import GimbalServos
from quietbus.model.load import Constant, Load
from quietbus.model.satellite import BUS, Satellite
from quietbus.model.steering import NoSteering
from quietbus.model.variants import (
    with_clusters,
    without_friction,
    without_leg_mass,
    without_rotation,
)
from quietbus.programs import compiled
from quietbus.reference.engine import import_mujoco, model_of
from quietbus.reference.mechanism import Mechanism
from quietbus.reference.mjcf import ARMATURE
from quietbus.reference.motion import Motion
from quietbus.solve.integrator import diffeqsolve
from quietbus.spatial.inertia import point_inertia
from quietbus.validate.mjcf import write_mjcf
from quietbus.validate.translate import driven_by, mechanism_of, state_of


def massless_legs(satellite: Satellite) -> Satellite:
    """The satellite with struts only: legs without mass, inertia and joint friction."""
    return without_friction(without_leg_mass(satellite))


def no_loads(satellite: Satellite) -> np.ndarray:
    """Nothing on any body."""
    return np.zeros((len(satellite.bodies), 2, 3))


def load_on(satellite: Satellite, name: str, force: object, torque: object = 0.0) -> np.ndarray:
    """One force [N] and torque [N m] on a body."""
    wrenches = no_loads(satellite)
    number = [body.name for body in satellite.bodies].index(name)
    wrenches[number, 0], wrenches[number, 1] = force, torque
    return wrenches


def held_gimbals(satellite: Satellite, wrenches: np.ndarray | None = None) -> Satellite:
    """The satellite without control, gimbals keeping their rates, under constant loads, or none."""
    parts = [element for element in satellite.others if not element.external]
    if wrenches is not None:
        parts += [
            Load(
                f"load on {body.name}",
                (body.name,),
                "inertial",
                jnp.asarray(force),
                jnp.asarray(torque),
                jnp.zeros(3),
                Constant(),
            )
            for body, (force, torque) in zip(satellite.bodies, wrenches, strict=True)
        ]
    control = replace(satellite.control, controller=NoController(), steering=NoSteering())
    return replace(with_clusters(satellite, _held), others=tuple(parts), control=control)


def _held(cluster: Cluster) -> Cluster:
    if not isinstance(cluster.gimbals, GimbalServos):
        return cluster
    idle = jnp.zeros_like(cluster.gimbals.bandwidth)
    return replace(cluster, gimbals=replace(cluster.gimbals, bandwidth=idle))


def lossless(satellite: Satellite) -> Satellite:
    """The satellite without damping, friction, loads and control, its rotors stopped."""
    damping = lambda s: [legs.strut.damping for legs in s.hexapods]  # noqa: E731
    undamped = eqx.tree_at(damping, satellite, replace_fn=jnp.zeros_like)
    return held_gimbals(without_rotation(without_friction(undamped)))


@compiled
def fly(
    satellite: Satellite, state: State, times: Float[Array, " time"], tolerance: float = 1e-12
) -> State:
    """States at the given times [s] by quietbus's equations, with a leading axis of times.

    The first time is that of ``state``. ``tolerance`` is relative, per step. A flight that cannot
    go on ends in numbers that are not finite.
    """
    satellite = satellite.prepared()
    start, unravel = ravel_pytree(state)

    @jax.jit  # traced once for the integrator's many uses of it
    def rate(t, y, _):
        return ravel_pytree(state_rate(satellite, t, unravel(y)))[0]

    steps = diffrax.PIDController(rtol=tolerance, atol=0.1 * tolerance)
    flight = diffeqsolve(
        diffrax.ODETerm(rate),
        diffrax.Dopri8(),
        times[0],
        times[-1],
        None,
        start,
        # interpolating between steps would cost more than the tolerance
        stepsize_controller=diffrax.ClipStepSizeController(steps, step_ts=times),
        saveat=diffrax.SaveAt(ts=times),
        adjoint=diffrax.ForwardMode(),
        max_steps=200_000,
        throw=False,
    )
    return jax.vmap(unravel)(flight.ys)


def fly_mujoco_to(
    bound: float,
    satellite: Satellite,
    state: State,
    wrenches: np.ndarray,
    times: np.ndarray,
    max_steps: int = 500_000,
) -> tuple[State, float]:
    """States by MuJoCo and an estimate of their own error (see ``differences``).

    The step is halved until the estimate is below ``bound`` or a run would take more than
    ``max_steps``; two runs give one of the next order (Richardson).
    """
    duration = times[-1] - times[0]
    timestep = min(0.1 / fastest_rate(satellite), duration / 200)
    coarse = fly_mujoco(satellite, state, wrenches, times, timestep)
    while True:
        timestep /= 2.0
        fine = fly_mujoco(satellite, state, wrenches, times, timestep)
        best = jax.tree.map(lambda c, f: f + (f - c) / 15.0, coarse, fine)
        own_error = largest_difference(best, fine)
        if own_error < bound or 2.0 * duration / timestep > max_steps:
            return best, own_error
        coarse = fine


def fly_mujoco(
    satellite: Satellite, state: State, wrenches: np.ndarray, times: np.ndarray, timestep: float
) -> State:
    """States at the given times [s] by MuJoCo's fourth-order Runge-Kutta method.

    Args:
        satellite: legs have to be massless and joints without friction; a run-up has to be linear
            and to last for all of the flight.
        wrenches: constant loads.
        times: equally spaced.
        timestep: upper bound [s]; the spacing of the times is divided evenly.
    """
    mujoco = import_mujoco()
    steps = int(np.ceil((times[1] - times[0]) / timestep - 1e-9))
    xml = write_mjcf(satellite, state, "tendons", (times[1] - times[0]) / steps, times[0])
    model = model_of(xml)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    mechanism = mechanism_of(satellite)
    for name, wrench in zip(mechanism.names, wrenches, strict=True):
        data.xfrc_applied[data.body(f"{name}_origin").id] = wrench.ravel()
    _, spin_up = driven_by(satellite, jnp.asarray(times[0], float), state, _idle(satellite))
    for j, acceleration in enumerate(np.asarray(spin_up)):
        data.qfrc_applied[model.joint(f"rotor{j}").dofadr[0]] = ARMATURE * acceleration
    states = [state_of(satellite, _read(mujoco, model, data, mechanism))]
    for _ in times[1:]:
        mujoco.mj_step(model, data, steps)
        states.append(state_of(satellite, _read(mujoco, model, data, mechanism)))
    return jax.tree.map(lambda *leaves: np.stack(leaves), *states)


def _idle(satellite: Satellite) -> dict[str, Rates]:
    """Drives that do nothing."""
    return {c.name: Rates(jnp.zeros(c.driven), jnp.zeros(0)) for c in satellite.clusters}


def differences(a: State, b: State) -> dict[str, float]:
    """Largest difference of two flights, relative to the largest value that flight a has.

    Per quantity of each free body: position, attitude [rad, absolute], velocity, rate. Positions
    of all but the bus are compared relative to it.
    """
    least, found = float(np.finfo(float).tiny), {}
    for name, x in a.bodies.items():
        y = b.bodies[name]
        place_x, place_y = x.p_NX_N, y.p_NX_N
        if name != BUS:
            place_x, place_y = place_x - a.bus.p_NX_N, place_y - b.bus.p_NX_N
        for quantity, one, other in (
            ("position", place_x, place_y),
            ("velocity", x.v_NX_N, y.v_NX_N),
            ("rate", x.w_NX_X, y.w_NX_X),
        ):
            found[f"{name} {quantity}"] = _largest(one - other) / max(_largest(one), least)
        sign = jnp.sign(jnp.sum(x.q_NX * y.q_NX, axis=1, keepdims=True))
        found[f"{name} attitude"] = 2.0 * _largest(x.q_NX - sign * y.q_NX)
    return found


def largest_difference(a: State, b: State) -> float:
    """The largest of ``differences``; not a number if any of them is."""
    return float(np.max(list(differences(a, b).values())))


def fastest_rate(satellite: Satellite) -> float:
    """Largest of rotor speeds, natural frequencies and damping rates, roughly [rad/s].

    Each of the two bodies that struts join on these alone; only to choose a step.
    """
    fastest = max(float(np.max(np.abs(satellite.rotor_speed), initial=0.0)), 1.0)
    nominal = satellite.nominal()
    for legs in satellite.hexapods:
        if not legs.holds:
            continue
        joints = (legs.geometry.p_PU_P, legs.geometry.p_BA_B)
        hosts = [nominal[host] for host in legs.hosts]
        arms = [np.asarray(p @ m.R_AX.T) for p, m in zip(joints, hosts, strict=True)]
        span = np.asarray(hosts[0].p - hosts[1].p) + arms[0] - arms[1]
        s = span / np.linalg.norm(span, axis=1, keepdims=True)
        k, c = (np.asarray(each) for each in legs.tangent[:2])
        for name, motion, arm in zip(legs.hosts, hosts, arms, strict=True):
            mass, inertia = _with_units(satellite, name)
            R = np.asarray(motion.R_AX)
            M = block_diag(mass * np.eye(3), R @ inertia @ R.T)
            rows = np.concatenate([s, np.cross(arm, s)], axis=1)
            stiff = eigh(rows.T @ (k[:, None] * rows), M)[0]
            damped = eigh(rows.T @ (c[:, None] * rows), M)[0]
            fastest = max(fastest, float(np.sqrt(np.max(stiff))), float(np.max(damped)))
    return fastest


def _with_units(satellite: Satellite, name: str) -> tuple[float, np.ndarray]:
    """Mass [kg] and inertia [kg m^2] of a body with its units as points."""
    body = satellite.body(name)
    mass, inertia = float(body.mass_X), np.asarray(body.I_XXcm_X)
    for cluster in satellite.clusters:
        if cluster.hosts[0] == name:
            unit = np.asarray(cluster.units.gimbal_mass + cluster.units.rotor_mass)
            points = map(point_inertia, unit, np.asarray(cluster.units.p_PC_P))
            mass, inertia = mass + unit.sum(), inertia + sum(map(np.asarray, points))
    return mass, inertia


def _largest(vectors: Float[Array, "time 3"]) -> float:
    return float(jnp.max(jnp.linalg.norm(vectors, axis=1)))


def _read(mujoco, model, data, mechanism: Mechanism) -> Motion:
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    bodies = []
    for name in mechanism.names:
        body = data.body(name)
        J, Jw = np.zeros((2, 3, model.nv))
        mujoco.mj_jac(model, data, J, Jw, body.xpos, body.id)
        rate = body.xmat.reshape(3, 3).T @ Jw @ data.qvel
        bodies.append((body.xpos.copy(), body.xquat.copy(), J @ data.qvel, rate))
    wheel = mechanism.units.wheel
    gimbals, rotors = np.zeros((2, len(wheel))), np.zeros((2, len(wheel)))  # wheels have no gimbal
    for found, joint, which in (
        (gimbals, "gimbal", np.flatnonzero(~wheel)),
        (rotors, "rotor", np.arange(len(wheel))),
    ):
        for j in which:
            one = data.joint(f"{joint}{j}")
            found[:, j] = one.qpos[0], one.qvel[0]
    p, q, v, w = (np.array(each) for each in zip(*bodies, strict=True))
    return Motion(p, q, v, w, gimbals[0], gimbals[1], rotors[0], rotors[1], np.zeros(3))
