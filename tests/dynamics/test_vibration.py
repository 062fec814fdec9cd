"""The equations of small vibration: their parts against the nonlinear equations and analysis."""

from dataclasses import replace
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import awkward_satellite, paper_satellite, uncontrolled
from quietbus.analysis.jitter.lines import steady_jitter
from quietbus.dynamics.closed_loop import initial_state
from quietbus.dynamics.coefficients import coefficients, slow_motion
from quietbus.dynamics.equations import balance, mass_matrix
from quietbus.dynamics.equations import moving as all_motions
from quietbus.dynamics.linearize import OperatingPoint, linearize
from quietbus.dynamics.views import View, linear_outputs_with
from quietbus.model.moments import ClusterMoments, Turning
from quietbus.model.motion import Motion
from quietbus.spatial.rotation import rotation_vector_to_matrix
from quietbus.spatial.vector import solve_small


@pytest.fixture(scope="module")
def moving():
    """An awkward satellite turning, its plate out of place, gimbals moving; seen along its bus."""
    satellite = awkward_satellite()
    rng = np.random.default_rng(7)
    start = jnp.array([1.0, 0, 0, 0]), jnp.array(rng.normal(size=3)), jnp.zeros(satellite.count)
    state = initial_state(satellite, *start)
    averaged = satellite.averaged()
    return averaged, slow_motion(averaged, jnp.zeros(()), state)


def moved(now, way):
    """All motions changed by (r, theta, v, w) of every body."""
    motions = {}
    for (name, motion), part in zip(now.motions.items(), np.reshape(way, (-1, 4, 3)), strict=True):
        r, theta, v, w = map(jnp.array, part)
        R_AX = rotation_vector_to_matrix(theta) @ motion.R_AX
        motions[name] = Motion(R_AX, motion.p + r, motion.v + v, motion.w + w)
    return replace(now, motions=motions)


def test_coefficients_are_the_derivatives_of_the_equations_of_motion(moving):
    """Central differences of the whole force, along every displacement, turn and speed."""
    averaged, slow = moving
    layout, names = slow.now.layout, list(slow.now.motions)
    each = coefficients(averaged.elements, slow)
    shares = list(zip(averaged.elements, each, strict=True))
    total = jax.jit(lambda now: balance(averaged, now, slow.rates, slow.u_rate))
    step = 1e-5
    ways = np.eye(12 * len(names))
    columns = [
        (total(moved(slow.now, step * way)) - total(moved(slow.now, -step * way))) / (2 * step)
        for way in ways
    ]
    by_way = np.stack(columns, axis=1).reshape(layout.size, len(names), 2, 6)
    order = [names.index(name) for name in layout.names]
    for kind, expected in zip(("by_pose", "by_speed"), np.moveaxis(by_way, 2, 0), strict=True):
        found = layout.matrix((e, getattr(c, kind)) for e, c in shares)
        expected = expected[:, order].reshape(layout.size, -1)
        assert np.max(np.abs(found - expected)) < 1e-7 * np.max(np.abs(expected))
    M = mass_matrix(averaged, slow.now)
    found = layout.matrix((e, c.M) for e, c in shares)
    assert pytest.approx(np.asarray(M), rel=1e-12, abs=1e-12) == found
    # the slow motion obeys its equations
    left = layout.vector((e, c.force) for e, c in shares)
    assert np.max(np.abs(left)) < 1e-9 * np.max(np.abs(M @ slow.u_rate))


def test_force_at_accelerations_is_that_at_rest_less_mass_times_accelerations(moving):
    """Two ways to the inertia: velocities' accelerations, and the mass matrix."""
    averaged, slow = moving
    a = jnp.array(np.random.default_rng(3).normal(size=slow.now.layout.size))
    M = mass_matrix(averaged, slow.now)
    none = balance(averaged, slow.now, slow.rates, jnp.zeros_like(a))
    with_a = balance(averaged, slow.now, slow.rates, a)
    assert np.asarray(with_a) == pytest.approx(np.asarray(none - M @ a), rel=1e-10, abs=1e-9)


def test_orders_are_the_fourier_coefficients_of_the_moments():
    units = awkward_satellite().clusters[0].units
    moments = ClusterMoments.expand(units)
    n = len(units.rotor_speed)
    rng = np.random.default_rng(5)
    gimbal = Turning(*(jnp.array(rng.normal(size=n)) for _ in range(3)))
    phi, spin_up = (jnp.array(rng.normal(size=n)) for _ in range(2))
    rotor = Turning(phi, units.rotor_speed, spin_up)
    full = moments.at(gimbal, rotor)
    orders = [moments.order(h, gimbal, rotor) for h in (0, 1, 2)]
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
    satellite = uncontrolled(paper_satellite())
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
    averaged, slow = moving
    inertial = all_motions(averaged, jnp.zeros(()), slow.state).motions
    arm = np.asarray(inertial["plate"].p - inertial["bus"].p)
    assert np.asarray(slow.now.motions["bus"].R_AX) == pytest.approx(np.eye(3))
    assert np.asarray(inertial["bus"].R_AX @ slow.now.motions["plate"].p) == pytest.approx(arm)


def test_each_motion_moves_the_image_by_its_own_column(moving):
    """Satellite as one body: the bus's six columns alone. Plate alone: the plate's six alone."""
    averaged, slow = moving
    small = SimpleNamespace(slow=slow, turning=jnp.zeros((3, 3)), seen={})
    small.projection, small.speed = np.eye(12), np.zeros((12, 12))
    view = View(jnp.zeros((0, 3)), jnp.eye(12).reshape(4, 3, 12))
    nothing = lambda: jnp.zeros(0)  # noqa: E731
    see = lambda xi: linear_outputs_with(averaged, small, 1j, jnp.array(xi), view, nothing)  # noqa: E731
    r, theta = np.random.default_rng(3).normal(size=(2, 3)) + 0j
    arm = slow.now.motions["plate"].p
    as_one = np.concatenate([r, theta, r + np.cross(theta, arm), theta])
    expected = np.concatenate([theta, r, np.zeros(6)])
    assert np.max(np.abs(see(as_one)["line_of_sight"].ravel() - expected)) < 1e-12
    plate = np.concatenate([np.zeros(6), r, theta])
    expected = np.concatenate([np.zeros(6), theta, r])
    assert np.max(np.abs(see(plate)["line_of_sight"].ravel() - expected)) < 1e-12
