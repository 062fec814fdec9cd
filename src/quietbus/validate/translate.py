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
from quietbus.reference.mechanism import Body, LegParts, Legs, Mechanism, Units
from quietbus.reference.motion import Motion


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
    return Mechanism(
        mount=satellite.mount,
        bus=Body(bus.mass, np.zeros(3), bus.I_BBcm_B),
        plate=Body(plate.mass, plate.p_PPcm_P, plate.I_PPcm_P),
        p_BP_B=plain.p_BP_B,
        R_BP=Rotation.from_quat(plain.q_BP, scalar_first=True).as_matrix(),
        legs=Legs(
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
            wheels=cluster.wheels,
            position_P=cluster.p_PC_P,
            axes_P=cluster.R_PG0,
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
    names = [name for name in Motion.__dataclass_fields__ if not name.startswith("rotor")]
    known = {name: np.asarray(getattr(state, name)) for name in names}
    return Motion(**known, rotor_angle=np.asarray(rotor_angle), rotor_speed=np.asarray(speed))


def state_of(satellite: Satellite, motion: Motion) -> State:
    """A motion as the satellite's state; angles of rotors of constant speed are not part of it."""
    known = {
        name: jnp.asarray(value)
        for name, value in vars(motion).items()
        if not name.startswith("rotor")
    }
    rotor = None
    if satellite.cluster.drive is not None:
        rotor = RotorState(jnp.asarray(motion.rotor_angle), jnp.asarray(motion.rotor_speed))
    return State(**known, rotor=rotor)
