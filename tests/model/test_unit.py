"""Mass moments of the CMGs against clouds of point masses, and the cluster's expansion."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from quietbus.build import build_satellite
from quietbus.model.moments import ClusterMoments, Turning
from quietbus.model.unit import ControlMomentGyro, momentum_P
from quietbus.scenario import load_scenario

ANGLES = (0.7, -1.1, 0.4)  # gimbal angle, rotor angle [rad], gimbal rate [rad/s] of a case


carried = eqx.filter_jit(ControlMomentGyro.carried)


@eqx.filter_jit
def expanded(cluster, gimbal, rotor):
    return ClusterMoments.expand(cluster).at(gimbal, rotor)


def turning(angle, rate, acceleration=0.0):
    """How gimbals or rotors turn."""
    each = (jnp.asarray(value, dtype=float) for value in (angle, rate, acceleration))
    return Turning(*(jnp.ones(len(angle)) * value for value in each))


def derivative(function, at, along):
    """Value of a function and its derivative along a direction."""
    return jax.jit(lambda at, along: jax.jvp(function, at, along))(at, along)


def body(rng, center):
    """Point masses of a body of any shape: masses, positions, total mass, inertia about centre."""
    m, r = rng.uniform(0.1, 1.0, 8), rng.normal(size=(8, 3), scale=0.2)
    r += center - m @ r / m.sum()
    q = r - center
    inertia = np.einsum("i,ijk->jk", m, (q**2).sum(1)[:, None, None] * np.eye(3) - outer(q, q))
    return m, r, m.sum(), inertia


def outer(a, b):
    return a[:, :, None] * b[:, None, :]


def random_unit(seed):
    """A unit in which nothing is aligned, and the point masses that it stands for."""
    rng = np.random.default_rng(seed)
    eccentricity, p_CGcm_G = rng.normal(scale=0.05), rng.normal(size=3, scale=0.1)
    gimbal_points, gimbal_r, gimbal_mass, I_G = body(rng, p_CGcm_G)
    rotor_points, rotor_r, rotor_mass, I_R = body(rng, np.array([0.0, eccentricity, 0.0]))
    R_PG0, R_GF = Rotation.random(2, rng=rng).as_matrix()
    unit = ControlMomentGyro(
        p_PC_P=rng.normal(size=3, scale=0.5),
        R_PG0=R_PG0,
        gimbal_mass=gimbal_mass,
        p_CGcm_G=p_CGcm_G,
        I_GGcm_G=I_G,
        rotor_mass=rotor_mass,
        p_CR_G=rng.normal(size=3, scale=0.1),
        R_GF=R_GF,
        I_RRcm_R=I_R,
        eccentricity=eccentricity,
        rotor_speed=rng.choice([-1.0, 1.0]) * rng.uniform(50.0, 100.0),
        rotor_phase=rng.uniform(0.0, 6.0),
    )
    unit = jax.tree.map(lambda value: jnp.asarray(value, dtype=float), unit)
    return unit, (gimbal_points, gimbal_r), (rotor_points, rotor_r)


def turn(axis, angle):
    """Rotation about a coordinate axis, written out."""
    c, s = jnp.cos(angle), jnp.sin(angle)
    if axis == "x":
        return jnp.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    return jnp.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def points_P(unit, gimbal_r, rotor_r, gamma, phi):
    """Where the point masses are in the plate."""
    R_PG = unit.R_PG0 @ turn("z", gamma)
    rotor_G = unit.p_CR_G + rotor_r @ (unit.R_GF @ turn("x", phi)).T
    return unit.p_PC_P + jnp.concatenate([gimbal_r, rotor_G]) @ R_PG.T


def random_cluster(count=3):
    units = [random_unit(seed)[0] for seed in range(count)]
    return jax.tree.map(lambda *values: jnp.stack(values), *units)


@pytest.mark.parametrize("seed", range(5))
def test_moments_of_a_unit_are_those_of_its_point_masses(seed):
    unit, (m_G, r_G), (m_R, r_R) = random_unit(seed)
    gamma, phi, rate = ANGLES
    m = np.concatenate([m_G, m_R])

    def positions(gamma, phi):
        return points_P(unit, r_G, r_R, gamma, phi)

    r, v = derivative(positions, (gamma, phi), (rate, float(unit.rotor_speed)))
    found = carried(unit, gamma, phi, rate)
    J = jnp.einsum("i,ijk->jk", m, jnp.sum(r * r, 1)[:, None, None] * jnp.eye(3) - outer(r, r))
    np.testing.assert_allclose(found.mass, m.sum(), rtol=1e-13)
    np.testing.assert_allclose(found.c, m @ r, atol=1e-12)
    np.testing.assert_allclose(found.J, J, atol=1e-12)
    np.testing.assert_allclose(found.p, m @ v, atol=1e-11)
    np.testing.assert_allclose(found.H, m @ jnp.cross(r, v), atol=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_expansion_is_the_sum_over_units_and_its_time_derivative(seed):
    """Trigonometric polynomials against the rigid bodies, rates by automatic differentiation."""
    cluster = random_cluster()
    rng = np.random.default_rng(seed)
    gamma, phi = rng.uniform(-np.pi, np.pi, (2, 3))
    gamma_rate, gamma_acceleration = rng.normal(size=(2, 3))

    def summed(gamma, phi, rate):
        each = eqx.filter_vmap(ControlMomentGyro.carried)(cluster, gamma, phi, rate)
        return jax.tree.map(lambda value: jnp.sum(value, axis=0), each)

    expected, rates = derivative(
        summed,
        (gamma, phi, gamma_rate),
        (gamma_rate, np.asarray(cluster.rotor_speed), gamma_acceleration),
    )
    gimbal = turning(gamma, gamma_rate, gamma_acceleration)
    found = expanded(cluster, gimbal, turning(phi, cluster.rotor_speed))
    for name in ("mass", "c", "J", "p", "H"):
        close(getattr(found, name), getattr(expected, name))
    for name in ("J", "p", "H"):
        close(getattr(found, f"{name}_rate"), getattr(rates, name))
    close(found.p, rates.c)  # momentum is the rate of the first moment


def test_averaged_moments_are_the_mean_over_the_rotor_angles():
    """Five equally spaced angles average a trigonometric polynomial of degree two exactly."""
    cluster = random_cluster()
    gamma, rate, acceleration = np.random.default_rng(1).normal(size=(3, 3))
    moments = eqx.filter_jit(ClusterMoments.expand)(cluster)
    turns = 2.0 * np.pi / 5.0 * np.stack(np.meshgrid(*[np.arange(5)] * 3), axis=-1).reshape(-1, 3)
    gimbal, speed = turning(gamma, rate, acceleration), cluster.rotor_speed
    at = jax.jit(jax.vmap(lambda phi: moments.at(gimbal, turning(phi, speed))))(turns)
    averaged = moments.averaged().at(gimbal, turning(turns[7], speed))
    for name in ("c", "J", "p", "H", "J_rate", "p_rate", "H_rate"):
        values = np.asarray(getattr(at, name))
        error = np.abs(getattr(averaged, name) - values.mean(axis=0)).max()
        assert error <= 1e-13 * np.abs(values).max(), name


def test_orders_add_up_to_the_moments_while_speeds_change():
    """Real part of the sum over units and orders of amplitude exp(i h phi)."""
    cluster = random_cluster()
    rng = np.random.default_rng(3)
    gamma, phi = rng.uniform(-np.pi, np.pi, (2, 3))
    rate, acceleration = rng.normal(size=(2, 3))
    speed, spin_up = 30.0 * rng.normal(size=3), 500.0 * rng.normal(size=3)

    @jax.jit
    def both(cluster):
        moments = ClusterMoments.expand(cluster)
        motion = turning(gamma, rate, acceleration), turning(phi, speed, spin_up)
        return moments.at(*motion), [moments.order(h, *motion) for h in (0, 1, 2)]

    whole, orders = both(cluster)
    for name in ("c", "J", "p", "H", "J_rate", "p_rate", "H_rate"):
        total = 0.0
        for h, amplitude in enumerate(orders):
            value = np.asarray(getattr(amplitude, name))
            turned = np.exp(1j * h * phi).reshape(-1, *[1] * (value.ndim - 1))
            total = total + np.sum((value * turned).real, axis=0)
        close(total, np.asarray(getattr(whole, name)))


def close(found, expected, relative=1e-12):
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=relative * scale)


@pytest.fixture(scope="module")
def plain_unit():
    """A unit of the built-in satellite, its bodies in line with the gimbal frame."""
    cluster = build_satellite(load_scenario("zhang2012")).clusters[0].units
    return jax.tree.map(lambda value: value[1], cluster)


def test_gimbal_angle_turns_spin_axis_towards_t(plain_unit):
    s0, t0, g = np.asarray(plain_unit.R_PG0.T)
    np.testing.assert_allclose(np.cross(g, s0), t0, atol=1e-15)
    R = np.asarray(plain_unit.R_PG(0.3))
    np.testing.assert_allclose(R[:, 0], np.cos(0.3) * s0 + np.sin(0.3) * t0, atol=1e-15)
    np.testing.assert_allclose(R, R_about(g, 0.3) @ plain_unit.R_PG0, atol=1e-15)


def R_about(axis, angle):
    return Rotation.from_rotvec(angle * np.asarray(axis)).as_matrix()


@pytest.mark.parametrize("gamma", [0.0, 0.5])
def test_static_imbalance_starts_along_t_and_turns_towards_g(plain_unit, gamma):
    """First moment m e (cos phi t + sin phi g), over that of the same unit without imbalance."""
    _, t, g = np.asarray(plain_unit.R_PG(gamma)).T
    balanced = eqx.tree_at(lambda unit: unit.eccentricity, plain_unit, jnp.zeros(()))
    for phi in (0.0, 0.5 * np.pi, 2.0):
        c = carried(plain_unit, gamma, phi, 0.0).c - carried(balanced, gamma, phi, 0.0).c
        np.testing.assert_allclose(c, 1.36e-5 * (np.cos(phi) * t + np.sin(phi) * g), atol=1e-14)


def test_dynamic_imbalance_is_the_product_of_inertia_so_the_matrix_has_minus_it(plain_unit):
    """17 g cm^2 between spin axis and imbalance: a mass at (+x, +y) and one at (-x, -y)."""
    D = 17e-7
    x, y = np.array([0.02, 0.03, 0.0]), D / (2 * 0.02 * 0.03)
    assert 2 * y * x[0] * x[1] == pytest.approx(D)
    np.testing.assert_allclose(plain_unit.I_RRcm_R[0, 1], -D, rtol=1e-12)
    pair = 2 * y * (x @ x * np.eye(3) - np.outer(x, x))
    np.testing.assert_allclose(pair[0, 1], plain_unit.I_RRcm_R[0, 1], rtol=1e-12)


def test_dynamic_imbalance_tilts_the_momentum_away_from_the_imbalance(plain_unit):
    """H = h s - D Omega t at rotor angle zero, on top of r x p of the static imbalance."""
    s, t, _ = np.asarray(plain_unit.R_PG(0.0)).T
    at_center = eqx.tree_at(
        lambda unit: (unit.eccentricity, unit.p_PC_P), plain_unit, (jnp.zeros(()), jnp.zeros(3))
    )
    speed = 200.0 * np.pi
    H = carried(at_center, 0.0, 0.0, 0.0).H
    np.testing.assert_allclose(H, 15.0 * s - 17e-7 * speed * t, rtol=1e-12, atol=1e-12)


def test_rotor_momentum_is_h_along_the_turned_spin_axes():
    cluster = build_satellite(load_scenario("zhang2012")).clusters[0].units
    gamma = np.array([0.3, -0.8, 1.2, 2.0])
    azimuth = 0.5 * np.pi * np.arange(4)
    r = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=1)
    skew = np.deg2rad(53.13)
    z = np.array([0.0, 0.0, 1.0])
    g = np.sin(skew) * r + np.cos(skew) * z
    expected = [
        15.0 * R_about(axis, angle) @ np.cross(z, rj)
        for axis, angle, rj in zip(g, gamma, r, strict=True)
    ]
    np.testing.assert_allclose(momentum_P(cluster, gamma), expected, atol=1e-12)
