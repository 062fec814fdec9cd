"""The equations of motion against closed forms, symmetries and Newton's and Euler's laws."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

from oracles.satellites import awkward_satellite, paper_satellite, with_control, with_units
from oracles.two_bodies import changed, names_of, seen
from quietbus.dynamics.closed_loop import evaluate, initial_state, state_rate
from quietbus.dynamics.equations import moving
from quietbus.dynamics.invariants import kinetic_energy, rigid_parts
from quietbus.dynamics.outputs import joined, told
from quietbus.model.legs.rigid_parts import joint_motion
from quietbus.model.load import Constant, Load
from quietbus.spatial.inertia import point_inertia
from quietbus.spatial.rotation import (
    quaternion_multiply,
    quaternion_to_matrix,
    rotation_vector_to_quaternion,
)
from quietbus.validate.states import random_state, random_wrenches
from quietbus.validate.trajectory import fly, held_gimbals, load_on, massless_legs

quickly = settings(deadline=None, max_examples=10)
seeds = st.integers(0, 10_000)
vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(jnp.array)

T0 = jnp.float64(0.3)  # [s] time at which equations are compared: rotors in no special position
IDENTITY = jnp.array([1.0, 0.0, 0.0, 0.0])
MOUNTS = ["isolated", "rigid"]

rate_of = eqx.filter_jit(state_rate)
at_start = eqx.filter_jit(initial_state)
awkward = cache(awkward_satellite)


def at_rest(satellite):
    """Plate in its nominal pose, everything at the origin and at rest."""
    return at_start(satellite, IDENTITY, jnp.zeros(3), jnp.zeros(4))


def controlled(mount, seed):
    """A satellite with every term in play, its control aiming anywhere, and a random state."""
    rng = np.random.default_rng(seed)
    satellite = awkward(mount, imbalance=100.0)
    q_NR = rng.normal(size=4)
    satellite = aimed(satellite, jnp.asarray(q_NR / np.linalg.norm(q_NR)))
    satellite = replace(satellite, others=body_loads(rng.normal(size=(2, 3, 3))))
    return satellite, changed(random_state(satellite, rng), error_integral=rng.normal(size=3))


def aimed(satellite, q_NR):
    return with_control(satellite, guidance=replace(satellite.control.guidance, q_NR=q_NR))


def body_loads(vectors):
    """Force, torque and point of application on plate and bus, turning with them."""
    each = zip(("plate", "bus"), jnp.asarray(vectors), strict=True)
    return tuple(Load(f"on {body}", (body,), "body", *rows, Constant()) for body, rows in each)


def same_state(found, expected, atol):
    found = names_of(found)
    for name, value in names_of(expected).items():
        np.testing.assert_allclose(found[name], value, atol=atol, err_msg=name)


# --- closed forms ------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("h_z", [-300.0, 0.0, 300.0])
def test_free_axisymmetric_gyrostat_precesses_at_closed_form_rate(h_z):
    """w_x + i w_y turns at ((I_a - I_t) w_z + h_z) / I_t, over ten seconds.

    Balanced rotors spin along z, away from the axis; the bus is chosen so that the whole, platform
    and legs included, is axisymmetric about its mass centre.
    """
    I_t, I_a, w0 = 1300.0, 1700.0, np.array([0.05, -0.03, 0.4])
    satellite = held_gimbals(paper_satellite("rigid", imbalance=0.0))
    R_PG0 = jnp.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # s, t, g = z, x, y
    rotor = jnp.diag(jnp.array([0.5, 0.3, 0.3]))
    satellite = with_units(
        satellite,
        R_PG0=jnp.tile(R_PG0, (4, 1, 1)),
        I_RRcm_R=jnp.tile(rotor, (4, 1, 1)),
        rotor_speed=h_z / 0.5 * jnp.array([0.1, 0.2, 0.3, 0.4]),
    )
    bodies = rigid_parts(satellite, jnp.zeros(()), at_rest(satellite))
    center = bodies.mass @ bodies.p / jnp.sum(bodies.mass)
    others = (
        sum(
            I + point_inertia(m, p - center)
            for m, I, p in zip(bodies.mass, bodies.I, bodies.p, strict=True)
        )
        - satellite.bus.I_XXcm_X
    )
    inertia = jnp.diag(jnp.array([I_t, I_t, I_a])) - others
    assert np.linalg.eigvalsh(inertia).min() > 100.0
    satellite = with_bus(satellite, inertia)

    times = jnp.linspace(0.0, 10.0, 6)
    start = at_start(satellite, IDENTITY, jnp.asarray(w0), jnp.zeros(4))
    w = fly(satellite, start, times).bus.w_NX_X
    turning = ((I_a - I_t) * w0[2] + h_z) / I_t
    expected = (w0[0] + 1j * w0[1]) * np.exp(1j * turning * times)
    np.testing.assert_allclose(w[:, 0] + 1j * w[:, 1], expected, atol=1e-10)
    np.testing.assert_allclose(w[:, 2], w0[2], rtol=1e-10)


def with_bus(satellite, inertia, mass=None):
    """The satellite with another inertia, and mass, of its bus."""
    bus, *others = satellite.bodies
    bus = replace(bus, I_XXcm_X=inertia, mass_X=bus.mass_X if mass is None else mass)
    return replace(satellite, bodies=(bus, *others))


def moved(state, x, u):
    """The state at rest after displacements and turns x, with velocities and rates u (12 each)."""
    return changed(
        state,
        p_NP_N=state.bodies["plate"].p_NX_N + x[:3],
        q_NP=rotation_vector_to_quaternion(x[3:6]),
        p_NB_N=x[6:9],
        q_NB=rotation_vector_to_quaternion(x[9:]),
        v_NP_N=u[:3],
        w_NP_P=u[3:6],
        v_NB_N=u[6:9],
        w_NB_B=u[9:],
    )


@eqx.filter_jit
def _acceleration_along(satellite, x, u):
    state, zero = at_rest(satellite), jnp.zeros(12)

    def accelerations(x, u):
        rate = state_rate(satellite, jnp.zeros(()), moved(state, x, u))
        rate = seen(rate)
        return jnp.concatenate([rate.v_NP_N, rate.w_NP_P, rate.v_NB_N, rate.w_NB_B])

    value, derivative = jax.jvp(accelerations, (zero, zero), (x, u))
    return value, derivative


def linearized(satellite):
    """Derivatives of the twelve accelerations at rest by displacements and by velocities."""
    zero, unit = jnp.zeros(12), jnp.eye(12)
    by_x = np.stack([_acceleration_along(satellite, e, zero)[1] for e in unit], axis=1)
    by_u = np.stack([_acceleration_along(satellite, zero, e)[1] for e in unit], axis=1)
    return by_x, by_u


def _at_rest_under(satellite, wrenches=None):
    return _stopped(held_gimbals(satellite, wrenches))


@pytest.mark.parametrize(("damping_ratio", "peak"), [(0.1, 5.1228), (0.5, 1.4679), (1.0, 1.1547)])
def test_strut_transmits_force_as_the_single_axis_isolator(damping_ratio, peak):
    """Force on a heavy bus per force on the plate along z: (c s + k) / (M s^2 + c s + k).

    Eq. 1 of the paper with M = 82.8 kg and six struts at 1/sqrt(3) from z; the peaks are those of
    its figure 1. All curves pass through 1 at sqrt(2) times the natural frequency.
    """
    M, k = 82.8, 6 * 2e4 / 3
    c = 2.0 * damping_ratio * np.sqrt(k * M)
    satellite = massless_legs(paper_satellite(imbalance=0.0))
    satellite = with_bus(satellite, 1e10 * jnp.eye(3), jnp.float64(1e10))
    (legs,) = satellite.hexapods
    legs = replace(legs, strut=replace(legs.strut, damping=jnp.full(6, c / 2.0)))
    satellite = replace(satellite, hexapods=(legs,))
    by_x, by_u = linearized(_at_rest_under(satellite))
    along_z = load_on(satellite, "plate", [0.0, 0.0, 1.0])
    zero = jnp.zeros(12)
    by_force = np.asarray(_acceleration_along(_at_rest_under(satellite, along_z), zero, zero)[0])

    def transmitted(ratio):
        """At ratios of the natural frequency."""
        s = 1j * np.sqrt(k / M) * np.atleast_1d(ratio)[:, None, None]
        x = np.linalg.solve(s**2 * np.eye(12) - s * by_u - by_x, by_force[:, None])
        return 1e10 * (s**2 * x)[:, 8, 0], (c * s + k)[:, 0, 0] / (M * s**2 + c * s + k)[:, 0, 0]

    found, expected = transmitted(np.geomspace(0.01, 10.0, 301))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert np.abs(found).max() <= peak + 1e-4
    at_peak = np.sqrt(np.sqrt(1.0 + 8.0 * damping_ratio**2) - 1.0) / (2.0 * damping_ratio)
    assert np.abs(transmitted(at_peak)[0][0]) == pytest.approx(peak, abs=6e-5)
    assert np.abs(transmitted(np.sqrt(2.0))[0][0]) == pytest.approx(1.0, abs=1e-6)


def test_six_rigid_body_and_six_elastic_modes():
    """Small motions about rest: stiffness from the legs' directions, mass from kinetic energy."""
    satellite = _at_rest_under(paper_satellite())
    by_x, by_u = linearized(satellite)

    (hexapod,) = jax.tree.map(np.asarray, satellite.hexapods)
    legs = hexapod.geometry
    p_U, p_A = legs.p_PU_P + np.asarray(satellite.mounts[0].p_BX_B), legs.p_BA_B
    s = (p_U - p_A) / np.linalg.norm(p_U - p_A, axis=1, keepdims=True)
    stretch = np.hstack([s, np.cross(legs.p_PU_P, s), -s, -np.cross(p_A, s)])
    K = stretch.T @ (hexapod.strut.stiffness[:, None] * stretch)

    def energy(u):
        state = moved(at_rest(satellite), jnp.zeros(12), u)
        return kinetic_energy(satellite, jnp.zeros(()), state)

    unit = jnp.eye(12)
    pairs = (unit[:, None] + unit).reshape(-1, 12)
    sums, own = np.split(jax.jit(jax.vmap(energy))(jnp.concatenate([pairs, unit])), [144])
    M = sums.reshape(12, 12) - own[:, None] - own
    expected = eigh(K, M, eigvals_only=True)

    squares = np.sort(np.linalg.eigvals(-by_x).real)
    np.testing.assert_allclose(squares[6:], expected[6:], rtol=1e-9)
    assert squares[6] > 100.0
    assert np.abs(squares[:6]).max() < 1e-9 * squares[6]  # six motions without stiffness

    damped = np.linalg.eigvals(np.block([[np.zeros((12, 12)), np.eye(12)], [by_x, by_u]]))
    elastic = damped[np.abs(damped) > 1.0]
    assert len(elastic) == 12
    assert elastic.real.max() < -0.01
    # rigid-body poles lie at zero, twelve in six chains of two: computed to the square root
    assert np.sort(np.abs(damped))[11] < 1e-4


@pytest.mark.parametrize("unit", range(4))
@pytest.mark.parametrize("phi", [0.0, 1.0, 4.0])
def test_rotor_imbalance_shakes_a_heavy_bus_by_its_closed_forms(unit, phi):
    """m e Omega^2 outwards along the imbalance, and I_xy Omega^2 across it, on a rigid mount."""
    satellite = replace(paper_satellite("rigid"), others=body_loads(np.zeros((2, 3, 3))))
    speed = 200.0 * np.pi * (jnp.arange(4) == unit)
    satellite = with_units(satellite, rotor_speed=speed, rotor_phase=jnp.full(4, phi))
    satellite = with_bus(satellite, 1e11 * jnp.eye(3), jnp.float64(1e11))
    found = seen(rate_of(satellite, jnp.zeros(()), at_rest(satellite)))
    s, t, g = np.asarray(satellite.clusters[0].units.R_PG0[unit]).T
    outwards, across = np.cos(phi) * t + np.sin(phi) * g, np.cos(phi) * g - np.sin(phi) * t
    np.testing.assert_allclose(np.cross(s, outwards), across, atol=1e-12)
    force = 1.36e-5 * (200.0 * np.pi) ** 2 * outwards  # g cm in kg m
    arm = np.asarray(satellite.mounts[0].p_BX_B + satellite.clusters[0].units.p_PC_P[unit])
    torque = 17e-7 * (200.0 * np.pi) ** 2 * across  # g cm^2 in kg m^2
    np.testing.assert_allclose(1e11 * found.v_NB_N, force, atol=1e-6)
    np.testing.assert_allclose(1e11 * found.w_NB_B, torque + np.cross(arm, force), atol=1e-6)


def _stopped(satellite):
    return with_units(satellite, rotor_speed=jnp.zeros(4))


# --- symmetries --------------------------------------------------------------------------------


def in_rotated_space(satellite, state, q, shift, velocity):
    """Satellite, target and motion turned by q, moved and set moving in inertial space."""
    R, now = quaternion_to_matrix(q), names_of(state)
    turned = {}
    for name, value in now.items():
        if name.startswith("p_"):
            turned[name] = R @ value + shift
        elif name.startswith("v_"):
            turned[name] = R @ value + velocity
        elif name.startswith("q_"):
            turned[name] = quaternion_multiply(q, value)
    target = quaternion_multiply(q, satellite.control.guidance.q_NR)
    return aimed(satellite, target), changed(state, **turned)


def rate_in_rotated_space(rate, q, velocity):
    zero = jnp.zeros(3)
    _, turned = in_rotated_space(controlled("rigid", 0)[0], rate, q, velocity, zero)
    return turned


@pytest.mark.parametrize("mount", MOUNTS)
@quickly
@given(seed=seeds, turn=vectors, shift=vectors, velocity=vectors)
def test_space_has_no_preferred_direction_place_or_velocity(mount, seed, turn, shift, velocity):
    satellite, state = controlled(mount, seed)
    q = rotation_vector_to_quaternion(turn)
    found = rate_of(*_at(T0, *in_rotated_space(satellite, state, q, shift, velocity)))
    expected = rate_in_rotated_space(rate_of(satellite, T0, state), q, velocity)
    same_state(found, expected, atol=1e-8)


def _at(t, satellite, state):
    return satellite, t, state


def mirrored(satellite, state):
    """Satellite and motion seen in a mirror in the xz plane.

    A position or force v is seen as S v with S = diag(1, -1, 1), an angular velocity or torque as
    -S w, a body's attitude R and its inertia I as S R S and S I S. A CMG's spin and gimbal axes
    stand for angular velocities, so they are seen as -S s and -S g, and t = g x s as -S t: its
    angles and speeds stay as they are, and what it holds changes sides in its own frame.
    """
    S = jnp.array([1.0, -1.0, 1.0])
    both, turned = S[:, None] * S, jnp.array([1.0, -1.0, 1.0, -1.0])  # of matrices, quaternions
    bodies = tuple(
        replace(body, p_XXcm_X=S * body.p_XXcm_X, I_XXcm_X=both * body.I_XXcm_X)
        for body in satellite.bodies
    )
    (legs,), (mount,), (cluster,) = satellite.hexapods, satellite.mounts, satellite.clusters
    joints, units = legs.geometry, cluster.units
    joints = replace(joints, p_PU_P=S * joints.p_PU_P, p_BA_B=S * joints.p_BA_B, k_B=S * joints.k_B)
    units = replace(
        units,
        p_PC_P=S * units.p_PC_P,
        R_PG0=-S[:, None] * units.R_PG0,
        p_CGcm_G=-units.p_CGcm_G,
        p_CR_G=-units.p_CR_G,
        eccentricity=-units.eccentricity,
    )
    loads = tuple(
        replace(load, force=S * load.force, torque=-S * load.torque, point=S * load.point)
        for load in satellite.others
    )
    seen = replace(
        satellite,
        bodies=bodies,
        mounts=(replace(mount, p_BX_B=S * mount.p_BX_B, q_BX=turned * mount.q_BX),),
        hexapods=(replace(legs, geometry=joints),),
        clusters=(replace(cluster, units=units),),
        others=loads,
    )
    return aimed(seen, turned * satellite.control.guidance.q_NR), mirrored_state(state)


def mirrored_state(state):
    """Also of a state's rate."""
    S, turned = jnp.array([1.0, -1.0, 1.0]), jnp.array([1.0, -1.0, 1.0, -1.0])
    factor = {"p": S, "v": S, "q": turned, "w": -S, "error": -S}
    now = names_of(state)
    seen = {name: factor.get(name.split("_")[0], 1.0) * value for name, value in now.items()}
    return changed(state, **seen)


@pytest.mark.parametrize("mount", MOUNTS)
@quickly
@given(seed=seeds)
def test_mirrored_satellite_has_mirrored_accelerations(mount, seed):
    satellite, state = controlled(mount, seed)
    found = rate_of(*_at(T0, *mirrored(satellite, state)))
    same_state(found, mirrored_state(rate_of(satellite, T0, state)), atol=1e-8)


@pytest.mark.parametrize("mount", MOUNTS)
@quickly
@given(seed=seeds, leg_order=st.permutations(range(6)), cmg_order=st.permutations(range(4)))
def test_labels_of_legs_and_cmgs_mean_nothing(mount, seed, leg_order, cmg_order):
    satellite, state = controlled(mount, seed)
    legs, cmgs = np.array(leg_order), np.array(cmg_order)

    def relabelled(state):
        gimbals = (state.own["cluster"].y[cmgs], state.own["cluster"].y_rate[cmgs])
        return changed(state, gimbal_angle=gimbals[0], gimbal_rate=gimbals[1])

    units = jax.tree.map(lambda value: value[cmgs], satellite.clusters[0].units)
    other = replace(
        with_units(satellite, **vars(units)),
        hexapods=jax.tree.map(lambda value: value[legs], satellite.hexapods),
    )
    found = rate_of(other, T0, relabelled(state))
    same_state(found, relabelled(rate_of(satellite, T0, state)), atol=1e-8)


@pytest.mark.slow
def test_motion_is_the_same_in_rotated_space_and_mirrored_in_a_mirror():
    """Fifty milliseconds, five turns of the rotors, with strong imbalance."""
    satellite, state = controlled("isolated", 1)
    times = jnp.array([0.0, 0.05])
    end = jax.tree.map(lambda value: value[-1], fly(satellite, state, times, 1e-11))
    assert np.abs(end.bodies["plate"].v_NX_N - state.bodies["plate"].v_NX_N).max() > 0.1

    q, shift = rotation_vector_to_quaternion(jnp.array([0.5, 1.5, -1.0])), jnp.ones(3)
    other, start = in_rotated_space(satellite, state, q, shift, jnp.zeros(3))
    found = jax.tree.map(lambda value: value[-1], fly(other, start, times, 1e-11))
    same_state(found, in_rotated_space(satellite, end, q, shift, jnp.zeros(3))[1], atol=1e-8)

    found = jax.tree.map(lambda value: value[-1], fly(*mirrored(satellite, state), times, 1e-11))
    same_state(found, mirrored_state(end), atol=1e-8)


# --- joints ------------------------------------------------------------------------------------


def balances(satellite, state, rate):
    """Rates of linear and angular momentum of all bodies; joint forces and motion."""
    *rates, forces, joints = _balances(satellite, state, rate)
    return *rates, SimpleNamespace(**forces), SimpleNamespace(**joints)


@eqx.filter_jit
def _balances(satellite, state, rate):

    def momenta(t, state):
        bodies = rigid_parts(satellite, t, state)
        linear = bodies.mass[:, None] * bodies.v
        angular = jnp.cross(bodies.p, linear) + jnp.einsum("bij,bj->bi", bodies.I, bodies.w)
        return linear, angular

    _, rates = jax.jvp(momenta, (T0, state), (jnp.ones(()), rate))
    found = joined(told(satellite, state, evaluate(satellite, T0, state), detailed=True))
    return *rates, found, _joints(satellite, state)


def _joints(satellite, state):
    """Motion of the legs, and how they turn in plate and bus."""
    now = moving(satellite, T0, state)
    P, B = now.motions["plate"], now.motions["bus"]
    joints = joint_motion(satellite.hexapods[0].geometry, P, B)
    relative = {"w_leg_in_plate_N": joints.w - P.w, "w_leg_in_bus_N": joints.w - B.w}
    return {"length": joints.length, "length_rate": joints.length_rate, **relative}


# where the rigid parts of each are: the order of the elements
BUS, PLATE, LOWER, UPPER, UNITS = (
    slice(0, 1),
    slice(1, 2),
    slice(2, 8),
    slice(8, 14),
    slice(14, 22),
)


def joint_case(seed):
    satellite, state = controlled("isolated", seed)
    R_NB = quaternion_to_matrix(state.bus.q_NX)
    R_NP = quaternion_to_matrix(state.bodies["plate"].q_NX)
    wrench = [_pushed(load, R) for load, R in zip(satellite.others, (R_NP, R_NB), strict=True)]
    p_U = np.asarray(state.bodies["plate"].p_NX_N + satellite.hexapods[0].geometry.p_PU_P @ R_NP.T)
    p_A = np.asarray(state.bus.p_NX_N + satellite.hexapods[0].geometry.p_BA_B @ R_NB.T)
    linear, angular, forces, joints = balances(satellite, state, rate_of(satellite, T0, state))
    friction_U = -satellite.hexapods[0].bodies.spherical_friction[:, None] * joints.w_leg_in_plate_N
    friction_A = -satellite.hexapods[0].bodies.universal_friction[:, None] * joints.w_leg_in_bus_N
    at_U = forces.spherical_force, np.cross(p_U, forces.spherical_force) + friction_U
    moment = forces.universal_moment[:, None] * forces.universal_axis
    at_A = forces.universal_force, np.cross(p_A, forces.universal_force) + friction_A + moment
    return (
        satellite,
        state,
        wrench,
        (np.asarray(linear), np.asarray(angular)),
        at_U,
        at_A,
        forces,
        joints,
    )


@pytest.mark.parametrize("seed", range(3))
def test_joint_forces_are_what_moves_each_leg(seed):
    """Newton and Euler for each leg alone: F_s + F_u, their moments, M_u and friction."""
    _, _, _, rates, at_U, at_A, *_ = joint_case(seed)
    for rate, upper, lower in zip(rates, at_U, at_A, strict=True):
        of_leg = rate[LOWER] + rate[UPPER]
        assert np.abs(of_leg).max() > 1.0
        np.testing.assert_allclose(upper + lower, of_leg, atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_joint_forces_and_loads_are_what_moves_plate_and_bus(seed):
    """Newton and Euler for the plate with all its CMGs, and for the bus, spinning and tumbling."""
    _, state, (on_plate, on_bus), rates, at_U, at_A, *_ = joint_case(seed)
    tolerance = {"rtol": 1e-9, "atol": 1e-7}
    for name, (force, torque), joints, parts in (
        ("plate", on_plate, at_U, (PLATE, UNITS)),
        ("bus", on_bus, at_A, (BUS,)),
    ):
        linear, angular = (sum(rate[part].sum(0) for part in parts) for rate in rates)
        moment = torque + np.cross(state.bodies[name].p_NX_N, force)
        np.testing.assert_allclose(linear, force - joints[0].sum(0), **tolerance)
        np.testing.assert_allclose(angular, moment - joints[1].sum(0), **tolerance)


def _pushed(load, R_NX):
    """Force and torque of a constant load about its body's origin, inertial."""
    force = np.asarray(R_NX @ load.force)
    return force, np.asarray(R_NX @ load.torque) + np.cross(R_NX @ load.point, force)


@pytest.mark.parametrize("seed", range(3))
def test_struts_alone_push_the_upper_parts_along_the_legs(seed):
    """Along s: m_u a_u = F_s - (k stretch + c stretch rate) s. h is normal to both joint axes."""
    satellite, state, _, (linear, _), at_U, _, forces, joints = joint_case(seed)
    legs = satellite.hexapods[0].geometry
    s = _directions(satellite, state)
    along = np.sum(s * (at_U[0] - linear[UPPER]), axis=1)
    tension = _tension(satellite, joints)
    np.testing.assert_allclose(along, tension, atol=1e-8)
    k = np.asarray(legs.k_B @ quaternion_to_matrix(state.bus.q_NX).T)
    np.testing.assert_allclose(np.sum(forces.universal_axis * k, axis=1), np.zeros(6), atol=1e-12)
    np.testing.assert_allclose(
        np.sum(forces.universal_axis * np.cross(k, s), axis=1), np.zeros(6), atol=1e-12
    )
    np.testing.assert_allclose(
        np.linalg.norm(forces.universal_axis, axis=1), np.ones(6), rtol=1e-12
    )


def test_massless_legs_carry_their_strut_force_and_nothing_else():
    satellite, state = controlled("isolated", 4)
    satellite = massless_legs(satellite)
    _, _, forces, joints = balances(satellite, state, rate_of(satellite, T0, state))
    tension = _tension(satellite, joints)
    expected = tension[:, None] * _directions(satellite, state)
    np.testing.assert_allclose(forces.spherical_force, expected, atol=1e-9)
    np.testing.assert_allclose(forces.universal_force, -expected, atol=1e-9)
    np.testing.assert_allclose(forces.universal_moment, np.zeros(6), atol=1e-9)


def _tension(satellite, joints):
    strut = satellite.hexapods[0].strut
    return (
        strut.stiffness * (joints.length - strut.free_length) + strut.damping * joints.length_rate
    )


def _directions(satellite, state):
    bus, plate, legs = state.bus, state.bodies["plate"], satellite.hexapods[0].geometry
    R_NB, R_NP = quaternion_to_matrix(bus.q_NX), quaternion_to_matrix(plate.q_NX)
    p_U, p_A = plate.p_NX_N + legs.p_PU_P @ R_NP.T, bus.p_NX_N + legs.p_BA_B @ R_NB.T
    return np.asarray((p_U - p_A) / jnp.linalg.norm(p_U - p_A, axis=1, keepdims=True))


# --- rigid mount -------------------------------------------------------------------------------


def test_rigid_mount_holds_the_plate_where_the_bus_has_it():
    """What is told of the plate, under loads and strong imbalance, gimbals turning: Poisson."""
    satellite = awkward("rigid", imbalance=100.0)
    rng = np.random.default_rng(2)
    state = random_state(satellite, rng)
    satellite = held_gimbals(satellite, random_wrenches(satellite, rng))
    states = fly(satellite, state, jnp.linspace(0.0, 0.5, 6))
    assert np.abs(states.bus.w_NX_X - state.bus.w_NX_X).max() > 1e-3
    (mount,) = satellite.mounts
    for i in range(6):
        now = jax.tree.map(lambda value, i=i: value[i], states)
        plate = moving(satellite, T0, now).motions["plate"]
        R_NB = np.asarray(quaternion_to_matrix(now.bus.q_NX))
        arm, w = R_NB @ mount.p_BX_B, R_NB @ now.bus.w_NX_X
        np.testing.assert_allclose(plate.p, now.bus.p_NX_N + arm, atol=1e-12)
        np.testing.assert_allclose(plate.v, now.bus.v_NX_N + np.cross(w, arm), atol=1e-12)
        np.testing.assert_allclose(plate.w, w, atol=1e-12)
        R_NP = R_NB @ quaternion_to_matrix(mount.q_BX)
        np.testing.assert_allclose(plate.R_AX, R_NP, atol=1e-12)
