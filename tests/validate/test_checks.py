"""The user's verdict: right satellites pass, each kind of wrong one is seen."""

from dataclasses import replace
from types import SimpleNamespace

import equinox as eqx
import jax
import numpy as np
import pytest

import quietbus.validate.subject as subject_module
from oracles.scenarios import awkward_rigid, awkward_scenario, awkward_wheels
from quietbus.build import build_satellite
from quietbus.scenario import load_scenario
from quietbus.validate import Check, instants, not_covered, validate
from quietbus.validate.flight import ended
from quietbus.validate.instants import check_instants, check_start
from quietbus.validate.subject import Subject, apart

pytest.importorskip("mujoco")

STATES = 20  # more than loads and commands have corners


def _failed(subject):
    """Names of the checks at instants that fail."""
    checks = [check_start(subject), *check_instants(subject, STATES, np.random.default_rng(3))]
    return {check.name for check in checks if not check.passed}


@pytest.mark.parametrize("make", [awkward_scenario, awkward_wheels])
def test_awkward_satellites_agree_with_the_reference(make):
    assert not _failed(Subject(make(), make()))


def test_an_imbalance_of_less_than_a_micrometre_is_not_lost():
    """MuJoCo takes such a mass centre as on the axis, if it is let."""
    rotor = {"static_imbalance": 2e-6, "dynamic_imbalance": 0.0}
    small = load_scenario("zhang2012").with_overrides(
        {f"cluster.rotor.{key}": value for key, value in rotor.items()}
        | {"initial.attitude": [0, 0, 0]}
    )
    assert not _failed(Subject(small, small))


@pytest.mark.parametrize(
    ("path", "value", "seen_by"),
    [
        ("cluster.rotor.static_imbalance", 2 * 1.36e-5, "accelerations"),
        ("cluster.rotor.dynamic_imbalance_phase", 0.7 + np.pi, "accelerations"),
        ("cluster.rotor.installation_error.beta", 0.02, "accelerations"),
        ("cluster.rotor.disturbance.orders[1].whirl", "forward", "accelerations"),
        ("cluster.rotor.disturbance.resonances.rocking.frequency", 91.0, "accelerations"),
        ("isolator.orientation", [-0.1, -0.15, 0.4], "start"),
        ("isolator.legs.universal_friction", 1.0, "accelerations"),
        ("control.pid.ki", 4.001, "control"),
        ("control.torque_limit", 41.0, "control"),
        ("control.feedforward", False, "control"),
        ("cluster.gimbal_acceleration_limit", 31.0, "control"),
        ("target.guidance.max_jerk", 0.21, "control"),
        ("loads[0].point", [0.3, 0.2, 0.5], "accelerations"),
        ("loads[1].frame", "body", "accelerations"),
        ("loads[3].profile.step.end", 8.0, "accelerations"),
    ],
)
def test_a_satellite_of_another_scenario_is_seen(path, value, seen_by):
    scenario = awkward_scenario()
    assert seen_by in _failed(Subject(scenario, scenario.with_overrides({path: value})))


def _wrong_Kd(satellite):
    control = satellite.control
    controller = replace(control.controller, kd=-control.controller.kd)
    return replace(satellite, control=replace(control, controller=controller))


def _wrong_lever(satellite):
    first, *others = satellite.others
    return replace(satellite, others=(replace(first, point=-first.point), *others))


def _lower_joints_not_turned(satellite):
    joints = np.array(awkward_scenario().isolator.legs.lower_joints) + np.array([0.05, -0.1, 0.6])
    at = lambda s: s.hexapods[0].geometry.p_BA_B  # noqa: E731
    return eqx.tree_at(at, satellite, jax.numpy.asarray(joints))


@pytest.mark.parametrize(
    ("wrong", "seen_by"),
    [
        (_wrong_Kd, "control"),
        (_wrong_lever, "accelerations"),
        (_lower_joints_not_turned, "accelerations"),
    ],
)
def test_a_mistake_in_building_is_seen(wrong, seen_by, monkeypatch):
    monkeypatch.setattr(subject_module, "build_satellite", lambda s: wrong(build_satellite(s)))
    assert seen_by in _failed(Subject(awkward_scenario(), awkward_scenario()))


@pytest.mark.parametrize(
    "name", ["spherical_force", "universal_force", "universal_moment", "universal_axis"]
)
def test_a_wrong_sign_of_a_joint_force_is_seen(name, monkeypatch):
    right = instants._evaluated

    def wrong(*arguments):
        *others, joints = right(*arguments)
        return *others, joints | {name: -joints[name]}

    monkeypatch.setattr(instants, "_evaluated", wrong)
    assert _failed(Subject(awkward_scenario(), awkward_scenario())) == {"joint forces"}


def test_a_slight_error_in_the_accelerations_is_found(monkeypatch):
    right = instants._evaluated

    def wrong(*arguments):
        accelerations, *others = right(*arguments)
        return jax.tree.map(lambda a: a * (1.0 + 1e-8), accelerations), *others

    monkeypatch.setattr(instants, "_evaluated", wrong)
    subject = Subject(awkward_scenario(), awkward_scenario())
    check = check_instants(subject, STATES, np.random.default_rng(3))[0]
    assert not check.passed
    assert check.error == pytest.approx(1e-8, rel=1e-3)


@pytest.mark.slow
def test_every_check_of_a_rigid_awkward_satellite_passes():
    """Gimbal motors that ripple and step, order tables, loads, a slew, and a steady start."""
    said = []
    found = validate(awkward_rigid(), random_states=3, duration=0.01, progress=said.append)
    assert [check.name for check in found] == [
        "start",
        "accelerations",
        "control",
        "flight",
        "linear momentum",
        "angular momentum",
        "energy",
        "lines from rest",
    ]
    assert all(check.passed for check in found), found
    assert said == ["start", "instants", "flight", "momentum", "energy", "harmonic"]


def test_what_is_not_covered_is_said():
    assert not_covered(load_scenario("zhang2012")) == []
    said = not_covered(awkward_rigid())
    assert any("gimbal motors in harmonic runs" in each for each in said)
    assert any("joint forces" in each for each in said)
    assert any("preload" in each for each in not_covered(awkward_wheels()))
    noisy = load_scenario("zhang2012").with_overrides(
        {
            "cluster.rotor.disturbance": {
                "broadband": {"axial_force": {"frequency": [1.0, 100.0], "psd": [1e-8, 1e-8]}}
            }
        }
    )
    assert any("broadband" in each for each in not_covered(noisy))


def test_a_run_with_fewer_instants_than_asked_for_has_ended():
    solution = SimpleNamespace(time=np.zeros(8), stopped=None)
    assert ended(solution, 21) == "8 of 21 instants computed"
    assert not ended(solution, 8)
    assert ended(SimpleNamespace(time=np.zeros(8), stopped="diverged"), 8) == "diverged"


def test_an_error_that_is_no_number_fails():
    assert not Check("x", "y", float("nan"), 1.0).passed


def test_a_quantity_that_is_no_number_is_not_overlooked_among_others():
    theirs = {"a": np.ones((2, 3)), "b": np.ones((2, 3))}
    ours = {"a": np.full((2, 3), np.nan), "b": np.ones((2, 3))}
    assert not Check("x", "y", apart(theirs, ours), 1.0).passed
