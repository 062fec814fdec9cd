"""The reference with several platforms, a bench and mixed clusters."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from oracles.plain_data import cmgs, satellite, wheels
from oracles.scenarios import awkward_rigid, awkward_scenario
from quietbus.reference.mechanism import read_mechanism, turn
from quietbus.reference.motion import matrix
from quietbus.reference.multibody import Multibody
from quietbus.reference.satellite import ReferenceSatellite
from quietbus.validate.motions import kicked, random_motion

mujoco = pytest.importorskip("mujoco")

T = 0.7  # [s] at which instants are looked at
ARMATURE = 1e10  # [kg m^2] on hinges that move as they are told


def _text(values):
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _quaternion(R):
    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, np.ravel(R))
    return _text(found)


def _inertial(part):
    I = np.array(part["inertia"])
    I = np.diag(I) if I.ndim == 1 else I
    six = _text([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]])
    centre = _text(part["center_of_mass"])
    return f'<inertial pos="{centre}" mass="{part["mass"]}" fullinertia="{six}"/>'


def _unit(block, j, number):
    """MuJoCo's words for a CMG or wheel; wheels' hinge about the gimbal axis stands still."""
    unit, rotor = block["units"][j], block["rotor"]
    s = np.array(unit["spin_axis"])
    g = np.array(unit["gimbal_axis"]) if block["type"] == "cmg" else np.array([0.0, 0.0, 1.0])
    g = g if block["type"] == "cmg" else (g - g @ s * s) / np.linalg.norm(g - g @ s * s)
    frame = _quaternion(np.stack([s, np.cross(g, s), g], axis=1))
    body = block["gimbal_body" if block["type"] == "cmg" else "housing"]
    spin = rotor.get("spin_inertia") or rotor["momentum"] / rotor["speed"]
    I = np.diag([spin, rotor["transverse_inertia"], rotor["transverse_inertia"]])
    phase = rotor["dynamic_imbalance_phase"]
    product = rotor["dynamic_imbalance"] * np.array([np.cos(phase), np.sin(phase)])
    I[0, 1:], I[1:, 0] = -product, -product
    turning = {
        "mass": rotor["mass"],
        "center_of_mass": [0.0, rotor["static_imbalance"] / rotor["mass"], 0.0],
        "inertia": I,
    }
    hinge = f'type="hinge" armature="{ARMATURE}"'
    return (
        f'<body pos="{_text(unit["position"])}" quat="{frame}">'
        f'<joint name="g{number}" axis="0 0 1" {hinge}/>{_inertial(body)}'
        f'<body pos="{_text(body["center_of_mass"])}">'
        f'<joint name="r{number}" axis="1 0 0" {hinge}/>{_inertial(turning)}</body></body>'
    )


def _by_hand(data, wrenches, motion, seconds):
    """Accelerations (body, 3) of origins and angular, by a model made of the data by hand.

    Legs are MuJoCo's tendons: massless, without friction in joints.

    Args:
        seconds: accelerations (unit,) of gimbals and rotors.
    """
    benches = [{"name": "payload", "isolator": data["payload"]["isolator"], "cluster": []}]
    benches[0]["isolator"] = benches[0]["isolator"] | {"plate": data["payload"]["body"]}
    inside, world, tendons, number = "", "", "", 0
    for platform in [*data["platforms"], *benches]:
        name, isolator = platform["name"], platform["isolator"]
        base, legs = turn(isolator["orientation"]).as_matrix(), isolator["legs"]
        carried = ""
        for i in range(6):
            low, up = np.array(legs["lower_joints"][i]), np.array(legs["upper_joints"][i])
            above = np.array([0.0, 0.0, isolator["separation"]])
            length = np.linalg.norm(up + above - low)
            foot = _text(isolator["offset"] + base @ low)
            inside += f'<site name="{name}A{i}" pos="{foot}"/>'
            carried += f'<site name="{name}U{i}" pos="{_text(up)}"/>'
            tendons += (
                f'<spatial stiffness="{legs["stiffness"]}" damping="{legs["damping"]}" '
                f'springlength="{float(length)!r}"><site site="{name}A{i}"/>'
                f'<site site="{name}U{i}"/></spatial>'
            )
        clusters = platform["cluster"]
        for block in clusters if isinstance(clusters, list) else [clusters]:
            for j in range(len(block["units"])):
                carried += _unit(block, j, number)
                number += 1
        world += (
            f'<body name="{name}"><freejoint name="{name}"/>'
            f"{_inertial(isolator['plate'])}{carried}</body>"
        )
    bus = _inertial(data["bus"] | {"center_of_mass": [0.0] * 3})
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler balanceinertia="false"/><option gravity="0 0 0"/><worldbody>'
        f'<body name="bus"><freejoint name="bus"/>{bus}{inside}</body>{world}</worldbody>'
        f"<tendon>{tendons}</tendon></mujoco>"
    )
    mj = mujoco.MjData(model)
    names = ["bus", *(p["name"] for p in data["platforms"]), "payload"]
    for i, name in enumerate(names):
        q, v = model.joint(name).qposadr[0], model.joint(name).dofadr[0]
        mj.qpos[q : q + 7] = [*motion.p_NX_N[i], *motion.q_NX[i]]
        mj.qvel[v : v + 6] = [*motion.v_NX_N[i], *motion.w_NX_X[i]]
    for kind, angle, rate, second in (
        ("g", motion.gimbal_angle, motion.gimbal_rate, seconds[0]),
        ("r", motion.rotor_angle, motion.rotor_speed, seconds[1]),
    ):
        for j in range(number):
            joint = model.joint(f"{kind}{j}")
            mj.qpos[joint.qposadr[0]], mj.qvel[joint.dofadr[0]] = angle[j], rate[j]
            mj.qfrc_applied[joint.dofadr[0]] = ARMATURE * second[j]
    mujoco.mj_kinematics(model, mj)
    mujoco.mj_comPos(model, mj)
    for name, (force, torque) in zip(names, wrenches, strict=True):
        at = mj.body(name)
        mujoco.mj_applyFT(model, mj, force, torque, at.xpos, at.id, mj.qfrc_applied)
    mujoco.mj_forward(model, mj)
    rows = [model.joint(name).dofadr[0] for name in names]
    R = [mj.body(name).xmat.reshape(3, 3) for name in names]
    w = [R[i] @ mj.qacc[row + 3 : row + 6] for i, row in enumerate(rows)]
    return np.array([mj.qacc[row : row + 3] for row in rows]), np.array(w)


def test_platforms_and_bench_move_as_in_a_mujoco_model_made_by_hand():
    """Massless struts as tendons; random motions, units accelerating, a load on every body."""
    data, rng = satellite(heavy=False), np.random.default_rng(4)
    reference = ReferenceSatellite(data)
    cmg = ~reference.mechanism.units.wheel
    for _ in range(5):
        motion = random_motion(reference, T, rng)
        seconds = rng.uniform(-20.0, 20.0, (2, 6)) * np.array([cmg, np.ones(6)])
        wrenches = rng.uniform(-10.0, 10.0, (4, 2, 3))
        reference.body.set(motion)
        found = reference.body.accelerations(*seconds, wrenches)
        v, w = _by_hand(data, wrenches, motion, seconds)
        np.testing.assert_allclose(found.v, v, rtol=0, atol=1e-9 * np.abs(v).max())
        np.testing.assert_allclose(found.w, w, rtol=0, atol=1e-9 * np.abs(w).max())


def _momentum(multibody, motion):
    """Linear and angular momentum about the inertial origin, as MuJoCo adds them up."""
    multibody.set(motion)
    model, mj = multibody._model, multibody._data
    mujoco.mj_subtreeVel(model, mj)
    p = mj.subtree_linvel[0] * model.body_mass.sum()
    return p, mj.subtree_angmom[0] + np.cross(mj.subtree_com[0], p)


@pytest.mark.parametrize("rigid", [(), (0,), (1, 2)])
def test_momentum_changes_by_the_loads_alone(rigid):
    """Heavy legs with friction, control and units at work; some platforms welded to the bus."""
    data = satellite()
    mounts = [each["isolator"] for each in [*data["platforms"], data["payload"]]]
    for i in rigid:
        mounts[i]["mount"] = "rigid"
    force, torque = np.array([3.0, -2.0, 1.0]), np.array([0.5, 1.5, -1.0])
    common = {"frame": "inertial", "point": [0.1, 0.2, 0.3], "profile": "constant"}
    data["loads"] = [
        {"body": "payload", "force": [0.0] * 3, "torque": torque.tolist()} | common,
        {"body": "south", "force": force.tolist(), "torque": [0.0] * 3} | common,
    ]
    reference = ReferenceSatellite(data)
    number = reference.mechanism.names.index("south")
    start = kicked(reference, reference.initial(), np.random.default_rng(1))
    times = np.linspace(0.0, 0.03, 31)
    flight = reference.fly(start, times)
    p, H = np.moveaxis([_momentum(reference.body, motion) for motion in flight], 1, 0)
    gained = p - p[0] - force * times[:, None]
    assert np.abs(gained).max() <= 1e-9 * np.abs(p).max()
    at = [m.p_NX_N[number] + matrix(m.q_NX[number]) @ common["point"] for m in flight]
    # Simpson's rule is of the fourth order: the point moves little in a step
    rate = torque + np.cross(at, force)
    arms = (times[2] / 6.0) * (rate[:-2:2] + 4.0 * rate[1:-1:2] + rate[2::2]).sum(axis=0)
    assert np.abs(H[-1] - H[0] - arms).max() <= 1e-8 * np.abs(H).max()
    assert np.abs(H[-1] - H[0]).max() > 1e-3 * np.abs(H).max() * times[-1]


def test_a_welded_platform_moves_with_the_bus_as_one_body():
    data = satellite()
    data["platforms"][0]["isolator"]["mount"] = "rigid"
    reference = ReferenceSatellite(data)
    motion = random_motion(reference, T, np.random.default_rng(3))
    a = reference.at(T, motion).accelerations
    w = matrix(motion.q_NX[0]) @ motion.w_NX_X[0]
    arm = motion.p_NX_N[1] - motion.p_NX_N[0]
    rigid = a.v[0] + np.cross(a.w[0], arm) + np.cross(w, np.cross(w, arm))
    np.testing.assert_allclose(a.v[1], rigid, rtol=1e-11)
    np.testing.assert_allclose(a.w[1], a.w[0], rtol=1e-11)
    assert np.linalg.norm(a.w[2] - a.w[0]) > 1e-2 * np.linalg.norm(a.w[0])


def _apart(data, others, order=slice(None)):
    """Largest difference of accelerations and rates of two satellites' data at random motions.

    Args:
        order: of the bodies of the first in the second.
    """
    one, other = ReferenceSatellite(data), ReferenceSatellite(others)
    found = [np.abs(one.initial().rotor_angle - other.initial().rotor_angle).max()]
    for seed in range(4):
        motion = random_motion(one, T, np.random.default_rng(seed))
        bodies = ("p_NX_N", "q_NX", "v_NX_N", "w_NX_X")
        moved = replace(motion, **{name: getattr(motion, name)[order] for name in bodies})
        a, b = one.at(T, motion), other.at(T, moved)
        for x, y in (
            (a.accelerations.v[order], b.accelerations.v),
            (a.accelerations.w[order], b.accelerations.w),
            (a.rates.gimbal_rate, b.rates.gimbal_rate),
            (a.rates.rotor_speed, b.rates.rotor_speed),
            (a.rates.error_integral, b.rates.error_integral),
        ):
            found.append(np.abs(x - y).max() / max(np.abs(x).max(), 1e-300))
    return max(found)


@pytest.mark.parametrize("make", [awkward_scenario, awkward_rigid])
def test_one_platform_in_a_list_and_a_cluster_in_two_blocks_are_what_they_were(make):
    """Lines, ripple and random phases included: units are numbered through the blocks."""
    single = make().to_dict()
    listed = copy.deepcopy(single)
    cluster = listed.pop("cluster")
    pyramid = cluster.pop("pyramid")
    units = []
    for j in range(4):
        a, b = np.pi / 2.0 * j, pyramid["skew"]
        out, up = np.array([np.cos(a), np.sin(a), 0.0]), np.array([0.0, 0.0, 1.0])
        units.append(
            {
                "position": (pyramid["radius"] * out + pyramid["height"] * up).tolist(),
                "gimbal_axis": (np.sin(b) * out + np.cos(b) * up).tolist(),
                "spin_axis": np.cross(up, out).tolist(),
            }
        )

    def part(some):
        block = cluster | {"units": units[some], "gimbal_angles": cluster["gimbal_angles"][some]}
        phases = cluster["rotor_phases"]
        return block | {"rotor_phases": phases if phases == "random" else phases[some]}

    blocks = [part(slice(0, 1)), part(slice(1, 4))]
    isolator = listed.pop("isolator")
    listed["platforms"] = [{"name": "plate", "isolator": isolator, "cluster": blocks}]
    assert _apart(single, listed) < 1e-9


def test_the_order_of_platforms_does_not_matter():
    """Units keep their numbers, since only the first has any; their rotors have lines."""
    data = satellite()
    line = {"order": 1.3, "radial_force": 2e-5, "axial_force": 1e-5, "phase": 0.4}
    line |= {"radial_torque": 3e-6, "axial_torque": 1e-6, "whirl": "forward"}
    for block in data["platforms"][0]["cluster"]:
        block["rotor"]["disturbance"] = {"orders": [line], "resonances": {}, "seed": 0}
    data["platforms"][1]["cluster"] = []
    swapped = data | {"platforms": data["platforms"][::-1]}
    assert _apart(data, swapped, np.array([0, 2, 1, 3])) < 1e-9


def test_a_bench_that_stands_on_a_platform_pushes_that_platform():
    """Legs between any bodies: pressed struts push both ends alike, and not the bus."""
    data = satellite(heavy=False)
    for each in [*data["platforms"], data["payload"]]:
        each["isolator"]["legs"] |= {"stiffness": 0.0, "damping": 0.0}
    data["payload"]["isolator"]["legs"] |= {"stiffness": 2e4, "free_length": [0.6] * 6}
    alone = read_mechanism(data)
    bench, below = alone.legs.upper_body == 3, 1
    R, p = alone.R_BX[below], alone.p_BX_B[below]
    foot = np.where(bench[:, None], (alone.legs.lower_joint_Y - p) @ R, alone.legs.lower_joint_Y)
    axis = np.where(bench[:, None], alone.legs.axis_Y @ R, alone.legs.axis_Y)
    legs = replace(
        alone.legs,
        lower_body=np.where(bench, below, alone.legs.lower_body),
        lower_joint_Y=foot,
        axis_Y=axis,
    )
    start = ReferenceSatellite(data).initial()
    still = replace(
        start,
        v_NX_N=0.0 * start.v_NX_N,
        w_NX_X=0.0 * start.w_NX_X,
        rotor_speed=0.0 * start.rotor_speed,
    )
    body = Multibody(replace(alone, legs=legs), still)
    body.set(still)
    zero = np.zeros(6)
    found = body.accelerations(zero, zero, np.zeros((4, 2, 3)))
    assert np.abs([found.v[0], found.v[2], found.w[0], found.w[2]]).max() < 1e-9
    forces = body.joint_forces(found).spherical_force[bench].sum(axis=0)
    assert np.linalg.norm(forces) > 10.0
    mass, centre = 60.0, matrix(still.q_NX[3]) @ [0.02, 0.01, -0.05]
    moved = mass * (found.v[3] + np.cross(found.w[3], centre))
    np.testing.assert_allclose(moved, -forces, rtol=1e-9)
    assert np.linalg.norm(found.v[below]) > 1.0


def _decide(blocks, torque, speeds, law="pseudo_inverse"):
    """Decisions of a platform that is not turned when a torque [N m] is asked for by position."""
    data = satellite()
    data["platforms"] = [data["platforms"][0] | {"cluster": blocks}]
    data["platforms"][0]["isolator"]["orientation"] = [0.0, 0.0, 0.0]
    data["initial"] = {"attitude": [0.0] * 3, "rate": [0.0] * 3}
    data["target"]["attitude"] = [0.0] * 3
    data["control"] |= {
        "pid": {"kp": 0.0, "ki": 1.0, "kd": 4.0},
        "steering": {"law": law, "lambda0": 0.5, "mu": 1.0},
    }
    reference = ReferenceSatellite(data)
    start = replace(reference.initial(), error_integral=-np.array(torque))
    return reference.control.decide(0.0, replace(start, rotor_speed=np.array(speeds)))


X, Y, Z = np.eye(3).tolist()
# at gimbal angle zero its rate takes the momentum of 15 N m s along x: t = g x s
ALONG_X = {"position": [0.0] * 3, "gimbal_axis": Z, "spin_axis": [0.0, -1.0, 0.0]}


def _cmg_and_wheels(**limits):
    return [
        cmgs(1, units=[ALONG_X], gimbal_angles=[0.0], **limits),
        wheels([X, Y, Z], motor={"torque_limit": 2.0, "speed_limit": 400.0}),
    ]


def test_torque_is_shared_by_the_squares_of_what_units_can_do():
    """A CMG that gives 3 N m at most and a wheel that gives 2 N m, both along x."""
    blocks = _cmg_and_wheels(gimbal_rate_limit=0.2)
    found = _decide(blocks, [1.3, 0.4, -0.6], [500.0, 10.0, 10.0, 10.0])
    rate, torques = found.gimbal_acceleration[0] / 40.0, 0.02 * found.rotor_acceleration[1:]
    # their momentum takes up what the bus is to feel
    assert 15.0 * rate == pytest.approx(-1.3 * 9.0 / 13.0, rel=1e-12)
    np.testing.assert_allclose(torques, [-1.3 * 4.0 / 13.0, -0.4, 0.6], rtol=1e-12)
    assert found.torque_share == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_array_equal(found.gimbal_acceleration[1:], 0.0)


def test_without_limits_a_cmg_counts_by_one_radian_a_second_and_a_wheel_by_one_newton_metre():
    blocks = _cmg_and_wheels()
    blocks[1]["motor"] = {}
    found = _decide(blocks, [10.0, 0.0, 0.0], [500.0, 0.0, 0.0, 0.0])
    share = 15.0**2 / (15.0**2 + 1.0)
    assert 15.0 * found.gimbal_acceleration[0] / 40.0 == pytest.approx(-10.0 * share, rel=1e-12)
    # products of the three directions' own share: sqrt((15^2 + 1) 1 1) over the RMS cubed
    rms = np.sqrt((15.0**2 + 3.0) / 4.0)
    assert found.singularity == pytest.approx(np.sqrt(15.0**2 + 1.0) / rms**3, rel=1e-12)


def test_units_of_tilted_platforms_give_the_torque_along_the_axes_of_the_bus():
    """Three CMGs and a wheel on one platform, two wheels on another: what they all do adds up."""
    data = satellite()
    data["control"]["pid"] = {"kp": 0.0, "ki": 1.0, "kd": 4.0}
    reference = ReferenceSatellite(data)
    target = turn(data["target"]["attitude"]).as_quat(scalar_first=True)
    start, torque = reference.initial(), np.array([0.03, -0.02, 0.01])
    motion = replace(
        start,
        q_NX=np.tile(target, (4, 1)),
        w_NX_X=np.zeros((4, 3)),
        error_integral=-torque,
    )
    found, given, number = reference.control.decide(0.0, motion), np.zeros(3), 0
    for platform in data["platforms"]:
        tilt, clusters = turn(platform["isolator"]["orientation"]), platform["cluster"]
        for block in clusters if isinstance(clusters, list) else [clusters]:
            for j, unit in enumerate(block["units"]):
                s, change = np.array(unit["spin_axis"]), 0.02 * found.rotor_acceleration[number]
                if block["type"] == "cmg":
                    g, gamma = np.array(unit["gimbal_axis"]), block["gimbal_angles"][j]
                    s = np.cross(g, Rotation.from_rotvec(gamma * g).apply(s))
                    change = 15.0 * found.gimbal_acceleration[number] / 40.0
                given += tilt.apply(change * s)
                number += 1
    np.testing.assert_allclose(given, -torque, rtol=1e-12)


@pytest.mark.parametrize("beyond", [1.0, 2.5])
def test_one_factor_cuts_all_commands_and_what_is_lost_is_unwound(beyond):
    """The wheel along y is the first at its limit; direction stays, dq/dt = (T - T_d) / 2."""
    torque = beyond * np.array([1.3, 2.0, -0.6])
    found = _decide(_cmg_and_wheels(gimbal_rate_limit=0.2), torque, [500.0, 10.0, 10.0, 10.0])
    torques = 0.02 * found.rotor_acceleration[1:]
    np.testing.assert_allclose(torques[1:], [-2.0, 0.6], rtol=1e-12)
    assert 15.0 * found.gimbal_acceleration[0] / 40.0 == pytest.approx(-0.9, rel=1e-12)
    assert found.torque_share == pytest.approx(1.0 / beyond, rel=1e-12)
    # K_i = 1 and K_d = 4, so that the time of unwinding is 2 s; the error is zero
    expected = (1.0 - 1.0 / beyond) * torque / 2.0
    np.testing.assert_allclose(found.integral_rate, expected, rtol=1e-12, atol=1e-14)


def test_a_wheel_at_the_end_of_its_speed_gives_nothing_further_and_all_back():
    """At 400 rad/s along y: -0.4 N m on the bus would speed it up, +0.4 N m slow it down."""
    speeds = [500.0, 10.0, 400.0, 10.0]
    blocks = _cmg_and_wheels(gimbal_rate_limit=0.2)
    stuck = _decide(blocks, [0.3, -0.4, 0.0], speeds)
    assert stuck.rotor_acceleration[2] == 0.0
    assert stuck.torque_share == pytest.approx(0.09 / 0.25, rel=1e-12)
    np.testing.assert_allclose(stuck.integral_rate, [0.0, -0.2, 0.0], atol=1e-14)
    back = _decide(blocks, [0.3, 0.4, 0.0], speeds)
    assert 0.02 * back.rotor_acceleration[2] == pytest.approx(-0.4, rel=1e-12)


def test_robust_law_leaves_out_its_share_of_each_direction():
    """Along axes whose singular values are known the share is sigma^2 / (sigma^2 + lambda)."""
    found = _decide(
        _cmg_and_wheels(gimbal_rate_limit=0.2),
        [0.5, 0.0, 0.0],
        [500.0, 0.0, 0.0, 0.0],
        "singularity_robust",
    )
    square = np.array([13.0, 4.0, 4.0]) / ((13.0 + 4.0 + 4.0) / 4.0)  # of sigma
    weight = 0.5 * np.exp(-np.prod(square))
    assert found.singularity == pytest.approx(np.sqrt(np.prod(square)), rel=1e-12)
    assert found.torque_share == pytest.approx(square[0] / (square[0] + weight), rel=1e-12)
