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


def rotor_angles(satellite: Satellite, t: Float[Array, ""]) -> Float[Array, " cmg"]:
    """Rotor angles [rad] at time t [s]."""
    return satellite.cluster.rotor_phase + satellite.cluster.rotor_speed * t


def torque_axes(
    satellite: Satellite, gimbal_angle: Float[Array, " cmg"]
) -> tuple[Float[Array, "3 cmg"], Float[Array, ""]]:
    """Momentum derivatives dh/dgamma over the units' RMS momentum, plate axes, and that momentum.

    The RMS momentum [N m s] counts as 1 where no rotor turns.
    """
    cluster = satellite.cluster
    h_rms = jnp.sqrt(jnp.mean(cluster.momentum**2))
    h_rms = jnp.where(h_rms > 0.0, h_rms, 1.0)
    t_P = eqx.filter_vmap(ControlMomentGyro.R_PG)(cluster, gimbal_angle)[:, :, 1]
    return (cluster.momentum[:, None] * t_P).T / h_rms, h_rms


def control_signals(satellite: Satellite, t: Float[Array, ""], state: State) -> ControlSignals:
    """Controller, steering and gimbal servo at time t [s]."""
    reference = satellite.guidance.reference(t)
    error = attitude_error(reference.q_NR, state.q_NB)
    A, h_rms = torque_axes(satellite, state.gimbal_angle)

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
        share = jnp.ones(())
        if satellite.steering is not None:
            # the reaction of dh/dt on the plate is the torque, in the nominal pose of the plate
            momentum_rate = -quaternion_to_matrix(satellite.q_BP).T @ torque
            rate_command = satellite.steering.rates(A, momentum_rate / h_rms, t)
            share = satellite.servo.share(rate_command)
            rate_command = share * rate_command
        integral_rate = controller.integral_rate(error, asked, share * torque)
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
    each = satellite.disturbance.wrench(satellite.cluster, t, rotor_angle)
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
    phi = rotor_angles(satellite, t) if rotor_angle is None else rotor_angle
    signals = control_signals(satellite, t, state)
    plates = plate_motion(state)
    wrench = external_wrench(satellite, t, plates)
    if satellite.disturbance is not None:
        shaking = disturbance_wrench(satellite, t, state, phi, plates)
        wrench = jax.tree.map(jnp.add, wrench, shaking)
    return signals, accelerations(
        satellite, state, phi, signals.gimbal_acceleration, wrench, moments
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
    )


def initial_state(
    satellite: Satellite,
    q_NB: Float[Array, "4"],
    w_NB_B: Float[Array, "3"],
    gimbal_angle: Float[Array, " cmg"],
) -> State:
    """Plate and bus moving as one, the plate in its nominal pose, bus mass centre at rest at 0."""
    zero, none = jnp.zeros(3), jnp.zeros(4)
    state = State(
        zero, q_NB, zero, none, zero, w_NB_B, zero, zero, gimbal_angle, 0.0 * gimbal_angle, zero
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
