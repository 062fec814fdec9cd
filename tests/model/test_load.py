"""External loads: profiles in closed form, frames and points of application."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from quietbus.model.element import NOTHING, Around, Rates
from quietbus.model.load import Constant, HalfSine, Load, Step, Table
from quietbus.model.motion import Motion

T = np.array([-1.0, 0.0, 0.999, 1.0, 1.5, 1.75, 2.0, 2.999, 3.0, 10.0])
PROFILES = {
    "constant": (Constant(), np.ones(10), []),
    "step": (Step(jnp.asarray(1.0), jnp.asarray(3.0)), [0, 0, 0, 1, 1, 1, 1, 1, 0, 0], [1, 3]),
    "endless step": (
        Step(jnp.asarray(1.0), jnp.asarray(np.inf)),
        [0, 0, 0, 1, 1, 1, 1, 1, 1, 1],
        [1, np.inf],
    ),
    "half sine": (
        HalfSine(jnp.asarray(1.0), jnp.asarray(2.0)),
        np.where((T > 1) & (T < 3), np.sin(np.pi * (T - 1) / 2), 0.0),
        [1, 3],
    ),
    "table": (
        Table(jnp.array([1.0, 2.0, 3.0]), jnp.array([2.0, 4.0, -1.0])),
        [2, 2, 2, 2, 3, 3.5, 4, 4 - 5 * 0.999, -1, -1],
        [1, 2, 3],
    ),
}

R_NX = Rotation.from_rotvec([0.5, -1.0, 0.7]).as_matrix()
FORCE, TORQUE, POINT = np.array([[1.0, -2.0, 3.0], [0.5, 0.4, -0.3], [0.2, 0.1, -0.6]])


def pushed(load, t):
    """Force and torque about the origin, inertial axes, on a body that moves somehow."""
    body = Motion(jnp.asarray(R_NX), *jnp.asarray(np.random.default_rng(0).normal(size=(3, 3))))
    around = Around(jnp.asarray(t), jnp.eye(3), (body,), NOTHING)
    nothing = Rates(jnp.zeros(0), jnp.zeros(0))
    return np.asarray(load.balance(around, nothing, jnp.zeros(6))).reshape(2, 3)


@pytest.mark.parametrize("name", PROFILES)
def test_profile_has_its_closed_form_and_names_its_corners(name):
    profile, expected, corners = PROFILES[name]
    found = [float(profile.factor(jnp.asarray(t))) for t in T]
    np.testing.assert_allclose(found, expected, atol=1e-14)
    np.testing.assert_array_equal(profile.corners, corners)


@pytest.mark.parametrize("frame", ["body", "inertial"])
def test_wrench_turns_with_the_body_only_in_the_body_frame_but_its_point_always_does(frame):
    ramp = Table(jnp.array([0.0, 1.0]), jnp.array([0, 2.0]))
    load = Load("push", ("bus",), frame, FORCE, TORQUE, POINT, ramp)
    force, torque = pushed(load, 0.75)
    turn = R_NX if frame == "body" else np.eye(3)
    F, arm = 1.5 * turn @ FORCE, R_NX @ POINT
    np.testing.assert_allclose(force, F, atol=1e-14)
    np.testing.assert_allclose(torque, 1.5 * turn @ TORQUE + np.cross(arm, F), atol=1e-14)


def test_torque_about_the_origin_has_the_power_of_the_force_at_its_point():
    load = Load("push", ("plate",), "inertial", FORCE, np.zeros(3), POINT, Constant())
    force, torque = pushed(load, 0.0)
    v, w = np.array([0.3, -0.1, 0.2]), np.array([-0.4, 0.9, 0.6])
    power = force @ v + torque @ w
    assert float(power) == pytest.approx(FORCE @ (v + np.cross(w, R_NX @ POINT)), rel=1e-13)
