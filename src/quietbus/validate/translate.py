"""Between quietbus's objects and the plain arrays of the reference."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.dynamics.closed_loop import rotor_angles
from quietbus.dynamics.state import State
from quietbus.model.rotor import RotorState
from quietbus.model.satellite import Satellite
from quietbus.reference.body import Body
from quietbus.reference.mechanism import LegParts, Legs, Mechanism
from quietbus.reference.motion import Motion
from quietbus.reference.units import Units

NAMES = ("bus", "plate")  # of the reference's bodies
BUS, PLATE = range(2)  # their numbers


def mechanism_of(satellite: Satellite) -> Mechanism:
    """A satellite's bodies and struts as the reference's, for satellites without a scenario.

    ``validate`` does not use it: there the reference reads the scenario for itself.
    """
    plain: Any = jax.tree.map(np.asarray, satellite)
    bus, plate, legs, cluster = plain.bus, plain.plate, plain.legs, plain.cluster
    along_y = np.stack([0.0 * cluster.eccentricity, cluster.eccentricity], axis=1)
    parts = ("mass", "distance", "transverse_inertia", "axial_inertia")
    lower, upper = (
        LegParts(*(getattr(part, name) for name in parts)) for part in (legs.lower, legs.upper)
    )
    feet, count = len(legs.stiffness), len(cluster.rotor_phase)
    R_BP = Rotation.from_quat(plain.q_BP, scalar_first=True).as_matrix()
    return Mechanism(
        names=NAMES,
        bodies=Body(
            np.stack([bus.mass, plate.mass]),
            np.stack([np.zeros(3), plate.p_PPcm_P]),
            np.stack([bus.I_BBcm_B, plate.I_PPcm_P]),
        ),
        p_BX_B=np.stack([np.zeros(3), plain.p_BP_B]),
        R_BX=np.stack([np.eye(3), R_BP]),
        welded=np.array([False, satellite.mount == "rigid"]),
        legs=Legs(
            np.full(feet, BUS),
            np.full(feet, PLATE),
            legs.p_BA_B,
            legs.p_PU_P,
            legs.k_B,
            legs.stiffness,
            legs.damping,
            legs.free_length,
            lower,
            upper,
            legs.spherical_friction,
            legs.universal_friction,
        ),
        units=Units(
            host=np.full(count, PLATE),
            wheel=np.full(count, cluster.wheels),
            position_X=cluster.p_PC_P,
            axes_X=cluster.R_PG0,
            gimbal=Body(cluster.gimbal_mass, cluster.p_CGcm_G, cluster.I_GGcm_G),
            rotor=Body(cluster.rotor_mass, np.pad(along_y, ((0, 0), (0, 1))), cluster.I_RRcm_R),
            rotor_centre_G=cluster.p_CR_G,
            bearing_G=cluster.R_GF,
            speed=cluster.rotor_speed,
            phase=cluster.rotor_phase,
            gimbal_angle=np.zeros_like(cluster.rotor_phase),
        ),
    )


def motion_of(satellite: Satellite, state: State, rotor_angle: object = None) -> Motion:
    """A state as the reference's motion.

    Args:
        rotor_angle: (cmg,) [rad]; by default the state's, or that at t = 0.
    """
    if rotor_angle is None:
        rotor_angle = rotor_angles(satellite, jnp.zeros(()), state)
    cluster = satellite.cluster
    speed = cluster.rotor_speed if state.rotor is None else state.rotor.speed
    bodies = {
        "p_NX_N": (state.p_NB_N, state.p_NP_N),
        "q_NX": (state.q_NB, state.q_NP),
        "v_NX_N": (state.v_NB_N, state.v_NP_N),
        "w_NX_X": (state.w_NB_B, state.w_NP_P),
    }
    return Motion(
        **{name: np.stack(both) for name, both in bodies.items()},
        **{name: np.asarray(getattr(state, name)) for name in _OWN},
        rotor_angle=np.asarray(rotor_angle),
        rotor_speed=np.asarray(speed),
    )


def state_of(satellite: Satellite, motion: Motion) -> State:
    """A motion as the satellite's state; angles of rotors of constant speed are not part of it."""
    m = {name: jnp.asarray(value) for name, value in vars(motion).items()}
    rotor = None
    if satellite.cluster.drive is not None:
        rotor = RotorState(m["rotor_angle"], m["rotor_speed"])
    return State(
        p_NB_N=m["p_NX_N"][BUS],
        q_NB=m["q_NX"][BUS],
        p_NP_N=m["p_NX_N"][PLATE],
        q_NP=m["q_NX"][PLATE],
        v_NB_N=m["v_NX_N"][BUS],
        w_NB_B=m["w_NX_X"][BUS],
        v_NP_N=m["v_NX_N"][PLATE],
        w_NP_P=m["w_NX_X"][PLATE],
        **{name: m[name] for name in _OWN},
        rotor=rotor,
    )


_OWN = ("gimbal_angle", "gimbal_rate", "error_integral")
