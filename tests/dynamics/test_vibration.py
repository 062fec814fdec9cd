"""The equations of small vibration: their parts against the nonlinear equations and analysis."""

from dataclasses import replace
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import awkward_satellite, paper_satellite
from quietbus.analysis.jitter.lines import steady_jitter
from quietbus.dynamics.closed_loop import initial_state
from quietbus.dynamics.equations import force, mass_matrix, plate_motion
from quietbus.dynamics.kinematics import PlateMotion
from quietbus.dynamics.linearize import OperatingPoint, linearize
from quietbus.dynamics.vibration import (
    Coefficients,
    View,
    body_coefficients,
    leg_coefficients,
    linear_outputs,
    slow_motion,
)
from quietbus.model.cmg import ClusterMoments
from quietbus.spatial.rotation import rotation_vector_to_matrix
from quietbus.spatial.vector import solve_small


@pytest.fixture(scope="module")
def moving():
    """An awkward satellite turning, its plate out of place, gimbals moving; seen along its bus."""
    satellite = awkward_satellite()
    n = len(satellite.cluster.rotor_speed)
    rng = np.random.default_rng(7)
    state = initial_state(
        satellite, jnp.array([1.0, 0, 0, 0]), jnp.array(rng.normal(size=3)), jnp.zeros(n)
    )
    averaged = ClusterMoments.expand(satellite.cluster).averaged()
    return satellite, slow_motion(satellite, jnp.zeros(()), state, averaged), averaged


def moved(plates, way):
    """The plates' motion changed by (r, theta_P, theta_B, v, w_P, w_B)."""
    r, theta_P, theta_B, v, w_P, w_B = np.reshape(way, (6, 3))
    turn = lambda theta, R: rotation_vector_to_matrix(jnp.array(theta)) @ R  # noqa: E731
    return PlateMotion(
        turn(theta_B, plates.R_NB),
        turn(theta_P, plates.R_NP),
        plates.p_BP + r,
        plates.v_B,
        plates.w_B + w_B,
        plates.v_P + v,
        plates.w_P + w_P,
    )


def test_coefficients_are_the_derivatives_of_the_equations_of_motion(moving):
    """Central differences of the whole force, loads apart, along all 18 ways."""
    satellite, slow, averaged = moving
    parts = leg_coefficients(satellite, slow), body_coefficients(satellite, slow, averaged)
    found: Coefficients = jax.tree.map(jnp.add, *parts)
    still = jnp.zeros_like(slow.gimbal[0])
    carried = averaged.at(slow.gimbal[0], still, *slow.gimbal[1:])
    total = jax.jit(lambda plates: force(satellite, plates, carried, slow.u_rate))
    step = 1e-5
    columns = [
        (total(moved(slow.plates, step * way)) - total(moved(slow.plates, -step * way)))
        / (2 * step)
        for way in np.eye(18)
    ]
    r, theta_P, theta_B, v, w_P, w_B = np.split(np.stack(columns, axis=1), 6, axis=1)
    by_pose = np.concatenate([r, theta_P, -r, theta_B], axis=1)
    by_speed = np.concatenate([v, w_P, -v, w_B], axis=1)
    for value, expected in ((found.by_pose, by_pose), (found.by_speed, by_speed)):
        assert np.max(np.abs(value - expected)) < 1e-7 * np.max(np.abs(expected))
    M = mass_matrix(satellite, slow.plates, carried)
    assert pytest.approx(np.asarray(M), rel=1e-12, abs=1e-12) == found.M
    # the slow motion obeys its equations
    assert np.max(np.abs(found.force)) < 1e-9 * np.max(np.abs(M @ slow.u_rate))


def test_force_at_accelerations_is_that_at_rest_less_mass_times_accelerations(moving):
    """Two ways to the inertia: velocities' accelerations, and the mass matrix."""
    satellite, slow, averaged = moving
    still = jnp.zeros_like(slow.gimbal[0])
    carried = averaged.at(slow.gimbal[0], still, *slow.gimbal[1:])
    a = jnp.array(np.random.default_rng(3).normal(size=12))
    M = mass_matrix(satellite, slow.plates, carried)
    none = force(satellite, slow.plates, carried, jnp.zeros(12))
    with_a = force(satellite, slow.plates, carried, a)
    assert np.asarray(with_a) == pytest.approx(np.asarray(none - M @ a), rel=1e-10, abs=1e-9)


def test_orders_are_the_fourier_coefficients_of_the_moments():
    cluster = awkward_satellite().cluster
    moments = ClusterMoments.expand(cluster)
    n = len(cluster.rotor_speed)
    rng = np.random.default_rng(5)
    gamma, rate, acceleration, phi = (jnp.array(rng.normal(size=n)) for _ in range(4))
    full = moments.at(gamma, phi, rate, acceleration)
    orders = [moments.order(h, gamma, rate, acceleration) for h in (0, 1, 2)]
    for name in ("c", "J", "p", "H", "J_rate", "p_rate", "H_rate"):
        total = sum(
            np.einsum("j...,j->...", getattr(order, name), np.exp(1j * h * phi)).real
            for h, order in enumerate(orders)
        )
        expected = np.asarray(getattr(full, name))
        assert np.max(np.abs(total - expected)) < 1e-12 * np.max(np.abs(expected)), name


@pytest.mark.parametrize("angles", [[0, 0, 0, 0], [0.4, -0.9, 1.3, 0.2]])
def test_modes_are_those_of_the_linear_analysis(angles):
    """Gimbals held: another set of coordinates and another derivation (dynamics.linearize)."""
    satellite = replace(paper_satellite(), controller=None, steering=None)
    small = jax.jit(lambda s, a: steady_jitter(s, a)[1])(satellite, jnp.array(angles, float))
    found = np.linalg.eigvals(jax.tree.map(np.asarray, small).state_matrix())
    model = linearize(satellite, OperatingPoint(np.zeros(3), np.array(angles, float)), "ideal")
    expected = np.linalg.eigvals(model.A)
    for mode in expected[np.abs(expected) > 1e-3]:
        assert np.min(np.abs(found - mode)) < 1e-7 * np.abs(mode)


@pytest.mark.parametrize("dtype", [float, complex])
def test_small_systems_are_solved_with_pivoting(dtype):
    rng = np.random.default_rng(1)
    A = rng.normal(size=(40, 9, 9)) + (1j * rng.normal(size=(40, 9, 9)) if dtype is complex else 0)
    A[:, 0, 0] = 0.0  # would stop an elimination in given order
    B = rng.normal(size=(40, 9, 4)).astype(dtype)
    X = jax.jit(jax.vmap(solve_small))(A, B)
    assert np.asarray(X) == pytest.approx(np.linalg.solve(A, B), rel=1e-9, abs=1e-9)


def test_derivative_of_a_small_solution():
    rng = np.random.default_rng(2)
    A, dA = rng.normal(size=(2, 5, 5))
    B, dB = rng.normal(size=(2, 5, 2))
    _, tangent = jax.jvp(solve_small, (A, B), (dA, dB))
    h = 1e-6
    difference = np.linalg.solve(A + h * dA, B + h * dB) - np.linalg.solve(A - h * dA, B - h * dB)
    assert np.asarray(tangent) == pytest.approx(difference / (2 * h), rel=1e-6, abs=1e-6)


def test_plate_motion_is_seen_along_the_bus(moving):
    _, slow, _ = moving
    inertial = plate_motion(slow.state)
    assert np.asarray(slow.plates.R_NB) == pytest.approx(np.eye(3))
    assert np.asarray(inertial.R_NB @ slow.plates.p_BP) == pytest.approx(np.asarray(inertial.p_BP))


def test_each_motion_moves_the_image_by_its_own_column(moving):
    """Satellite as one body: the bus's six columns alone. Plate alone: the plate's six alone."""
    satellite, slow, _ = moving
    small = SimpleNamespace(slow=slow, turning=jnp.zeros((3, 3)))
    view = View(jnp.zeros((0, 3)), jnp.eye(12).reshape(4, 3, 12))
    see = lambda xi: linear_outputs(satellite, small, 1j, jnp.array(xi), view)  # noqa: E731
    r, theta = np.random.default_rng(3).normal(size=(2, 3)) + 0j
    as_one = np.concatenate([r + np.cross(theta, slow.plates.p_BP), theta, r, theta])
    expected = np.concatenate([theta, r, np.zeros(6)])
    assert np.max(np.abs(see(as_one)["line_of_sight"].ravel() - expected)) < 1e-12
    plate = np.concatenate([r, theta, np.zeros(6)])
    expected = np.concatenate([np.zeros(6), theta, r])
    assert np.max(np.abs(see(plate)["line_of_sight"].ravel() - expected)) < 1e-12
