"""Quaternions and rotation vectors against SciPy, and their derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from quietbus.spatial import rotation
from quietbus.spatial.rotation import quaternion_rate, quaternion_to_rotation_vector, skew

quickly = settings(deadline=None, max_examples=50)

SMALL = [0.0, 1e-12, 1e-8, 0.99e-4, 1.01e-4, 1e-3]  # angles around the switch to series [rad]
QUATERNION = [
    "quaternion_to_matrix",
    "quaternion_multiply",
    "quaternion_conjugate",
    "quaternion_to_rotation_vector",
    "rotation_vector_to_quaternion",
    "rotation_vector_to_matrix",
    "attitude_error",
]
jitted = {name: jax.jit(getattr(rotation, name)) for name in QUATERNION}

vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)
quaternions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4).map(np.array).filter(lambda q: np.linalg.norm(q) > 0.1)
).map(lambda q: q / np.linalg.norm(q))


def scipy_of(q):
    """SciPy's rotation of a scalar-first quaternion."""
    return Rotation.from_quat(np.roll(q, -1))


def same_turn(q, expected: Rotation, atol=1e-12):
    np.testing.assert_allclose(scipy_of(np.asarray(q)).as_matrix(), expected.as_matrix(), atol=atol)


@quickly
@given(quaternions, st.floats(0.1, 10.0))
def test_matrix_of_a_quaternion_of_any_length(q, length):
    R = jitted["quaternion_to_matrix"](length * q)
    np.testing.assert_allclose(R, scipy_of(q).as_matrix(), atol=1e-14)


@quickly
@given(quaternions, quaternions)
def test_product_is_the_composition_and_conjugate_the_inverse(a, b):
    product = jitted["quaternion_multiply"](a, b)
    same_turn(product, scipy_of(a) * scipy_of(b))
    same_turn(jitted["quaternion_conjugate"](a), scipy_of(a).inv())


@quickly
@given(vectors)
def test_rotation_vector_to_quaternion_and_matrix(theta):
    turn = Rotation.from_rotvec(theta)
    q = jitted["rotation_vector_to_quaternion"](theta)
    np.testing.assert_allclose(q, np.roll(turn.as_quat(), 1), atol=1e-14)
    R = jitted["rotation_vector_to_matrix"](theta)
    np.testing.assert_allclose(R, turn.as_matrix(), atol=1e-14)


@pytest.mark.parametrize("angle", SMALL)
def test_small_turns_keep_all_digits(angle):
    axis = np.array([0.6, -0.48, 0.64])
    q = jitted["rotation_vector_to_quaternion"](angle * axis)
    exact = [np.cos(angle / 2), *(np.sin(angle / 2) * axis)]
    np.testing.assert_allclose(q, exact, rtol=1e-15)
    back = jitted["quaternion_to_rotation_vector"](np.array(exact))
    np.testing.assert_allclose(back, angle * axis, rtol=4e-15)


@quickly
@given(quaternions)
def test_rotation_vector_of_a_quaternion_is_the_shortest(q):
    expected = scipy_of(q).as_rotvec()
    assume(np.linalg.norm(expected) < np.pi - 1e-6)  # at a half turn both signs are right
    for same in (q, -q):
        theta = jitted["quaternion_to_rotation_vector"](same)
        np.testing.assert_allclose(theta, expected, atol=1e-13)


@quickly
@given(quaternions, vectors)
def test_quaternion_rate_turns_the_matrix_at_the_body_rate(q, w):
    """dR/dt = R skew(w), the derivative of R taken along the quaternion's rate."""
    rate = quaternion_rate(jnp.asarray(q), jnp.asarray(w))
    R, R_rate = jax.jvp(jitted["quaternion_to_matrix"], (jnp.asarray(q),), (rate,))
    np.testing.assert_allclose(R_rate, R @ skew(jnp.asarray(w)), atol=1e-12)
    assert abs(q @ rate) < 1e-13  # keeps its length


@quickly
@given(vectors, vectors)
def test_skew_is_the_cross_product(a, b):
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-13)


@quickly
@given(quaternions, vectors)
def test_attitude_error_is_twice_the_sine_of_half_the_shortest_turn(q_NR, theta):
    """Body B is turned by theta from reference R; the error points along the turn that is left."""
    turn = Rotation.from_rotvec(theta)
    shortest = turn.as_rotvec()
    angle = np.linalg.norm(shortest)
    assume(1e-6 < angle < np.pi - 1e-6)
    q_NB = np.roll((scipy_of(q_NR) * turn).as_quat(), 1)
    expected = 2.0 * np.sin(angle / 2) * shortest / angle
    for sign_R, sign_B in ((1, 1), (1, -1), (-1, 1)):
        error = jitted["attitude_error"](sign_R * q_NR, sign_B * q_NB)
        np.testing.assert_allclose(error, expected, atol=1e-12)


def test_derivatives_at_zero_rotation_are_those_of_the_exponential():
    """q = (1 - |theta|^2 / 8, theta / 2) to second order; and its inverse."""
    zero, identity = jnp.zeros(3), jnp.array([1.0, 0.0, 0.0, 0.0])
    to_q = rotation.rotation_vector_to_quaternion
    for jacobian in (jax.jacfwd, jax.jacrev):
        first = jax.jit(jacobian(to_q))(zero)
        np.testing.assert_allclose(first[0], np.zeros(3))
        np.testing.assert_allclose(first[1:], 0.5 * np.eye(3))
        back = jax.jit(jacobian(quaternion_to_rotation_vector))(identity)
        np.testing.assert_allclose(back[:, 1:], 2.0 * np.eye(3))
    second = jax.jit(jax.hessian(to_q))(zero)
    np.testing.assert_allclose(second[0], -0.25 * np.eye(3))
    np.testing.assert_allclose(second[1:], np.zeros((3, 3, 3)))


@pytest.mark.parametrize("angle", SMALL)
def test_angular_velocity_of_small_turns_about_a_fixed_axis(angle):
    """Differentiating through the series and the closed form gives the same body rate."""
    axis = jnp.array([0.6, -0.48, 0.64])
    q, rate = jax.jvp(lambda x: rotation.rotation_vector_to_quaternion(x * axis), (angle,), (1.0,))
    np.testing.assert_allclose(rate, quaternion_rate(q, axis), atol=1e-12)
