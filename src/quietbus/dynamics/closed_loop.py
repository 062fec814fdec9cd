"""The controlled satellite as one ordinary differential equation."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.equations import Accelerations, Wrench, accelerations, plate_motion
from quietbus.dynamics.kinematics import PlateMotion
from quietbus.dynamics.state import State
from quietbus.model.cmg import ClusterMoments, ControlMomentGyro
from quietbus.model.disturbance import on_plate
from quietbus.model.rotor import RotorState, WheelMotors
from quietbus.model.satellite import Satellite
from quietbus.model.steering import singularity_measure
from quietbus.spatial.rotation import (
    attitude_error,
    quaternion_conjugate,
    quaternion_multiply,
    quaternion_rate,
    quaternion_to_matrix,
)
from quietbus.spatial.vector import rotate


class ControlSignals(eqx.Module):
    """What the attitude control and the steering decide at one instant."""

    attitude_error_B: Float[Array, "3"]  # [rad]
    torque_B: Float[Array, "3"]  # [N m] commanded, within the torque limit
    integral_rate: Float[Array, "3"]  # [rad]
    gimbal_rate_command: Float[Array, " cmg"]  # [rad/s] within the rate limit
    gimbal_acceleration: Float[Array, " cmg"]  # [rad/s^2]
    singularity: Float[Array, ""]  # [-]
    rotor_acceleration: Float[Array, " cmg"] | None = None  # [rad/s^2], where speeds change
    torque_share: Float[Array, ""] | None = None  # [-] as of ``share_along``, where units act


def rotor_angles(satellite: Satellite, t: Float[Array, ""], state: State) -> Float[Array, " cmg"]:
    """Rotor angles [rad] at time t [s]."""
    if state.rotor is not None:
        return state.rotor.angle
    return satellite.cluster.rotor_phase + satellite.cluster.rotor_speed * t


def torque_axes(
    satellite: Satellite,
    gimbal_angle: Float[Array, " cmg"],
    rotor_speed: Float[Array, " cmg"] | None = None,
) -> tuple[Float[Array, "3 cmg"], Float[Array, ""]]:
    """What the units' motion does to the momentum: axes in the plate, and their scale.

    CMGs: momentum derivatives dh/dgamma over the units' RMS momentum, and that momentum [N m s],
    which counts as 1 where no rotor turns. Wheels: spin axes times the motors' weights, and 1.

    Args:
        rotor_speed: (cmg,) [rad/s], instead of the nominal one.
    """
    cluster = satellite.cluster
    R_PG = eqx.filter_vmap(ControlMomentGyro.R_PG)(cluster, gimbal_angle)
    if isinstance(cluster.drive, WheelMotors):
        return R_PG[:, :, 0].T * cluster.drive.weights, jnp.ones(())
    momentum = cluster.momentum
    if rotor_speed is not None:
        momentum = cluster.I_RRcm_R[:, 0, 0] * rotor_speed
    h_rms = jnp.sqrt(jnp.mean(momentum**2))
    h_rms = jnp.where(h_rms > 0.0, h_rms, 1.0)
    return (momentum[:, None] * R_PG[:, :, 1]).T / h_rms, h_rms


def share_along(delivered: Float[Array, "3"], asked: Float[Array, "3"]) -> Float[Array, ""]:
    """Part of a torque that is delivered along its own direction; 1 where nothing is asked."""
    square = asked @ asked
    return jnp.where(square > 0.0, delivered @ asked / jnp.where(square > 0.0, square, 1.0), 1.0)


def control_signals(satellite: Satellite, t: Float[Array, ""], state: State) -> ControlSignals:
    """Controller, steering and gimbal servo at time t [s]."""
    reference = satellite.guidance.reference(t)
    error = attitude_error(reference.q_NR, state.q_NB)
    rotor, drive = state.rotor, satellite.cluster.drive
    A, h_rms = torque_axes(satellite, state.gimbal_angle, None if rotor is None else rotor.speed)

    rotor_acceleration = torque_share = None
    if rotor is not None:
        rotor_acceleration = jnp.zeros_like(rotor.speed)
        if satellite.cluster.run_up is not None:
            rotor_acceleration = satellite.cluster.run_up.acceleration(t)
    rate_command = jnp.zeros_like(state.gimbal_rate)
    torque = integral_rate = jnp.zeros(3)
    controller = satellite.controller
    if controller is not None:
        q_BR = quaternion_multiply(quaternion_conjugate(state.q_NB), reference.q_NR)
        R_BR = quaternion_to_matrix(q_BR)
        rate_error = state.w_NB_B - R_BR @ reference.w_NR_R
        asked = controller.torque_B(
            error, state.error_integral, rate_error, R_BR @ reference.dw_NR_R
        )
        torque = controller.limited(asked)
        delivered = torque
        if satellite.steering is not None:
            # the reaction of dh/dt on the plate is the torque, in the nominal pose of the plate
            R_BP = quaternion_to_matrix(satellite.q_BP)
            command = satellite.steering.rates(A, -R_BP.T @ torque / h_rms, t)
            if isinstance(drive, WheelMotors):
                assert rotor is not None
                wheel_torque = drive.weights * command
                wheel_torque = drive.share(wheel_torque) * wheel_torque
                wheel_torque = drive.within_speed(wheel_torque, rotor.speed)
                delivered = -R_BP @ A @ (wheel_torque / drive.weights)
                torque_share = share_along(delivered, torque)
                rotor_acceleration = wheel_torque / satellite.cluster.I_RRcm_R[:, 0, 0]
            else:
                share = satellite.servo.share(command)
                rate_command, delivered = share * command, share * torque
                torque_share = share_along(-h_rms * (R_BP @ A @ rate_command), torque)
        integral_rate = controller.integral_rate(error, asked, delivered)
    acceleration = satellite.servo.acceleration(rate_command, state.gimbal_rate)
    if satellite.motor is not None:
        gimbals = (state.gimbal_angle, state.gimbal_rate)
        acceleration += satellite.motor.acceleration(satellite.cluster, *gimbals)
    return ControlSignals(
        error,
        torque,
        integral_rate,
        rate_command,
        acceleration,
        singularity_measure(A),
        rotor_acceleration,
        torque_share,
    )


def external_wrench(satellite: Satellite, t: Float[Array, ""], plates: PlateMotion) -> Wrench:
    """Sum of all external loads at time t [s]."""
    attitude = {"bus": plates.R_NB, "plate": plates.R_NP}
    total = Wrench.zero()
    for load in satellite.loads:
        force, torque = load.wrench(t, attitude[load.body])
        zero = jnp.zeros(3)
        on = (zero, zero, force, torque) if load.body == "bus" else (force, torque, zero, zero)
        total = jax.tree.map(jnp.add, total, Wrench(*on))
    return total


def disturbance_wrench(
    satellite: Satellite,
    t: Float[Array, ""],
    state: State,
    rotor_angle: Float[Array, " cmg"],
    plates: PlateMotion,
) -> Wrench:
    """What the rotors do to the plate beyond their imbalance (``model.disturbance``)."""
    assert satellite.disturbance is not None
    speed = satellite.cluster.rotor_speed if state.rotor is None else state.rotor.speed
    each = satellite.disturbance.wrench(satellite.cluster, t, rotor_angle, speed)
    on_P = on_plate(satellite.cluster, state.gimbal_angle, each[:, None])
    force, torque = jnp.sum(on_P, axis=(0, 1)).reshape(2, 3)
    zero = jnp.zeros(3)
    return Wrench(rotate(plates.R_NP, force), rotate(plates.R_NP, torque), zero, zero)


def evaluate(
    satellite: Satellite,
    t: Float[Array, ""],
    state: State,
    rotor_angle: Float[Array, " cmg"] | None = None,
    moments: ClusterMoments | None = None,
) -> tuple[ControlSignals, Accelerations]:
    """Control decisions and accelerations at time t [s]; rotor angles as given or those of t."""
    phi = rotor_angles(satellite, t, state) if rotor_angle is None else rotor_angle
    signals = control_signals(satellite, t, state)
    plates = plate_motion(state)
    wrench = external_wrench(satellite, t, plates)
    if satellite.disturbance is not None:
        shaking = disturbance_wrench(satellite, t, state, phi, plates)
        wrench = jax.tree.map(jnp.add, wrench, shaking)
    return signals, accelerations(
        satellite,
        state,
        phi,
        signals.gimbal_acceleration,
        wrench,
        moments,
        signals.rotor_acceleration,
    )


def state_rate(
    satellite: Satellite,
    t: Float[Array, ""],
    state: State,
    rotor_angle: Float[Array, " cmg"] | None = None,
    moments: ClusterMoments | None = None,
) -> State:
    """Time derivative of the state (arguments as of ``evaluate`` and ``accelerations``)."""
    signals, acceleration = evaluate(satellite, t, state, rotor_angle, moments)
    R_NB, R_NP = quaternion_to_matrix(state.q_NB), quaternion_to_matrix(state.q_NP)
    rotor = None
    if state.rotor is not None:
        assert signals.rotor_acceleration is not None
        rotor = RotorState(angle=state.rotor.speed, speed=signals.rotor_acceleration)
    return State(
        p_NB_N=state.v_NB_N,
        q_NB=quaternion_rate(state.q_NB, state.w_NB_B),
        p_NP_N=state.v_NP_N,
        q_NP=quaternion_rate(state.q_NP, state.w_NP_P),
        v_NB_N=acceleration.v_B,
        w_NB_B=rotate(R_NB.T, acceleration.w_B),
        v_NP_N=acceleration.v_P,
        w_NP_P=rotate(R_NP.T, acceleration.w_P),
        gimbal_angle=state.gimbal_rate,
        gimbal_rate=signals.gimbal_acceleration,
        error_integral=signals.integral_rate,
        rotor=rotor,
    )


def initial_state(
    satellite: Satellite,
    q_NB: Float[Array, "4"],
    w_NB_B: Float[Array, "3"],
    gimbal_angle: Float[Array, " cmg"],
) -> State:
    """Plate and bus moving as one, the plate in its nominal pose, bus mass centre at rest at 0."""
    zero, none = jnp.zeros(3), jnp.zeros(4)
    cluster, rotor = satellite.cluster, None
    if cluster.drive is not None:
        run_up = cluster.run_up
        speed = cluster.rotor_speed if run_up is None else run_up.initial_speed
        rotor = RotorState(cluster.rotor_phase, speed)
    still = 0.0 * gimbal_angle
    state = State(
        zero, q_NB, zero, none, zero, w_NB_B, zero, zero, gimbal_angle, still, zero, rotor
    )
    return with_plate_on_bus(satellite, state)


def with_plate_on_bus(satellite: Satellite, state: State) -> State:
    """The state with the plate in its nominal pose, moving with the bus as one body."""
    R_NB = quaternion_to_matrix(state.q_NB)
    return eqx.tree_at(
        lambda s: (s.p_NP_N, s.q_NP, s.v_NP_N, s.w_NP_P),
        state,
        (
            state.p_NB_N + R_NB @ satellite.p_BP_B,
            quaternion_multiply(state.q_NB, satellite.q_BP),
            state.v_NB_N + R_NB @ jnp.cross(state.w_NB_B, satellite.p_BP_B),
            quaternion_to_matrix(satellite.q_BP).T @ state.w_NB_B,
        ),
    )
