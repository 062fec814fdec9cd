"""The legs of a platform, with mass, joint friction, and struts of any law.

Leg i runs from a universal joint A on the base (fixed axis k in the base) to a spherical joint U on
the upper body. Its lower part turns about A, its upper part slides in the lower one. Any number of
legs is one ``Hexapod``: every field has the legs as its first axis.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.model.element import AbstractElement, Around, Energy, Own, Rates
from quietbus.model.legs.inertia import LegBodies, leg_forces, leg_mass_matrix
from quietbus.model.legs.joints import joint_forces
from quietbus.model.legs.kinematics import Geometry, LegMotion, leg_motion
from quietbus.model.legs.rigid_parts import joint_motion, leg_rigid_parts
from quietbus.model.report import AXIS, LEG, Output, Quantity
from quietbus.model.struts import AbstractStrut, StrutTangent, tangent

STROKE = Quantity("leg_stroke", LEG, "m", "leg length less its nominal length", vibrates=True)
FORCE = Quantity("leg_force", LEG, "N", "force of the strut, tension positive", vibrates=True)
_ASKED = "with joint forces"
SPHERICAL_FORCE = Quantity(
    "spherical_force",
    LEG + AXIS,
    "N",
    "plate on leg at the spherical joint, inertial frame",
    _ASKED,
)
UNIVERSAL_FORCE = Quantity(
    "universal_force",
    LEG + AXIS,
    "N",
    "base on leg at the universal joint, inertial frame",
    _ASKED,
)
UNIVERSAL_MOMENT = Quantity(
    "universal_moment", LEG, "N m", "base on leg at the universal joint, about its h axis", _ASKED
)
UNIVERSAL_AXIS = Quantity(
    "universal_axis", LEG + AXIS, "1", "axis of the universal moment, inertial frame", _ASKED
)
QUANTITIES = (
    STROKE,
    FORCE,
    SPHERICAL_FORCE,
    UNIVERSAL_FORCE,
    UNIVERSAL_MOMENT,
    UNIVERSAL_AXIS,
)
SHORTEST = 0.1  # of its nominal length, which a leg must not fall below
LOCKED = 1e-3  # 1 - (k.s)^2 at which a universal joint counts as locked


class Hexapod(AbstractElement):
    """Legs with struts and viscous joints between an upper body and its base."""

    name: str = eqx.field(static=True)
    hosts: tuple[str, str] = eqx.field(static=True)  # upper body, base
    geometry: Geometry
    bodies: LegBodies
    strut: AbstractStrut
    # on a rigid mount the legs hold nothing: their joints' forces are not determined
    holds: bool = eqx.field(static=True, default=True)
    sampled: ClassVar[bool] = True

    def start(self):
        return Own.of(z=self.strut.start())

    def motion(self, around: Around) -> LegMotion:
        """Kinematics of the legs."""
        return leg_motion(self.geometry, *around.hosts)

    def tension(self, motion: LegMotion, own: Own) -> Float[Array, " leg"]:
        """Tension of the struts [N]."""
        return self.strut.tension(motion.length, motion.length_rate, own.z)

    @property
    def tangent(self) -> StrutTangent:
        """The struts for small motion about their nominal lengths."""
        return tangent(self.strut, self.geometry.nominal_length)

    def mass(self, around):
        return leg_mass_matrix(self.bodies, self.motion(around))

    def balance(self, around, rates, u_rate):
        motion, (P, B) = self.motion(around), around.hosts
        tension = self.tension(motion, around.own)
        return leg_forces(self.bodies, motion, P, B, u_rate, tension)

    def rates(self, around, command):
        motion = self.motion(around)
        z_rate = self.strut.memory_rate(motion.length, motion.length_rate, around.own.z)
        return Rates(around.own.y, z_rate)

    def configuration(self, around):
        """Pose and turning of the upper body in its base, and what the struts remember."""
        P, B = around.hosts
        return jnp.concatenate([B.R_AX.T @ (P.p - B.p), _turn(B.R_AX.T @ P.R_AX), around.own.z])

    def margin(self, around):
        """The smaller of: length over its least value, less one; distance of joints from locking.

        A leg may be a tenth of its nominal length; a joint locks where its axis k is along s.
        """
        motion = self.motion(around)
        length = motion.length / (SHORTEST * self.geometry.nominal_length) - 1.0
        return jnp.minimum(jnp.min(length), jnp.min(1.0 - motion.kappa**2 - LOCKED))

    def energy(self, around):
        P, B = around.hosts
        joints = joint_motion(self.geometry, P, B)
        at = (joints.length, joints.length_rate, around.own.z)
        friction = self.bodies.spherical_friction * jnp.sum((joints.w - P.w) ** 2, axis=1)
        friction += self.bodies.universal_friction * jnp.sum((joints.w - B.w) ** 2, axis=1)
        return Energy(self.strut.stored(*at), self.strut.dissipated(*at) + jnp.sum(friction))

    def rigid_parts(self, around):
        return leg_rigid_parts(self.bodies, joint_motion(self.geometry, *around.hosts))

    def report(self, around, rates, u_rate, detailed=False):
        motion = self.motion(around)
        tension = self.tension(motion, around.own)
        told = (
            Output(STROKE, motion.length - self.geometry.nominal_length),
            Output(FORCE, tension),
        )
        if not (detailed and self.holds):
            return told
        P, B = around.hosts
        joints = joint_forces(self.bodies, motion, P, B, u_rate, tension)
        inertial = lambda v: v @ around.R_AN  # noqa: E731
        return (
            *told,
            Output(SPHERICAL_FORCE, inertial(joints.spherical_force)),
            Output(UNIVERSAL_FORCE, inertial(joints.universal_force)),
            Output(UNIVERSAL_MOMENT, joints.universal_moment),
            Output(UNIVERSAL_AXIS, inertial(joints.universal_axis)),
        )


def _turn(R: Float[Array, "3 3"]) -> Float[Array, "3"]:
    """Rotation vector [rad] of a turn, to second order of a small one; the same for like turns."""
    return 0.5 * jnp.stack([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
