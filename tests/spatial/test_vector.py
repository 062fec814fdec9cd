"""Products of 3-vectors and the small linear solver against NumPy."""

import jax
import numpy as np
import pytest

from quietbus.spatial.inertia import point_inertia
from quietbus.spatial.vector import cross, dot, rotate, solve_positive_definite

SHAPES = [(3,), (5, 3), (2, 4, 3)]


@pytest.mark.parametrize("shape", SHAPES)
def test_products_are_those_of_numpy(shape):
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, *shape))
    np.testing.assert_allclose(dot(a, b), np.sum(a * b, axis=-1), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(cross(a, b), np.cross(a, b), rtol=1e-12, atol=1e-14)
    R = rng.normal(size=(3, 3))
    np.testing.assert_allclose(rotate(R, a), a @ R.T, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("n", [1, 6, 12])
@pytest.mark.parametrize("condition", [1e0, 1e4, 1e8])
def test_solver_is_as_exact_as_the_conditioning_allows(n, condition):
    rng = np.random.default_rng(n)
    Q, _ = np.linalg.qr(rng.normal(size=(n, n)))
    eigenvalues = np.geomspace(1.0, condition, n)
    M, x = (Q * eigenvalues) @ Q.T, rng.normal(size=n)
    found = jax.jit(solve_positive_definite)(M, M @ x)
    assert np.linalg.norm(found - x) <= 1e-14 * max(condition, 10.0) * np.linalg.norm(x)
    np.testing.assert_allclose(M @ found, M @ x, atol=1e-13 * condition)


def test_derivative_of_the_solution_is_that_of_the_inverse():
    """x' = M^-1 (f' - M' x), by NumPy and by central differences."""
    rng = np.random.default_rng(5)
    root, dM, f, df = (rng.normal(size=shape) for shape in ((6, 6), (6, 6), 6, 6))
    M, dM = root @ root.T + np.eye(6), dM + dM.T
    x, dx = jax.jit(lambda *at: jax.jvp(solve_positive_definite, at[:2], at[2:]))(M, f, dM, df)
    np.testing.assert_allclose(dx, np.linalg.solve(M, df - dM @ x), rtol=1e-10)
    h = 1e-5
    ahead, behind = (np.linalg.solve(M + d * dM, f + d * df) for d in (h, -h))
    np.testing.assert_allclose(dx, (ahead - behind) / (2 * h), rtol=1e-6)


def test_point_inertia_gives_the_momentum_of_a_point_on_a_circle():
    """I w = r x (m w x r)."""
    r, w = np.random.default_rng(2).normal(size=(2, 3))
    np.testing.assert_allclose(
        point_inertia(2.5, r) @ w, np.cross(r, 2.5 * np.cross(w, r)), atol=1e-14
    )
