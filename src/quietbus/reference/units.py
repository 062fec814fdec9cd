"""CMGs and reaction wheels of a scenario, as plain arrays."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.body import Body
from quietbus.reference.platforms import Block, Data, blocks


@dataclass(frozen=True)
class Units:
    """CMGs and wheels (whose housing is the gimbal body); units are the first axis."""

    host: np.ndarray  # (unit,) number of the body that carries it
    wheel: np.ndarray  # (unit,) whether it is a wheel, without gimbal motion
    position_X: np.ndarray  # (unit, 3) [m] frame of the host
    axes_X: np.ndarray  # (unit, 3, 3) [-] columns s, t, g at gimbal angle zero
    gimbal: Body  # in (s, t, g) from the unit's position
    rotor: Body  # in rotor axes from its centre: x along the spin axis
    rotor_centre_G: np.ndarray  # (unit, 3) [m] in (s, t, g) from the unit's position
    bearing_G: np.ndarray  # (unit, 3, 3) [-] axes of the rotor at rotor angle zero
    speed: np.ndarray  # (unit,) [rad/s]
    phase: np.ndarray  # (unit,) [rad] rotor angles at t = 0
    gimbal_angle: np.ndarray  # (unit,) [rad] at t = 0


@dataclass(frozen=True)
class Drives:
    """What moves the units; what has no limit in the scenario has an infinite one."""

    limit: np.ndarray  # (unit,) of the gimbal rate [rad/s], or of a wheel's torque [N m]
    bandwidth: np.ndarray  # (unit,) [rad/s] of the gimbal servo; 0 for wheels
    acceleration_limit: np.ndarray  # (unit,) [rad/s^2] of the gimbal
    speed_limit: np.ndarray  # (unit,) [rad/s] of the wheel


def unit_data(cluster: Data) -> list[dict[str, Any]]:
    """What a scenario says of each unit of a block.

    That is position, axes, gimbal body (or housing), rotor, and motor of a wheel.
    """
    wheels = cluster["type"] == "wheel"
    body, common = "housing" if wheels else "gimbal_body", cluster["rotor"]
    motor = cluster.get("motor", {})
    if "pyramid" not in cluster:
        return [
            _placed(unit, cluster[body] | unit.get(body, {}), _own_rotor(common, unit), wheels)
            | {"motor": motor | unit.get("motor", {})}
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
        found.append(_placed(place, cluster[body], common, wheels) | {"motor": motor})
    return found


def _own_rotor(common: Data, unit: Data) -> Data:
    """The common rotor with what the unit says otherwise."""
    own = unit.get("rotor", {})
    either = ("momentum", "spin_inertia")  # two ways to say one thing
    if any(key in own for key in either):
        common = {key: value for key, value in common.items() if key not in either}
    return {**common, **own}


def _placed(place: Data, body: Data, rotor: Data, wheel: bool) -> dict[str, Any]:
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


def read_units(data: Data) -> Units:
    """The units of all blocks."""
    each = [(block, unit) for block in blocks(data) for unit in unit_data(block.data)]
    units = [unit for _, unit in each]

    def stacked(of: Any, *shape: int) -> np.ndarray:
        return np.array([of(unit) for unit in units], dtype=float).reshape(-1, *shape)

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
        stacked(lambda unit: unit["body"]["center_of_mass"], 3),
        stacked(lambda unit: np.diag(unit["body"]["inertia"]), 3, 3),
    )
    rotor = Body(
        stacked(lambda unit: unit["rotor"]["mass"]),
        stacked(off_centre, 3),
        stacked(lambda unit: rotor_inertia(unit["rotor"]), 3, 3),
    )
    return Units(
        host=np.array([block.host for block, _ in each], dtype=int),
        wheel=np.array([block.wheels for block, _ in each], dtype=bool),
        position_X=stacked(lambda unit: unit["position"], 3),
        axes_X=stacked(axes, 3, 3),
        gimbal=gimbal,
        rotor=rotor,
        rotor_centre_G=gimbal.centre + stacked(lambda unit: unit["rotor"]["offset"], 3),
        bearing_G=stacked(bearing, 3, 3),
        speed=stacked(lambda unit: unit["rotor"]["speed"]),
        phase=_joined(blocks(data), _phases),
        gimbal_angle=_joined(blocks(data), lambda block: block.data.get("gimbal_angles")),
    )


def read_drives(data: Data) -> Drives:
    """Of the units of all blocks."""

    def of_block(key: str, default: float) -> np.ndarray:
        return _joined(blocks(data), lambda block: block.data.get(key, default))

    def of_motor(key: str) -> np.ndarray:
        units = [unit for block in blocks(data) for unit in unit_data(block.data)]
        return np.array([unit["motor"].get(key, np.inf) for unit in units], dtype=float)

    return Drives(
        limit=np.minimum(of_block("gimbal_rate_limit", np.inf), of_motor("torque_limit")),
        bandwidth=of_block("gimbal_bandwidth", 0.0),
        acceleration_limit=of_block("gimbal_acceleration_limit", np.inf),
        speed_limit=of_motor("speed_limit"),
    )


def _joined(found: list[Block], of: Any) -> np.ndarray:
    """One number for each unit, from one or a list for each block; None is zero."""
    parts = [np.zeros(block.units.stop - block.units.start) + (of(block) or 0.0) for block in found]
    return np.concatenate([np.zeros(0), *parts])


def _phases(block: Block) -> list[float]:
    """Rotor angles at the start [rad]; random ones go by the seed and number of the rotor."""
    said = block.data["rotor_phases"]
    if said != "random":
        return list(said)
    first, units = block.units.start, unit_data(block.data)
    return [random_angles(seed_of(unit), j, 2, 1)[0] for j, unit in enumerate(units, first)]


def seed_of(unit: Data) -> int:
    """Seed of a rotor's random numbers."""
    return int((unit["rotor"].get("disturbance") or {"seed": 0})["seed"])


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
