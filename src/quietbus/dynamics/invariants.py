"""Momentum and energy of the whole satellite, body by body.

A check of the equations of motion that shares nothing with their mass matrix: every body (bus,
plate, gimbal bodies, rotors, lower and upper leg parts) moves with its own mass-centre and angular
velocity, from the velocities of the points that carry it. All vectors in inertial components.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.state import State
from quietbus.model.cmg import ControlMomentGyro
from quietbus.model.satellite import Satellite
from quietbus.spatial.rotation import quaternion_to_matrix


class Motion(eqx.Module):
    """Mass and motion of bodies; every field has the bodies as its first axis."""

    mass: Float[Array, " body"]  # [kg]
    I_N: Float[Array, "body 3 3"]  # [kg m^2] about the mass centre
    p_N: Float[Array, "body 3"]  # [m] mass centre, from the inertial origin
    v_N: Float[Array, "body 3"]  # [m/s]
    w_N: Float[Array, "body 3"]  # [rad/s]


class Joints(eqx.Module):
    """Relative motion in the legs and their joints."""

    length: Float[Array, " leg"]  # [m]
    length_rate: Float[Array, " leg"]  # [m/s]
    w_leg_in_plate_N: Float[Array, "leg 3"]  # [rad/s]
    w_leg_in_bus_N: Float[Array, "leg 3"]  # [rad/s]


def linear_momentum_N(
    satellite: Satellite, rotor_angle: Float[Array, " cmg"], state: State
) -> Float[Array, "3"]:
    """Linear momentum [kg m/s]."""
    bodies = body_motions(satellite, rotor_angle, state)
    return bodies.mass @ bodies.v_N


def angular_momentum_N(
    satellite: Satellite, rotor_angle: Float[Array, " cmg"], state: State
) -> Float[Array, "3"]:
    """Angular momentum about the inertial origin [N m s]."""
    bodies = body_motions(satellite, rotor_angle, state)
    orbital = jnp.cross(bodies.p_N, bodies.mass[:, None] * bodies.v_N)
    return jnp.sum(orbital + jnp.einsum("bij,bj->bi", bodies.I_N, bodies.w_N), axis=0)


def kinetic_energy(
    satellite: Satellite, rotor_angle: Float[Array, " cmg"], state: State
) -> Float[Array, ""]:
    """Kinetic energy [J], that of the spinning rotors included."""
    bodies = body_motions(satellite, rotor_angle, state)
    linear = bodies.mass * jnp.sum(bodies.v_N**2, axis=1)
    return 0.5 * jnp.sum(linear + jnp.einsum("bi,bij,bj->b", bodies.w_N, bodies.I_N, bodies.w_N))


def strut_energy(satellite: Satellite, state: State) -> Float[Array, ""]:
    """Energy stored in the struts' springs [J]."""
    stretch = joint_motion(satellite, state).length - satellite.legs.free_length
    return 0.5 * jnp.sum(satellite.legs.stiffness * stretch**2)


def dissipated_power(satellite: Satellite, state: State) -> Float[Array, ""]:
    """Power [W] that dampers and joint friction take from the motion."""
    legs, joints = satellite.legs, joint_motion(satellite, state)
    return jnp.sum(
        legs.damping * joints.length_rate**2
        + legs.spherical_friction * jnp.sum(joints.w_leg_in_plate_N**2, axis=1)
        + legs.universal_friction * jnp.sum(joints.w_leg_in_bus_N**2, axis=1)
    )


def body_motions(satellite: Satellite, rotor_angle: Float[Array, " cmg"], state: State) -> Motion:
    """Mass and motion of all bodies: bus, plate, gimbal bodies, rotors, lower, upper leg parts."""
    R_NB, R_NP = quaternion_to_matrix(state.q_NB), quaternion_to_matrix(state.q_NP)
    w_B, w_P = R_NB @ state.w_NB_B, R_NP @ state.w_NP_P
    bus, plate = satellite.bus, satellite.plate
    r_Pcm = R_NP @ plate.p_PPcm_P
    two = Motion(
        jnp.stack([bus.mass, plate.mass]),
        jnp.stack([R_NB @ bus.I_BBcm_B @ R_NB.T, R_NP @ plate.I_PPcm_P @ R_NP.T]),
        jnp.stack([state.p_NB_N, state.p_NP_N + r_Pcm]),
        jnp.stack([state.v_NB_N, state.v_NP_N + jnp.cross(w_P, r_Pcm)]),
        jnp.stack([w_B, w_P]),
    )

    def unit(cmg, gamma, gamma_rate, phi, rotor_speed):
        return _cmg_motions(cmg, gamma, gamma_rate, phi, rotor_speed, state, R_NP, w_P)

    speed = satellite.cluster.rotor_speed if state.rotor is None else state.rotor.speed
    gimbals, rotors = jax.vmap(unit)(
        satellite.cluster, state.gimbal_angle, state.gimbal_rate, rotor_angle, speed
    )
    groups = (two, gimbals, rotors, *_leg_motions(satellite, state))
    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *groups)


def joint_motion(satellite: Satellite, state: State) -> Joints:
    """Lengths of the legs and their angular velocities in plate and bus."""
    ends = _leg_ends(satellite, state)
    length, length_rate, _, w_leg = _leg_rates(*ends)
    R_NP = quaternion_to_matrix(state.q_NP)
    return Joints(length, length_rate, w_leg - R_NP @ state.w_NP_P, w_leg - ends[-1])


def _cmg_motions(
    cmg: ControlMomentGyro, gamma, gamma_rate, phi, rotor_speed, state: State, R_NP, w_P
) -> tuple[Motion, Motion]:
    R_NG = R_NP @ cmg.R_PG(gamma)
    w_G = w_P + gamma_rate * R_NG[:, 2]
    R_NR = R_NG @ cmg.R_GR(phi)
    w_R = w_G + rotor_speed * R_NR[:, 0]
    r_C = R_NP @ cmg.p_PC_P
    p_C, v_C = state.p_NP_N + r_C, state.v_NP_N + jnp.cross(w_P, r_C)
    r_G, r_R = R_NG @ cmg.p_CGcm_G, R_NG @ cmg.p_CR_G
    e = cmg.eccentricity * R_NR[:, 1]
    gimbal = Motion(
        cmg.gimbal_mass,
        R_NG @ cmg.I_GGcm_G @ R_NG.T,
        p_C + r_G,
        v_C + jnp.cross(w_G, r_G),
        w_G,
    )
    rotor = Motion(
        cmg.rotor_mass,
        R_NR @ cmg.I_RRcm_R @ R_NR.T,
        p_C + r_R + e,
        v_C + jnp.cross(w_G, r_R) + jnp.cross(w_R, e),
        w_R,
    )
    return gimbal, rotor


def _leg_motions(satellite: Satellite, state: State) -> tuple[Motion, Motion]:
    ends = _leg_ends(satellite, state)
    p_A, v_A, p_U, v_U, _, _ = ends
    _, _, s, w = _leg_rates(*ends)
    ss = s[:, :, None] * s[:, None, :]
    parts = []
    for part, p, v, side in (
        (satellite.legs.lower, p_A, v_A, 1.0),
        (satellite.legs.upper, p_U, v_U, -1.0),
    ):
        across, along = part.transverse_inertia[:, None, None], part.axial_inertia[:, None, None]
        r = side * part.distance[:, None] * s
        inertia = across * (jnp.eye(3) - ss) + along * ss
        parts.append(Motion(part.mass, inertia, p + r, v + jnp.cross(w, r), w))
    return parts[0], parts[1]


def _leg_ends(satellite: Satellite, state: State):
    """Position and velocity of A and U, fixed axes k (leg 3), and the bus's angular velocity."""
    legs = satellite.legs
    R_NB, R_NP = quaternion_to_matrix(state.q_NB), quaternion_to_matrix(state.q_NP)
    w_B, w_P = R_NB @ state.w_NB_B, R_NP @ state.w_NP_P
    r_A, r_U = legs.p_BA_B @ R_NB.T, legs.p_PU_P @ R_NP.T
    return (
        state.p_NB_N + r_A,
        state.v_NB_N + jnp.cross(w_B, r_A),
        state.p_NP_N + r_U,
        state.v_NP_N + jnp.cross(w_P, r_U),
        legs.k_B @ R_NB.T,
        w_B,
    )


def _leg_rates(p_A, v_A, p_U, v_U, k, w_B):
    """Length [m], its rate, direction, angular velocity [rad/s] of the legs.

    Joint by joint: the leg turns in the bus at alpha about k and at beta about y = k x s. With
    ``d`` the velocity of s as the bus sees it, ``d = alpha y + beta (y x s)``, and y is normal to
    y x s, both of length ``abs(y)``.
    """
    span = p_U - p_A
    length = jnp.linalg.norm(span, axis=1)
    s = span / length[:, None]
    length_rate = _dot(s, v_U - v_A)
    d = (v_U - v_A - length_rate[:, None] * s) / length[:, None] - jnp.cross(w_B, s)
    y = jnp.cross(k, s)
    alpha, beta = _dot(d, y) / _dot(y, y), _dot(d, jnp.cross(y, s)) / _dot(y, y)
    w = w_B + alpha[:, None] * k + beta[:, None] * y
    return length, length_rate, s, w


def _dot(a: Float[Array, "leg 3"], b: Float[Array, "leg 3"]) -> Float[Array, " leg"]:
    return jnp.sum(a * b, axis=1)
