"""Legs and their struts."""

from functools import singledispatch
from typing import Any

import jax
import numpy as np

from quietbus.build.arrays import array, rotation
from quietbus.build.own import built, is_own
from quietbus.build.own_struts import check_strut
from quietbus.model.legs.hexapod import Hexapod
from quietbus.model.legs.inertia import LegBodies, LegParts
from quietbus.model.legs.kinematics import Geometry
from quietbus.model.struts import AbstractStrut, SpringDamper
from quietbus.scenario.hardware import Mounting
from quietbus.scenario.struts import SpringDamperStrut


@singledispatch
def strut_of(law: Any, legs: int, free_length: jax.Array) -> AbstractStrut:
    """The struts of so many legs, each force-free at its free length [m], by the law's type.

    A law of another type is registered: ``@strut_of.register`` (docs/extending.md).
    """
    raise TypeError(f"no strut is registered for {type(law).__name__}")


@strut_of.register
def _(law: SpringDamperStrut, legs: int, free_length: jax.Array) -> AbstractStrut:
    k, c = (array(np.broadcast_to(value, legs)) for value in (law.stiffness, law.damping))
    return SpringDamper(k, c, free_length)


def legs_of(isolator: Mounting, name: str, hosts: tuple[str, str], holds: bool) -> Hexapod:
    """The legs between an upper body and its base.

    Args:
        hosts: names of the upper body and of the base.
        holds: whether they, and no weld, hold the upper body.

    Raises:
        LawError: a strut of a user's own kind that is wrong.
    """
    legs, base = isolator.legs, rotation(isolator.orientation)
    lower, upper = isolator.joints()
    length = np.linalg.norm(upper - lower, axis=1)

    def per_leg(value: Any) -> jax.Array:
        return array(np.broadcast_to(value, legs.count))

    def parts(value: Any) -> LegParts:
        each = value if isinstance(value, tuple) else (value,) * legs.count
        keys = ("mass", "distance", "transverse_inertia", "axial_inertia")
        return LegParts(*(array([getattr(part, key) for part in each]) for key in keys))

    free = np.broadcast_to(length if legs.free_length is None else legs.free_length, legs.count)
    strut = built(strut_of, AbstractStrut, legs.law, legs.count, array(free))
    if is_own(legs.law):
        check_strut(strut, length)
    return Hexapod(
        name,
        hosts,
        Geometry(
            p_PU_P=array(legs.upper_joints),
            p_BA_B=array(isolator.offset + base.apply(lower)),
            k_B=array(base.apply(legs.universal_axes)),
            nominal_length=array(length),
        ),
        LegBodies(
            upper=parts(legs.upper_part),
            lower=parts(legs.lower_part),
            spherical_friction=per_leg(legs.spherical_friction),
            universal_friction=per_leg(legs.universal_friction),
        ),
        strut,
        holds,
    )
