"""Bodies, joints, struts and units of a scenario, as plain arrays.

Made from the scenario's data alone, by the conventions of docs/scenario.md. Bodies go by their
numbers, the bus by 0.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.body import Body
from quietbus.reference.platforms import Data, platforms
from quietbus.reference.units import Units, read_units


@dataclass(frozen=True)
class LegParts:
    """Lower or upper parts of the legs, each (leg,)."""

    mass: np.ndarray  # [kg]
    distance: np.ndarray  # [m] of the mass centre from the joint at that part's end
    transverse_inertia: np.ndarray  # [kg m^2]
    axial_inertia: np.ndarray  # [kg m^2]


@dataclass(frozen=True)
class Legs:
    """The legs, each from a body Y up to a body X; the legs are the first axis of each field."""

    lower_body: np.ndarray  # (leg,) number of Y
    upper_body: np.ndarray  # (leg,) number of X
    lower_joint_Y: np.ndarray  # (leg, 3) [m] universal joints
    upper_joint_X: np.ndarray  # (leg, 3) [m] spherical joints
    axis_Y: np.ndarray  # (leg, 3) [-] axes of the universal joints that are fixed in Y
    stiffness: np.ndarray  # [N/m]
    damping: np.ndarray  # [N s/m]
    free_length: np.ndarray  # [m]
    lower: LegParts
    upper: LegParts
    spherical_friction: np.ndarray  # [N m s/rad]
    universal_friction: np.ndarray  # [N m s/rad]


@dataclass(frozen=True)
class Mechanism:
    """The whole satellite."""

    names: tuple[str, ...]  # of the bodies, the bus first
    bodies: Body
    p_BX_B: np.ndarray  # (body, 3) [m] origins in the bus, nominal pose
    R_BX: np.ndarray  # (body, 3, 3) nominal pose
    welded: np.ndarray  # (body,) whether it is a part of the bus (``mount: rigid``)
    legs: Legs
    units: Units

    @cached_property
    def nominal_legs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Length (leg,) [m], direction s and axis along k x s (leg, 3), nominal pose, frame Y."""
        spans = self.spans_Y
        return np.linalg.norm(spans, axis=1), unit(spans), unit(cross(self.legs.axis_Y, spans))

    @cached_property
    def spans_Y(self) -> np.ndarray:
        """Vectors (leg, 3) from universal to spherical joints [m], nominal pose, frame Y."""
        p, R, legs = self.p_BX_B, self.R_BX, self.legs
        tops_B = p[legs.upper_body] + apply(R[legs.upper_body], legs.upper_joint_X)
        R_YB = np.swapaxes(R[legs.lower_body], 1, 2)
        return apply(R_YB, tops_B - p[legs.lower_body]) - legs.lower_joint_Y


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors along the last axis at unit length."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product along the last axis; NumPy's takes several times as long."""
    (a0, a1, a2), (b0, b1, b2) = a.T, b.T
    return np.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], axis=-1)


def apply(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Each matrix (n, 3, 3) times its vector (n, 3)."""
    return (matrices @ vectors[:, :, None])[:, :, 0]


def turn(angles: Any) -> Rotation:
    """The rotation of [roll, pitch, yaw]: about z by yaw, the new y by pitch, the new x by roll."""
    roll, pitch, yaw = angles
    about = (([0, 0, 1], yaw), ([0, 1, 0], pitch), ([1, 0, 0], roll))
    z, y, x = (Rotation.from_rotvec(np.multiply(axis, angle)) for axis, angle in about)
    return z * y * x


def read_mechanism(data: Data) -> Mechanism:
    """Bodies, joints, struts and units of a scenario."""
    names, p_BX_B, R_BX, welded = ["bus"], [np.zeros(3)], [np.eye(3)], [False]
    bodies = [{**data["bus"], "center_of_mass": np.zeros(3)}]
    legs = []
    for number, platform in enumerate(platforms(data), start=1):
        isolator = platform.isolator
        base, offset = turn(isolator["orientation"]).as_matrix(), np.array(isolator["offset"])
        above = np.array([0.0, 0.0, isolator["separation"]])
        names.append(platform.name)
        bodies.append(isolator["plate"])
        p_BX_B.append(offset + base @ above)
        R_BX.append(base)
        welded.append(isolator["mount"] == "rigid")
        legs.append(_legs(isolator["legs"], number, base, offset, above))

    def each(key: str) -> np.ndarray:
        return np.array([body[key] for body in bodies], dtype=float)

    return Mechanism(
        names=tuple(names),
        bodies=Body(each("mass"), each("center_of_mass"), each("inertia")),
        p_BX_B=np.array(p_BX_B),
        R_BX=np.array(R_BX),
        welded=np.array(welded),
        legs=_joined(legs),
        units=read_units(data),
    )


def balanced(mechanism: Mechanism) -> Mechanism:
    """The same with balanced rotors."""
    rotor = mechanism.units.rotor
    diagonal = rotor.inertia * np.eye(3)
    plain = replace(rotor, centre=np.zeros_like(rotor.centre), inertia=diagonal)
    return replace(mechanism, units=replace(mechanism.units, rotor=plain))


def _legs(legs: Data, number: int, R_BD: np.ndarray, offset: np.ndarray, above: np.ndarray) -> Legs:
    """Of the isolator between the bus and the body of this number."""
    lower, upper = np.array(legs["lower_joints"]), np.array(legs["upper_joints"])
    count = len(lower)

    def each(value: Any) -> np.ndarray:
        return np.array(value if isinstance(value, list) else [value] * count, dtype=float)

    def parts(said: Any) -> LegParts:
        of_legs = said if isinstance(said, list) else [said] * count
        keys = ("mass", "distance", "transverse_inertia", "axial_inertia")
        return LegParts(*(np.array([part[key] for part in of_legs]) for key in keys))

    strut = legs.get("strut") or legs  # spring and damper, under the key or beside the joints
    free = legs.get("free_length")
    if free is None:  # without force in the nominal pose
        free = list(np.linalg.norm(upper + above - lower, axis=1))
    return Legs(
        lower_body=np.zeros(count, int),
        upper_body=np.full(count, number),
        lower_joint_Y=np.array([offset + R_BD @ joint for joint in lower]),
        upper_joint_X=upper,
        axis_Y=np.array([R_BD @ axis for axis in np.array(legs["universal_axes"])]),
        stiffness=each(strut["stiffness"]),
        damping=each(strut["damping"]),
        free_length=each(free),
        lower=parts(legs["lower_part"]),
        upper=parts(legs["upper_part"]),
        spherical_friction=each(legs["spherical_friction"]),
        universal_friction=each(legs["universal_friction"]),
    )


def _joined(several: list[Any]) -> Any:
    """The legs, or their parts, of all isolators as one."""
    if isinstance(several[0], np.ndarray):
        return np.concatenate(several)
    names = [field.name for field in fields(several[0])]
    return type(several[0])(*(_joined([getattr(one, name) for one in several]) for name in names))
