"""Every convention of docs/coming-from.md beside the other tool's, written out from its source.

The other tools' sides are plain NumPy from published equations: Basilisk's (H. Schaub's group,
``reactionWheelStateEffector``, ``vscmgStateEffector``, ``mrpFeedback``), S2E's
(``reaction_wheel_jitter``), 42's (``42jitter``), MathWorks' ``quat2dcm``. MuJoCo and SciPy run.
"""

import re
from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import quietbus as qb
from quietbus.build import build_initial_state, build_satellite
from quietbus.model.controller import Measured
from quietbus.model.disturbance import on_carrier
from quietbus.model.moments import ClusterMoments, Turning
from quietbus.scenario import Scenario, builtin_text
from quietbus.spatial.rotation import attitude_error, quaternion_rate, quaternion_to_matrix

PAGE = (Path(__file__).parents[1] / "docs/coming-from.md").read_text(encoding="utf-8")
RNG = np.random.default_rng(2012)
R_NB = Rotation.random(rng=RNG)
X, Y, Z, W = R_NB.as_quat()  # SciPy's order
Q_NB = np.array([W, X, Y, Z])
NAMES_ONLY = {  # rows that give another name, and no convention
    "`SimBaseClass`, `CreateNewProcess`, `CreateNewTask`",
    "`vscmgJitterFullyCoupled`, `JitterFullyCoupled`",
    "`VSCMGArrayTorqueMsg`: wheel and gimbal torques",
    "`scStateOutMsg.recorder()`",
    "times in nanoseconds (`macros.sec2nano`)",
    "joints",
    "time step",
    "rotor speed",
    "derivatives",
    "contact",
}
TESTED = set()


def row(*names):
    """Mark a test as that of rows of the page's tables."""
    TESTED.update(names)
    return lambda test: test


def near(found, expected, **how):
    np.testing.assert_allclose(np.asarray(found), expected, **{"rtol": 1e-12, "atol": 1e-12} | how)


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def mrp_dcm(sigma):
    """Basilisk's [BN] of sigma_BN: inertial to body."""
    square, tilde = sigma @ sigma, skew(sigma)
    return np.eye(3) + (8 * tilde @ tilde - 4 * (1 - square) * tilde) / (1 + square) ** 2


def mrp(rotation):
    """Modified Rodrigues parameters tan(angle / 4) along the axis."""
    vector = rotation.as_rotvec()
    angle = np.linalg.norm(vector)
    return np.tan(angle / 4) * vector / angle


def zhang(**changes):
    data = Scenario.from_yaml(builtin_text("zhang2012")).to_dict()
    return Scenario.from_dict(data).with_overrides(
        {path.replace("__", "."): value for path, value in changes.items()}
    )


# --- conventions ----------------------------------------------------------------------------------


@row("units")
def test_units():
    scenario = zhang(cluster__rotor__speed="6000 rpm", cluster__rotor__static_imbalance="1.36 g*cm")
    assert scenario.cluster.rotor.speed == pytest.approx(6000 * 2 * np.pi / 60)
    assert scenario.cluster.rotor.static_imbalance == pytest.approx(1.36e-3 * 1e-2)


@row("quaternion", "direction cosine matrix")
def test_quaternions_and_matrices():
    near(quaternion_to_matrix(Q_NB), R_NB.as_matrix())
    # MathWorks, quat2dcm: scalar first, inertial to body
    w, x, y, z = Q_NB
    quat2dcm = np.array(
        [
            [w*w + x*x - y*y - z*z, 2 * (x*y + w*z), 2 * (x*z - w*y)],
            [2 * (x*y - w*z), w*w - x*x + y*y - z*z, 2 * (y*z + w*x)],
            [2 * (x*z + w*y), 2 * (y*z - w*x), w*w - x*x - y*y + z*z],
        ]
    )  # fmt: skip
    near(quat2dcm.T, quaternion_to_matrix(Q_NB))
    near(mrp_dcm(mrp(R_NB)).T, quaternion_to_matrix(Q_NB))


@row("`quaternion_i2b`, `quaternion_b2c`")
def test_s2e_quaternions_are_ours_with_the_scalar_last():
    """S2E's InverseFrameConversion, q v q*, takes components in b to those in i."""
    vector = RNG.normal(size=3)

    def product(a, b):  # scalar last, Hamilton's
        u, v = a[:3], b[:3]
        return np.r_[a[3] * v + b[3] * u + np.cross(u, v), a[3] * b[3] - u @ v]

    q_i2b = np.roll(Q_NB, -1)
    back = product(product(q_i2b, np.r_[vector, 0.0]), q_i2b * [-1, -1, -1, 1])
    near(back[:3], quaternion_to_matrix(Q_NB) @ vector)


@row("`qn`, `qbn`")
def test_42s_quaternion_is_ours_with_the_scalar_last():
    q = np.roll(Q_NB, -1)
    # 42's Q2C
    twice = 2.0 * np.outer(q, q)
    C = np.array(
        [
            [1 - twice[1, 1] - twice[2, 2], twice[0, 1] + twice[2, 3], twice[0, 2] - twice[1, 3]],
            [twice[0, 1] - twice[2, 3], 1 - twice[2, 2] - twice[0, 0], twice[1, 2] + twice[0, 3]],
            [twice[0, 2] + twice[1, 3], twice[1, 2] - twice[0, 3], 1 - twice[0, 0] - twice[1, 1]],
        ]
    )
    near(C.T, quaternion_to_matrix(Q_NB))


@row("Euler angles", "`hub.sigma_BNInit`, `hub.omega_BN_BInit`")
def test_euler_angles_of_a_start_from_basilisks():
    yaw, pitch, roll = R_NB.as_euler("ZYX")
    rate = [0.01, -0.02, 0.03]
    scenario = zhang(initial__attitude=[roll, pitch, yaw], initial__rate=rate)
    state = build_initial_state(scenario, build_satellite(scenario))
    near(quaternion_to_matrix(state.bus.q_NX).T, mrp_dcm(mrp(R_NB)))
    near(state.bus.w_NX_X, rate)

    def about(axis, angle):  # turned yaw first, then pitch, then roll, each about moved axes
        return Rotation.from_rotvec(angle * np.eye(3)[axis]).as_matrix()

    near(quaternion_to_matrix(state.bus.q_NX), about(2, yaw) @ about(1, pitch) @ about(0, roll))


@row("angular velocity")
def test_angular_velocity_is_in_body_components():
    """Basilisk: 4 dsigma/dt = ((1 - s^2) E + 2 [s x] + 2 s s^T) omega_BN_B."""
    omega, step = np.array([0.3, -0.2, 0.5]), 1e-6
    sigma = mrp(R_NB)
    B = (1 - sigma @ sigma) * np.eye(3) + 2 * skew(sigma) + 2 * np.outer(sigma, sigma)
    theirs = mrp_dcm(sigma + 0.25 * step * B @ omega).T
    ours = quaternion_to_matrix(Q_NB + step * np.asarray(quaternion_rate(jnp.array(Q_NB), omega)))
    near(ours, theirs, atol=1e-11)
    near((ours - R_NB.as_matrix()) / step, R_NB.as_matrix() @ skew(omega), atol=1e-5)


@row("attitude error", "`attTrackingError`, σ_BR")
@pytest.mark.parametrize("angle", [1e-3, 1.0, 3.0])
def test_attitude_error(angle):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    turn = Rotation.from_rotvec(angle * axis)  # from reference to body
    q_NR = np.roll((R_NB * turn.inv()).as_quat(), 1)
    e = np.asarray(attitude_error(jnp.array(q_NR), jnp.array(Q_NB)))
    near(e, 2 * np.sin(angle / 2) * axis, atol=1e-9)
    near(e / 2, turn.as_quat()[:3] * np.sign(turn.as_quat()[3]), atol=1e-9)
    sigma = mrp(turn)
    near(sigma, np.tan(angle / 4) * axis, atol=1e-9)
    if angle < 0.01:
        near(e, angle * axis, rtol=1e-6)
        near(e, 4 * sigma, rtol=1e-6)


@row("control torque", "`mrpFeedback`")
def test_control_torque_is_basilisks_for_small_angles():
    kp, kd = 200.0, 2500.0
    scenario = zhang(control__pid={"kp": kp, "ki": 0.0, "kd": kd})
    controller = build_satellite(scenario).control.controller
    turn, omega = Rotation.from_rotvec([1e-4, -2e-4, 3e-4]), np.array([1e-3, 2e-3, -1e-3])
    e = attitude_error(jnp.array([1.0, 0, 0, 0]), jnp.array(np.roll(turn.as_quat(), 1)))
    ours = controller.torque_B(Measured(e, omega, jnp.zeros(3)), jnp.zeros(3))
    K, P = 4 * kp, kd  # without the gyroscopic terms, which are small here
    near(ours, -(K * mrp(turn) + P * omega), rtol=1e-6)
    assert ours[0] * omega[0] < 0.0  # on the body, against its motion


@row("bus frame", "`hub.r_BcB_B`")
def test_positions_are_from_the_hubs_mass_centre():
    """Moment of a wheel's force about the hub's mass centre, r_WB from Basilisk's own origin."""
    r_BcB, r_WB, force = RNG.normal(size=(3, 3))
    cluster = build_satellite(zhang()).clusters[0].units
    cluster = replace(cluster, p_PC_P=cluster.p_PC_P.at[0].set(r_WB - r_BcB))
    R_GP = np.asarray(cluster.R_PG0[0]).T
    each = np.zeros((4, 1, 6))
    each[0, 0, :3] = R_GP @ force
    found = np.asarray(on_carrier(cluster, jnp.zeros(4), jnp.array(each)))[0, 0]
    near(found, np.r_[force, np.cross(r_WB - r_BcB, force)])


@row("inertia", "`spacecraft.Spacecraft()`, `hub.mHub`, `hub.IHubPntBc_B`")
def test_inertia_is_the_matrix():
    mass, r = RNG.uniform(1.0, 2.0, 6), RNG.normal(size=(6, 3))
    r -= mass @ r / mass.sum()
    matrix = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(mass, r, strict=True))
    product_xy = np.sum(mass * r[:, 0] * r[:, 1])  # as CAD programs print it
    assert matrix[0, 1] == pytest.approx(-product_xy)
    scenario = zhang(bus__mass=mass.sum(), bus__inertia=matrix.tolist())
    bus = build_satellite(scenario).bus
    near(bus.I_XXcm_X, matrix)
    # momentum of the point masses that turn as one
    omega = np.array([0.1, 0.2, -0.3])
    near(bus.I_XXcm_X @ omega, np.sum(mass[:, None] * np.cross(r, np.cross(omega, r)), axis=0))


@row("dynamic imbalance")
@pytest.mark.parametrize("degrees", [0.0, -90.0, 35.0])
def test_dynamic_imbalance_is_a_product_of_inertia_of_point_masses(degrees):
    """Two opposite masses at both rims: their product of inertia along the phase's direction."""
    mass, height, radius = 1e-3, 0.02, 0.1
    direction = np.deg2rad(degrees)
    rim = radius * np.array([0.0, np.cos(direction), np.sin(direction)])
    up = np.array([height, 0.0, 0.0])
    points = np.array([up + rim, -up - rim])
    product = 2 * mass * height * radius  # sum of m x y'
    added = sum(mass * (p @ p * np.eye(3) - np.outer(p, p)) for p in points)
    rotor = zhang(
        cluster__rotor__dynamic_imbalance=product,
        cluster__rotor__dynamic_imbalance_phase=f"{degrees} deg",
    ).cluster.rotor
    off = ~np.eye(3, dtype=bool)
    expected = added.copy()
    expected[1, 2] = expected[2, 1] = 0.0  # of the two masses; a rotor's other masses balance it
    near(rotor.inertia[off], expected[off], atol=1e-15)


# --- gimbals and wheels of Basilisk ---------------------------------------------------------------


def M1(angle):
    """Basilisk's eigenM1: direction cosine matrix of a turn about the first axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, s], [0, -s, c]])


def M3(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def vscmg_axes(gs0, gt0, gg, gamma, theta):
    """Basilisk's columns gs, gt, gg and w1, w2, w3 in the body."""
    BG0 = np.stack([gs0, gt0, gg], axis=1)
    return BG0 @ M3(gamma).T, BG0 @ (M1(theta) @ M3(gamma)).T


@row("gimbal angle", "`VSCMGStateEffector`, `ggHat_B`, `gsHat0_B`, `gtHat0_B`")
def test_gimbal_frames():
    cluster = build_satellite(zhang()).clusters[0].units
    for j in range(4):
        s0, t0, g = np.asarray(cluster.R_PG0[j]).T
        near(t0, np.cross(g, s0))
        unit = eqx.tree_at(lambda c: c.R_PG0, cluster, cluster.R_PG0[j])
        G, W = vscmg_axes(s0, t0, g, 0.7, 1.9)
        near(unit.R_PG(jnp.array(0.7)), G)
        unit = eqx.tree_at(lambda c: c.R_GF, unit, jnp.eye(3))
        near(np.asarray(unit.R_PG(jnp.array(0.7))) @ np.asarray(unit.R_GR(jnp.array(1.9))), W)


@row("`rGB_B`, `rGcG_G`, `l`, `L`", "`IG1`, `IG2`, `IG3`; `IW1`, `IW2` = `IW3`; `massW`")
def test_where_a_vscmg_has_its_masses():
    """Basilisk's first moment and inertia about G at gamma: massG, massW, IG, IW."""
    l, L, rGc = 0.01, 0.1, np.array([1e-4, -0.02, 0.03])
    IG, IW, mG, mW, gamma = np.array([0.1, 0.2, 0.25]), np.array([0.16, 0.09, 0.09]), 6.0, 5.0, 0.7
    units = zhang().cluster.placed()
    body = {"mass": mG, "inertia": IG.tolist(), "center_of_mass": rGc.tolist()}
    rotor = {
        "mass": mW, "spin_inertia": IW[0], "transverse_inertia": IW[1], "speed": 100.0,
        "offset": (np.array([l, 0.0, L]) - rGc).tolist(),
    }  # fmt: skip
    data = zhang().to_dict()
    data["cluster"] |= {"gimbal_body": body, "rotor": rotor}
    cluster = build_satellite(Scenario.from_dict(data)).clusters[0].units
    found = _carried(cluster, gamma)
    c, J = np.zeros(3), np.zeros((3, 3))
    for j, unit in enumerate(units):
        G, _ = vscmg_axes(*np.asarray(cluster.R_PG0[j]).T, gamma, 0.0)
        rGB = np.array(unit.position)
        for mass, r, inertia in ((mG, G @ rGc, IG), (mW, L * G[:, 2] + l * G[:, 0], IW)):
            at = rGB + r
            c += mass * at
            J += G @ np.diag(inertia) @ G.T + mass * (at @ at * np.eye(3) - np.outer(at, at))
    near(found.c, c)
    near(found.J, J)


_motion = eqx.filter_jit(lambda cluster, *motion: ClusterMoments.expand(cluster).at(*motion))


def _carried(cluster, gamma, phi=0.0):
    still = jnp.zeros(4)
    gimbals = Turning(still + gamma, still, still)
    return _motion(cluster, gimbals, Turning(still + phi, cluster.rotor_speed, still))


U_S, U_D, SPEED = 4.8e-6, 1.54e-6, 200.0


def basilisks_wheels(cluster, gamma, theta, coupled):
    """Force and torque on the body about the plate's origin of Basilisk's wheels."""
    wrench = np.zeros(6)
    for j in range(4):
        _, W = vscmg_axes(*np.asarray(cluster.R_PG0[j]).T, gamma, theta)
        w1, w2, _ = W.T
        r = np.asarray(cluster.p_PC_P[j])
        if not coupled:  # JitterSimple: forces added to a balanced wheel
            force, couple = U_S * SPEED**2 * w2, U_D * SPEED**2 * w2
        else:  # JitterFullyCoupled at constant speed: mass centre at d w2, I13 = U_d
            Js, Jt = (float(cluster.I_RRcm_R[j][i, i]) for i in (0, 1))
            tensor = W @ np.array([[Js, 0, U_D], [0, Jt, 0], [U_D, 0, Jt]]) @ W.T
            mass = float(cluster.rotor_mass[j])
            force = -mass * np.cross(SPEED * w1, np.cross(SPEED * w1, U_S / mass * w2))
            couple = -np.cross(SPEED * w1, tensor @ (SPEED * w1))
        wrench += np.r_[force, np.cross(r, force) + couple]
    return wrench


@row("`U_s`, `U_d`")
@pytest.mark.parametrize("coupled", [False, True])
def test_imbalance_of_basilisks_wheels_and_cmgs(coupled):
    scenario = zhang(
        cluster__rotor={
            "mass": 6.0, "speed": SPEED, "spin_inertia": 0.024, "transverse_inertia": 0.0143,
            "static_imbalance": U_S, "dynamic_imbalance": U_D, "dynamic_imbalance_phase": "-90 deg",
        }
    )  # fmt: skip
    cluster = build_satellite(scenario).clusters[0].units
    size = U_D * SPEED**2
    for gamma, theta in ((0.0, 0.0), (0.7, 1.9), (-1.2, 4.0)):
        found = _carried(cluster, gamma, theta)
        ours = -np.r_[np.asarray(found.p_rate), np.asarray(found.H_rate)]
        near(ours, basilisks_wheels(cluster, gamma, theta, coupled), atol=1e-9 * size)
    # by the names alone it is wrong: the torque is a quarter turn ahead
    named = scenario.with_overrides({"cluster.rotor.dynamic_imbalance_phase": 0.0})
    found = _carried(build_satellite(named).clusters[0].units, 0.7, 1.9)
    theirs = basilisks_wheels(cluster, 0.7, 1.9, coupled)
    assert np.linalg.norm(np.asarray(found.H_rate) + theirs[3:]) > 0.5 * size


@row("`ReactionWheelStateEffector`, `gsHat_B`, `u_max`, `Omega_max`", "`w2Hat0_B` of a wheel")
def test_a_wheels_zero_angle_is_found_from_w2():
    """Static imbalance of one wheel whose w2Hat0 lies anywhere across its spin axis."""
    scenario = qb.load_scenario("wheels-demo")
    wheels = scenario.cluster.placed()
    motor = {"torque_limit": 0.1, "speed_limit": 600.0}
    limited = build_satellite(scenario.with_overrides({"cluster.motor": motor})).clusters[0].rotors
    near(limited.torque_limit, 0.1)
    near(limited.speed_limit, 600.0)
    phases = []
    for wheel in wheels:
        s = np.array(wheel.spin_axis)
        g = np.eye(3)[2] - s[2] * s
        if np.linalg.norm(g) < 1e-3:
            g = np.eye(3)[0] - s[0] * s
        g /= np.linalg.norm(g)
        t = np.cross(g, s)
        w2 = np.cross(s, RNG.normal(size=3))
        w2 /= np.linalg.norm(w2)
        phases.append((w2, float(np.arctan2(w2 @ np.cross(s, t), w2 @ t))))
    cluster = build_satellite(
        scenario.with_overrides({"cluster.rotor_phases": [phase for _, phase in phases]})
    )
    cluster = cluster.clusters[0].units
    for j, (w2, _) in enumerate(phases):
        unit = eqx.tree_at(lambda c: c.R_GF, cluster, cluster.R_GF[j])
        R_GR = np.asarray(unit.R_GR(cluster.rotor_phase[j]))
        near(np.asarray(cluster.R_PG0[j]) @ R_GR[:, 1], w2)


# --- measured wheels of S2E and 42 ----------------------------------------------------------------


@eqx.filter_jit
def pushes(disturbance, cluster, phi):
    each = disturbance.wrench(cluster, jnp.zeros(()), phi, cluster.rotor_speed)
    return each, on_carrier(cluster, jnp.zeros(4), each[:, None])[:, 0]


@row(
    "harmonics of rotor speed in Hz (description)",
    "sense of the lines: from y to x, *against* a rotor that turns about +z",
    "torque of jitter on the body",
)
def test_s2es_lines_turn_against_the_rotor(tmp_path):
    rows = [(1.0, 2e-7), (2.83, 3e-8)]
    for kind in ("force", "torque"):
        text = "".join(f"{h},{c}\n" for h, c in rows)
        (tmp_path / f"radial_{kind}.csv").write_text(text)
    files = [tmp_path / "radial_force.csv", tmp_path / "radial_torque.csv"]
    alpha = {"force": [0.3, -1.0], "torque": [2.0, 0.8]}
    orders = []
    for i, order in enumerate(qb.read_wheel_table(files).orders):
        degrees = {f"radial_{k}": f"{np.rad2deg(a[i]) - 90} deg" for k, a in alpha.items()}
        orders.append(order | {"whirl": "backward", "phase": degrees})
    satellite = build_satellite(zhang(cluster__rotor__disturbance={"orders": orders}))
    cluster, phi = satellite.clusters[0].units, np.array([0.0, 0.4, -2.0, 5.0])
    speed = float(cluster.rotor_speed[0])
    each, plate = (
        np.asarray(a) for a in pushes(satellite.clusters[0].disturbance, cluster, jnp.array(phi))
    )
    for j in range(4):
        line = {}
        for kind, angles in alpha.items():
            psi = [h * phi[j] + a for (h, _), a in zip(rows, angles, strict=True)]
            size = [c * speed**2 for _, c in rows]  # rad/s, as S2E's source has it
            line[kind] = np.array([size @ np.sin(psi), size @ np.cos(psi), 0.0])  # z: spin axis
        x, y, z = 1, 2, 0  # component axes are t, g, s
        force, torque = (line[kind][np.argsort([x, y, z])] for kind in ("force", "torque"))
        near(each[j], np.r_[force, torque], atol=1e-10)
        G = np.asarray(cluster.R_PG0[j])
        r = np.asarray(cluster.p_PC_P[j]) + G @ np.asarray(cluster.p_CR_G[j])
        theirs = -np.cross(r, G @ force) - G @ torque  # S2E's GetOutputTorque_b_Nm
        near(plate[j], np.r_[G @ force, -theirs], atol=1e-10)


@row("`Ks`, `Kd` at the harmonic `n`", "phase of a harmonic")
def test_42s_lines(tmp_path):
    """A file of 42, read and built into a satellite, against the force of its WheelJitter."""
    harmonics = [(3.0, 0.2, 2.0, 15.0), (0.6, 0.1, 0.5, -40.0)]
    text = (
        "<<<<\n0.8 ! 2*Jt/Jr\n20 ! Phase of Static vs. Dyn Imbalance\n1e9 0.03 ! Lateral Mode\n"
        "1e9 0.05 ! Rocking Mode\n2 ! Number of Harmonics\n"
    )
    for n, Ks, Kd, phase in harmonics:
        text += f"{n} ! Harmonic Number\n{Ks} ! Static Imbalance, g-cm\n"
        text += f"{Kd} ! Dynamic Imbalance, g-cm^2\n{phase} ! Harmonic Phase Angle\n"
    (tmp_path / "Whl.txt").write_text(text)
    block = qb.read_wheel_table(tmp_path / "Whl.txt").to_dict()
    satellite = build_satellite(zhang(cluster__rotor__disturbance=block))
    phi = np.array([0.0, 0.4, -2.0, 5.0])
    speed = float(satellite.clusters[0].units.rotor_speed[0])
    each, _ = pushes(satellite.clusters[0].disturbance, satellite.clusters[0].units, jnp.array(phi))
    for j in range(4):
        line = np.zeros(6)  # stiff: the resonance's part vanishes; x, y across the spin axis z
        for n, Ks, Kd, phase in harmonics:
            w2, tilt = (n * speed) ** 2, np.deg2rad(20.0)
            rho_s, rho_d = n * (phi[j] + tilt + np.deg2rad(phase)), n * (phi[j] + np.deg2rad(phase))
            force = -Ks * 1e-5 * w2 * np.array([0.0, np.cos(rho_s), np.sin(rho_s)])
            torque = -Kd * 1e-7 * w2 * np.array([0.0, np.cos(rho_d), np.sin(rho_d)])
            line += np.r_[force, torque]
        near(each[j], line, rtol=1e-9, atol=1e-9)


# --- MuJoCo ---------------------------------------------------------------------------------------


@row("`opt.gravity`")
def test_mujocos_free_joint():
    """Quaternion scalar first, body to world; angular velocity in the body, linear in the world."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
    )
    near(model.opt.gravity, [0.0, 0.0, -9.81])
    data = mujoco.MjData(model)
    omega, velocity, step = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, 3.0]), 1e-6
    data.qpos[3:] = Q_NB
    mujoco.mj_forward(model, data)
    near(data.xmat[1].reshape(3, 3), quaternion_to_matrix(Q_NB))
    mujoco.mj_integratePos(model, data.qpos, np.r_[velocity, omega], step)
    near(data.qpos[:3], step * velocity)
    rate = quaternion_rate(jnp.array(Q_NB), jnp.array(omega))
    near(data.qpos[3:], Q_NB + step * np.asarray(rate), atol=1e-12)


# --- the page -------------------------------------------------------------------------------------


def test_every_row_is_tested_or_gives_a_name_only():
    headings = ("Conventions", "From Basilisk", "From S2E", "From 42", "From MuJoCo")
    found = set()
    for heading in headings:
        section = re.split(r"\n## ", PAGE.split(f"\n## {heading}\n", 1)[1], maxsplit=1)[0]
        rows = re.findall(r"^\| (.*?) \|", section, re.MULTILINE)
        found.update(name.strip() for name in rows[1:])
    assert found == TESTED | NAMES_ONLY
