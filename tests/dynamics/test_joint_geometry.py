"""The legs' angular velocity against the joint angles themselves, on a rotating base."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import awkward_satellite
from quietbus.dynamics.state import State
from quietbus.model.legs.kinematics import leg_motion
from quietbus.model.motion import Motion
from quietbus.spatial.rotation import quaternion_to_matrix, rotation_vector_to_matrix
from quietbus.validate.states import random_state


def _pose(state: State, t: float):
    """Both plates after t [s] at constant velocities."""
    R_NB = quaternion_to_matrix(state.bus.q_NX) @ rotation_vector_to_matrix(t * state.bus.w_NX_X)
    plate, bus = state.bodies["plate"], state.bus
    R_NP = quaternion_to_matrix(plate.q_NX) @ rotation_vector_to_matrix(t * plate.w_NX_X)
    return R_NB, R_NP, plate.p_NX_N + t * plate.v_NX_N - bus.p_NX_N - t * bus.v_NX_N


def _leg_attitudes(legs, R_NB, R_NP, p_BP_N):
    """Attitude of each leg: the bus, turned about k, then about the y that has come with it."""
    span = p_BP_N + legs.p_PU_P @ R_NP.T - legs.p_BA_B @ R_NB.T
    s = (span / jnp.linalg.norm(span, axis=1, keepdims=True)) @ R_NB  # bus frame
    attitudes = []
    for k, s_B in zip(np.asarray(legs.k_B), np.asarray(s), strict=True):
        y0 = np.cross(k, [0.0, 0.0, 1.0])
        y0 /= np.linalg.norm(y0)
        x0 = np.cross(y0, k)
        # s = R(k, alpha) R(y0, beta) k, since k itself is normal to y0
        alpha = np.arctan2(s_B @ y0, s_B @ x0)
        beta = np.arctan2(np.hypot(s_B @ x0, s_B @ y0), s_B @ k)
        turn = rotation_vector_to_matrix(jnp.asarray(alpha * k)) @ rotation_vector_to_matrix(
            jnp.asarray(beta * y0)
        )
        np.testing.assert_allclose(turn @ k, s_B, atol=1e-12)
        attitudes.append(R_NB @ turn)
    return np.stack(attitudes)


@pytest.mark.parametrize("seed", range(5))
def test_leg_angular_velocity_is_that_of_the_joint_angles(seed):
    """Fourth-order differences of the leg's attitude; bus and plate turn at 1 rad/s and more."""
    satellite = awkward_satellite()
    legs, state = (
        satellite.hexapods[0].geometry,
        random_state(satellite, np.random.default_rng(seed)),
    )
    h = 1e-3
    R = {n: _leg_attitudes(legs, *_pose(state, n * h)) for n in (-2, -1, 0, 1, 2)}
    R_rate = (R[-2] - 8.0 * R[-1] + 8.0 * R[1] - R[2]) / (12.0 * h)
    cross = R_rate @ R[0].transpose(0, 2, 1)
    w = np.stack([cross[:, 2, 1], cross[:, 0, 2], cross[:, 1, 0]], axis=1)

    R_NB, R_NP, p_BP_N = _pose(state, 0.0)
    w_B, w_P = R_NB @ state.bus.w_NX_X, R_NP @ state.bodies["plate"].w_NX_X
    P = Motion(R_NP, p_BP_N, state.bodies["plate"].v_NX_N, w_P)
    motion = leg_motion(legs, P, Motion(R_NB, jnp.zeros(3), state.bus.v_NX_N, w_B))
    np.testing.assert_allclose(motion.w, w, atol=1e-8)
    np.testing.assert_allclose(motion.spin, np.sum(w * np.asarray(motion.s), axis=1), atol=1e-8)


def test_spin_derivatives_are_those_of_the_spin():
    """The partial velocities of the spin, which the mass matrix uses, by automatic derivatives."""
    satellite = awkward_satellite()
    state = random_state(satellite, np.random.default_rng(9))
    R_NB, R_NP, p_BP_N = _pose(state, 0.0)

    def motion(v_P, w_B):
        w_P = jnp.array([0.3, -0.2, 0.5])
        P, B = Motion(R_NP, p_BP_N, v_P, w_P), Motion(R_NB, jnp.zeros(3), state.bus.v_NX_N, w_B)
        return leg_motion(satellite.hexapods[0].geometry, P, B)

    at = (state.bodies["plate"].v_NX_N, R_NB @ state.bus.w_NX_X)
    by_v, by_w = jax.jacfwd(lambda v, w: motion(v, w).spin, argnums=(0, 1))(*at)
    found = motion(*at)
    np.testing.assert_allclose(by_v, found.spin_by_velocity, atol=1e-12)
    through_joint = jnp.cross(found.r_A, -found.spin_by_velocity)
    np.testing.assert_allclose(by_w, found.spin_by_base_rate + through_joint, atol=1e-12)
