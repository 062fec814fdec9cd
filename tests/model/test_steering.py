"""Steering laws against their singular value decomposition, at and around singular states."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from quietbus.build import build_initial_state, build_satellite
from quietbus.dynamics.closed_loop import decide
from quietbus.model.steering import (
    GeneralizedSingularityRobust,
    PseudoInverse,
    SingularityRobust,
    singularity_measure,
)
from quietbus.model.unit import momentum_P
from quietbus.scenario import load_scenario
from quietbus.spatial.rotation import quaternion_to_matrix, rotation_vector_to_quaternion

quickly = settings(deadline=None, max_examples=40)

SKEW = np.deg2rad(53.13)
LAMBDA0, MU = 0.01, 10.0
SR = SingularityRobust(jnp.asarray(LAMBDA0), jnp.asarray(MU))
GSR = GeneralizedSingularityRobust(
    jnp.asarray(LAMBDA0),
    jnp.asarray(MU),
    jnp.asarray(0.1),
    jnp.asarray(1.0),
    jnp.array([0.0, 0.5 * jnp.pi, jnp.pi]),
)
ELLIPTIC = np.deg2rad([-90.0, 0.0, 90.0, 0.0])  # no torque about x, and no null motion leads away

angles = st.lists(st.floats(-3.1, 3.1), min_size=4, max_size=4).map(np.array)
wishes = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)
pseudo_inverse_rates, sr_rates, gsr_rates = (
    jax.jit(lambda A, wish, t, law=law: law.rates(A, wish, t)) for law in (PseudoInverse(), SR, GSR)
)


def jacobian(gamma, skew=SKEW):
    """d(sum of spin axes)/d gamma of a pyramid: t = cos gamma (sin b z - cos b r) - sin gamma s."""
    azimuth = 2.0 * np.pi * np.arange(len(gamma)) / len(gamma)
    zero = 0.0 * azimuth
    t0 = np.stack([-np.cos(skew) * np.cos(azimuth), -np.cos(skew) * np.sin(azimuth), zero])
    t0[2] = np.sin(skew)
    s0 = np.stack([-np.sin(azimuth), np.cos(azimuth), zero])
    return jnp.cos(gamma) * t0 - jnp.sin(gamma) * s0


def weight(A):
    return LAMBDA0 * np.exp(-MU * np.linalg.det(A @ A.T))


@pytest.mark.parametrize("count", [3, 4, 6])
def test_singularity_measure_of_a_pyramid_at_zero_gimbal_angles(count):
    """A A^T is diagonal there, n (cos^2 b / 2, cos^2 b / 2, sin^2 b)."""
    found = singularity_measure(jacobian(np.zeros(count)))
    assert float(found) == pytest.approx(
        0.5 * count**1.5 * np.sin(SKEW) * np.cos(SKEW) ** 2, rel=1e-12
    )
    built = build_satellite(load_scenario("zhang2012"))
    signals = decide(built, jnp.zeros(()), build_initial_state(load_scenario("zhang2012"), built))
    assert float(signals.singularity) == pytest.approx(
        4.0 * np.sin(SKEW) * np.cos(SKEW) ** 2, rel=1e-12
    )


@quickly
@given(angles, wishes)
def test_pseudo_inverse_gives_exactly_the_torque_by_the_smallest_rates(gamma, wish):
    A = np.asarray(jacobian(gamma))
    assume(np.linalg.svd(A)[1][-1] > 0.1)
    found = pseudo_inverse_rates(A, wish, 0.0)
    np.testing.assert_allclose(A @ found, wish, atol=1e-11)
    np.testing.assert_allclose(found, np.linalg.pinv(A) @ wish, atol=1e-11)


@quickly
@given(angles, wishes)
def test_sr_inverse_is_the_damped_inverse_of_the_singular_values(gamma, wish):
    """Rates V (s / (s^2 + lambda)) U^T wish, so at most |wish| / (2 sqrt(lambda))."""
    A = np.asarray(jacobian(gamma))
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    lam = weight(A)
    found = np.asarray(sr_rates(A, wish, 0.0))
    np.testing.assert_allclose(found, Vt.T @ (s / (s**2 + lam) * (U.T @ wish)), atol=1e-10)
    bound = np.linalg.norm(wish) * (1 + 1e-9) + 1e-300
    assert np.linalg.norm(found) <= bound / (2.0 * np.sqrt(lam))
    assert np.linalg.norm(A @ found - wish) <= bound * lam / (s[-1] ** 2 + lam) + 1e-12


@quickly
@given(angles, wishes, st.floats(0.0, 100.0))
def test_gsr_inverse_adds_the_moving_matrix_of_wie(gamma, wish, t):
    A = np.asarray(jacobian(gamma))
    e1, e2, e3 = 0.1 * np.sin(t + np.array([0.0, 0.5 * np.pi, np.pi]))
    E = np.array([[1, e3, e2], [e3, 1, e1], [e2, e1, 1]])
    expected = A.T @ np.linalg.solve(A @ A.T + weight(A) * E, wish)
    np.testing.assert_allclose(gsr_rates(A, wish, t), expected, atol=1e-9)


def test_gsr_without_perturbation_is_sr():
    A, wish = jacobian(np.array([1.5, 0.1, -1.4, 0.2])), np.array([0.3, -0.2, 0.1])
    plain = eqx.tree_at(lambda law: law.epsilon0, GSR, jnp.zeros(()))
    np.testing.assert_allclose(plain.rates(A, wish, 3.0), SR.rates(A, wish, 3.0), rtol=1e-12)


def test_rates_stay_bounded_at_singular_states_where_the_pseudo_inverse_grows_without_bound():
    """Singular states found by driving the measure to zero from random angles."""
    rng = np.random.default_rng(3)
    found = 0
    for start in rng.uniform(-np.pi, np.pi, (10, 4)):
        least = least_squares(
            lambda gamma: np.linalg.svd(np.asarray(jacobian(gamma)))[1][-1:], start, xtol=1e-15
        ).x
        A = np.asarray(jacobian(least))
        U, s, _ = np.linalg.svd(A)
        if s[-1] > 1e-6:
            continue
        found += 1
        lost, had = U[:, 2], U[:, 0]
        limit = 1.0 / (2.0 * np.sqrt(LAMBDA0))
        for wish in (lost, had, (lost + had) / np.sqrt(2.0)):
            assert np.linalg.norm(sr_rates(A, wish, 0.0)) <= limit
        nearby = np.asarray(jacobian(least + 1e-5 * rng.normal(size=4)))
        assert np.linalg.norm(pseudo_inverse_rates(nearby, lost, 0.0)) > 100.0 * limit
    assert found >= 5


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_gsr_leaves_the_elliptic_singularity_where_sr_stays(sign):
    """A whole unit of momentum asked about the lost axis from (-90, 0, 90, 0) degrees."""
    wish, step, count = jnp.array([0.3 * sign, 0.0, 0.0]), 0.01, 333
    assert float(singularity_measure(jacobian(ELLIPTIC))) < 1e-7

    def gained(law):
        def euler(gamma, t):
            A = jacobian(gamma)
            rates = law.rates(A, wish, t)
            return gamma + step * rates, (step * A @ rates, singularity_measure(A))

        times = step * jnp.arange(count)
        return jax.jit(lambda: jax.lax.scan(euler, jnp.asarray(ELLIPTIC), times)[1])()

    momentum, measure = gained(SR)
    assert np.abs(np.sum(momentum, axis=0)).max() < 1e-4
    assert measure.max() < 0.01
    momentum, measure = gained(GSR)
    assert sign * np.sum(momentum[:, 0]) > 0.4
    assert measure.max() > 0.9


@quickly
@given(angles, wishes, st.permutations(range(4)))
def test_relabelling_units_relabels_the_rates(gamma, wish, order):
    A, order = np.asarray(jacobian(gamma)), np.array(order)
    assume(np.linalg.svd(A)[1][-1] > 0.05)
    for rates in (pseudo_inverse_rates, sr_rates, gsr_rates):
        expected = np.asarray(rates(A, wish, 1.0))[order]
        np.testing.assert_allclose(rates(A[:, order], wish, 1.0), expected, atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_commanded_gimbal_rates_give_the_bus_the_torque_of_the_controller(seed):
    """-dh/dt in the bus frame is the torque, with unlike rotors and a plate mounted askew."""
    rng = np.random.default_rng(seed)
    scenario = load_scenario("zhang2012").with_overrides(
        {"control.steering": {"law": "pseudo_inverse"}}
    )
    satellite = build_satellite(scenario)
    speed = satellite.clusters[0].units.rotor_speed * jnp.array([1.0, -0.9, 1.1, 0.8])
    q_BP = rotation_vector_to_quaternion(jnp.asarray(rng.normal(size=3)))
    where = lambda s: (s.clusters[0].units.rotor_speed, s.mounts[0].q_BX)  # noqa: E731
    satellite = eqx.tree_at(where, satellite, (speed, q_BP))
    state = build_initial_state(scenario, satellite)
    gamma = jnp.asarray(rng.uniform(-0.5, 0.5, 4))
    state = eqx.tree_at(lambda s: s.own["cluster"].y, state, gamma)
    signals = decide(satellite, jnp.zeros(()), state)

    def momentum_B(gamma):
        h_P = jnp.sum(momentum_P(satellite.clusters[0].units, gamma), axis=0)
        return quaternion_to_matrix(q_BP) @ h_P

    _, rate = jax.jvp(momentum_B, (gamma,), (signals.commands[0],))
    assert np.linalg.norm(signals.torque_B) > 5.0
    np.testing.assert_allclose(-rate, signals.torque_B, atol=1e-10)
