"""Motion of the legs from the motion of the two plates (Zhang and Xu, eq. 4-18)."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.hexapod import Hexapod


class LegMotion(eqx.Module):
    """Positions and rates of all legs at one instant, inertial components."""

    r_U: Float[Array, "leg 3"]  # [m] spherical joint from the origin of P
    r_A: Float[Array, "leg 3"]  # [m] universal joint from the origin of B
    length: Float[Array, " leg"]  # [m]
    s: Float[Array, "leg 3"]  # [-] unit vector from A to U
    length_rate: Float[Array, " leg"]  # [m/s]
    s_rate: Float[Array, "leg 3"]  # [1/s]
    k: Float[Array, "leg 3"]  # [-] fixed axis of the universal joint
    kappa: Float[Array, " leg"]  # [-] k . s: 0 at right angles, +-1 where the joint locks
    spin: Float[Array, " leg"]  # [rad/s] leg's angular velocity about its own axis, w_s
    spin_by_velocity: Float[Array, "leg 3"]  # [1/m] d w_s / d(v_U - v_A)
    spin_by_bus_rate: Float[Array, "leg 3"]  # [-] d w_s / d w_B

    @property
    def w(self) -> Float[Array, "leg 3"]:
        """Angular velocity of each leg [rad/s] (eq. 12)."""
        return jnp.cross(self.s, self.s_rate) + self.spin[:, None] * self.s


def leg_motion(
    legs: Hexapod,
    R_NB: Float[Array, "3 3"],
    R_NP: Float[Array, "3 3"],
    p_BP_N: Float[Array, "3"],
    v_B: Float[Array, "3"],
    w_B: Float[Array, "3"],
    v_P: Float[Array, "3"],
    w_P: Float[Array, "3"],
) -> LegMotion:
    """Kinematics of all legs (eq. 4-18); every vector in inertial components.

    A universal joint lets the leg turn about k and about y = k x s, so the leg's angular velocity
    *relative to the base* has no component along h = y x k: ``(w_leg - w_B) . h = 0``. With
    kappa = k . s this gives the spin about the leg's own axis,

        w_s = [w_B . s - kappa w_B . k + kappa (k x s) . ds/dt] / (1 - kappa^2).

    (The paper's eq. 12 leaves w_B out: docs/theory.md.)

    Args:
        p_BP_N: (3,) from the origin of B to that of P [m].
        v_B, v_P: (3,) velocities of the two origins [m/s].
        w_B, w_P: (3,) angular velocities of bus and plate [rad/s].
    """
    r_U, r_A, k = legs.p_PU_P @ R_NP.T, legs.p_BA_B @ R_NB.T, legs.k_B @ R_NB.T
    span = p_BP_N + r_U - r_A
    length = jnp.sqrt(jnp.sum(span * span, axis=1))
    s = span / length[:, None]
    v_rel = v_P + jnp.cross(w_P, r_U) - v_B - jnp.cross(w_B, r_A)
    length_rate = jnp.sum(s * v_rel, axis=1)
    s_rate = (v_rel - length_rate[:, None] * s) / length[:, None]
    kappa = jnp.sum(k * s, axis=1)
    lever = 1.0 / (1.0 - kappa**2)
    spin_by_velocity = (kappa * lever / length)[:, None] * jnp.cross(k, s)
    spin_by_bus_rate = lever[:, None] * (s - kappa[:, None] * k)
    spin = jnp.sum(spin_by_velocity * v_rel, axis=1) + spin_by_bus_rate @ w_B
    return LegMotion(
        r_U, r_A, length, s, length_rate, s_rate, k, kappa, spin, spin_by_velocity, spin_by_bus_rate
    )
