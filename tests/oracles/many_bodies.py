"""A satellite of many parts, built straight from the model's: nothing aligned, centred or alike."""

from collections.abc import Collection

import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.model.body import Body, Mount
from quietbus.model.cluster import Cluster
from quietbus.model.control import Control
from quietbus.model.controller import PIDController
from quietbus.model.disturbance import quiet_rotors
from quietbus.model.gimbals import GimbalServos, HeldGimbals
from quietbus.model.guidance import StepGuidance
from quietbus.model.legs.hexapod import Hexapod
from quietbus.model.legs.inertia import LegBodies, LegParts
from quietbus.model.legs.kinematics import Geometry
from quietbus.model.rotors import ConstantSpeed, RunUp, WheelMotors
from quietbus.model.satellite import BUS, Satellite
from quietbus.model.steering import PseudoInverse
from quietbus.model.struts import SpringDamper
from quietbus.model.unit import ControlMomentGyro

POSES = {  # of the bodies in their bases: metres, rotation vector
    "north": ([0.1, -0.9, 0.95], [0.1, -0.2, 0.4]),
    "south": ([-0.2, 1.1, 0.85], [-0.3, 0.1, 0.0]),
    "bench": ([0.0, 0.1, -1.1], [3.0, 0.1, 0.2]),
}
ON_NORTH = ([0.05, -0.1, 0.55], [0.2, 0.1, -0.3])


def many_parts(welded: Collection[str] = (), bench_on: str = BUS) -> Satellite:
    """Platforms ``north`` with CMGs and wheels and ``south`` with wheels, and a heavy bench.

    The rotors of a further group of CMGs, on the south platform, run up. Legs have mass and
    friction in their joints, struts are preloaded, rotors heavily unbalanced.

    Args:
        welded: names of the bodies that are one with their bases.
        bench_on: the body that the bench stands on, ``bus`` or ``north``.
    """
    rng = np.random.default_rng(7)
    poses = POSES | ({"bench": ON_NORTH} if bench_on == "north" else {})
    mounts = tuple(
        Mount(
            name,
            bench_on if name == "bench" else BUS,
            _array(place),
            _array(Rotation.from_rotvec(turn).as_quat(scalar_first=True)),
            name in welded,
        )
        for name, (place, turn) in poses.items()
    )
    clusters = (
        _cmgs("cmgs", "north", 3, rng),
        _wheels("wheels", "north", 2, rng),
        _wheels("more wheels", "south", 3, rng),
        _cmgs("running up", "south", 2, rng, runs_up=True),
    )
    names = ("cmgs", "wheels", "more wheels", "running up")
    return Satellite(
        bodies=(
            Body(BUS, _array(600.0), jnp.zeros(3), _inertia(300.0, rng)),
            _body("north", 9.0, 0.6, rng),
            _body("south", 12.0, 0.8, rng),
            _body("bench", 60.0, 6.0, rng),
        ),
        mounts=mounts,
        hexapods=tuple(_hexapod(mount, rng) for mount in mounts),
        clusters=clusters,
        others=(),
        control=Control(
            StepGuidance(_array([0.9, 0.1, -0.3, 0.3])),
            PIDController(*map(_array, (60.0, 1.0, 400.0, np.zeros((3, 3)), 0.05, np.inf))),
            PseudoInverse(),
            names,
        ),
    )


def _body(name: str, mass: float, inertia: float, rng: np.random.Generator) -> Body:
    return Body(name, _array(mass), _array(rng.normal(size=3, scale=0.02)), _inertia(inertia, rng))


def _inertia(size: float, rng: np.random.Generator) -> jnp.ndarray:
    """Of three unlike parts, axes not aligned."""
    R = Rotation.from_rotvec(rng.normal(size=3, scale=0.3)).as_matrix()
    return _array(size * R @ np.diag([1.0, 1.2, 0.9]) @ R.T)


def _hexapod(mount: Mount, rng: np.random.Generator) -> Hexapod:
    """Six struts of two rings under a body, in its base's frame."""
    angles = np.pi / 3.0 * np.arange(6)
    pairs = 0.3 * (-1.0) ** np.arange(6)
    up, low = _ring(0.45, angles - pairs, rng), _ring(0.55, angles + pairs, rng)
    R = Rotation.from_quat(mount.q_BX, scalar_first=True)
    top_B = np.asarray(mount.p_BX_B) + R.apply(up)
    foot_B = np.asarray(mount.p_BX_B) + R.apply(low - np.array([0.0, 0.0, 0.35]))
    length = np.linalg.norm(top_B - foot_B, axis=1)
    axes = R.apply(_ring(1.0, angles + np.pi / 2.0, rng)) + rng.normal(size=(6, 3), scale=0.2)

    def each(least: float, most: float) -> jnp.ndarray:
        return _array(rng.uniform(least, most, 6))

    def parts(mass: float) -> LegParts:
        return LegParts(
            each(mass, 2.0 * mass), each(0.1, 0.2), each(0.01, 0.03), each(0.001, 0.004)
        )

    return Hexapod(
        f"legs of {mount.body}",
        (mount.body, mount.base),
        Geometry(
            p_PU_P=_array(up),
            p_BA_B=_array(foot_B),
            k_B=_array(axes / np.linalg.norm(axes, axis=1, keepdims=True)),
            nominal_length=_array(length),
        ),
        LegBodies(parts(0.5), parts(1.0), each(0.5, 3.0), each(0.5, 3.0)),
        SpringDamper(each(1e4, 3e4), each(200.0, 800.0), _array(0.98 * length)),
        not mount.welded,
    )


def _ring(radius: float, angles: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    height = rng.uniform(-0.03, 0.03, len(angles))
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), height], axis=1)


def _cmgs(
    name: str, host: str, count: int, rng: np.random.Generator, runs_up: bool = False
) -> Cluster:
    one = np.ones(count)
    rotors = ConstantSpeed()
    if runs_up:
        ends = rng.uniform(-150.0, 150.0, (2, count))
        rotors = RunUp(*map(_array, (*ends, 0.0 * one, 1.5 * one)), "smooth")
    servos = GimbalServos(_array(40.0), _array(np.inf), _array(np.inf))
    units = _units(count, 500.0, rng)
    return Cluster(name, (host,), units, servos, rotors, quiet_rotors(count))


def _wheels(name: str, host: str, count: int, rng: np.random.Generator) -> Cluster:
    held = HeldGimbals(_array(rng.uniform(-1.0, 1.0, count)))
    motors = WheelMotors(_array(0.3 * np.ones(count)), _array(np.inf * np.ones(count)))
    units = _units(count, 200.0, rng)
    return Cluster(name, (host,), units, held, motors, quiet_rotors(count))


def _units(count: int, speed: float, rng: np.random.Generator) -> ControlMomentGyro:
    turns = Rotation.random(count, random_state=int(rng.integers(1 << 31)))
    tilts = Rotation.from_rotvec(rng.normal(size=(count, 3), scale=0.05))
    inertia = np.tile(np.diag([0.03, 0.018, 0.02]), (count, 1, 1))
    products = rng.uniform(-5e-4, 5e-4, (count, 2))
    inertia[:, 0, 1:], inertia[:, 1:, 0] = products, products
    return ControlMomentGyro(
        p_PC_P=_array(rng.uniform(-0.3, 0.3, (count, 3))),
        R_PG0=_array(turns.as_matrix()),
        gimbal_mass=_array(rng.uniform(3.0, 6.0, count)),
        p_CGcm_G=_array(rng.normal(size=(count, 3), scale=0.02)),
        I_GGcm_G=jnp.stack([_inertia(0.04, rng) for _ in range(count)]),
        rotor_mass=_array(rng.uniform(2.0, 4.0, count)),
        p_CR_G=_array(rng.normal(size=(count, 3), scale=0.02)),
        R_GF=_array(tilts.as_matrix()),
        I_RRcm_R=_array(inertia),
        eccentricity=_array(rng.uniform(1e-4, 1e-3, count)),
        rotor_speed=_array(speed * rng.uniform(0.8, 1.2, count) * rng.choice([-1.0, 1.0], count)),
        rotor_phase=_array(rng.uniform(-np.pi, np.pi, count)),
    )


def _array(value: object) -> jnp.ndarray:
    return jnp.asarray(value, dtype=float)
