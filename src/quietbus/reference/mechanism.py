"""Bodies, joints and struts of a scenario, as plain arrays.

Made from the scenario's data alone, by the conventions of docs/scenario.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

Data = Mapping[str, Any]  # as of Scenario.to_dict: SI units, every default filled in


@dataclass(frozen=True)
class Body:
    """A rigid body."""

    mass: Any  # [kg]
    centre: np.ndarray  # (..., 3) [m] in its frame
    inertia: np.ndarray  # (..., 3, 3) [kg m^2] about its mass centre


@dataclass(frozen=True)
class LegParts:
    """Lower or upper parts of the legs, each (leg,)."""

    mass: np.ndarray  # [kg]
    distance: np.ndarray  # [m] of the mass centre from the joint at that part's end
    transverse_inertia: np.ndarray  # [kg m^2]
    axial_inertia: np.ndarray  # [kg m^2]


@dataclass(frozen=True)
class Legs:
    """The legs; each field with the legs as its first axis."""

    lower_joint_B: np.ndarray  # (leg, 3) [m] universal joints, bus frame
    upper_joint_P: np.ndarray  # (leg, 3) [m] spherical joints, plate frame
    axis_B: np.ndarray  # (leg, 3) [-] axes of the universal joints that are fixed in the bus
    stiffness: np.ndarray  # [N/m]
    damping: np.ndarray  # [N s/m]
    free_length: np.ndarray  # [m]
    lower: LegParts
    upper: LegParts
    spherical_friction: np.ndarray  # [N m s/rad]
    universal_friction: np.ndarray  # [N m s/rad]


@dataclass(frozen=True)
class Units:
    """CMGs, or wheels (whose housing is the gimbal body); units are the first axis."""

    wheels: bool
    position_P: np.ndarray  # (unit, 3) [m]
    axes_P: np.ndarray  # (unit, 3, 3) [-] columns s, t, g at gimbal angle zero
    gimbal: Body  # in (s, t, g) from the unit's position
    rotor: Body  # in rotor axes from its centre: x along the spin axis
    rotor_centre_G: np.ndarray  # (unit, 3) [m] in (s, t, g) from the unit's position
    bearing_G: np.ndarray  # (unit, 3, 3) [-] axes of the rotor at rotor angle zero
    speed: np.ndarray  # (unit,) [rad/s]
    phase: np.ndarray  # (unit,) [rad] rotor angles at t = 0
    gimbal_angle: np.ndarray  # (unit,) [rad] at t = 0


@dataclass(frozen=True)
class Mechanism:
    """The whole satellite."""

    mount: str  # isolated or rigid
    bus: Body
    plate: Body
    p_BP_B: np.ndarray  # (3,) [m] plate frame in the bus, nominal pose
    R_BP: np.ndarray  # (3, 3)
    legs: Legs
    units: Units

    @cached_property
    def nominal_legs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Length (leg,) [m], direction s and axis along k x s (leg, 3), nominal pose, bus frame."""
        spans = self.spans_B
        return np.linalg.norm(spans, axis=1), unit(spans), unit(cross(self.legs.axis_B, spans))

    @property
    def spans_B(self) -> np.ndarray:
        """Vectors (leg, 3) from universal to spherical joints [m], nominal pose, bus frame."""
        tops = self.p_BP_B + self.legs.upper_joint_P @ self.R_BP.T
        return tops - self.legs.lower_joint_B


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors along the last axis at unit length."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product along the last axis; NumPy's takes several times as long."""
    (a0, a1, a2), (b0, b1, b2) = a.T, b.T
    return np.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], axis=-1)


def turn(angles: Any) -> Rotation:
    """The rotation of [roll, pitch, yaw]: about z by yaw, the new y by pitch, the new x by roll."""
    roll, pitch, yaw = angles
    about = (([0, 0, 1], yaw), ([0, 1, 0], pitch), ([1, 0, 0], roll))
    z, y, x = (Rotation.from_rotvec(np.multiply(axis, angle)) for axis, angle in about)
    return z * y * x


def read_mechanism(data: Data) -> Mechanism:
    """Bodies, joints and struts of a scenario."""
    isolator = data["isolator"]
    base, offset = turn(isolator["orientation"]), np.array(isolator["offset"])
    above = np.array([0.0, 0.0, isolator["separation"]])
    plate = isolator["plate"]
    return Mechanism(
        mount=isolator["mount"],
        bus=Body(data["bus"]["mass"], np.zeros(3), np.array(data["bus"]["inertia"])),
        plate=Body(plate["mass"], np.array(plate["center_of_mass"]), np.array(plate["inertia"])),
        p_BP_B=offset + base.as_matrix() @ above,
        R_BP=base.as_matrix(),
        legs=_legs(isolator["legs"], base.as_matrix(), offset, above),
        units=_units(data["cluster"]),
    )


def _legs(legs: Data, R_BD: np.ndarray, offset: np.ndarray, above: np.ndarray) -> Legs:
    lower, upper = np.array(legs["lower_joints"]), np.array(legs["upper_joints"])
    count = len(lower)

    def each(value: Any) -> np.ndarray:
        return np.array(value if isinstance(value, list) else [value] * count, dtype=float)

    def parts(said: Any) -> LegParts:
        of_legs = said if isinstance(said, list) else [said] * count
        keys = ("mass", "distance", "transverse_inertia", "axial_inertia")
        return LegParts(*(np.array([part[key] for part in of_legs]) for key in keys))

    free = legs.get("free_length")
    if free is None:  # without force in the nominal pose
        free = list(np.linalg.norm(upper + above - lower, axis=1))
    return Legs(
        lower_joint_B=np.array([offset + R_BD @ joint for joint in lower]),
        upper_joint_P=upper,
        axis_B=np.array([R_BD @ axis for axis in np.array(legs["universal_axes"])]),
        stiffness=each(legs["stiffness"]),
        damping=each(legs["damping"]),
        free_length=each(free),
        lower=parts(legs["lower_part"]),
        upper=parts(legs["upper_part"]),
        spherical_friction=each(legs["spherical_friction"]),
        universal_friction=each(legs["universal_friction"]),
    )


def unit_data(cluster: Data) -> list[Data]:
    """What the scenario says of each unit: position, axes, gimbal body (or housing), rotor."""
    wheels = cluster["type"] == "wheel"
    body, common = "housing" if wheels else "gimbal_body", cluster["rotor"]
    if "pyramid" not in cluster:
        return [
            _placed(unit, cluster[body] | unit.get(body, {}), _own_rotor(common, unit), wheels)
            for unit in cluster["units"]
        ]
    pyramid, found = cluster["pyramid"], []
    for j in range(pyramid["units"]):
        azimuth = 2.0 * np.pi * j / pyramid["units"]
        outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        around = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        up = np.array([0.0, 0.0, 1.0])
        leaning = np.sin(pyramid["skew"]) * outward + np.cos(pyramid["skew"]) * up
        place = {"position": pyramid["radius"] * outward + pyramid["height"] * up}
        axes = {"gimbal_axis": leaning, "spin_axis": around}
        place |= {"spin_axis": leaning} if wheels else axes
        found.append(_placed(place, cluster[body], common, wheels))
    return found


def _own_rotor(common: Data, unit: Data) -> Data:
    """The common rotor with what the unit says otherwise."""
    own = unit.get("rotor", {})
    either = ("momentum", "spin_inertia")  # two ways to say one thing
    if any(key in own for key in either):
        common = {key: value for key, value in common.items() if key not in either}
    return {**common, **own}


def _placed(place: Data, body: Data, rotor: Data, wheel: bool) -> Data:
    s = np.array(place["spin_axis"], dtype=float)
    if wheel:
        up = np.array([0.0, 0.0, 1.0])
        across = up - (up @ s) * s
        if np.linalg.norm(across) <= 1e-3:
            across = np.array([1.0, 0.0, 0.0]) - s[0] * s
        g = across / np.linalg.norm(across)
    else:
        g = np.array(place["gimbal_axis"], dtype=float)
    return {"position": place["position"], "s": s, "g": g, "body": body, "rotor": rotor}


def _units(cluster: Data) -> Units:
    units = unit_data(cluster)
    count = len(units)

    def stacked(of: Any) -> np.ndarray:
        return np.array([of(unit) for unit in units], dtype=float)

    def axes(unit: Data) -> np.ndarray:
        t = np.cross(unit["g"], unit["s"])
        t /= np.linalg.norm(t)
        return np.stack([np.cross(t, unit["g"]), t, unit["g"]], axis=1)

    def bearing(unit: Data) -> np.ndarray:
        error = unit["rotor"]["installation_error"]
        about = [error["chi"], error["beta"], error["alpha"]]  # s, t, g
        return Rotation.from_rotvec(about).as_matrix()

    def off_centre(unit: Data) -> list[float]:
        return [0.0, unit["rotor"]["static_imbalance"] / unit["rotor"]["mass"], 0.0]

    gimbal = Body(
        stacked(lambda unit: unit["body"]["mass"]),
        stacked(lambda unit: unit["body"]["center_of_mass"]),
        stacked(lambda unit: np.diag(unit["body"]["inertia"])),
    )
    rotor = Body(
        stacked(lambda unit: unit["rotor"]["mass"]),
        stacked(off_centre),
        stacked(lambda unit: rotor_inertia(unit["rotor"])),
    )
    return Units(
        wheels=cluster["type"] == "wheel",
        position_P=stacked(lambda unit: unit["position"]),
        axes_P=stacked(axes),
        gimbal=gimbal,
        rotor=rotor,
        rotor_centre_G=gimbal.centre + stacked(lambda unit: unit["rotor"]["offset"]),
        bearing_G=stacked(bearing),
        speed=stacked(lambda unit: unit["rotor"]["speed"]),
        phase=_phases(cluster, units),
        gimbal_angle=np.array(cluster.get("gimbal_angles") or np.zeros(count), dtype=float),
    )


def _phases(cluster: Data, units: list[Data]) -> np.ndarray:
    """Rotor angles at the start [rad]; random ones go by the seed and number of the rotor."""
    said = cluster["rotor_phases"]
    if said != "random":
        return np.array(said, dtype=float)
    drawn = [random_angles(seed_of(unit), j, 2, 1)[0] for j, unit in enumerate(units)]
    return np.array(drawn)


def seed_of(unit: Data) -> int:
    """Seed of a rotor's random numbers."""
    return (unit["rotor"].get("disturbance") or {"seed": 0})["seed"]


def random_angles(seed: int, unit: int, stream: int, count: int) -> np.ndarray:
    """Angles [rad] that scenarios call random: rotors' by stream 2, gimbal motors' by 3."""
    return np.random.default_rng([seed, unit, stream]).uniform(-np.pi, np.pi, count)


def rotor_inertia(rotor: Data) -> np.ndarray:
    """Inertia (3, 3) [kg m^2] about the mass centre, y towards the static imbalance.

    The dynamic imbalance is the product of inertia, the integral of x r dm along the direction r
    in the rotor plane that `dynamic_imbalance_phase` says; matrix elements are minus products.
    """
    spin = rotor.get("spin_inertia")
    if spin is None:
        spin = rotor["momentum"] / rotor["speed"]
    inertia = np.diag([spin, rotor["transverse_inertia"], rotor["transverse_inertia"]])
    phase = rotor["dynamic_imbalance_phase"]
    for axis, share in ((1, np.cos(phase)), (2, np.sin(phase))):
        inertia[0, axis] = inertia[axis, 0] = -rotor["dynamic_imbalance"] * share
    return inertia
