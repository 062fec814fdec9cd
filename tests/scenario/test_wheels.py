"""Reaction wheels and run-ups in scenarios: what is read, and what is refused by name."""

import numpy as np
import pytest

from quietbus.scenario import Scenario, ScenarioError, load_scenario

DEMO, ZHANG = load_scenario("wheels-demo"), load_scenario("zhang2012")


def data(base=DEMO, **cluster):
    """A scenario's data with other keys of its cluster; None takes a key out."""
    whole = base.to_dict()
    whole["cluster"] = {k: v for k, v in (whole["cluster"] | cluster).items() if v is not None}
    return whole


def refused(whole):
    with pytest.raises(ScenarioError) as error:
        Scenario.from_dict(whole)
    return [str(problem) for problem in error.value.problems]


def test_demo_has_wheels_without_net_momentum():
    wheels = DEMO.cluster.placed()
    momentum = [w.rotor.inertia[0, 0] * w.rotor.speed * np.array(w.spin_axis) for w in wheels]
    assert np.linalg.norm(momentum[0]) == pytest.approx(12.0 / 3.0, rel=1e-3)
    np.testing.assert_allclose(np.sum(momentum, axis=0), 0.0, atol=1e-12)
    assert [wheel.motor.torque_limit for wheel in wheels] == [0.2] * 4


def test_pyramid_of_wheels_leans_their_spin_axes():
    scenario = Scenario.from_dict(data(units=None, pyramid={"skew": "30 deg", "radius": 0.3}))
    second = scenario.cluster.placed()[1]
    np.testing.assert_allclose(second.position, [0.0, 0.3, 0.0], atol=1e-15)
    np.testing.assert_allclose(second.spin_axis, [0.0, 0.5, np.sqrt(0.75)], atol=1e-15)
    assert second.rotor.speed == pytest.approx(2000.0 * np.pi / 30.0)


@pytest.mark.parametrize("spin", [[0, 0, 1], [0, 0, -1], [0.6, 0, 0.8], [0, 1, 0]])
def test_a_wheels_second_axis_is_across_its_spin(spin):
    units = [{"position": [0, 0, 0], "spin_axis": spin}]
    whole = data(units=units, rotor_phases=None) | {"control": "none"}
    axis = Scenario.from_dict(whole).cluster.placed()[0].gimbal_axis
    assert np.linalg.norm(axis) == pytest.approx(1.0)
    assert np.dot(axis, spin) == pytest.approx(0.0, abs=1e-12)
    assert np.dot(axis, [1, 0, 0] if abs(spin[2]) == 1 else [0, 0, 1]) > 0.0


def test_type_of_the_units_makes_a_cluster_of_wheels():
    units = [unit | {"type": "wheel"} for unit in DEMO.to_dict()["cluster"]["units"]]
    assert Scenario.from_dict(data(type=None, units=units)).cluster.count == 4


def test_scenarios_of_wheels_and_run_ups_survive_writing_and_reading():
    run_up = {"initial_speed": [0, "10 rpm", 0, 0], "duration": "30 s", "start": 2}
    for base in (DEMO, ZHANG):
        scenario = Scenario.from_dict(data(base, run_up=run_up) | {"control": "none"})
        assert Scenario.from_yaml(scenario.to_yaml()) == scenario
    assert DEMO.with_overrides({"cluster.rotor.mass": 5}).cluster.placed()[1].rotor.mass == 5


def test_steering_left_out_is_the_pseudo_inverse():
    whole = DEMO.to_dict()
    del whole["control"]["steering"]
    assert Scenario.from_dict(whole) == DEMO


@pytest.mark.parametrize(
    ("changes", "where", "what"),
    [
        ({"type": "reaction_wheel"}, "cluster.type", "expected one of cmg, wheel"),
        ({"gimbal_bandwidth": 50}, "cluster.gimbal_bandwidth", "unknown key"),
        ({"gimbal_angles": [0, 0, 0, 0]}, "cluster.gimbal_angles", "unknown key"),
        ({"gimbal_body": {"mass": 1}}, "cluster.gimbal_body", "unknown key"),
        ({"rotor_phases": [0, 0]}, "cluster.rotor_phases", "expected 4 angles, one for each wheel"),
        ({"motor": {"torque_limit": 0}}, "cluster.motor.torque_limit", "above 0"),
        ({"motor": {"speed_limit": "1000 rpm"}}, "cluster.units[0].rotor.speed", "speed limit"),
        ({"run_up": {"duration": 0}}, "cluster.run_up.duration", "above 0"),
        ({"run_up": {"duration": 9, "shape": "s"}}, "cluster.run_up.shape", "'smooth' or 'linear'"),
        (
            {"run_up": {"duration": 9, "final_speed": "7000 rpm"}},
            "cluster.run_up.final_speed",
            "speed limit",
        ),
        (
            {"run_up": {"duration": 9, "initial_speed": [0, 0]}},
            "cluster.run_up.initial_speed",
            "expected 4 speeds",
        ),
        ({"run_up": {"duration": 9}}, "control.steering.law", "run_up prescribes"),
    ],
)
def test_what_wheels_do_not_have_is_refused_by_name(changes, where, what):
    said = refused(data(**changes))
    assert any(line.startswith(where) and what in line for line in said), said


def test_cmgs_and_wheels_do_not_mix():
    units = DEMO.to_dict()["cluster"]["units"]
    units[2]["type"] = "cmg"
    (said,) = refused(data(units=units))
    assert said.startswith("cluster.units[2].type: expected wheel as before")


def test_a_torque_limit_for_some_wheels_only_is_refused():
    units = DEMO.to_dict()["cluster"]["units"]
    units[1]["motor"] = {"torque_limit": 0.3}
    (said,) = refused(data(units=units, motor=None))
    assert said.startswith("cluster.units[0].motor: expected a torque_limit")


@pytest.mark.parametrize("law", ["singularity_robust", "generalized_singularity_robust"])
def test_steering_laws_for_gimbals_are_refused_for_wheels(law):
    (said,) = refused(data() | {"control": DEMO.to_dict()["control"] | {"steering": {"law": law}}})
    assert said.startswith("control.steering.law: expected pseudo_inverse or none")


def test_wheels_that_cannot_turn_about_some_axis_are_refused():
    units = DEMO.to_dict()["cluster"]["units"]
    (said,) = refused(data(units=[units[0], units[2]], rotor_phases=None))
    assert "give no torque about [0, 1, 0]" in said or "about [0, -1, 0]" in said


def test_run_up_through_rest_needs_gimbals_that_are_held():
    (said,) = refused(data(ZHANG, run_up={"duration": 10}))
    assert said.startswith("cluster.run_up: expected control: none")
    slower = {"duration": 10, "initial_speed": "5000 rpm"}
    assert Scenario.from_dict(data(ZHANG, run_up=slower)).cluster.run_up.duration == 10


def test_run_up_has_no_steady_start():
    whole = data(ZHANG, run_up={"duration": 10}) | {"control": "none", "initial": "steady"}
    (said,) = refused(whole)
    assert said.startswith("initial.steady: expected false with cluster.run_up")
