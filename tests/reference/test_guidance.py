"""The reference's slew: within the limits, at its target, and the one that quietbus plans."""

import jax
import numpy as np
import pytest

from oracles.scenarios import awkward_scenario
from quietbus.build import build_satellite
from quietbus.reference.guidance import Guidance, turn_profile

LIMITS = [(0.05, 0.05, 0.2), (0.2, 0.05, 0.2), (5.0, 0.05, 0.2), (0.2, 5.0, 0.2), (5.0, 5.0, 0.2)]


@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("angle", [1e-4, 0.3, 2.0])
def test_turn_ends_at_its_angle_within_the_limits(angle, limits):
    turn = turn_profile(angle, *limits, start=1.5)
    t = np.linspace(turn.x[0], turn.x[-1], 2001)
    assert turn.x[0] == 1.5
    assert turn(t[-1]) == pytest.approx(angle, rel=1e-12)
    assert abs(turn(t[-1], 1)) < 1e-12
    for nu, limit in enumerate(limits, start=1):
        assert np.max(np.abs(turn(t, nu))) <= limit * (1.0 + 1e-12)
    # rate, acceleration or jerk is at its limit at every instant: no quicker turn exists
    at_limit = [
        np.abs(turn(t[1:-1], nu)) > limit * (1 - 1e-6) for nu, limit in enumerate(limits, 1)
    ]
    assert np.mean(np.any(at_limit, axis=0)) > 0.999


@pytest.mark.parametrize("limits", LIMITS)
def test_attitude_rate_and_acceleration_are_those_that_quietbus_plans(limits):
    names = ("max_rate", "max_acceleration", "max_jerk")
    changes = {f"target.guidance.{name}": x for name, x in zip(names, limits, strict=True)}
    scenario = awkward_scenario().with_overrides(changes | {"target.guidance.start": 0.7})
    theirs = Guidance(scenario.to_dict())
    ours = build_satellite(scenario).control.guidance
    times = np.random.default_rng(1).uniform(0.0, 1.2 * theirs.turn.x[-1], 50)
    found = jax.vmap(ours.reference)(times)
    for i, t in enumerate(times):
        attitude, rate, acceleration = theirs.reference(t)
        q = attitude.as_quat(scalar_first=True)
        assert abs(q @ np.asarray(found.q_NR[i])) == pytest.approx(1.0, abs=1e-14)
        np.testing.assert_allclose(rate, found.w_NR_R[i], atol=1e-13)
        np.testing.assert_allclose(acceleration, found.dw_NR_R[i], atol=1e-12)
