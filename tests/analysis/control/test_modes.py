"""Modes against closed forms: hexapod on a fixed base, whirl by momentum, free bodies."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import paper_satellite
from quietbus.analysis.control.modes import fixed_base_modes, free_modes
from quietbus.dynamics.linearize import OperatingPoint, linearize, platform_inertia
from quietbus.model.variants import with_base_fixed
from quietbus.validate.trajectory import massless_legs

STIFFNESS, DAMPING, COUPLING = 2e4, 500.0, np.sqrt(2.0) / 4.0


def light():
    return massless_legs(paper_satellite(imbalance=0.0))


def fixed(satellite, gamma=0.0):
    point = OperatingPoint(np.zeros(3), np.full(4, gamma))
    return fixed_base_modes(linearize(with_base_fixed(satellite), point, "ideal"))


def named(modes, word):
    return [mode for mode in modes if mode.name == word]


def test_fixed_base_frequencies_are_those_of_the_papers_stiffness():
    """K/k = diag(2, 2, 2, 1/4, 1/4, 3/4) with coupling sqrt(2)/4 (facts, section 8)."""
    mass, _, inertia = platform_inertia(light(), np.zeros(4), "plate")
    pair = np.array([[2.0, -COUPLING], [-COUPLING, 0.25]]) * STIFFNESS
    scale = 1.0 / np.sqrt([mass, inertia[0, 0]])
    rocking = np.sqrt(np.linalg.eigvalsh(scale[:, None] * pair * scale)) / (2 * np.pi)
    np.testing.assert_allclose(rocking, [2.567, 4.476], atol=1e-3)
    z = np.sqrt(np.array([2.0 / mass, 0.75 / inertia[2, 2]]) * STIFFNESS) / (2 * np.pi)
    assert z[1] == pytest.approx(5.033, abs=1e-3)
    expected = np.sort([*rocking, *rocking, *z])
    modes = fixed(light())
    np.testing.assert_allclose([mode.frequency_hz for mode in modes], expected, rtol=1e-9)
    # proportional damping: zeta = c omega / (2 k)
    zeta = DAMPING * 2 * np.pi * expected / (2 * STIFFNESS)
    np.testing.assert_allclose([mode.damping for mode in modes], zeta, rtol=1e-8)
    damped = expected * np.sqrt(1.0 - zeta**2)
    np.testing.assert_allclose([mode.damped_frequency_hz for mode in modes], damped, rtol=1e-8)


def test_shapes_on_a_fixed_base_are_eigenvectors_of_the_papers_stiffness():
    modes = fixed(light())
    (heave,), (twist,) = named(modes, "translation z"), named(modes, "rotation z")
    np.testing.assert_allclose(np.abs(heave.shape), np.eye(12)[2], atol=1e-8)
    np.testing.assert_allclose(np.abs(twist.shape), np.eye(12)[5], atol=1e-8)
    mass, _, inertia = platform_inertia(light(), np.zeros(4), "plate")
    for mode in modes:
        if mode in (heave, twist):
            continue
        omega = 2 * np.pi * mode.frequency_hz
        x, y, theta_x, theta_y = (mode.shape[i] for i in (0, 1, 3, 4))
        for shift, turn, sign in ((x, theta_y, -1.0), (y, theta_x, 1.0)):
            force = (2.0 * shift + sign * COUPLING * turn) * STIFFNESS - mass * omega**2 * shift
            assert abs(force) < 1e-6 * STIFFNESS
            torque = (0.25 * turn + sign * COUPLING * shift) * STIFFNESS
            assert abs(torque - inertia[0, 0] * omega**2 * turn) < 1e-6 * STIFFNESS


@pytest.mark.parametrize("gamma", [0.3, 1.2, -1.2])
def test_cluster_momentum_splits_the_rocking_modes(gamma):
    """All gimbals turned alike: net momentum H along z, and with zeta = x + i y, phi likewise

    m zeta'' + u (2 zeta + i b phi) = 0,  I phi'' - i H phi' + u (phi/4 - i b zeta) = 0.
    """
    satellite = light()
    mass, _, inertia = platform_inertia(satellite, np.full(4, gamma), "plate")
    assert inertia[0, 0] == pytest.approx(inertia[1, 1])
    H = 4 * 15.0 * np.sin(gamma) * np.sin(np.deg2rad(53.13))
    u = np.array([DAMPING, STIFFNESS])
    top = np.polyadd([mass, 0, 0], 2.0 * u)
    bottom = np.polyadd([inertia[0, 0], -1j * H, 0], 0.25 * u)
    poles = np.roots(np.polysub(np.polymul(top, bottom), COUPLING**2 * np.polymul(u, u)))
    whirl = np.sort(np.abs(poles) / (2 * np.pi))
    modes = [m for m in fixed(satellite, gamma) if " z" not in m.name]
    np.testing.assert_allclose([mode.frequency_hz for mode in modes], whirl, rtol=1e-9)
    assert whirl[1] / whirl[0] > 1.01  # split: without momentum they come in equal pairs
    assert whirl[3] / whirl[2] > 1.03
    for mode in modes:  # they go round: x and y a quarter period apart
        x, y = mode.shape[:2]
        assert abs(np.angle(y / x)) == pytest.approx(np.pi / 2, abs=1e-6)
        assert abs(y / x) == pytest.approx(1.0, abs=1e-6)


def test_direction_of_the_whirl_follows_the_momentum():
    def turns(gamma):
        return [
            np.sign(np.angle(mode.shape[1] / mode.shape[0]))
            for mode in fixed(light(), gamma)
            if " z" not in mode.name
        ]

    assert turns(1.0) == [-turn for turn in turns(-1.0)]
    assert set(turns(1.0)) == {-1.0, 1.0}


def test_free_heave_is_that_of_two_bodies():
    """Reduced mass of bus and plate; the shape conserves momentum."""
    satellite = light()
    mass, bus = platform_inertia(satellite, np.zeros(4), "plate")[0], 1000.0
    modes = free_modes(linearize(satellite, OperatingPoint(np.zeros(3), np.zeros(4)), "ideal"))
    (heave,) = named(modes, "translation z")
    omega = np.sqrt(2.0 * STIFFNESS * (1.0 / mass + 1.0 / bus))
    assert heave.frequency_hz == pytest.approx(omega / (2 * np.pi), rel=1e-4)  # products of inertia
    for mode in modes:
        momentum = mass * mode.shape[:3] + bus * mode.shape[6:9]
        assert np.abs(momentum).max() < 1e-6 * mass


def test_free_twist_is_that_of_two_inertias():
    satellite = light()
    bus, plate = satellite.bodies
    bus = replace(bus, I_XXcm_X=jnp.diag(jnp.array([1100.0, 900.0, 800.0])))
    model = linearize(
        replace(satellite, bodies=(bus, plate)), OperatingPoint(np.zeros(3), np.zeros(4)), "ideal"
    )
    (twist,) = named(free_modes(model), "rotation z")
    inertia = platform_inertia(satellite, np.zeros(4), "plate")[2][2, 2]
    omega = np.sqrt(0.75 * STIFFNESS * (1.0 / inertia + 1.0 / 800.0))
    assert twist.frequency_hz == pytest.approx(omega / (2 * np.pi), rel=1e-9)
    assert twist.shape[11] / twist.shape[5] == pytest.approx(-inertia / 800.0)


def test_leg_mass_lowers_the_frequencies():
    heavy = fixed(paper_satellite(imbalance=0.0))
    for with_mass, without in zip(heavy, fixed(light()), strict=True):
        assert 0.97 * without.frequency_hz < with_mass.frequency_hz < without.frequency_hz
