"""The same free flight by quietbus and by MuJoCo.

Both programs fly a satellite whose gimbals keep their rates, under a constant load. Legs are
massless struts, which MuJoCo knows as tendons: no constraint has to be closed, so its own
integrator applies.
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

from quietbus.dynamics.closed_loop import rotor_angles, state_rate
from quietbus.dynamics.equations import Wrench
from quietbus.dynamics.state import State
from quietbus.model.cmg import ClusterMoments
from quietbus.model.load import Constant, Load
from quietbus.model.satellite import Satellite
from quietbus.model.variants import without_friction, without_leg_mass, without_rotation
from quietbus.reference.engine import import_mujoco
from quietbus.reference.mjcf import ARMATURE
from quietbus.solve.integrator import diffeqsolve
from quietbus.spatial.inertia import point_inertia
from quietbus.validate.mjcf import write_mjcf
from quietbus.validate.translate import mechanism_of


def massless_legs(satellite: Satellite) -> Satellite:
    """The satellite with struts only: legs without mass, inertia and joint friction."""
    return without_friction(without_leg_mass(satellite))


def held_gimbals(satellite: Satellite, wrench: Wrench) -> Satellite:
    """The satellite without control, gimbals keeping their rates, under a constant load."""
    zero = jnp.zeros(3)
    loads = (
        Load("plate", "inertial", wrench.force_P, wrench.torque_P, zero, Constant()),
        Load("bus", "inertial", wrench.force_B, wrench.torque_B, zero, Constant()),
    )
    servo = replace(satellite.servo, bandwidth=jnp.zeros(()))
    return replace(satellite, controller=None, steering=None, loads=loads, servo=servo)


def lossless(satellite: Satellite) -> Satellite:
    """The satellite without damping, friction, loads and control, its rotors stopped."""
    undamped = replace(satellite.legs, damping=jnp.zeros_like(satellite.legs.damping))
    still = without_rotation(without_friction(replace(satellite, legs=undamped)))
    return held_gimbals(still, Wrench.zero())


def at_constant_speed(satellite: Satellite, state: State) -> tuple[Satellite, State]:
    """Satellite and state with rotors that keep the speeds which they have in the state."""
    if state.rotor is None:
        return satellite, state
    cluster = replace(satellite.cluster, rotor_speed=state.rotor.speed)
    return replace(satellite, cluster=cluster), replace(state, rotor=None)


@eqx.filter_jit
def fly(
    satellite: Satellite, state: State, times: Float[Array, " time"], tolerance: float = 1e-12
) -> State:
    """States at the given times [s] by quietbus's equations, with a leading axis of times.

    The first time is that of ``state``. ``tolerance`` is relative, per step. A flight that cannot
    go on ends in numbers that are not finite.
    """
    moments = ClusterMoments.expand(satellite.cluster)
    start, unravel = ravel_pytree(state)

    @jax.jit  # traced once for the integrator's many uses of it
    def rate(t, y, _):
        return ravel_pytree(state_rate(satellite, t, unravel(y), None, moments))[0]

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
    wrench: Wrench,
    times: np.ndarray,
    max_steps: int = 500_000,
) -> tuple[State, float]:
    """States by MuJoCo and an estimate of their own error (see ``differences``).

    The step is halved until the estimate is below ``bound`` or a run would take more than
    ``max_steps``; two runs give one of the next order (Richardson).
    """
    duration = times[-1] - times[0]
    timestep = min(0.1 / fastest_rate(satellite), duration / 200)
    coarse = fly_mujoco(satellite, state, wrench, times, timestep)
    while True:
        timestep /= 2.0
        fine = fly_mujoco(satellite, state, wrench, times, timestep)
        best = jax.tree.map(lambda c, f: f + (f - c) / 15.0, coarse, fine)
        own_error = largest_difference(best, fine)
        if own_error < bound or 2.0 * duration / timestep > max_steps:
            return best, own_error
        coarse = fine


def fly_mujoco(
    satellite: Satellite, state: State, wrench: Wrench, times: np.ndarray, timestep: float
) -> State:
    """States at the given times [s] by MuJoCo's fourth-order Runge-Kutta method.

    Args:
        satellite: legs have to be massless and joints without friction; a run-up has to be linear
            and to last for all of the flight.
        wrench: constant load.
        times: equally spaced.
        timestep: upper bound [s]; the spacing of the times is divided evenly.
    """
    mujoco = import_mujoco()
    steps = int(np.ceil((times[1] - times[0]) / timestep - 1e-9))
    phi = np.asarray(rotor_angles(satellite, times[0], state))
    xml = write_mjcf(satellite, state, "tendons", (times[1] - times[0]) / steps, phi)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    for body, force, torque in (
        ("plate_origin", wrench.force_P, wrench.torque_P),
        ("bus", wrench.force_B, wrench.torque_B),
    ):
        data.xfrc_applied[data.body(body).id] = np.concatenate([force, torque])
    if satellite.cluster.run_up is not None and state.rotor is not None:
        acceleration = np.asarray(satellite.cluster.run_up.acceleration(jnp.asarray(times[0])))
        for j, spin_up in enumerate(acceleration):
            data.qfrc_applied[model.joint(f"rotor{j}").dofadr[0]] = ARMATURE * spin_up
    states = [_read(mujoco, model, data, satellite)]
    for _ in times[1:]:
        mujoco.mj_step(model, data, steps)
        states.append(_read(mujoco, model, data, satellite))
    return jax.tree.map(lambda *leaves: np.stack(leaves), *states)


def differences(a: State, b: State) -> dict[str, float]:
    """Largest difference of two flights, relative to the largest value that flight a has.

    Per quantity of bus and plate: position, attitude [rad, absolute], velocity, rate. Positions of
    the plate are compared relative to the bus.
    """
    a_plate, b_plate = a.p_NP_N - a.p_NB_N, b.p_NP_N - b.p_NB_N
    pairs = {
        "bus position": (a.p_NB_N, b.p_NB_N),
        "plate position": (a_plate, b_plate),
        "bus velocity": (a.v_NB_N, b.v_NB_N),
        "plate velocity": (a.v_NP_N, b.v_NP_N),
        "bus rate": (a.w_NB_B, b.w_NB_B),
        "plate rate": (a.w_NP_P, b.w_NP_P),
    }
    least = float(np.finfo(float).tiny)
    found = {name: _largest(x - y) / max(_largest(x), least) for name, (x, y) in pairs.items()}
    for name, x, y in (("bus attitude", a.q_NB, b.q_NB), ("plate attitude", a.q_NP, b.q_NP)):
        sign = jnp.sign(jnp.sum(x * y, axis=1, keepdims=True))
        found[name] = 2.0 * _largest(x - sign * y)
    return found


def largest_difference(a: State, b: State) -> float:
    """The largest of ``differences``; not a number if any of them is."""
    return float(np.max(list(differences(a, b).values())))


def fastest_rate(satellite: Satellite) -> float:
    """Largest of rotor speeds, natural frequencies and damping rates, roughly [rad/s].

    Each of the two plates on the struts alone; only to choose a step.
    """
    legs, cluster = satellite.legs, satellite.cluster
    unit = np.asarray(cluster.gimbal_mass + cluster.rotor_mass)
    inertia_P = np.asarray(satellite.plate.I_PPcm_P)  # with the units as points
    inertia_P = inertia_P + sum(map(point_inertia, unit, np.asarray(cluster.p_PC_P)))
    spans = mechanism_of(satellite).spans_Y
    s = spans / np.linalg.norm(spans, axis=1, keepdims=True)
    fastest = float(np.max(np.abs(cluster.rotor_speed)))
    if satellite.mount == "rigid":
        return max(fastest, 1.0)
    for mass, inertia, arms in (
        (satellite.plate.mass + unit.sum(), inertia_P, legs.p_PU_P),
        (satellite.bus.mass, satellite.bus.I_BBcm_B, legs.p_BA_B),
    ):
        rows = np.concatenate([s, np.cross(arms, s)], axis=1)
        M = block_diag(mass * np.eye(3), inertia)
        stiff = eigh(rows.T @ (np.asarray(legs.stiffness)[:, None] * rows), M)[0]
        damped = eigh(rows.T @ (np.asarray(legs.damping)[:, None] * rows), M)[0]
        fastest = max(fastest, float(np.sqrt(np.max(stiff))), float(np.max(damped)))
    return fastest


def _largest(vectors: Float[Array, "time 3"]) -> float:
    return float(jnp.max(jnp.linalg.norm(vectors, axis=1)))


def _read(mujoco, model, data, satellite: Satellite) -> State:
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    bodies = []
    for name in ("bus", "plate"):
        body = data.body(name)
        J, Jw = np.zeros((2, 3, model.nv))
        mujoco.mj_jac(model, data, J, Jw, body.xpos, body.id)
        rate = body.xmat.reshape(3, 3).T @ Jw @ data.qvel
        bodies.append((body.xpos.copy(), body.xquat.copy(), J @ data.qvel, rate))
    cmgs = range(len(satellite.cluster.rotor_speed))
    gimbals = np.zeros((2, len(cmgs)))  # wheels have none
    if not satellite.cluster.wheels:
        joints = [data.joint(f"gimbal{j}") for j in cmgs]
        gimbals = np.array([[joint.qpos[0], joint.qvel[0]] for joint in joints]).T
    (p_B, q_B, v_B, w_B), (p_P, q_P, v_P, w_P) = bodies
    return State(
        p_NB_N=p_B,
        q_NB=q_B,
        p_NP_N=p_P,
        q_NP=q_P,
        v_NB_N=v_B,
        w_NB_B=w_B,
        v_NP_N=v_P,
        w_NP_P=w_P,
        gimbal_angle=gimbals[0],
        gimbal_rate=gimbals[1],
        error_integral=jnp.zeros(3),
    )
