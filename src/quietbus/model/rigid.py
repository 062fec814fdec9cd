"""Mass and motion of what a body carries, on the body's speeds (v, w)."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.motion import Motion
from quietbus.spatial.rotation import skew
from quietbus.spatial.vector import cross, rotate


class Moments(eqx.Module):
    """Mass moments about a body's origin and their rates as seen in the body, body axes."""

    mass: Float[Array, ""]  # [kg]
    c: Float[Array, "3"]  # [kg m] first moment
    J: Float[Array, "3 3"]  # [kg m^2] inertia
    p: Float[Array, "3"]  # [kg m/s] dc/dt
    H: Float[Array, "3"]  # [N m s] angular momentum of the motion relative to the body
    J_rate: Float[Array, "3 3"]  # [kg m^2/s]
    p_rate: Float[Array, "3"]  # [N]
    H_rate: Float[Array, "3"]  # [N m]

    def mass_matrix(self, body: Motion) -> Float[Array, "6 6"]:
        """Mass matrix on (v, w) of the body."""
        R, c_skew = body.R_AX, skew(rotate(body.R_AX, self.c))
        J = R @ self.J @ R.T
        return jnp.block([[self.mass * jnp.eye(3), -c_skew], [c_skew, J]])

    def balance(self, body: Motion, u_rate: Float[Array, "6"]) -> Float[Array, "6"]:
        """``f - M du/dt`` on (v, w): minus d/dt of (m v + w x c + p, c x v + J w + H)."""
        R = body.R_AX
        w, dv, dw = (rotate(R.T, vector) for vector in (body.w, u_rate[:3], u_rate[3:]))
        force = (
            self.mass * dv
            + cross(dw, self.c)
            + cross(w, cross(w, self.c) + 2.0 * self.p)
            + self.p_rate
        )
        torque = (
            cross(self.c, dv)
            + rotate(self.J, dw)
            + rotate(self.J_rate, w)
            + cross(w, rotate(self.J, w) + self.H)
            + self.H_rate
        )
        return -jnp.concatenate([rotate(R, force), rotate(R, torque)])
