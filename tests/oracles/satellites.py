"""Satellites built straight from the model's parts, for tests of the physics."""

from dataclasses import replace
from typing import Literal

import jax.numpy as jnp
import numpy as np

from quietbus.model.body import Body
from quietbus.model.body import Mount as Mounted
from quietbus.model.cluster import Cluster
from quietbus.model.control import Control
from quietbus.model.controller import NoController, PIDController
from quietbus.model.disturbance import quiet_rotors
from quietbus.model.element import AbstractElement
from quietbus.model.gimbal_motor import SmoothMotor
from quietbus.model.gimbals import GimbalServos, HeldGimbals
from quietbus.model.guidance import StepGuidance
from quietbus.model.legs.hexapod import Hexapod
from quietbus.model.legs.inertia import LegBodies, LegParts
from quietbus.model.legs.kinematics import Geometry
from quietbus.model.rotors import ConstantSpeed, RunUp, WheelMotors
from quietbus.model.satellite import Satellite
from quietbus.model.steering import NoSteering, PseudoInverse, SingularityRobust
from quietbus.model.struts import SpringDamper
from quietbus.model.unit import ControlMomentGyro
from quietbus.spatial.rotation import (
    quaternion_to_matrix,
    rotation_vector_to_matrix,
    rotation_vector_to_quaternion,
)

Mount = Literal["isolated", "rigid"]


def paper_satellite(mount: Mount = "isolated", imbalance: float = 1.0) -> Satellite:
    """The satellite of Zhang and Xu (2012), controlled; imbalance in units of the paper's."""
    inertia = _array([[1100, -20, -10], [-20, 900, -15], [-10, -15, 800]])
    welded = mount == "rigid"
    p_BP_B = _array([0.0, 0.0, 0.6 + 0.25 * np.sqrt(2.0)])
    still = _array([1.0, 0.0, 0.0, 0.0])
    controller = PIDController(
        kp=_array(200.0),
        ki=_array(0.1),
        kd=_array(2500.0),
        J_feedforward_B=jnp.zeros((3, 3)),
        unwinding=_array(1.0 / (0.1 * np.sqrt(2500.0 / 0.1))),
        torque_limit=_array(np.inf),
    )
    steering = SingularityRobust(_array(0.01), _array(10.0))
    return Satellite(
        bodies=(
            Body("bus", _array(1000.0), jnp.zeros(3), inertia),
            Body("plate", _array(6.8), jnp.zeros(3), jnp.diag(_array([1.78, 1.78, 1.3]))),
        ),
        mounts=(Mounted("plate", "bus", p_BP_B, still, welded),),
        hexapods=(_legs(not welded),),
        clusters=(_cluster(imbalance),),
        others=(),
        control=Control(StepGuidance(still), controller, steering, ("cluster",)),
    )


def uncontrolled(satellite: Satellite, *others: AbstractElement) -> Satellite:
    """The satellite without control, its gimbals keeping their rates, with further parts."""
    control = replace(satellite.control, controller=NoController(), steering=NoSteering())
    clusters = tuple(replace(c, gimbals=_coasting(c.gimbals)) for c in satellite.clusters)
    return replace(satellite, control=control, clusters=clusters, others=others)


def _coasting(gimbals):
    return replace(gimbals, bandwidth=jnp.zeros(())) if hasattr(gimbals, "bandwidth") else gimbals


def with_units(satellite: Satellite, **changes: object) -> Satellite:
    """The satellite with other numbers of its units."""
    (cluster,) = satellite.clusters
    units = replace(cluster.units, **changes)
    return replace(satellite, clusters=(replace(cluster, units=units),))


def with_cluster(satellite: Satellite, **changes: object) -> Satellite:
    """The satellite with other parts of its cluster: gimbals, rotors, disturbance, motor."""
    (cluster,) = satellite.clusters
    return replace(satellite, clusters=(replace(cluster, **changes),))


def with_control(satellite: Satellite, **changes: object) -> Satellite:
    """The satellite with another guidance, controller or steering."""
    return replace(satellite, control=replace(satellite.control, **changes))


def awkward_satellite(mount: Mount = "isolated", imbalance: float = 1.0) -> Satellite:
    """Nothing aligned, centred or alike: every term of the equations of motion counts.

    Tilted plate, mass centres off the axes, misaligned rotors, gimbal bodies with products of
    inertia, heavy legs of unlike parts with much friction, slanted universal joints, preload.
    """
    rng = np.random.default_rng(2012)
    satellite = paper_satellite(mount, imbalance)
    (legs,), (cluster,), (mount_,) = satellite.hexapods, satellite.clusters, satellite.mounts
    joints, units = legs.geometry, cluster.units

    def each(low: float, high: float) -> jnp.ndarray:
        return _array(rng.uniform(low, high, 6))

    q_BP = rotation_vector_to_quaternion(_array([0.1, -0.15, 0.4]))
    p_BU_B = mount_.p_BX_B + joints.p_PU_P @ quaternion_to_matrix(q_BP).T
    length = jnp.linalg.norm(p_BU_B - joints.p_BA_B, axis=1)
    k_B = joints.k_B + _array(rng.normal(size=(6, 3), scale=0.3))
    k_B = k_B / jnp.linalg.norm(k_B, axis=1, keepdims=True)
    strut = SpringDamper(each(1e4, 3e4), each(200.0, 800.0), 0.98 * length)
    upper = LegParts(each(1, 2), each(0.1, 0.2), each(0.01, 0.02), each(0.001, 0.004))
    lower = LegParts(each(2, 4), each(0.1, 0.2), each(0.02, 0.04), each(0.001, 0.004))
    legs = replace(
        legs,
        geometry=replace(joints, k_B=k_B, nominal_length=length),
        bodies=LegBodies(upper, lower, each(0.5, 3.0), each(0.5, 3.0)),
        strut=strut,
    )
    products = np.array([[0.0, 0.01, 0.005], [0.01, 0.0, -0.007], [0.005, -0.007, 0.01]])
    tilts = [rotation_vector_to_matrix(_array(rng.normal(size=3, scale=0.05))) for _ in range(4)]
    units = replace(
        units,
        R_GF=jnp.stack(tilts),
        I_GGcm_G=units.I_GGcm_G + products,
        p_CGcm_G=_array(rng.normal(size=(4, 3), scale=0.02)),
        p_CR_G=_array(rng.normal(size=(4, 3), scale=0.02)),
        rotor_speed=units.rotor_speed * _array([1.0, -0.9, 1.1, 0.95]),
    )
    bus, plate = satellite.bodies
    plate = replace(plate, p_XXcm_X=_array([0.01, -0.02, 0.03]), I_XXcm_X=plate.I_XXcm_X + 0.1)
    return replace(
        satellite,
        bodies=(bus, plate),
        mounts=(replace(mount_, q_BX=q_BP),),
        hexapods=(legs,),
        clusters=(replace(cluster, units=units),),
    )


def with_wheels(satellite: Satellite) -> Satellite:
    """The satellite with reaction wheels, spinning about what were the gimbal axes, unlike fast."""
    speed = _array([90.0, -110.0, 70.0, 0.0])
    (cluster,) = satellite.clusters
    units = replace(
        cluster.units, rotor_speed=speed, R_PG0=jnp.roll(cluster.units.R_PG0, 1, axis=2)
    )
    unlimited = jnp.full(4, jnp.inf)
    wheels = replace(
        cluster,
        units=units,
        gimbals=HeldGimbals(jnp.zeros(4)),
        rotors=WheelMotors(unlimited, unlimited),
    )
    return with_control(replace(satellite, clusters=(wheels,)), steering=PseudoInverse())


def with_run_up(satellite: Satellite, shape: Literal["smooth", "linear"] = "linear") -> Satellite:
    """The satellite with its rotors running up, down, through rest and not at all."""
    initial, final = _array([0.0, 100.0, -60.0, 80.0]), _array([150.0, 40.0, 60.0, 80.0])
    one = jnp.ones(4)
    return with_cluster(satellite, rotors=RunUp(initial, final, 0.0 * one, 1.5 * one, shape))


def _legs(holds: bool) -> Hexapod:
    root3 = np.sqrt(3.0)
    upper = [[0.5, 0, 0], [-0.25, 0.25 * root3, 0], [-0.25, 0.25 * root3, 0]]
    lower = [[0.25, 0.25 * root3, 0], [-0.5, 0, 0], [0.25, 0.25 * root3, 0]]
    axes = [[-0.5 * root3, 0.5, 0], [0, -1, 0], [0.5 * root3, 0.5, 0]]
    mirror = np.array([1.0, -1.0, 1.0])
    p_PU_P = np.concatenate([upper, upper * mirror])
    p_DA_D = np.concatenate([lower, lower * mirror])
    # the fixed axes of the mirrored legs, as the paper lists them
    k_B = np.concatenate([axes, np.array(axes) * [-1.0, 1.0, 1.0]])
    length = np.full(
        6, np.linalg.norm(p_PU_P[0] - p_DA_D[0] + np.array([0, 0, 0.25 * np.sqrt(2.0)]))
    )
    six = np.ones(6)
    part = LegParts(*(_array(value * six) for value in (0.25, 0.15, 0.002, 1e-4)))
    return Hexapod(
        "legs",
        ("plate", "bus"),
        Geometry(
            p_PU_P=_array(p_PU_P),
            p_BA_B=_array(p_DA_D + np.array([0.0, 0.0, 0.6])),
            k_B=_array(k_B),
            nominal_length=_array(length),
        ),
        LegBodies(part, part, _array(1e-4 * six), _array(1e-4 * six)),
        SpringDamper(_array(2e4 * six), _array(500.0 * six), _array(length)),
        holds,
    )


def _cluster(imbalance: float) -> Cluster:
    azimuth, skew = 0.5 * np.pi * np.arange(4), np.deg2rad(53.13)
    r = np.stack([np.cos(azimuth), np.sin(azimuth), 0.0 * azimuth], axis=1)
    z = np.array([0.0, 0.0, 1.0])
    g, s = np.sin(skew) * r + np.cos(skew) * z, np.cross(z, r)
    speed = 200.0 * np.pi
    along = 15.0 / speed
    I_RRcm_R = np.diag([along, 0.6 * along, 0.6 * along])
    I_RRcm_R[0, 1] = I_RRcm_R[1, 0] = -17e-7 * imbalance
    four = np.ones(4)

    def each(value: np.ndarray) -> jnp.ndarray:
        return _array(np.repeat(value[None], 4, axis=0))

    units = ControlMomentGyro(
        p_PC_P=_array(0.42 * r),
        R_PG0=_array(np.stack([s, np.cross(g, s), g], axis=2)),
        gimbal_mass=_array(13.0 * four),
        p_CGcm_G=each(np.zeros(3)),
        I_GGcm_G=each(0.06 * np.eye(3)),
        rotor_mass=_array(6.0 * four),
        p_CR_G=each(np.zeros(3)),
        R_GF=each(np.eye(3)),
        I_RRcm_R=each(I_RRcm_R),
        eccentricity=_array(1.36e-5 / 6.0 * imbalance * four),
        rotor_speed=_array(speed * four),
        rotor_phase=_array([0.0, 0.7, 1.4, 2.1]),
    )
    none = _array(np.inf)
    servos = GimbalServos(_array(50.0), none, none)
    quiet = quiet_rotors(4)
    return Cluster("cluster", ("plate",), units, servos, ConstantSpeed(), quiet, SmoothMotor())


def _array(value: object) -> jnp.ndarray:
    return jnp.asarray(value, dtype=float)
