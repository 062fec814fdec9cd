"""What of the torque asked for CMGs deliver: closed forms by singular values, limits, notes."""

import warnings

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

import quietbus as qb
from quietbus.build import build_satellite
from quietbus.dynamics.closed_loop import decide, initial_state
from quietbus.results import delivery_notes
from quietbus.spatial.rotation import rotation_vector_to_quaternion

signals = eqx.filter_jit(decide)
SINGULAR = np.radians([-90.0, 0.0, 90.0, 0.0])  # no torque about x
NEAR = SINGULAR + np.array([0.11, -0.02, -0.07, 0.16])
TURNS = [[0.02, 0.0, 0.0], [0.01, -0.02, 0.015], [0.0, 0.0, -0.03]]


def decided(turn, angles, law=None, limit=None):
    """Signals with the satellite at rest, turned; A and y of theory (40), from the scenario."""
    scenario = qb.load_scenario("zhang2012").with_overrides(
        {
            "isolator.orientation": [0.3, -0.2, 0.5],
            "control.steering": {"law": law or "singularity_robust"},
            "cluster.gimbal_rate_limit": 1e6 if limit is None else limit,
            "target.attitude": [0, 0, 0],
        }
    )
    satellite = build_satellite(scenario)
    q_NB = rotation_vector_to_quaternion(jnp.asarray(turn, float))
    state = initial_state(satellite, q_NB, jnp.zeros(3), jnp.asarray(angles))
    found = signals(satellite, jnp.zeros(()), state)
    A = []
    for unit, gamma in zip(scenario.cluster.placed(), angles, strict=True):
        g, s = np.array(unit.gimbal_axis), np.array(unit.spin_axis)
        A.append(np.cos(gamma) * np.cross(g, s) - np.sin(gamma) * s)
    q_BP = np.asarray(satellite.mounts[0].q_BX)
    w, v = float(q_BP[0]), -q_BP[1:]  # from bus to plate
    torque = np.asarray(found.torque_B)
    y = torque + 2.0 * np.cross(v, np.cross(v, torque) + w * torque)
    return found, np.array(A).T, y


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("angles", [SINGULAR, NEAR, np.zeros(4)], ids=["at", "near", "far"])
def test_the_robust_law_leaves_of_each_singular_direction_what_its_singular_value_says(
    turn, angles
):
    """sigma^2 / (sigma^2 + lambda) of the torque's component."""
    found, A, y = decided(turn, angles)
    U, sigma, _ = np.linalg.svd(A, full_matrices=False)
    weight = 0.01 * np.exp(-10.0 * np.linalg.det(A @ A.T))
    left = sigma**2 / (sigma**2 + weight)
    expected = np.sum(left * (U.T @ y) ** 2) / (y @ y)
    assert float(found.torque_share) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_no_torque_along_the_singular_direction_is_delivered():
    found, A, y = decided([0.02, 0, 0], SINGULAR)
    along = np.linalg.svd(A)[0][:, 2]
    assert np.abs(along) == pytest.approx([1, 0, 0], abs=1e-9)
    assert float(found.torque_share) < 1.0 - 0.99 * (along @ y) ** 2 / (y @ y)


def test_the_pseudo_inverse_delivers_all_and_the_rate_limit_cuts_it():
    found, _, _ = decided(TURNS[1], np.zeros(4), "pseudo_inverse")
    assert float(found.torque_share) == pytest.approx(1.0, rel=1e-12)
    fastest = float(np.max(np.abs(found.commands[0])))
    cut, _, _ = decided(TURNS[1], np.zeros(4), "pseudo_inverse", limit=0.4 * fastest)
    assert float(cut.torque_share) == pytest.approx(0.4, rel=1e-9)


def test_where_nothing_is_asked_for_nothing_is_missing():
    found, _, _ = decided(np.zeros(3), SINGULAR)
    assert not np.any(found.torque_B)
    assert float(found.torque_share) == 1.0


def made_up(share, rate=10.0, **changes):
    """A run with a torque of 2 N m about z, by its share over time."""
    scenario = qb.load_scenario("zhang2012").with_overrides(changes)
    n = len(share)
    torque = np.tile([0.0, 0.0, 2.0], (n, 1))
    return xr.Dataset(
        {
            "torque_share": ("time", np.asarray(share, float)),
            "control_torque": (("time", "axis"), torque),
            "gimbal_rate": (("time", "cmg"), np.tile([0.1, 0.0, 0.0, -0.5], (n, 1))),
            "singularity_measure": ("time", np.linspace(1.0, 0.03, n)),
        },
        {"time": np.arange(n) / rate},
        {"scenario": scenario.to_yaml()},
    )


def test_only_what_is_missing_for_more_than_a_second_is_told():
    whole = np.ones(60)
    short = np.where(np.arange(60) % 12 < 11, 0.5, 1.0)  # a second each, with gaps
    assert delivery_notes(made_up(whole)) == []
    assert delivery_notes(made_up(short)) == []
    assert delivery_notes(made_up(np.full(60, 0.91))) == []
    share = whole.copy()
    share[20:35] = 0.25
    share[40:52] = 0.1
    (note,) = delivery_notes(made_up(share))
    assert note.startswith("from t = 2 s to 3.4 s the satellite felt less than 90 % of the torque")
    assert "2 N m were asked for, 0.5 N m delivered along them" in note
    assert "at the least 25 %" in note


def test_the_cause_is_told():
    share = np.full(60, 0.3)
    (note,) = delivery_notes(made_up(share))
    assert "near a singular set (singularity_measure down to 0.03)" in note
    (note,) = delivery_notes(made_up(share[:20], **{"cluster.gimbal_rate_limit": 0.5}))
    assert "rate limit" in note


@pytest.mark.slow
@pytest.mark.parametrize(("degrees", "leads_out"), [(1.5, False), (5.0, True), (20.0, True)])
def test_the_generalised_law_leads_out_of_a_singular_set_for_large_torques_only(degrees, leads_out):
    """The figures of docs/theory.md, section 9."""
    scenario = qb.load_scenario("zhang2012").with_overrides(
        {
            "isolator.mount": "rigid",
            "cluster.gimbal_angles": SINGULAR.tolist(),
            "cluster.gimbal_rate_limit": 2.0,
            "control.steering": {"law": "generalized_singularity_robust"},
            "initial.attitude": [f"{degrees} deg", 0, 0],
        }
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = qb.simulate(scenario, "harmonic", duration=40.0)
    notes = [str(each.message) for each in caught if "felt less than 90 %" in str(each.message)]
    missing = 0.1 * np.count_nonzero(run.torque_share.to_numpy() < 0.9)
    error = np.degrees(np.linalg.norm(run.attitude_error.to_numpy(), axis=1))
    summary = qb.summarize(run)
    assert summary.minimum_torque_share < 1e-3
    if leads_out:
        assert missing < 3.0
        assert error[-1] < 0.06 * error[0]
    else:
        (note,) = notes
        assert note.startswith("from t = 0 s to 40 s the satellite felt less than 90 %")
        assert "5.3 N m were asked for" in note or "5.32 N m were asked for" in note
        assert missing > 40.0
        assert error[-1] > 0.99 * error[0]
        assert run.singularity_measure.max() < 1e-3
