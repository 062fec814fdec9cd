"""From scenario to model: every number in its place, in the right frame."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from quietbus.build import build_initial_state, build_satellite
from quietbus.dynamics.equations import accelerations, moving
from quietbus.model.controller import NoController
from quietbus.model.element import Rates
from quietbus.model.guidance import EigenaxisSlew
from quietbus.model.load import Constant, HalfSine, Step, Table
from quietbus.model.steering import (
    GeneralizedSingularityRobust,
    NoSteering,
    PseudoInverse,
    SingularityRobust,
)
from quietbus.model.unit import ControlMomentGyro, momentum_P
from quietbus.scenario import Scenario, load_scenario
from quietbus.spatial.rotation import attitude_error, quaternion_to_matrix

ZHANG = load_scenario("zhang2012")
SATELLITE = build_satellite(ZHANG)
UNITS, LEGS = SATELLITE.clusters[0].units, SATELLITE.hexapods[0]
BALANCED = {"cluster.rotor.static_imbalance": 0, "cluster.rotor.dynamic_imbalance": 0}


def elementary(angle, axis):
    """Rotation matrix about a coordinate axis, written out."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(3)
    matrix[[i, j, i, j], [i, j, j, i]] = c, c, -s, s
    return matrix


def euler(roll, pitch, yaw):
    """3-2-1: R_NB of yaw, then pitch, then roll."""
    return elementary(yaw, 2) @ elementary(pitch, 1) @ elementary(roll, 0)


# ---- the paper's satellite


@pytest.mark.parametrize("turned", [0.0, 1.0, 2.5])
def test_plate_with_cmgs_has_the_papers_mass_and_inertia(turned):
    """82.8 kg and diag(8.8, 8.8, 15) kg m^2 about the mass centre in the upper joint plane."""
    satellite = build_satellite(ZHANG.with_overrides(BALANCED))
    zero = jnp.zeros(4)
    carried = eqx.filter_vmap(ControlMomentGyro.carried)
    units = carried(satellite.clusters[0].units, zero, zero + turned, zero)
    plate = satellite.body("plate")
    assert units.mass.sum() + plate.mass_X == pytest.approx(82.8, rel=1e-15)
    assert units.c.sum(axis=0) + plate.mass_X * plate.p_XXcm_X == pytest.approx(
        np.zeros(3), abs=1e-14
    )
    assert plate.p_XXcm_X == pytest.approx(np.zeros(3), abs=0.0)
    inertia = np.asarray(units.J.sum(axis=0) + plate.I_XXcm_X)
    assert inertia == pytest.approx(np.diag([8.8, 8.8, 15.0]), rel=1e-12, abs=1e-12)


def test_pyramid_has_no_net_momentum_and_each_unit_its_own():
    h = np.asarray(momentum_P(UNITS, jnp.zeros(4)))
    assert np.linalg.norm(h, axis=1) == pytest.approx([15.0] * 4, rel=1e-14)
    assert h.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-13)
    assert h[0] == pytest.approx([0.0, 15.0, 0.0], abs=1e-13)  # z x r at azimuth 0


def test_gimbal_turns_spin_towards_t():
    """Unit 0 after a quarter turn: t = g x s = (-cos skew, 0, sin skew)."""
    skew = np.radians(53.13)
    h = np.asarray(momentum_P(UNITS, jnp.full(4, np.pi / 2)))
    assert h[0] == pytest.approx([-15 * np.cos(skew), 0.0, 15 * np.sin(skew)], rel=1e-12, abs=1e-12)


def test_leg_geometry_of_the_cubic_hexapod():
    """Legs of 0.61237 m, pairwise parallel, otherwise orthogonal."""
    legs = LEGS.geometry
    assert np.asarray(legs.nominal_length) == pytest.approx([np.sqrt(0.375)] * 6, rel=1e-14)
    assert np.asarray(LEGS.strut.free_length) == pytest.approx(np.asarray(legs.nominal_length))
    spans = SATELLITE.mounts[0].p_BX_B + legs.p_PU_P - legs.p_BA_B
    s = np.asarray(spans) / np.sqrt(0.375)
    cosines = np.sort(np.abs(s @ s.T), axis=1)
    assert cosines == pytest.approx(np.tile([0, 0, 0, 0, 1, 1], (6, 1)), abs=1e-14)
    assert np.asarray(legs.p_BA_B)[:, 2] == pytest.approx([0.6] * 6)


def test_rotor_is_at_rest_in_its_imbalance():
    assert UNITS.eccentricity == pytest.approx([1.36e-5 / 6] * 4)
    assert UNITS.I_RRcm_R[0, 0, 1] == pytest.approx(-1.7e-6)
    assert UNITS.rotor_phase == pytest.approx([0.0, 0.7, 1.4, 2.1])
    assert UNITS.rotor_speed == pytest.approx([200 * np.pi] * 4)


# ---- frames


def turned_base(**more):
    angles = [0.3, -0.2, 0.5]
    return ZHANG.with_overrides(
        {"isolator.orientation": angles, "isolator.offset": [0.1, -0.2, 0.6]} | more
    ), euler(*angles)


def test_orientation_turns_the_whole_platform():
    scenario, R_BD = turned_base()
    turned, offset = build_satellite(scenario), np.array([0.1, -0.2, 0.6])
    straight = LEGS.geometry.p_BA_B - jnp.array([0.0, 0.0, 0.6])
    assert np.asarray(turned.hexapods[0].geometry.p_BA_B) == pytest.approx(
        np.asarray(offset + straight @ R_BD.T), rel=1e-13
    )
    assert np.asarray(turned.hexapods[0].geometry.k_B) == pytest.approx(
        np.asarray(LEGS.geometry.k_B @ R_BD.T), rel=1e-13, abs=1e-15
    )
    assert np.asarray(quaternion_to_matrix(turned.mounts[0].q_BX)) == pytest.approx(R_BD, abs=1e-14)
    assert turned.mounts[0].p_BX_B == pytest.approx(
        offset + R_BD @ [0, 0, ZHANG.isolator.separation]
    )


def test_struts_are_free_of_force_at_the_start():
    """Also with a turned base and a turning satellite: plate and bus move as one."""
    scenario, _ = turned_base(initial={"attitude": [0.4, 0.5, -0.6], "rate": [0.1, 0.2, 0.3]})
    satellite = build_satellite(scenario)
    state = build_initial_state(scenario, satellite)
    R_NB, R_NP = (
        quaternion_to_matrix(state.bus.q_NX),
        quaternion_to_matrix(state.bodies["plate"].q_NX),
    )
    assert np.asarray(R_NB) == pytest.approx(euler(0.4, 0.5, -0.6), abs=1e-14)
    assert state.bus.w_NX_X == pytest.approx([0.1, 0.2, 0.3])
    # joints and their velocities, each from its own body
    r_U = np.asarray(satellite.hexapods[0].geometry.p_PU_P) @ np.asarray(R_NP).T
    r_A = np.asarray(satellite.hexapods[0].geometry.p_BA_B) @ np.asarray(R_NB).T
    v_U = state.bodies["plate"].v_NX_N + np.cross(R_NP @ state.bodies["plate"].w_NX_X, r_U)
    v_A = state.bus.v_NX_N + np.cross(R_NB @ state.bus.w_NX_X, r_A)
    span = np.asarray(state.bodies["plate"].p_NX_N - state.bus.p_NX_N) + r_U - r_A
    length = np.linalg.norm(span, axis=1)
    rate = np.sum((v_U - v_A) * span, axis=1) / length
    force = satellite.hexapods[0].strut.tension(length, rate, jnp.zeros(0))
    assert np.asarray(force) == pytest.approx(np.zeros(6), abs=1e-10)
    assert np.abs(v_U - state.bus.v_NX_N).max() > 0.1


def test_initial_gimbal_angles():
    scenario = ZHANG.with_overrides({"cluster.gimbal_angles": [0.1, 0.2, "30 deg", 0]})
    state = build_initial_state(scenario, build_satellite(scenario))
    assert state.own["cluster"].y == pytest.approx([0.1, 0.2, np.pi / 6, 0.0])
    assert state.own["cluster"].y_rate == pytest.approx(np.zeros(4), abs=0.0)


def test_installation_error_is_the_papers_to_first_order():
    """A_fg = [[1, a, -b], [-a, 1, c], [b, -c, 1]] takes gimbal to bearing components (eq. 3)."""
    a, b, c = 1e-5, -2e-5, 3e-5
    scenario = ZHANG.with_overrides(
        {"cluster.rotor.installation_error": {"alpha": a, "beta": b, "chi": c}}
    )
    A_fg = np.array([[1, a, -b], [-a, 1, c], [b, -c, 1]])
    R_GF = np.asarray(build_satellite(scenario).clusters[0].units.R_GF[0])
    np.testing.assert_allclose(R_GF.T, A_fg, atol=1e-9)
    np.testing.assert_allclose(R_GF.T @ R_GF, np.eye(3), atol=1e-15)


def test_offsets_of_gimbal_and_rotor_add_up():
    scenario = ZHANG.with_overrides(
        {
            "cluster.gimbal_body.center_of_mass": ["1 mm", 0, "3 mm"],
            "cluster.rotor.offset": [0, "2 mm", "4 mm"],
        }
    )
    units = build_satellite(scenario).clusters[0].units
    assert units.p_CGcm_G[2] == pytest.approx([1e-3, 0.0, 3e-3])
    assert units.p_CR_G[2] == pytest.approx([1e-3, 2e-3, 7e-3])


def test_units_placed_at_will():
    """Two units that differ; an axis a little off right angles is straightened."""
    units = [
        {"position": [0.4, 0, 0], "gimbal_axis": [0, 0, 1], "spin_axis": [1, 0, 5e-4]},
        {
            "position": [0, 0.3, 0.1],
            "gimbal_axis": [0, 1, 0],
            "spin_axis": [0, 0, 1],
            "rotor": {"momentum": "-10 N*m*s", "speed": "-4000 rpm", "transverse_inertia": 0.02},
        },
    ]
    data = ZHANG.to_dict()
    data["cluster"] = {
        key: data["cluster"][key] for key in ("gimbal_body", "rotor", "gimbal_bandwidth")
    } | {"units": units}
    cluster = build_satellite(Scenario.from_dict(data)).clusters[0].units
    assert np.asarray(cluster.R_PG0[0]) == pytest.approx(np.eye(3), abs=1e-15)
    # columns s = z, t = g x s = y x z = x, g = y
    assert np.asarray(cluster.R_PG0[1]) == pytest.approx(
        np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]), abs=1e-15
    )
    h = np.asarray(momentum_P(cluster, jnp.zeros(2)))
    assert h == pytest.approx(np.array([[15, 0, 0], [0, 0, -10]]), abs=1e-12)
    assert np.asarray(cluster.p_PC_P[1]) == pytest.approx([0, 0.3, 0.1])
    assert np.asarray(cluster.rotor_phase) == pytest.approx(np.zeros(2), abs=np.pi)
    assert abs(np.diff(cluster.rotor_phase)) > 0.1  # drawn, each its own


# ---- control


def test_feedforward_inertia_is_what_the_equations_of_motion_feel():
    """Oracle: angular acceleration of the rigidly mounted satellite at rest under unit torques."""
    scenario, _ = turned_base(
        **BALANCED,
        **{
            "cluster.gimbal_angles": [0.3, -0.8, 1.0, 2.0],
            "cluster.gimbal_body.inertia": [0.03, 0.05, 0.06],
            "cluster.gimbal_body.center_of_mass": [0.01, 0.02, -0.03],
            "cluster.rotor.offset": [0.02, 0, 0.01],
            "cluster.rotor.installation_error.chi": 0.2,
            "cluster.rotor.installation_error.beta": 0.1,
            "isolator.plate.center_of_mass": [0.05, -0.02, 0.1],
            "isolator.legs.upper_part.mass": 3.0,
            "isolator.legs.lower_part.transverse_inertia": 0.5,
            "isolator.legs.lower_part.axial_inertia": 0.3,
        },
    )
    satellite = build_satellite(scenario, mount="rigid")
    state = build_initial_state(scenario.with_overrides({"initial.attitude": [0, 0, 0]}), satellite)
    satellite = eqx.tree_at(lambda s: s.clusters[0].units.rotor_speed, satellite, jnp.zeros(4))
    zero = jnp.zeros(3)

    now, still = moving(satellite, zero[0], state), {"cluster": Rates(jnp.zeros(4), jnp.zeros(0))}

    def rate(torque):
        on_bus = now.layout.rows("bus")
        extra = jnp.zeros(12).at[on_bus].set(jnp.concatenate([zero, torque]))
        return accelerations(satellite, now, still, extra)[on_bus][3:]

    felt = np.linalg.inv(np.asarray(jax.jit(jax.vmap(rate))(jnp.eye(3))).T)
    assert np.asarray(satellite.control.controller.J_feedforward_B) == pytest.approx(
        felt, rel=1e-11
    )


def test_controller_gains_and_tracking_time():
    controller = SATELLITE.control.controller
    assert (controller.kp, controller.ki, controller.kd) == (200.0, 0.1, 2500.0)
    assert controller.torque_limit == np.inf
    # Astrom: T_t = sqrt(Ti Td) with Ti = kp/ki, Td = kd/kp
    tracking_time = np.sqrt((200 / 0.1) * (2500 / 200))
    assert controller.unwinding == pytest.approx(1.0 / (0.1 * tracking_time))
    other = build_satellite(
        ZHANG.with_overrides(
            {"control.pid.ki": 0, "control.feedforward": False, "control.torque_limit": 3}
        )
    ).control.controller
    assert other.unwinding == 0.0
    assert not other.J_feedforward_B.any()
    assert other.torque_limit == 3.0


@pytest.mark.parametrize(
    ("law", "kind"),
    [
        ("singularity_robust", SingularityRobust),
        ("pseudo_inverse", PseudoInverse),
        ("generalized_singularity_robust", GeneralizedSingularityRobust),
        ("none", NoSteering),
    ],
)
def test_steering(law, kind):
    satellite = build_satellite(ZHANG.with_overrides({"control.steering": {"law": law}}))
    assert type(satellite.control.steering) is kind
    assert satellite.control.controller.acts


def test_steering_parameters_arrive():
    given = {"lambda0": 0.1, "mu": 2, "epsilon0": 0.3, "frequency": 4, "phases": [5, 6, 7]}
    law = {"law": "generalized_singularity_robust"} | given
    steering = build_satellite(ZHANG.with_overrides({"control.steering": law})).control.steering
    for key, value in given.items():
        assert np.asarray(getattr(steering, key)) == pytest.approx(value)


def test_control_none_has_neither_controller_nor_steering():
    satellite = build_satellite(ZHANG.with_overrides({"control": "none"}))
    assert type(satellite.control.controller) is NoController
    assert type(satellite.control.steering) is NoSteering


def test_gimbal_servo():
    servo = SATELLITE.clusters[0].gimbals
    assert (servo.bandwidth, servo.rate_limit, servo.acceleration_limit) == (50.0, np.inf, np.inf)
    limited = ZHANG.with_overrides(
        {"cluster.gimbal_rate_limit": "90 deg/s", "cluster.gimbal_acceleration_limit": 7}
    )
    servo = build_satellite(limited).clusters[0].gimbals
    assert servo.rate_limit == pytest.approx(np.pi / 2)
    assert servo.acceleration_limit == 7.0


def test_mount_may_be_chosen_at_the_build():
    assert not SATELLITE.mounts[0].welded
    assert LEGS.holds
    overridden = build_satellite(ZHANG.with_overrides({"isolator.mount": "rigid"}))
    for satellite in (build_satellite(ZHANG, mount="rigid"), overridden):
        assert satellite.mounts[0].welded
        assert not satellite.hexapods[0].holds
    with pytest.raises(ValueError, match="'isolated' or 'rigid', got 'free'"):
        build_satellite(ZHANG, mount="free")


# ---- guidance and loads


def test_step_guidance_is_the_target():
    scenario = ZHANG.with_overrides({"target.attitude": [0.1, 0.2, 0.3]})
    reference = build_satellite(scenario).control.guidance.reference(jnp.zeros(()))
    assert np.asarray(quaternion_to_matrix(reference.q_NR)) == pytest.approx(
        euler(0.1, 0.2, 0.3), abs=1e-14
    )


def test_slew_turns_from_start_to_target_the_short_way():
    scenario = load_scenario("zhang2012-slew").with_overrides(
        {"initial.attitude": ["20 deg", 0, "170 deg"], "target.attitude": [0, 0, "-170 deg"]}
    )
    guidance = build_satellite(scenario).control.guidance
    start, end = (guidance.reference(jnp.asarray(t)) for t in (0.0, 1e4))
    assert np.asarray(quaternion_to_matrix(start.q_NR)) == pytest.approx(
        euler(np.radians(20), 0, np.radians(170)), abs=1e-14
    )
    assert np.asarray(quaternion_to_matrix(end.q_NR)) == pytest.approx(
        euler(0, 0, np.radians(-170)), abs=1e-12
    )
    angle = np.linalg.norm(np.trapezoid(_rates(guidance), dx=0.05, axis=0))
    assert np.degrees(angle) < 29.0


def _rates(guidance):
    times = jnp.arange(0.0, 200.0, 0.05)
    return np.asarray(jax.jit(jax.vmap(lambda t: guidance.reference(t).w_NR_R))(times))


def test_built_in_slew_stays_within_what_the_cluster_can_do():
    """Rates times inertia against the pyramid's weakest momentum, 3.2 h; settled by the end."""
    scenario = load_scenario("zhang2012-slew")
    satellite = build_satellite(scenario)
    assert isinstance(satellite.control.guidance, EigenaxisSlew)
    momentum = (
        _rates(satellite.control.guidance)
        @ np.asarray(satellite.control.controller.J_feedforward_B).T
    )
    peak = np.linalg.norm(momentum, axis=1).max()
    assert 0.5 < peak / (3.2 * 15.0) < 0.6
    assert float(satellite.control.guidance.end) == pytest.approx(100.0, abs=0.1)
    end = satellite.control.guidance.reference(jnp.asarray(scenario.simulation.duration))
    target = Rotation.from_euler("ZYX", [-60, 30, 60], degrees=True).as_quat()
    error = attitude_error(jnp.asarray(np.roll(target, 1)), end.q_NR)
    assert np.asarray(error) == pytest.approx(np.zeros(3), abs=1e-12)


def test_loads():
    loads = [
        {"body": "plate", "frame": "inertial", "force": [1, 2, 3], "torque": [4, 5, 6]},
        {"body": "bus", "point": [7, 8, 9], "profile": {"step": {"start": 1}}},
        {"body": "bus", "profile": {"step": {"start": 1, "end": 2}}},
        {"body": "bus", "profile": {"half_sine": {"start": 1, "duration": 2}}},
        {"body": "bus", "profile": {"table": {"times": [1, 3], "values": [0, 4]}}},
    ]
    built = build_satellite(ZHANG.with_overrides({"loads": loads})).others
    assert [(load.hosts, load.frame) for load in built[:2]] == [
        (("plate",), "inertial"),
        (("bus",), "body"),
    ]
    assert np.asarray([built[0].force, built[0].torque]).tolist() == [[1, 2, 3], [4, 5, 6]]
    assert built[1].point.tolist() == [7, 8, 9]
    kinds = [type(load.profile) for load in built]
    assert kinds == [Constant, Step, Step, HalfSine, Table]
    at = {
        t: [float(load.profile.factor(jnp.asarray(t))) for load in built] for t in (0.5, 2.0, 9.0)
    }
    assert at[0.5] == pytest.approx([1, 0, 0, 0, 0])
    assert at[2.0] == pytest.approx([1, 1, 0, 1, 2])
    assert at[9.0] == pytest.approx([1, 1, 0, 0, 4], abs=1e-15)


def test_each_leg_keeps_its_own_values():
    part = ZHANG.to_dict()["isolator"]["legs"]["upper_part"]
    scenario = ZHANG.with_overrides(
        {
            "isolator.legs.damping": [1, 2, 3, 4, 5, 6],
            "isolator.legs.free_length": "60 cm",
            "isolator.legs.upper_part": [part | {"distance": 0.1 * i} for i in range(6)],
        }
    )
    legs = build_satellite(scenario).hexapods[0]
    assert legs.strut.damping.tolist() == [1, 2, 3, 4, 5, 6]
    assert legs.strut.stiffness.tolist() == [20e3] * 6
    assert legs.strut.free_length.tolist() == [0.6] * 6
    assert legs.geometry.nominal_length == pytest.approx([np.sqrt(0.375)] * 6)
    assert legs.bodies.upper.distance == pytest.approx([0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert legs.bodies.lower.distance == pytest.approx([0.15] * 6)
