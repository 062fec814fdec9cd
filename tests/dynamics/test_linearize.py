"""The linear model against the nonlinear equations, in time and frequency, and against MuJoCo."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import root
from scipy.spatial.transform import Rotation

import quietbus as qb
from oracles.satellites import (
    awkward_satellite,
    paper_satellite,
    uncontrolled,
    with_control,
    with_units,
)
from oracles.two_bodies import accelerations_of, two_bodies
from quietbus.dynamics.linearize import (
    OperatingPoint,
    OperatingPointError,
    linearize,
    platform_inertia,
)
from quietbus.model.load import Load, Profile
from quietbus.model.steering import NoSteering
from quietbus.model.unit import momentum_P
from quietbus.model.variants import with_base_fixed
from quietbus.spatial.rotation import quaternion_to_matrix
from quietbus.validate.mjcf import write_mjcf
from quietbus.validate.trajectory import fly, held_gimbals, massless_legs

GAMMA = np.array([0.4, -0.7, 1.1, 0.2])
STILL = OperatingPoint(np.zeros(3), GAMMA)
ZERO, NOTHING, HELD = np.zeros(3), np.zeros(6), np.zeros(4)


def quaternion(rotation):
    return jnp.asarray(np.roll(rotation.as_quat(), 1))


def rotation(q):
    return Rotation.from_quat(np.roll(np.asarray(q), -1))


def placed(pose, x, gamma=GAMMA, rate=ZERO):
    """The state at deviation x from a plate in ``pose`` (position, rotation), written anew."""
    theta_B, r, theta_P, w_B, v, w_P = x[:18].reshape(6, 3)
    n = len(gamma)
    v_B, p_B = x[18 + 2 * n :].reshape(2, 3)
    R_B, R_P = Rotation.from_rotvec(theta_B), Rotation.from_rotvec(theta_P) * pose[1]
    arm = pose[0] + r
    speed = v_B + np.cross(rate, p_B)
    return two_bodies(
        p_NB_N=jnp.asarray(p_B),
        q_NB=quaternion(R_B),
        p_NP_N=jnp.asarray(p_B + arm),
        q_NP=quaternion(R_P),
        v_NB_N=jnp.asarray(speed),
        w_NB_B=jnp.asarray(rate + w_B),
        v_NP_N=jnp.asarray(speed + v + np.cross(rate, arm)),
        w_NP_P=jnp.asarray(R_P.inv().apply(rate + w_P)),
        gimbal_angle=jnp.asarray(gamma + x[18 : 18 + n]),
        gimbal_rate=jnp.asarray(x[18 + n : 18 + 2 * n]),
        error_integral=jnp.zeros(3),
    )


def deviation(state, pose, turned=None, rate=ZERO):
    """Attitudes, plate position and rates of a state, seen in a frame turned with the satellite."""
    back = (turned or Rotation.identity()).inv()
    R_B, R_P = back * rotation(state.bus.q_NX), back * rotation(state.bodies["plate"].q_NX)
    arm = back.apply(np.array(state.bodies["plate"].p_NX_N - state.bus.p_NX_N))
    slip = back.apply(np.array(state.bodies["plate"].v_NX_N - state.bus.v_NX_N)) - np.cross(
        rate, arm
    )
    return np.concatenate(
        [
            R_B.as_rotvec(),
            arm - pose[0],
            (R_P * pose[1].inv()).as_rotvec(),
            state.bus.w_NX_X - rate,
            slip,
            R_P.apply(np.array(state.bodies["plate"].w_NX_X)) - rate,
        ]
    )


@eqx.filter_jit
def nonlinear(satellite, state, bus, plate, command):
    """Accelerations with forces and torques in body axes, gimbals behind their servo."""
    R_B, R_P = (quaternion_to_matrix(body.q_NX) for body in (state.bus, state.bodies["plate"]))
    forces = jnp.stack([R_P @ plate[:3], R_P @ plate[3:], R_B @ bus[:3], R_B @ bus[3:]])
    (cluster,) = satellite.clusters
    bandwidth = getattr(cluster.gimbals, "bandwidth", 0.0)  # of wheels none
    driven = bandwidth * (command - state.own["cluster"].y_rate)
    return accelerations_of(satellite.averaged(), state, driven, forces)


def rows(satellite, state, bus=NOTHING, plate=NOTHING, command=HELD):
    """Rates of bus rate, relative plate velocity and plate rate, satellite at rest."""
    args = (jnp.asarray(value) for value in (bus, plate, command))
    a = nonlinear(satellite, state, *args)
    to_bus = rotation(state.bus.q_NX).as_matrix().T
    w_B, v_B, w_P, v_P = (np.array(part) for part in (a.w_B, a.v_B, a.w_P, a.v_P))
    return np.concatenate([to_bus @ w_B, v_P - v_B, w_P])


def equilibrium(satellite):
    """Where preloaded struts hold the plate, found by a solver of its own."""
    nominal = np.array(satellite.mounts[0].p_BX_B), rotation(satellite.mounts[0].q_BX)

    def pose(y):
        return nominal[0] + y[:3], Rotation.from_rotvec(y[3:]) * nominal[1]

    def unbalance(y):
        a = rows(satellite, placed(pose(y), np.zeros(32)))
        return np.concatenate([a[3:6], a[6:9] - a[:3]])

    found = root(unbalance, np.zeros(6), tol=1e-12)
    assert np.abs(unbalance(found.x)).max() < 1e-9
    return pose(found.x)


# --- matrices ----------------------------------------------------------------------------------


@pytest.mark.parametrize("mount", ["isolated", "rigid"])
def test_matrices_are_derivatives_of_the_equations_of_motion(mount):
    """Central differences in coordinates written anew; preload, heavy legs, tilted everything."""
    satellite = awkward_satellite(mount, imbalance=0.0)
    rigid = mount == "rigid"
    pose = (
        (np.array(satellite.mounts[0].p_BX_B), rotation(satellite.mounts[0].q_BX))
        if rigid
        else equilibrium(satellite)
    )
    model = linearize(satellite, STILL, "servo")
    step = 1e-6

    def difference(at):
        return (at(step) - at(-step)) / (2 * step)

    def along(state_index):
        def at(h):
            x = np.zeros(32)
            x[state_index] = h
            if rigid:  # the plate goes where the bus takes it
                tilt, w = Rotation.from_rotvec(x[:3]), x[9:12]
                arm = tilt.apply(pose[0])
                x[3:6], x[6:9] = arm - pose[0], x[:3]
                x[15:18] = tilt.apply(w)
                x[12:15] = np.cross(x[15:18], arm)
            return rows(satellite, placed(pose, x))

        return difference(at)

    names = [name for name in model.states if not rigid or not name.startswith("plate_")]
    full = linearize(awkward_satellite(imbalance=0.0), STILL).states
    shown = [i for i, name in enumerate(full[9:18]) if name in model.states]
    A = np.stack([along(full.index(name)) for name in names], axis=1)[shown]
    wanted = [i for i, name in enumerate(model.states) if name in full[9:18]]
    np.testing.assert_allclose(model.A[wanted], A, atol=2e-7 * np.abs(A).max())

    origin = placed(pose, np.zeros(32))

    def by(key, index):
        def at(h):
            value = np.zeros(6 if key != "command" else 4)
            value[index] = h
            return rows(satellite, origin, **{key: value})

        return difference(at)[shown]

    groups = {"bus": ["bus_force", "bus_torque"], "plate": ["plate_force", "plate_torque"]}
    for key, group in groups.items():
        B = np.stack([by(key, i) for i in range(6)], axis=1)
        have = model.select(group).B[wanted]
        np.testing.assert_allclose(have, B, atol=1e-7 * np.abs(B).max())
    command = [f"gimbal_rate_command_{j}" for j in range(4)]
    B = np.stack([by("command", j) for j in range(4)], axis=1)
    np.testing.assert_allclose(model.select(command).B[wanted], B, atol=1e-7 * np.abs(B).max())


def test_outputs_are_derivatives_of_what_they_are_named_after():
    """Strokes, strut forces and accelerations of a point, by differences of the nonlinear model."""
    satellite = awkward_satellite(imbalance=0.0)
    pose, point, step = equilibrium(satellite), np.array([0.3, -0.4, 0.5]), 1e-6
    model = linearize(satellite, STILL, "servo", {"camera": point})

    def measured(x, plate=NOTHING):
        state = placed(pose, x)
        R_B, R_P = rotation(state.bus.q_NX), rotation(state.bodies["plate"].q_NX)
        (legs,) = satellite.hexapods
        joints, strut = legs.geometry, legs.strut
        span = np.asarray(state.bodies["plate"].p_NX_N - state.bus.p_NX_N) + R_P.apply(
            np.array(joints.p_PU_P)
        )
        span = span - R_B.apply(np.array(joints.p_BA_B))
        w_B, w_P = (
            R_B.apply(np.array(state.bus.w_NX_X)),
            R_P.apply(np.array(state.bodies["plate"].w_NX_X)),
        )
        v = np.asarray(state.bodies["plate"].v_NX_N - state.bus.v_NX_N) + np.cross(
            w_P, R_P.apply(np.array(joints.p_PU_P))
        )
        v = v - np.cross(w_B, R_B.apply(np.array(joints.p_BA_B)))
        length = np.linalg.norm(span, axis=1)
        rate = np.sum(span * v, axis=1) / length
        force = strut.stiffness * (length - strut.free_length) + strut.damping * rate
        a = nonlinear(satellite, state, jnp.zeros(6), jnp.asarray(plate), jnp.zeros(4))
        arm = R_B.apply(point)
        here = a.v_B + np.cross(a.w_B, arm) + np.cross(w_B, np.cross(w_B, arm))
        return np.concatenate([length, force, R_B.inv().apply(np.array(here))])

    unit = np.eye(32)
    C = np.stack([(measured(step * e) - measured(-step * e)) / (2 * step) for e in unit], axis=1)
    D = np.stack(
        [(measured(0 * unit[0], e) - measured(0 * unit[0], -e)) / 2 for e in np.eye(6)], axis=1
    )
    outputs = [f"{kind}_{i}" for kind in ("leg_stroke", "leg_force") for i in range(6)]
    shown = model.select(["plate_force", "plate_torque"], [*outputs, "camera_acceleration"])
    for part in (slice(0, 6), slice(6, 12), slice(12, 15)):
        np.testing.assert_allclose(shown.C[part], C[part], atol=1e-6 * np.abs(C[part]).max())
    np.testing.assert_allclose(shown.D, D, atol=1e-9)


@pytest.mark.parametrize("actuator", ["servo", "ideal"])
def test_control_torque_reaches_the_satellite_by_its_actuator(actuator):
    """Ideal: the torque in bus axes on the plate. Servo: the gimbals' answer, dh/dt = -torque."""
    satellite = with_control(awkward_satellite(imbalance=0.0), steering=NoSteering())
    model = linearize(satellite, STILL, actuator)
    B = model.select(["control_torque"]).B
    if actuator == "ideal":
        R_BP = equilibrium(satellite)[1].as_matrix()
        expected = model.select(["plate_torque"]).B @ R_BP.T
        np.testing.assert_allclose(B, expected, rtol=1e-9, atol=1e-12)
        assert not any(name.startswith("gimbal") for name in model.states)
    else:
        commands = [f"gimbal_rate_command_{j}" for j in range(4)]
        answer = np.linalg.lstsq(model.select(commands).B, B, rcond=None)[0]
        step, R_BP = 1e-6, rotation(satellite.mounts[0].q_BX)
        units = satellite.clusters[0].units
        h = lambda gamma: R_BP.apply(np.array(momentum_P(units, jnp.asarray(gamma)).sum(0)))  # noqa: E731
        by_angle = [(h(GAMMA + step * e) - h(GAMMA - step * e)) / (2 * step) for e in np.eye(4)]
        momentum_rate = np.stack(by_angle, axis=1) @ answer
        np.testing.assert_allclose(momentum_rate, -np.eye(3), atol=1e-9)


# --- time and frequency ------------------------------------------------------------------------


def symmetric(imbalance=0.0):
    """The paper's satellite with a diagonal bus inertia: it can turn steadily about z."""
    satellite = paper_satellite(imbalance=imbalance)
    bus, plate = satellite.bodies
    bus = replace(bus, I_XXcm_X=jnp.diag(jnp.array([1100.0, 900.0, 800.0])))
    return replace(satellite, bodies=(bus, plate))


@pytest.mark.slow
def test_step_response_meets_the_direct_solution_at_second_order():
    """A constant wrench on the plate and bus: what is left out falls with the square."""
    satellite = paper_satellite(imbalance=0.0)
    pose = np.array(satellite.mounts[0].p_BX_B), rotation(satellite.mounts[0].q_BX)
    bus = np.array([3.0, -2.0, 1.0, 5.0, 8.0, -6.0])
    plate = np.array([-20.0, 30.0, 10.0, 10.0, 4.0, -9.0])
    model = linearize(satellite, STILL, "servo").select(
        ["bus_force", "bus_torque", "plate_force", "plate_torque"]
    )
    n, duration = len(model.A), 0.4
    grown = np.zeros((n + 1, n + 1))
    grown[:n, :n], grown[:n, n] = model.A, model.B @ np.concatenate([bus, plate])
    linear = expm(grown * duration)[:18, n]

    def error(amplitude):
        loads = amplitude * np.stack([bus.reshape(2, 3), plate.reshape(2, 3)])
        flown = fly(
            held_gimbals(satellite, loads),
            placed(pose, np.zeros(32)),
            jnp.array([0.0, duration]),
        )
        last = jax.tree.map(lambda leaf: leaf[-1], flown)
        return np.linalg.norm(deviation(last, pose) - amplitude * linear)

    errors = [error(amplitude) for amplitude in (1.0, 0.5, 0.25)]
    assert errors[2] < 1e-2 * np.linalg.norm(0.25 * linear)
    assert 3.8 < errors[0] / errors[1] < 4.2
    assert 3.9 < errors[1] / errors[2] < 4.1


@pytest.mark.slow
@pytest.mark.parametrize("spin", [0.0, 0.3])
def test_free_motion_about_a_steady_turn_meets_the_direct_solution(spin):
    """With momentum on board and a turning satellite every gyroscopic and centrifugal term acts."""
    satellite = symmetric()
    gamma, rate = np.full(4, 0.5), np.array([0.0, 0.0, spin])
    model = linearize(satellite, OperatingPoint(rate, gamma), "servo")
    lift = _steady_lift(satellite, gamma, rate)
    pose = raised(satellite, lift), Rotation.identity()
    rng = np.random.default_rng(3)
    x = np.concatenate([rng.normal(size=9) * 1e-2, rng.normal(size=9) * 0.1, np.zeros(14)])
    duration = 0.5
    held = held_gimbals(satellite)
    turned = Rotation.from_rotvec(rate * duration)
    linear = (expm(model.A * duration) @ x)[:18]
    # the servo of `model` holds the gimbals, as `held` does

    def error(amplitude):
        start = placed(pose, amplitude * x, gamma, rate)
        flown = fly(held, start, jnp.array([0.0, duration]))
        last = jax.tree.map(lambda leaf: leaf[-1], flown)
        return np.linalg.norm(deviation(last, pose, turned, rate) - amplitude * linear)

    errors = [error(amplitude) for amplitude in (0.1, 0.05, 0.025)]
    assert errors[2] < 3e-3 * np.linalg.norm(0.025 * linear)
    assert 3.7 < errors[0] / errors[1] < 4.3
    assert 3.85 < errors[1] / errors[2] < 4.15


def raised(satellite, lift):
    return np.array(satellite.mounts[0].p_BX_B) + np.array([0.0, 0.0, lift])


def _steady_lift(satellite, gamma, rate):
    """Height that the plate gains in a steady turn, where its acceleration is the bus's."""

    def unbalance(lift):
        pose = raised(satellite, lift[0]), Rotation.identity()
        state = placed(pose, np.zeros(32), gamma, rate)
        a = nonlinear(satellite, state, jnp.zeros(6), jnp.zeros(6), jnp.zeros(4))
        return [float(a.v_P[2] - a.v_B[2])]

    return float(root(unbalance, [0.0], tol=1e-14).x[0])


class Sine(Profile):
    """A sine of time."""

    omega: jax.Array

    def factor(self, t):
        return jnp.sin(self.omega * t)

    @property
    def corners(self):
        return jnp.zeros(0)


@pytest.mark.parametrize("frequency", [1.7, 4.4])
def test_frequency_response_meets_a_sine_through_the_nonlinear_equations(frequency):
    """Bus rate by a torque on the plate, read from the last periods of a long flight."""
    satellite = paper_satellite(imbalance=0.0)
    torque, omega = np.array([0.6, -0.4, 0.5]), 2 * np.pi * frequency
    zero = jnp.zeros(3)
    sine = Sine(jnp.asarray(omega))
    load = Load("shaker", ("plate",), "body", zero, jnp.asarray(torque), zero, sine)
    shaken = uncontrolled(satellite, load)
    times = np.linspace(0.0, 6.0, 1201)
    pose = np.array(satellite.mounts[0].p_BX_B), rotation(satellite.mounts[0].q_BX)
    flown = fly(shaken, placed(pose, np.zeros(32)), jnp.asarray(times), 1e-10)
    late = times > 6.0 - 3.0 / frequency
    turn = omega * times[late]
    slow = np.vander(times[late] - 5.0, 4)
    basis = np.column_stack([slow, np.sin(turn), np.cos(turn)])
    fit = np.linalg.lstsq(basis, np.asarray(flown.bus.w_NX_X)[late], rcond=None)[0]
    model = linearize(satellite, STILL, "servo").select(["plate_torque"], ["bus_rate"])
    expected = model.response(np.array([frequency]))[0] @ torque
    np.testing.assert_allclose(fit[-2] + 1j * fit[-1], expected, atol=2e-3 * abs(expected).max())


# --- another engine ----------------------------------------------------------------------------


def test_eigenvalues_of_the_free_satellite_are_those_of_mujocos_matrices():
    """Massless legs as tendons, rotors at rest: mass matrix and slopes of MuJoCo's forces."""
    mujoco = pytest.importorskip("mujoco")
    satellite = massless_legs(paper_satellite(imbalance=0.0))
    satellite = with_units(satellite, rotor_speed=jnp.zeros(4))
    pose = np.array(satellite.mounts[0].p_BX_B), rotation(satellite.mounts[0].q_BX)
    state = placed(pose, np.zeros(32))
    model = mujoco.MjModel.from_xml_string(write_mjcf(satellite, state))
    data = mujoco.MjData(model)
    free = np.concatenate(
        [model.body(name).dofadr[0] + np.arange(6) for name in ("bus", "plate")]
    ).astype(int)

    def force(position, speed):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_integratePos(model, data.qpos, position, 1.0)
        data.qvel[:] = speed
        mujoco.mj_forward(model, data)
        return data.qfrc_passive[free].copy()

    step, still = 1e-6, np.zeros(model.nv)
    unit = np.eye(model.nv)[free]
    K = np.stack([force(-step * e, still) - force(step * e, still) for e in unit], 1) / (2 * step)
    C = np.stack([force(still, -e) - force(still, e) for e in unit], 1) / 2.0
    force(still, still)
    M = np.zeros((model.nv, model.nv))
    for i, e in enumerate(np.eye(model.nv)):
        column = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, column, e)
        M[:, i] = column
    M = M[np.ix_(free, free)]
    theirs = np.linalg.eigvals(
        np.vstack([np.eye(12, 24, 12), -np.linalg.solve(M, np.hstack([K, C]))])
    )
    ours = np.linalg.eigvals(linearize(satellite, STILL, "ideal").A)
    elastic = [np.sort_complex(p[abs(p) > 0.1]) for p in (ours, theirs)]
    assert len(elastic[0]) == 12
    np.testing.assert_allclose(elastic[0], elastic[1], rtol=1e-6)


def test_platform_inertia_is_the_papers_and_follows_the_gimbals():
    mass, center, inertia = platform_inertia(paper_satellite(), np.zeros(4), "plate")
    assert mass == pytest.approx(82.8)
    np.testing.assert_allclose(center, 0.0, atol=1e-12)
    np.testing.assert_allclose(inertia, np.diag([8.8, 8.8, 15.0]), atol=0.01)
    turned = platform_inertia(paper_satellite(), GAMMA, "plate")[2]
    assert np.trace(turned) == pytest.approx(np.trace(inertia))  # turning parts keeps it
    assert np.abs(turned - inertia).max() > 1e-3


# --- interface ---------------------------------------------------------------------------------


def test_named_inputs_and_outputs_reach_python_control():
    model = qb.linearize("zhang2012", points={"camera": [0.0, 0.0, -1.0]})
    system = model.to_control()
    assert tuple(system.input_labels) == model.inputs
    assert tuple(system.output_labels) == model.outputs
    assert {"cmg3_torque_z", "control_torque_x", "gimbal_rate_command_0"} <= set(model.inputs)
    assert {"camera_acceleration_y", "leg_force_5", "plate_rate_z"} <= set(model.outputs)
    frequency = np.array([0.5, 3.0, 100.0])
    theirs = system["bus_rate_x", "cmg1_force_z"](2j * np.pi * frequency)
    ours = model.select(["cmg1_force_z"], ["bus_rate_x"]).response(frequency)[:, 0, 0]
    np.testing.assert_allclose(ours, theirs, rtol=1e-9)
    with pytest.raises(KeyError, match="no input 'wheel'"):
        model.select(["wheel"])


def test_rotor_centre_force_is_a_force_and_a_torque_on_the_plate():
    model = qb.linearize("zhang2012")
    by_force = model.select(["cmg0_force_z"]).B
    on_plate = model.select(["plate_force_z"]).B - 0.42 * model.select(["plate_torque_y"]).B
    np.testing.assert_allclose(by_force, on_plate, atol=1e-12)  # unit 0 sits at x = 0.42 m


def test_position_and_velocity_as_a_whole_act_on_nothing():
    model = qb.linearize("zhang2012")
    inner = model.internal()
    assert len(inner.states) == len(model.states) - 6
    kept = [i for i, name in enumerate(model.states) if name in inner.states]
    gone = [i for i, name in enumerate(model.states) if name not in inner.states]
    np.testing.assert_allclose(model.A[np.ix_(kept, gone)], 0.0, atol=1e-12)


def test_rigid_mount_turns_as_one_body():
    """The torque on the plate of a rigid mount turns the whole inertia."""
    model = qb.linearize("zhang2012", mount="rigid", actuator="ideal")
    assert not any(name.startswith("plate") for name in model.states)
    rate = model.select(["control_torque"], ["bus_rate"]).response(np.array([1.0]))[0]
    inertia = np.linalg.inv(rate * 2j * np.pi).real
    z = 0.6 + 0.25 * np.sqrt(2.0)
    plate = 82.8 * 1000.0 / 1082.8 * z**2 * np.diag([1.0, 1.0, 0.0]) + np.diag([8.8, 8.8, 15.0])
    bus = np.array([[1100, -20, -10], [-20, 900, -15], [-10, -15, 800]])
    np.testing.assert_allclose(inertia, bus + plate, rtol=5e-3)  # and 3 kg of legs


def test_a_point_on_a_turning_bus_feels_the_turn_grow():
    """Centripetal acceleration -w^2 r grows with -2 w r for a rate that grows."""
    turn, arm = 0.2, 1.5
    point = OperatingPoint(np.array([0.0, 0.0, turn]), np.zeros(4))
    model = linearize(symmetric(), point, "ideal", {"tip": np.array([arm, 0.0, 0.0])})
    there = model.select(outputs=["tip_acceleration_x", "bus_acceleration_x"]).C
    row = there[0] - there[1]
    assert row[model.states.index("bus_rate_z")] == pytest.approx(-2.0 * turn * arm, rel=1e-9)


def test_a_heavy_bus_stands_still():
    model = linearize(with_base_fixed(paper_satellite()), STILL, "ideal")
    rate = model.select(["plate_torque"], ["bus_rate"]).response(np.array([2.0]))
    assert np.abs(rate).max() < 1e-12


def test_no_equilibrium_is_said_with_the_acceleration():
    with pytest.raises(OperatingPointError, match=r"not an equilibrium: the bus would accelerate"):
        qb.linearize("zhang2012", rate=[0.0, 0.1, 0.0])


def test_preload_without_an_equilibrium_is_said(monkeypatch):
    monkeypatch.setattr("quietbus.dynamics.linearize.NEWTON_STEPS", 1)
    with pytest.raises(OperatingPointError, match="no pose of the plate"):
        linearize(awkward_satellite(imbalance=0.0), STILL)


def test_singular_cluster_is_said():
    steering = {"control.steering": {"law": "pseudo_inverse"}}
    scenario = qb.load_scenario("zhang2012").with_overrides(steering)
    singular = np.full(4, np.pi / 2)  # all momentum along z
    with pytest.raises(OperatingPointError, match="singular"):
        qb.linearize(scenario, gimbal_angles=singular)
    qb.linearize(scenario, gimbal_angles=singular, actuator="ideal")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rate": [0.0, 1.0]}, "rate: expected 3 finite numbers"),
        ({"gimbal_angles": [0.0]}, "gimbal angles: expected 4 finite numbers"),
        ({"mount": "soft"}, "mount: expected one of"),
        ({"actuator": "magic"}, "actuator: expected one of"),
        ({"points": {"camera": [1.0, np.nan, 0.0]}}, "camera"),
    ],
)
def test_wrong_arguments_are_refused_by_name(options, message):
    with pytest.raises(ValueError, match=message):
        qb.linearize("zhang2012", **options)
