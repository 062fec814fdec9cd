"""What a run reports at each output instant."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.closed_loop import control_signals, evaluate
from quietbus.dynamics.equations import plate_motion
from quietbus.dynamics.joint_forces import JointForces, joint_forces
from quietbus.dynamics.kinematics import leg_motion
from quietbus.dynamics.rotor_torques import rotor_torques
from quietbus.dynamics.state import State
from quietbus.model.cmg import ClusterMoments
from quietbus.model.satellite import Satellite
from quietbus.model.variants import balanced


class Outputs(eqx.Module):
    """Quantities at one instant; names, frames and units as in the results (``results.schema``)."""

    bus_position: Float[Array, "3"]
    bus_velocity: Float[Array, "3"]
    bus_attitude: Float[Array, "4"]
    bus_rate: Float[Array, "3"]
    platform_position: Float[Array, "3"]
    platform_velocity: Float[Array, "3"]
    platform_attitude: Float[Array, "4"]
    platform_rate: Float[Array, "3"]
    gimbal_angle: Float[Array, " cmg"]
    gimbal_rate: Float[Array, " cmg"]
    leg_stroke: Float[Array, " leg"]
    leg_force: Float[Array, " leg"]
    control_torque: Float[Array, "3"]
    attitude_error: Float[Array, "3"]
    singularity_measure: Float[Array, ""]
    joint_forces: JointForces | None
    torque_share: Float[Array, ""] | None = None  # where the control makes units act
    # where rotor speeds change:
    rotor_angle: Float[Array, " cmg"] | None = None
    rotor_speed: Float[Array, " cmg"] | None = None
    rotor_torque: Float[Array, " cmg"] | None = None


def outputs(
    satellite: Satellite,
    t: Float[Array, ""],
    state: State,
    with_joint_forces: bool = False,
    averaged: ClusterMoments | None = None,
) -> Outputs:
    """Outputs at time t [s]; joint forces and rotors' torques need the accelerations: they cost.

    Args:
        averaged: as of ``ClusterMoments.averaged``, if the state is the slow motion's.
    """
    signals = control_signals(satellite, t, state)
    motion = leg_motion(satellite.legs, plate_motion(state))
    joints, torque = None, None
    if with_joint_forces or state.rotor is not None:
        _, acceleration = evaluate(satellite, t, state, None, averaged)
        if with_joint_forces:
            joints = joint_forces(satellite, state, acceleration)
        if state.rotor is not None:
            shaken = satellite if averaged is None else balanced(satellite)
            torque = rotor_torques(shaken, state, signals, acceleration)
    return Outputs(
        bus_position=state.p_NB_N,
        bus_velocity=state.v_NB_N,
        bus_attitude=state.q_NB,
        bus_rate=state.w_NB_B,
        platform_position=state.p_NP_N,
        platform_velocity=state.v_NP_N,
        platform_attitude=state.q_NP,
        platform_rate=state.w_NP_P,
        gimbal_angle=state.gimbal_angle,
        gimbal_rate=state.gimbal_rate,
        leg_stroke=motion.length - satellite.legs.nominal_length,
        leg_force=satellite.legs.strut_force(motion.length, motion.length_rate),
        control_torque=signals.torque_B,
        attitude_error=signals.attitude_error_B,
        singularity_measure=signals.singularity,
        joint_forces=joints,
        torque_share=signals.torque_share,
        rotor_angle=None if state.rotor is None else state.rotor.angle,
        rotor_speed=None if state.rotor is None else state.rotor.speed,
        rotor_torque=torque,
    )


def geometry_margin(satellite: Satellite, state: State) -> Float[Array, ""]:
    """How far the legs are from where their geometry ends; zero or less there [-].

    The smaller of: leg length over a tenth of its nominal value, less one; and the distance of
    each universal joint from locking, ``1 - (k.s)^2 - 1e-3``.
    """
    motion = leg_motion(satellite.legs, plate_motion(state))
    length = motion.length / (0.1 * satellite.legs.nominal_length) - 1.0
    return jnp.minimum(jnp.min(length), jnp.min(1.0 - motion.kappa**2 - 1e-3))
