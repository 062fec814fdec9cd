"""Rigid bodies, and how one stands on another."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.element import AbstractElement, RigidParts
from quietbus.model.motion import Motion
from quietbus.model.report import AXIS, QUATERNION, Quantity
from quietbus.spatial.inertia import point_inertia
from quietbus.spatial.rotation import quaternion_to_matrix, skew
from quietbus.spatial.vector import cross, rotate


class Body(AbstractElement):
    """A rigid body X; the bus has the origin of its frame at its mass centre."""

    name: str = eqx.field(static=True)
    mass_X: Float[Array, ""]  # [kg]
    p_XXcm_X: Float[Array, "3"]  # [m] mass centre
    I_XXcm_X: Float[Array, "3 3"]  # [kg m^2] about the mass centre

    hosts: tuple[str, ...] = eqx.field(static=True, init=False)

    def __post_init__(self):
        """A body is its own host."""
        self.hosts = (self.name,)

    def nameless(self):
        return replace(self, name="")

    @property
    def J_X(self) -> Float[Array, "3 3"]:
        """Inertia [kg m^2] about the origin."""
        return self.I_XXcm_X + point_inertia(self.mass_X, self.p_XXcm_X)

    def mass(self, around):
        (body,) = around.hosts
        c = skew(rotate(body.R_AX, self.mass_X * self.p_XXcm_X))
        J = body.R_AX @ self.J_X @ body.R_AX.T
        return jnp.block([[self.mass_X * jnp.eye(3), -c], [c, J]])

    def balance(self, around, rates, u_rate):
        """``-d/dt (m v + w x c, c x v + J w)``."""
        (body,) = around.hosts
        R = body.R_AX
        w, dv, dw = (rotate(R.T, vector) for vector in (body.w, u_rate[:3], u_rate[3:]))
        c, J = self.mass_X * self.p_XXcm_X, self.J_X
        force = self.mass_X * dv + cross(dw, c) + cross(w, cross(w, c))
        torque = cross(c, dv) + rotate(J, dw) + cross(w, rotate(J, w))
        return -jnp.concatenate([rotate(R, force), rotate(R, torque)])

    def rigid_parts(self, around):
        (body,) = around.hosts
        r = body.R_AX @ self.p_XXcm_X
        I = body.R_AX @ self.I_XXcm_X @ body.R_AX.T
        own = (self.mass_X, I, body.p + r, body.v + jnp.cross(body.w, r), body.w)
        return RigidParts(*(each[None] for each in own))


class Mount(eqx.Module):
    """The nominal pose of a body on its base: where a run starts, or where it stays."""

    body: str = eqx.field(static=True)
    base: str = eqx.field(static=True)
    p_BX_B: Float[Array, "3"]  # [m] origin of the body's frame X in that of the base, B
    q_BX: Float[Array, "4"]  # [-] attitude
    welded: bool = eqx.field(static=True)  # whether the body stays there; otherwise struts hold it

    def motion(self, base: Motion) -> Motion:
        """Motion of the body as if it were one with its base."""
        r = rotate(base.R_AX, self.p_BX_B)
        R = base.R_AX @ quaternion_to_matrix(self.q_BX)
        return Motion(R, base.p + r, base.v + cross(base.w, r), base.w)


def body_quantities(name: str) -> dict[str, Quantity]:
    """What a body reports, by kind; upper plates are known as platforms."""
    called = {"plate": "platform"}.get(name, name)
    of = {"bus": "the bus", "plate": "the upper plate"}.get(name, f"body {name}")
    point = "the bus mass centre" if name == "bus" else f"the origin of {of}"
    frame = {"bus": "bus frame", "plate": "plate frame"}.get(name, "its own frame")
    slow = f"rotation of {of} from its slow motion, {frame}"
    return {
        "position": Quantity(
            f"{called}_position", AXIS, "m", f"position of {point}, inertial frame"
        ),
        "velocity": Quantity(
            f"{called}_velocity", AXIS, "m/s", f"velocity of {point}, inertial frame"
        ),
        "attitude": Quantity(
            f"{called}_attitude",
            QUATERNION,
            "1",
            f"attitude of {of} in the inertial frame",
            vibrates=name == "bus",
            of_vibration=slow,
        ),
        "rate": Quantity(
            f"{called}_rate", AXIS, "rad/s", f"angular velocity of {of}, {frame}", vibrates=True
        ),
    }
