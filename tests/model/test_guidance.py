"""The eigenaxis slew: limits, continuity, and the time-optimal duration in every regime."""

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from quietbus.model.guidance import EigenaxisSlew, StepGuidance

quickly = settings(deadline=None, max_examples=50)

START = Rotation.from_rotvec([0.3, -0.8, 0.5])
AXIS = np.array([0.6, -0.48, 0.64])
REGIMES = {  # angle, rate, acceleration and jerk limits
    "all seven segments": (1.5, 0.05, 0.01, 0.005),
    "no cruise": (0.2, 0.05, 0.01, 0.005),
    "no constant acceleration": (1.5, 0.05, 0.05, 0.005),
    "neither": (0.05, 0.5, 0.5, 0.005),
}

reference = jax.jit(jax.vmap(lambda slew, t: slew.reference(t), (None, 0)))


def quaternion(rotation):
    return np.roll(rotation.as_quat(), 1)


def plan(angle, rate, acceleration, jerk, start=0.0):
    return EigenaxisSlew.plan(
        quaternion(START),
        angle * AXIS,
        max_rate=rate,
        max_acceleration=acceleration,
        max_jerk=jerk,
        start=start,
    )


def turned(found):
    """Rotation from the start to each reference attitude."""
    return START.inv() * Rotation.from_quat(np.roll(found.q_NR, -1, axis=1))


def optimal_duration(angle, w, a, j):
    """Of the rest-to-rest turn with bounded rate w, acceleration a and jerk j."""
    peak_acceleration = min(a, np.sqrt(w * j))
    ramp = w / peak_acceleration + peak_acceleration / j  # to full rate
    if angle >= w * ramp:
        return angle / w + ramp
    if angle >= 2 * a**3 / j**2:  # full acceleration, but not full rate
        return a / j + np.sqrt((a / j) ** 2 + 4 * angle / a)
    return 4 * np.cbrt(angle / (2 * j))


limits = st.floats(1e-3, 1.0)
cases = st.tuples(st.floats(1e-4, 3.1), limits, limits, limits)


def test_the_four_regimes_are_the_four_closed_forms():
    """The textbook durations, each written for its own regime."""
    (a1, w1, c1, j1), (a2, _, c2, j2), (a3, w3, _, j3), (a4, _, _, j4) = REGIMES.values()
    w2 = 0.5 * (-(c2**2) / j2 + np.sqrt((c2**2 / j2) ** 2 + 4 * c2 * a2))  # peak rate reached
    expected = [
        a1 / w1 + w1 / c1 + c1 / j1,
        2 * (w2 / c2 + c2 / j2),
        a3 / w3 + 2 * np.sqrt(w3 / j3),
        4 * (a4 / (2 * j4)) ** (1 / 3),
    ]
    zero = [(), (3,), (1, 5), (1, 3, 5)]  # segments that each regime does without
    for case, duration, without in zip(REGIMES.values(), expected, zero, strict=True):
        slew = plan(*case)
        assert float(slew.end) == pytest.approx(duration, rel=1e-12)
        assert optimal_duration(*case) == pytest.approx(duration, rel=1e-12)
        short = np.flatnonzero(np.asarray(slew.duration) < 1e-9 * duration)
        np.testing.assert_array_equal(short, without)


@pytest.mark.parametrize("regime", REGIMES)
def test_no_profile_within_the_limits_turns_further_in_the_same_time(regime):
    """A linear programme over the jerk in 60 intervals finds the largest angle to be this one."""
    angle, w, a, j = REGIMES[regime]
    n = 60
    dt = float(plan(angle, w, a, j).end) / n
    lower = np.tril(np.ones((n, n)))
    acceleration = dt * lower
    before = np.vstack([np.zeros(n), acceleration[:-1]])
    rate = lower @ (dt * before + 0.5 * dt**2 * np.eye(n))
    rate_before = np.vstack([np.zeros(n), rate[:-1]])
    turn = np.sum(dt * rate_before + 0.5 * dt**2 * before + dt**3 / 6 * np.eye(n), axis=0)
    bounds = np.repeat([a, w], n)
    found = linprog(
        -turn,
        A_ub=np.vstack([acceleration, rate, -acceleration, -rate]),
        b_ub=np.concatenate([bounds, bounds]),
        A_eq=np.vstack([acceleration[-1], rate[-1]]),
        b_eq=[0.0, 0.0],
        bounds=(-j, j),
    )
    assert found.status == 0
    assert -found.fun == pytest.approx(angle, rel=3e-3)


@quickly
@given(cases)
def test_slew_ends_at_rest_at_the_target_within_all_limits_and_as_early_as_can_be(case):
    angle, w, a, j = case
    slew = plan(*case, start=2.0)
    end = float(slew.end)
    assert end - 2.0 == pytest.approx(optimal_duration(*case), rel=1e-9)
    t = np.linspace(2.0, end, 401)
    found = reference(slew, np.concatenate([t, [0.0, end + 5.0]]))
    rate, acceleration = found.w_NR_R @ AXIS, found.dw_NR_R @ AXIS
    assert np.abs(rate).max() <= w * (1 + 1e-9)
    assert np.abs(acceleration).max() <= a * (1 + 1e-9)
    # continuous: neither rate nor acceleration changes faster than the limits let it
    dt = t[1] - t[0]
    assert np.abs(np.diff(rate[:401])).max() <= a * dt * (1 + 1e-9)
    assert np.abs(np.diff(acceleration[:401])).max() <= j * dt * (1 + 1e-9)
    np.testing.assert_allclose(found.w_NR_R, np.outer(rate, AXIS), atol=1e-12)
    # at rest at both ends, before and after
    for at, gone in ((0, 0.0), (400, angle), (401, 0.0), (402, angle)):
        assert abs(rate[at]) <= 1e-9 * w
        assert abs(acceleration[at]) <= 1e-9 * a
        np.testing.assert_allclose(turned(found).as_rotvec()[at], gone * AXIS, atol=1e-9)


@pytest.mark.parametrize("regime", REGIMES)
def test_rate_is_the_derivative_of_attitude_and_acceleration_that_of_rate(regime):
    slew = plan(*REGIMES[regime], start=1.0)
    t, h = np.linspace(0.5, float(slew.end) + 0.5, 60), 1e-4
    before, now, after = (reference(slew, t + dt) for dt in (-h, 0.0, h))
    change = (turned(before).inv() * turned(after)).as_rotvec() / (2 * h)
    np.testing.assert_allclose(change, now.w_NR_R, atol=1e-9)
    change = (after.w_NR_R - before.w_NR_R) / (2 * h)
    np.testing.assert_allclose(change, now.dw_NR_R, atol=1e-6)


def test_turn_of_zero_length_stays_at_rest():
    slew = plan(0.0, 0.05, 0.01, 0.005, start=3.0)
    assert float(slew.end) == 3.0
    found = reference(slew, np.array([0.0, 3.0, 10.0]))
    np.testing.assert_allclose(found.q_NR, np.tile(quaternion(START), (3, 1)), atol=1e-15)
    np.testing.assert_array_equal(found.w_NR_R, np.zeros((3, 3)))
    np.testing.assert_array_equal(found.dw_NR_R, np.zeros((3, 3)))


def test_step_is_the_target_at_rest_at_any_time():
    q = quaternion(START)
    found = reference(StepGuidance(q), np.array([0.0, 7.0]))
    np.testing.assert_array_equal(found.q_NR, [q, q])
    assert not np.any(found.w_NR_R)
    assert not np.any(found.dw_NR_R)
