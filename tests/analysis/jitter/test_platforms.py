"""Several platforms on one bus: the one-platform limit, MuJoCo, symmetry, momentum, statics."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import quietbus as qb
from quietbus.build import build_satellite

ANGLES = np.array([0.3, -0.5, 0.9, 0.1])
LIGHT = {"mass": 0, "distance": 0.1, "transverse_inertia": 0, "axial_inertia": 0}
BARE = {  # what MuJoCo's tendons are: legs without mass and friction; gimbals held
    "control": "none",
    "isolator.legs.upper_part": LIGHT,
    "isolator.legs.lower_part": LIGHT,
    "isolator.legs.spherical_friction": 0,
    "isolator.legs.universal_friction": 0,
    "cluster.rotor.dynamic_imbalance": 0,
}


@pytest.fixture(scope="module")
def paper():
    return qb.load_scenario("zhang2012")


@pytest.fixture(scope="module")
def tilted(paper):
    """The paper's platform turned in the bus."""
    return paper.with_overrides({"isolator.orientation": ["10 deg", "-20 deg", "30 deg"]})


@pytest.fixture(scope="module")
def single(tilted):
    return qb.platforms([tilted], [ANGLES])


@pytest.fixture(scope="module")
def unlike(paper):
    """Four platforms, no two alike, at gimbal angles with net momentum; legs massless."""
    scenarios = qb.per_cmg_scenarios(paper.with_overrides(BARE))
    changes = (
        {},
        {"isolator.orientation": ["20 deg", "-30 deg", "50 deg"]},
        {"isolator.legs.stiffness": 8000.0, "isolator.offset": [-0.3, 0.1, 0.2]},
        {"isolator.plate.mass": 4.0, "isolator.plate.center_of_mass": [0.02, -0.03, 0.04]},
    )
    changed = [s.with_overrides(c) for s, c in zip(scenarios, changes, strict=True)]
    return qb.platforms(changed, ANGLES[:, None])


@pytest.fixture(scope="module")
def alike(paper):
    """The paper's four CMGs with a platform each; bus and hexapods the same from all sides.

    The paper's universal joints of legs 2 and 5 are not: there they have each other's axis.
    """
    axes = [paper.isolator.legs.universal_axes[leg] for leg in (0, 1, 5, 3, 4, 2)]
    changes = {
        "bus.inertia": np.diag([900.0, 900.0, 700.0]).tolist(),
        "isolator.legs.universal_axes": axes,
    }
    return qb.platforms(qb.per_cmg_scenarios(paper.with_overrides(changes)))


def test_a_single_platform_gives_the_jitter_of_the_jitter_study(single, tilted):
    whole = qb.jitter(tilted, ANGLES)
    for mount in ("isolated", "rigid"):
        expected = whole.bus_rate(mount)
        error = np.max(np.abs(single.bus_rate(mount) - expected))
        assert error < 1e-10 * np.max(np.abs(expected)), mount
        assert single.combined(mount).envelope == pytest.approx(whole.combined(mount).envelope)
    strokes = whole.outputs["isolated"]["leg_stroke"]
    assert np.max(np.abs(single.leg_stroke()[0] - strokes)) < 1e-10 * np.max(np.abs(strokes))


def test_a_single_platform_has_modes_and_margins_of_the_linear_analysis(single, tilted):
    """Other coordinates, other derivation: dynamics.linearize."""
    study = qb.analyze(tilted, ANGLES)
    for base, held in (("free", False), ("fixed_base", True)):
        hz, damping = single.platforms.modes(held)
        expected = study.modes[base]
        assert hz == pytest.approx([mode.frequency_hz for mode in expected], rel=1e-6)
        assert damping == pytest.approx([mode.damping for mode in expected], rel=1e-6, abs=1e-6)
    assert single.coupled.disk_margin == pytest.approx(study.coupled.disk_margin, rel=1e-6)
    ranges = (single.coupled.stable_gain_range, study.coupled.stable_gain_range)
    assert ranges[0][0] == pytest.approx(ranges[1][0], rel=1e-6)


def _body(name, inner, position, quaternion, mass, center, inertia):
    text = lambda values: " ".join(repr(float(v)) for v in np.ravel(values))  # noqa: E731
    six = [inertia[i][j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return (
        f'<body name="{name}" pos="{text(position)}" quat="{text(quaternion)}">{inner}'
        f'<inertial pos="{text(center)}" mass="{mass}" fullinertia="{text(six)}"/>'
    )


def in_mujoco(scenarios, angles):
    """The model from the scenarios' numbers: free bodies, tendons, held gimbals, turning rotors."""
    free, bodies, tendons = "<freejoint/>", "", ""
    sites = ""
    spun = []
    for i, (scenario, gamma) in enumerate(zip(scenarios, angles, strict=True)):
        iso, unit = scenario.isolator, scenario.cluster.placed()[0]
        base = Rotation.from_euler("ZYX", iso.orientation[::-1])
        center = np.array(iso.offset) + base.apply([0, 0, iso.separation])
        body = _body(
            f"plate{i}",
            free,
            center,
            base.as_quat(scalar_first=True),
            iso.plate.mass,
            iso.plate.center_of_mass,
            iso.plate.inertia,
        )
        g, s = np.array(unit.gimbal_axis), np.array(unit.spin_axis)
        t = np.cross(g, s)
        s, t = np.cos(gamma) * s + np.sin(gamma) * t, np.cos(gamma) * t - np.sin(gamma) * s
        turn = Rotation.from_matrix(np.stack([s, t, g], axis=1)).as_quat(scalar_first=True)
        gimbal, rotor = unit.gimbal_body, unit.rotor
        inertia = rotor.inertia
        body += _body(
            f"gimbal{i}", "", unit.position, turn, gimbal.mass, [0, 0, 0], np.diag(gimbal.inertia)
        )
        hinge = '<joint type="hinge" axis="1 0 0" armature="1e12"/>'
        level = [1, 0, 0, 0]
        body += _body(f"rotor{i}", hinge, [0, 0, 0], level, rotor.mass, [0, 0, 0], inertia)
        body += "</body></body>"
        lower, upper = iso.joints()
        for k, (a, u) in enumerate(zip(lower, upper, strict=True)):
            a_B = np.array(iso.offset) + base.apply(a)
            u_P = u - np.array([0, 0, iso.separation])
            sites += f'<site name="A{i}_{k}" pos="{a_B[0]} {a_B[1]} {a_B[2]}"/>'
            body += f'<site name="U{i}_{k}" pos="{u_P[0]} {u_P[1]} {u_P[2]}"/>'
            tendons += (
                f'<spatial stiffness="{iso.legs.stiffness}" damping="{iso.legs.damping}" '
                f'springlength="{np.linalg.norm(u - a)}"><site site="A{i}_{k}"/>'
                f'<site site="U{i}_{k}"/></spatial>'
            )
        bodies += body + "</body>"
        spun.append(rotor.speed)
    bus = scenarios[0].bus
    bus_body = _body("bus", free, [0, 0, 0], [1, 0, 0, 0], bus.mass, [0, 0, 0], bus.inertia)
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><compiler angle="radian" balanceinertia="false"/><option gravity="0 0 0"/>'
        f"<worldbody>{bus_body}{sites}</body>{bodies}</worldbody>"
        f"<tendon>{tendons}</tendon></mujoco>"
    )
    return model, np.array(spun)


def linearised(model, speeds):
    """State matrix on the free bodies' freedoms, by central differences of MuJoCo's acceleration.

    Returns also the data at rest and the freedoms' indices: those of the bus first.
    """
    data = mujoco.MjData(model)
    hinges = model.jnt_dofadr[model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE]
    freedoms = np.setdiff1d(np.arange(model.nv), hinges)
    position, speed = data.qpos.copy(), np.zeros(model.nv)
    speed[hinges] = speeds

    def acceleration(dq, dv):
        data.qpos[:] = position
        mujoco.mj_integratePos(model, data.qpos, dq, 1.0)
        data.qvel[:] = speed + dv
        mujoco.mj_forward(model, data)
        return data.qacc[freedoms].copy()

    n, unit, none = len(freedoms), np.eye(model.nv)[freedoms], np.zeros(model.nv)
    step = 1e-5
    by_pose = [(acceleration(step * e, none) - acceleration(-step * e, none)) for e in unit]
    by_rate = [(acceleration(none, step * e) - acceleration(none, -step * e)) for e in unit]
    # speeds of rotation are along the body, which at rest differs from the bus by a constant turn
    by_pose, by_rate = (np.array(each).T / (2 * step) for each in (by_pose, by_rate))
    acceleration(none, none)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [by_pose, by_rate]])
    return A, data, freedoms


def test_modes_and_jitter_are_those_of_a_mujoco_model_of_all_platforms(unlike):
    """Other formulation, other engine: nothing of ours but the scenarios' numbers goes in."""
    model, speeds = in_mujoco(unlike.scenarios, ANGLES)
    A, data, freedoms = linearised(model, speeds)
    poles = np.linalg.eigvals(A)
    swinging = poles[(poles.imag >= 0.0) & (np.abs(poles) > 1.0)]
    hz, damping = unlike.platforms.modes()
    kept = hz > 1.0 / (2.0 * np.pi)
    order = np.argsort(np.abs(swinging))
    assert hz[kept] == pytest.approx(np.abs(swinging[order]) / (2.0 * np.pi), rel=1e-6)
    assert damping[kept] == pytest.approx(
        -swinging.real[order] / np.abs(swinging[order]), rel=1e-5, abs=1e-6
    )

    n = len(freedoms)
    for j in range(4):
        unit = unlike.scenarios[j].cluster.placed()[0]
        omega = unit.rotor.speed
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"gimbal{j}")
        R = data.xmat[body].reshape(3, 3)  # columns s, t, g
        pull = unit.rotor.static_imbalance * omega**2 * (R[:, 1] - 1j * R[:, 2])
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, data.xpos[body], body)
        forced = _accelerated(model, data, jacobian.T @ pull)[freedoms]
        x = np.linalg.solve(1j * omega * np.eye(2 * n) - A, np.append(np.zeros(n), forced))
        expected, ours = x[n + 3 : n + 6], unlike.bus_rate("isolated")[j, 0]
        assert np.max(np.abs(ours - expected)) < 1e-5 * np.max(np.abs(expected))


def _accelerated(model, data, force):
    """Acceleration by a complex generalised force."""
    rows = np.stack([force.real, force.imag])
    found = np.zeros_like(rows)
    mujoco.mj_solveM(model, data, found, rows)
    return found[0] + 1j * found[1]


def test_legs_push_nothing_but_their_ends_and_masses_add_up(alike):
    """Momentum: no net force or torque of any pose; none of a satellite that moves as one."""
    small = alike.platforms.small("isolated")
    M, C, K = (np.asarray(m) for m in (small.M, small.C, small.K))
    T = np.asarray(alike.platforms.small("rigid").projection)
    for product in (T.T @ K, (K @ T).T):
        assert np.max(np.abs(product)) < 1e-10 * np.max(np.abs(K))
    assert np.max(np.abs(T[:, :3].T @ C)) < 1e-10 * np.max(np.abs(C))
    assert np.max(np.abs(C @ T[:, :3])) < 1e-10 * np.max(np.abs(C))
    total = 1000.0 + 6.8 + 4 * 19.0 + 12 * 0.25
    whole = T.T @ M @ T
    assert whole[:3, :3] == pytest.approx(total * np.eye(3), rel=1e-12, abs=1e-9)
    assert whole == pytest.approx(whole.T, rel=1e-12, abs=1e-9)


def test_platforms_alike_around_a_round_bus_shake_it_alike(alike):
    """A quarter turn takes each CMG's platform to the next, and leaves a hexapod as it is."""
    quarter = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    for mount in ("isolated", "rigid"):
        rate = alike.bus_rate(mount)[:, 0]
        for j in range(4):
            error = np.max(np.abs(rate[(j + 1) % 4] - quarter @ rate[j]))
            assert error < 1e-9 * np.max(np.abs(rate)), mount
    hz, damping = alike.platforms.modes(held=True)  # the bus held: four times the same
    assert hz == pytest.approx(np.repeat(hz[::4], 4), rel=1e-5)
    assert damping == pytest.approx(np.repeat(damping[::4], 4), rel=1e-4)


def test_strokes_under_a_steady_torque_about_z_follow_from_momentum(paper):
    """The legs turn the bus; a hexapod twisted by theta about z has strokes theta sqrt(0.75/6)."""
    upright = paper.with_overrides(
        {k: v for k, v in BARE.items() if k != "control"}
        | {"bus.inertia": np.diag([1100.0, 900.0, 800.0]).tolist()}
    )
    study = qb.platforms([upright], [np.zeros(4)])
    strokes = study.static_stroke([0.0, 0.0, 2.0])[0]
    platform = qb.analyze(upright).satellite
    on_bus = 2.0 * 800.0 / (800.0 + 15.0)  # of the torque, the platform's inertia being 15
    twist = on_bus / (0.75 * float(platform.hexapods[0].strut.stiffness[0]))
    assert np.abs(strokes) == pytest.approx(np.full(6, twist * np.sqrt(0.75 / 6.0)), rel=1e-5)


def test_the_budget_of_one_platform_is_shared_out_and_cmgs_stay_where_they_are(paper):
    turned = paper.with_overrides({"isolator.orientation": ["10 deg", "-20 deg", "30 deg"]})
    parts = [build_satellite(s) for s in qb.per_cmg_scenarios(turned)]
    whole = build_satellite(turned)
    sums = (
        lambda s: s.body("plate").mass_X,
        lambda s: s.hexapods[0].strut.stiffness.sum(),
        lambda s: s.hexapods[0].strut.damping.sum(),
        lambda s: s.hexapods[0].bodies.upper.mass.sum() + s.hexapods[0].bodies.lower.mass.sum(),
        lambda s: s.hexapods[0].bodies.spherical_friction.sum(),
        lambda s: s.clusters[0].units.rotor_mass.sum() + s.clusters[0].units.gimbal_mass.sum(),
    )
    for part in sums:
        assert sum(float(part(s)) for s in parts) == pytest.approx(float(part(whole)))
    R = Rotation.from_euler("ZYX", np.deg2rad([30, -20, 10])).as_matrix()
    for j, part in enumerate(parts):
        (units,), (all_units,) = ([c.units for c in s.clusters] for s in (part, whole))
        (legs,), (whole_legs,) = part.hexapods, whole.hexapods
        place = np.asarray(whole.mounts[0].p_BX_B) + R @ np.asarray(all_units.p_PC_P[j])
        assert np.asarray(part.mounts[0].p_BX_B) == pytest.approx(place)
        assert np.asarray(units.p_PC_P[0]) == pytest.approx(np.zeros(3))
        assert np.asarray(units.R_PG0[0]) == pytest.approx(np.asarray(all_units.R_PG0[j]))
        assert float(units.rotor_phase[0]) == pytest.approx(0.7 * j)
        lengths = (np.asarray(each.geometry.nominal_length) for each in (legs, whole_legs))
        assert next(lengths) == pytest.approx(0.5 * next(lengths))
        # a strut of half the length and a quarter of the mass
        assert np.asarray(legs.bodies.upper.transverse_inertia) == pytest.approx(0.002 / 16)
    again = [qb.Scenario.from_yaml(s.to_yaml()) for s in qb.per_cmg_scenarios(turned)]
    assert again == qb.per_cmg_scenarios(turned)


def test_what_cannot_be_put_together_is_refused_by_name(paper):
    parts = qb.per_cmg_scenarios(paper)
    other = parts[1].with_overrides({"bus.mass": 900})
    with pytest.raises(qb.ScenarioError, match=r"cmg1: bus: expected the same as in 'zhang2012-cm"):
        qb.platforms([parts[0], other])
    with pytest.raises(ValueError, match="scenarios: expected one or more"):
        qb.platforms([])
    with pytest.raises(ValueError, match="expected 4 lists, one for each scenario, got 1"):
        qb.platforms(parts, [[0.0]])
    with pytest.raises(ValueError, match="expected 1 finite numbers"):
        qb.platforms(parts, [[0.0, 1.0]] * 4)
    with pytest.raises(ValueError, match="scale: expected a finite number above 0, got 0"):
        qb.per_cmg_scenarios(paper, scale=0.0)
    law = {"control.steering": {"law": "pseudo_inverse"}}
    with pytest.raises(qb.ScenarioError, match="fewer than three CMGs"):
        qb.per_cmg_scenarios(paper.with_overrides(law))
    preloaded = parts[0].with_overrides({"isolator.legs.free_length": 0.30})
    with pytest.raises(ValueError, match="no equilibrium here: a platform accelerates by"):
        qb.platforms([preloaded, *parts[1:]])


SLOW_SERVOS = (50.0, 2.0, 2.0, 2.0)  # [rad/s]


@pytest.fixture(scope="module")
def servos(paper):
    """Four platforms with gimbal servos that are not alike."""
    parts = qb.per_cmg_scenarios(paper)
    return [
        part.with_overrides({"cluster.gimbal_bandwidth": bandwidth})
        for part, bandwidth in zip(parts, SLOW_SERVOS, strict=True)
    ]


def test_every_gimbal_has_the_servo_of_its_own_platform(servos):
    """Poles of the free servos; and the loop's poles by another derivation, of the vibration."""
    study = qb.platforms(servos)
    model = study.platforms.linear()
    free = np.sort(np.linalg.eigvals(model.A).real)
    for bandwidth in SLOW_SERVOS:
        assert np.min(np.abs(free + bandwidth)) < 1e-9 * bandwidth
    closed = study.platforms.controlled(study.pid).poles(study.pid.gain)
    expected = np.linalg.eigvals(study.platforms.small("isolated").state_matrix())
    for pole in closed[np.abs(closed) > 1e-3]:
        assert np.min(np.abs(expected - pole)) < 1e-6 * max(abs(pole), 1.0)


def test_the_order_of_platforms_does_not_matter(servos):
    changes = {"cluster.rotor_phases": "random"}
    given = [s.with_overrides(changes) for s in servos]
    one, other = (qb.platforms(order) for order in (given, given[::-1]))
    assert one.coupled.stable_gain_range[0] == pytest.approx(
        other.coupled.stable_gain_range[0], rel=1e-6
    )
    assert one.coupled.disk_margin == pytest.approx(other.coupled.disk_margin, rel=1e-6)
    for mount in ("isolated", "rigid"):
        for kind in ("envelope", "worst_case", "rss", "rms"):
            both = (getattr(study.combined(mount), kind) for study in (one, other))
            np.testing.assert_allclose(*both, rtol=1e-9)
    phases = np.asarray(one.platforms.satellite.rotor_phase).tolist()
    assert len({round(phase, 9) for phase in phases}) == 4


LINES_AND_NOISE = {
    "orders": [{"order": 1.5, "radial_force": 1e-6, "axial_torque": 1e-8, "phase": "random"}],
    "broadband": {"radial_torque": {"frequency": [1.0, 300.0], "psd": [4e-5, 1e-6]}},
    "seed": 3,
}


@pytest.fixture(scope="module")
def noisy(paper):
    """With random phases of rotors and of a table's line, and with noise."""
    return paper.with_overrides(
        {"cluster.rotor_phases": "random", "cluster.rotor.disturbance": LINES_AND_NOISE}
    )


def test_the_rms_of_one_platform_has_the_noise_that_the_jitter_study_has(noisy):
    turned = noisy.with_overrides({"isolator.orientation": ["10 deg", "-20 deg", "30 deg"]})
    one, expected = qb.platforms([turned], [ANGLES]), qb.jitter(turned, ANGLES)
    whole = expected.combined("isolated").rms
    assert np.all(expected.noise("isolated").variance("bus_rate", 1)[0] > 1e-4 * whole**2)
    assert one.combined("isolated").rms == pytest.approx(whole, rel=1e-9)


def test_what_is_random_differs_from_cmg_to_cmg_and_is_that_of_the_one_platform(noisy):
    whole = build_satellite(noisy)
    parts = qb.per_cmg_scenarios(noisy)
    assert len({part.cluster.seeds[0] for part in parts}) == 4
    for j, part in enumerate(build_satellite(s) for s in parts):
        for of in (
            lambda s: s.clusters[0].units.rotor_phase,
            lambda s: s.clusters[0].disturbance.phase,
            lambda s: s.clusters[0].disturbance.coefficient,
        ):
            np.testing.assert_allclose(of(part)[0], of(whole)[j], rtol=1e-14)
    assert len(np.unique(np.round(whole.rotor_phase, 9))) == 4


@pytest.mark.slow
def test_noise_of_platforms_bolted_down_is_that_of_one_bolted_platform(noisy):
    """Rigid bodies on a rigid bus: masses may be shared out as they like."""
    light = {f"isolator.legs.{part}_part": LIGHT for part in ("upper", "lower")}
    bare = noisy.with_overrides(
        light
        | {"control": "none", "isolator.plate.mass": 1e-6}
        | {"isolator.plate.inertia": (1e-8 * np.eye(3)).tolist()}
        | {f"cluster.rotor.{kind}_imbalance": 0 for kind in ("static", "dynamic")}
        | {"cluster.rotor.disturbance.orders": None}
    )
    one, parts = qb.platforms([bare]), qb.platforms(qb.per_cmg_scenarios(bare))
    both = [study.combined("rigid").rms for study in (one, parts)]
    assert np.min(both) > 1e-9
    np.testing.assert_allclose(*both, rtol=1e-5)
