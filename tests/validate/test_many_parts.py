"""Several platforms, a bench and mixed clusters: equations of motion against MuJoCo's."""

import copy

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.many_bodies import many_parts
from oracles.plain_data import satellite
from quietbus.dynamics.equations import accelerations, moving
from quietbus.reference.mechanism import read_mechanism
from quietbus.scenario import Scenario, ScenarioError, load_scenario
from quietbus.scenario.struts import SpringDamperStrut
from quietbus.validate.checks import validate
from quietbus.validate.instants import check_instants, check_start
from quietbus.validate.reference import Reference
from quietbus.validate.states import random_rates, random_state, random_wrenches
from quietbus.validate.subject import Subject

pytest.importorskip("mujoco")


@eqx.filter_jit
def _ours(satellite, t, state, rates, wrenches):
    now = moving(satellite, t, state)
    return accelerations(satellite, now, rates, jnp.ravel(wrenches))


@pytest.mark.parametrize(
    ("welded", "bench_on"),
    [
        ((), "bus"),
        (("south",), "bus"),
        (("north", "south", "bench"), "bus"),
        ((), "north"),
        (("north", "bench"), "north"),
    ],
)
def test_accelerations_agree_with_mujoco_at_20_random_states(welded, bench_on):
    """CMGs and wheels on one plate, accelerating; rotors that run up; loads on all bodies."""
    satellite, rng = many_parts(welded, bench_on), np.random.default_rng(11)
    reference = Reference(satellite, random_state(satellite, rng))
    for _ in range(20):
        t, state = rng.uniform(0.0, 1.5), random_state(satellite, rng)
        rates, wrenches = random_rates(satellite, rng), random_wrenches(satellite, rng)
        theirs = reference.accelerations(t, state, rates, wrenches)
        ours = np.asarray(_ours(satellite, jnp.asarray(t), state, rates, wrenches))
        ours = ours.reshape(theirs.shape)
        error = np.linalg.norm(theirs - ours, axis=2) / np.linalg.norm(theirs, axis=2)
        assert np.max(error) <= 1e-9


def _scenario(**mounts):
    """The reference's own example of many parts, as a file would have it."""
    data = satellite()
    data["payload"]["isolator"].pop("plate")  # it is the payload's body
    for platform in data["platforms"]:
        platform["isolator"]["mount"] = mounts.get(platform["name"], "isolated")
    data |= {"name": "many", "simulation": {"duration": 10.0, "output_rate": 1000.0}}
    data["lines_of_sight"] = {"camera": {"on": "payload", "direction": [1.0, 0.0, 0.0]}}
    return Scenario.from_dict(data, "many")


@pytest.mark.parametrize("north", ["isolated", "rigid"])
def test_a_scenario_of_many_parts_agrees_with_the_reference(north):
    """Built by each program from the file's words: one control over CMGs and wheels of all."""
    subject = Subject(_scenario(north=north), _scenario(north=north))
    checks = [check_start(subject), *check_instants(subject, 20, np.random.default_rng(3))]
    assert all(check.passed for check in checks), checks
    assert len(checks) == (5 if north == "isolated" else 4)


def test_a_platform_that_is_turned_otherwise_is_seen():
    built_from = _scenario().with_overrides(
        {"platforms[1].isolator.orientation": [-0.3, 0.1, 0.01]}
    )
    assert not check_start(Subject(_scenario(), built_from)).passed


def test_struts_under_a_key_of_their_own_are_read_as_those_beside_the_joints():
    plain = load_scenario("zhang2012").to_dict()
    keyed = copy.deepcopy(plain)
    legs = keyed["isolator"]["legs"]
    legs["strut"] = {"type": "spring_damper"} | {k: legs.pop(k) for k in ("stiffness", "damping")}
    found = read_mechanism(Scenario.from_dict(keyed).to_dict()).legs
    expected = read_mechanism(plain).legs
    assert np.array_equal(found.stiffness, expected.stiffness)
    assert np.array_equal(found.damping, expected.damping)
    assert expected.stiffness[0] == 20e3


@pytest.mark.parametrize(
    ("override", "own_law", "said"),
    [
        ({"platforms[1].on": "north"}, False, r"platforms\[1\].on: expected 'bus', got 'north'"),
        ({}, True, r"platforms\[0\].isolator.legs.strut.type: expected spring_damper"),
    ],
)
def test_parts_that_the_reference_does_not_know_are_refused_by_name(
    override, own_law, said, monkeypatch
):
    data = _scenario().to_dict()
    legs = data["platforms"][0]["isolator"]["legs"]
    legs["strut"] = {"type": "spring_damper"} | {k: legs.pop(k) for k in ("stiffness", "damping")}
    scenario = Scenario.from_dict(data).with_overrides(override)
    if own_law:
        monkeypatch.setattr(SpringDamperStrut, "spring_and_damper", lambda _: None)
    with pytest.raises(ScenarioError, match=said):
        validate(scenario)
