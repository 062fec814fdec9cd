"""A satellite of many parts: what cannot matter does not, and momentum stays."""

import itertools
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.many_bodies import many_parts
from quietbus.dynamics.closed_loop import decide, initial_state, state_rate
from quietbus.dynamics.coefficients import slow_motion
from quietbus.dynamics.invariants import angular_momentum_N, linear_momentum_N
from quietbus.dynamics.linearize import OperatingPoint, linearize
from quietbus.dynamics.vibration import vibration
from quietbus.model.body import Body, Mount
from quietbus.model.variants import at_rest
from quietbus.spatial.inertia import point_inertia
from quietbus.spatial.rotation import (
    quaternion_conjugate,
    quaternion_multiply,
    quaternion_to_matrix,
)
from quietbus.validate.flight import over_time
from quietbus.validate.states import kicked_state, random_state
from quietbus.validate.trajectory import fly

T0 = jnp.asarray(0.4)
rate_of = eqx.filter_jit(state_rate)


def states(satellite, count=3):
    rng = np.random.default_rng(4)
    return [random_state(satellite, rng) for _ in range(count)]


def same_rates(found, expected, rtol=1e-10):
    """Of every body and element that both have."""
    for kind in ("bodies", "own"):
        theirs, ours = getattr(expected, kind), getattr(found, kind)
        assert theirs
        for name in theirs:
            for one, other in zip(*map(jax.tree.leaves, (ours[name], theirs[name])), strict=True):
                size = np.max(np.abs(other), initial=1.0)
                np.testing.assert_allclose(one, other, rtol=0, atol=rtol * size, err_msg=name)


# --- order -------------------------------------------------------------------------------------


def reordered(satellite):
    """The same satellite with bodies, mounts, hexapods and clusters told in another order."""
    bus, north, south, bench = satellite.bodies
    control = replace(satellite.control, actuators=satellite.control.actuators[::-1])
    return replace(
        satellite,
        bodies=(bus, bench, south, north),
        mounts=satellite.mounts[::-1],
        hexapods=satellite.hexapods[::-1],
        clusters=satellite.clusters[::-1],
        control=control,
    )


@pytest.mark.parametrize("welded", [(), ("south",)])
def test_order_of_bodies_and_elements_does_not_matter(welded):
    satellite = many_parts(welded)
    for state in states(satellite):
        same_rates(rate_of(reordered(satellite), T0, state), rate_of(satellite, T0, state))


def test_order_of_legs_and_units_does_not_matter():
    satellite = many_parts()
    legs, three, two = np.array([3, 1, 5, 0, 4, 2]), np.array([2, 0, 1]), np.array([1, 0])
    mixed = lambda tree, order: jax.tree.map(lambda leaf: leaf[order], tree)  # noqa: E731
    cmgs, wheels, *others = satellite.clusters
    other = replace(
        satellite,
        hexapods=tuple(mixed(hexapod, legs) for hexapod in satellite.hexapods),
        clusters=(
            replace(cmgs, units=mixed(cmgs.units, three)),
            _reordered_wheels(wheels, two, mixed),
            *others,
        ),
    )

    def relabelled(state):
        own = {
            name: jax.tree.map(
                lambda leaf, o=order: leaf[o] if len(leaf) else leaf, state.own[name]
            )
            for name, order in (("cmgs", three), ("wheels", two))
        }
        return replace(state, own=state.own | own)

    for state in states(satellite):
        found = rate_of(other, T0, relabelled(state))
        same_rates(found, relabelled(rate_of(satellite, T0, state)))


def _reordered_wheels(wheels, order, mixed):
    parts = {name: mixed(getattr(wheels, name), order) for name in ("units", "gimbals", "rotors")}
    return replace(wheels, **parts)


# --- one body in two ---------------------------------------------------------------------------


def split(satellite, name, hexapod=None):
    """A body in two that are welded together, mass and inertia shared out.

    Args:
        hexapod: name of one whose feet are on the second part.
    """
    rng = np.random.default_rng(2)
    whole = satellite.body(name)
    arm, turn = jnp.array([0.4, -0.3, 0.2]), jnp.array(rng.normal(size=4))
    mount = Mount("part", name, arm, turn / jnp.linalg.norm(turn), True)
    R = quaternion_to_matrix(mount.q_BX)
    cm, inertia = jnp.array([0.05, 0.02, -0.01]), 0.1 * jnp.diag(jnp.array([1.0, 2.0, 1.5]))
    second = Body("part", 0.3 * whole.mass_X, cm, inertia)
    place = arm + R @ cm  # of its mass centre in the first
    mass = whole.mass_X - second.mass_X
    left = (whole.mass_X * whole.p_XXcm_X - second.mass_X * place) / mass
    about_origin = whole.I_XXcm_X + point_inertia(whole.mass_X, whole.p_XXcm_X)
    about_origin = about_origin - R @ inertia @ R.T - point_inertia(second.mass_X, place)
    first = Body(name, mass, left, about_origin - point_inertia(mass, left))
    hexapods = tuple(
        _on_part(each, mount, R) if each.name == hexapod else each for each in satellite.hexapods
    )
    mounts = satellite.mounts
    if hexapod:  # what stood on the first part stands on the second
        mounts = tuple(
            replace(m, base="part", p_BX_B=R.T @ (m.p_BX_B - arm), q_BX=_seen(mount, m))
            if m.body in hexapod.split()
            else m
            for m in mounts
        )
        mounts = (mount, *mounts)
    else:
        mounts = (*mounts, mount)
    bodies = tuple(first if body.name == name else body for body in satellite.bodies)
    return replace(satellite, bodies=(*bodies, second), mounts=mounts, hexapods=hexapods)


def _seen(mount, other):
    return quaternion_multiply(quaternion_conjugate(mount.q_BX), other.q_BX)


def _on_part(hexapod, mount, R):
    joints = hexapod.geometry
    moved = replace(joints, p_BA_B=(joints.p_BA_B - mount.p_BX_B) @ R, k_B=joints.k_B @ R)
    return replace(hexapod, hosts=(hexapod.hosts[0], "part"), geometry=moved)


CASES = [
    ("bus", None, ()),
    ("north", None, ()),
    ("bus", "legs of bench", ()),
    ("bus", "legs of south", ("south",)),  # a weld on a weld
]


@pytest.mark.parametrize(("name", "hexapod", "welded"), CASES)
def test_splitting_a_body_into_two_welded_ones_changes_no_acceleration(name, hexapod, welded):
    satellite = many_parts(welded)
    parts = split(satellite, name, hexapod)
    for state in states(satellite):
        same_rates(rate_of(parts, T0, state), rate_of(satellite, T0, state))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "hexapod", "welded"), CASES[1::2])
def test_splitting_a_body_changes_no_linear_model_and_no_vibration(name, hexapod, welded):
    satellite = at_rest(many_parts(welded))
    parts = split(satellite, name, hexapod)
    point = OperatingPoint(np.zeros(3), np.zeros(satellite.count))
    one, two = (linearize(each, point, "ideal") for each in (satellite, parts))
    assert one.states == two.states
    np.testing.assert_allclose(two.A, one.A, atol=1e-10 * np.abs(one.A).max())
    outputs = [name for name in one.outputs if name.startswith(("leg_", "bus_acc"))]
    ours, theirs = (model.select(list(one.inputs), outputs) for model in (two, one))
    np.testing.assert_allclose(ours.C, theirs.C, atol=1e-10 * np.abs(theirs.C).max())
    np.testing.assert_allclose(ours.D, theirs.D, atol=1e-10 * np.abs(theirs.D).max())

    def matrices(satellite, state):
        averaged = satellite.averaged()
        slow = steady(slow_motion(averaged, T0, state))
        found = vibration(averaged, slow)
        return found.M, found.C, found.K

    rate = jnp.array([0.1, -0.05, 0.2])
    angles = jnp.linspace(-1.0, 1.0, satellite.count)
    state = initial_state(satellite, jnp.array([1.0, 0.0, 0.0, 0.0]), rate, angles)
    pairs = zip(
        *(eqx.filter_jit(matrices)(each, state) for each in (parts, satellite)), strict=True
    )
    for found, expected in pairs:
        np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


def steady(slow):
    """The same in a steady turn, where the equations of small vibration have constant coefficients.

    How fast the coefficients change is neglected (docs/theory.md, (53)), of one body and of
    two in different places.
    """
    w = slow.now.motions["bus"].w
    parts = [
        jnp.concatenate([jnp.cross(w, jnp.cross(w, slow.now.motions[name].p)), jnp.zeros(3)])
        for name in slow.now.layout.names
    ]
    return replace(slow, u_rate=jnp.concatenate(parts))


# --- invariants and sharing --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("welded", "bench_on"), [((), "north"), (("south",), "bus")])
def test_momentum_is_conserved_by_cmgs_wheels_platforms_and_bench(welded, bench_on):
    """Ten seconds under control, rotors unbalanced and running up, legs with mass."""
    satellite = many_parts(welded, bench_on)
    q_NB = jnp.array([0.95, 0.1, -0.25, 0.2])
    start = initial_state(
        satellite, q_NB / jnp.linalg.norm(q_NB), jnp.zeros(3), jnp.zeros(satellite.count)
    )
    start = kicked_state(satellite, start, np.random.default_rng(5))
    times = np.linspace(0.0, 10.0, 6)
    flown = fly(satellite, start, jnp.asarray(times), 1e-10)
    assert np.ptp(flown.own["cmgs"].y, axis=0).min() > 0.01
    assert np.ptp(flown.own["wheels"].y_rate, axis=0).min() > 0.01

    def momentum(*at):
        return jnp.stack([linear_momentum_N(*at), angular_momentum_N(*at)])

    values = over_time(momentum, satellite, times, flown)
    drift = np.linalg.norm(values - values[0], axis=2).max(axis=0)
    assert (drift <= 1e-9 * np.linalg.norm(values[0], axis=1)).all()


def test_torque_is_shared_by_the_weighted_least_squares_over_cmgs_and_wheels():
    """Commands with the least sum of squares of (command / limit), by NumPy's lstsq, cut alike."""
    names = ("cmgs", "wheels", "more wheels")
    satellite = many_parts()
    cmgs, *others = satellite.clusters
    slow = replace(cmgs, gimbals=replace(cmgs.gimbals, rate_limit=jnp.asarray(0.5)))
    satellite = replace(
        satellite,
        clusters=(slow, *others),
        control=replace(satellite.control, actuators=names),
    )
    shares_seen = []
    for scale, state in itertools.product((1.0, 1e-3), states(satellite)):
        gains = {name: scale * getattr(satellite.control.controller, name) for name in GAINS}
        weak = replace(satellite.control, controller=replace(satellite.control.controller, **gains))
        found = eqx.filter_jit(decide)(replace(satellite, control=weak), T0, state)
        groups = [torques(satellite, c, state) for c in satellite.clusters if c.name in names]
        axes, limits = (np.concatenate(part, axis=-1) for part in zip(*groups, strict=True))
        wanted = np.linalg.lstsq(axes * limits, np.asarray(found.torque_B), rcond=None)[0]
        within = min(1.0, 1.0 / np.abs(wanted).max())
        commands = np.concatenate(found.commands)
        np.testing.assert_allclose(commands, within * limits * wanted, rtol=1e-7)
        assert float(found.torque_share) == pytest.approx(within, rel=1e-7)
        shares_seen.append(within)
    assert min(shares_seen) < 0.1
    assert max(shares_seen) == 1.0


GAINS = ("kp", "ki", "kd")


def torques(satellite, cluster, state):
    """Torque on the bus by each unit's command, from its rotor's momentum; limits of commands."""
    R_BP = np.asarray(quaternion_to_matrix(satellite.mount(cluster.hosts[0]).q_BX))
    R_PG = np.asarray(cluster.units.R_PG0)

    def spin(angle):
        s, t = R_PG[:, :, 0], R_PG[:, :, 1]
        return R_BP @ (np.cos(angle)[:, None] * s + np.sin(angle)[:, None] * t).T

    if cluster.cut:  # gimbals turn the rotors' momentum
        angle = np.asarray(state.own[cluster.name].y)
        turn = (spin(angle + 1e-6) - spin(angle - 1e-6)) / 2e-6
        return -turn * np.asarray(cluster.units.momentum), np.full(len(angle), 0.5)
    return -spin(np.asarray(cluster.gimbals.angle)), np.asarray(cluster.rotors.torque_limit)
