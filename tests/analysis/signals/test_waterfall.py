"""A waterfall made of sines and noise in time is recovered by the fit within 1 %."""

import numpy as np
import pytest

from oracles.wheels import measured
from quietbus.analysis.signals.waterfall import FitError, Waterfall, fit

TURNS = np.linspace(8.0, 100.0, 56)
ROCKING = (60.0, 0.03, 1.7)
TORQUES = ((1.0, 7.5e-9, 1), (2.0, 9e-9, 1), (2.72, 2.4e-8, -1), (4.41, 2.1e-8, 1))
RADIAL = (230.0, 0.02, 0.0)
FORCES = ((1.0, 7.5e-8, 1), (2.0, 1.2e-8, 1), (3.87, 9e-9, 1))


def made(component, lines, mode, noise=1e-9, **options):
    frequency, psd = measured(lines, mode, TURNS, noise, **options)
    return Waterfall(component, 2 * np.pi * TURNS, frequency, psd, "hann")


@pytest.fixture(scope="module")
def rocking():
    return fit(made("radial_torque", TORQUES, ROCKING))


def assert_recovered(found, lines, within=0.01):
    assert len(found.orders) == len(lines)
    for line, (order, coefficient, _) in zip(found.orders, lines, strict=True):
        assert line.order.value == pytest.approx(order, rel=1e-4)
        assert line.coefficient.value == pytest.approx(coefficient, rel=within)
        # the stated deviations are believable: neither far too small nor useless
        assert abs(line.coefficient.value - coefficient) < 5 * line.coefficient.deviation
        assert line.coefficient.deviation < within * coefficient


def test_orders_crossing_both_whirls_of_a_rocking_mode_are_recovered(rocking):
    assert_recovered(rocking, TORQUES)
    assert [line.whirl for line in rocking.orders] == ["forward", "forward", "backward", "forward"]
    (mode,) = rocking.modes
    for estimate, true in zip((mode.frequency, mode.damping, mode.split), ROCKING, strict=True):
        assert estimate.value == pytest.approx(true, rel=0.01)
        assert abs(estimate.value - true) < 5 * estimate.deviation
    assert rocking.line_error < 0.03


def test_the_floor_is_white_noise_and_the_residual_is_its_scatter(rocking):
    assert not rocking.floor_at_rotor
    inside = (rocking.floor_frequency > 2) & (rocking.floor_frequency < 500)
    assert rocking.floor[inside] == pytest.approx(1e-9, rel=0.05)
    # 31 half-overlapped Hann segments count as some 29 independent ones (Welch 1967)
    assert 20 < rocking.averages < 35
    residual = rocking.residual_db[:, 2:-2]
    assert abs(np.mean(residual)) < 0.15
    assert np.std(residual) == pytest.approx(10 / np.log(10) / np.sqrt(29), rel=0.15)


def test_a_translation_and_a_coloured_floor_are_recovered():
    found = fit(made("radial_force", FORCES, RADIAL, noise=1e-8, coloured=True))
    assert_recovered(found, FORCES)
    assert found.modes[0].frequency.value == pytest.approx(RADIAL[0], rel=1e-3)
    assert found.modes[0].damping.value == pytest.approx(RADIAL[1], rel=0.01)
    assert found.modes[0].split is None
    f = found.floor_frequency
    inside = (f > 5) & (f < 400)
    pole = np.exp(-2 * np.pi * 100.0 / 1024)
    true = 1e-8 * np.abs((1 - pole) / (1 - pole * np.exp(-2j * np.pi * f / 1024))) ** 2
    assert found.floor[inside] == pytest.approx(true[inside], rel=0.1)


def test_noise_that_the_mode_shapes_is_told_from_noise_that_it_does_not():
    """White noise at the rotor through a translation, made by its power transmission."""
    from oracles.wheels import transmission

    clean = made("axial_force", FORCES, RADIAL, noise=1e-13)
    f = clean.frequency
    power = 1e-8 * np.abs(transmission(f, *RADIAL[:2], 0.0, 0.0)) ** 2
    noise = power * np.random.default_rng(5).gamma(25, 1 / 25, clean.psd.shape)
    shaped = Waterfall("axial_force", clean.speed, f, clean.psd + noise)
    found = fit(shaped)
    assert found.floor_at_rotor
    inside = (found.floor_frequency > 2) & (found.floor_frequency < 450)
    assert found.floor[inside] == pytest.approx(1e-8, rel=0.05)
    assert_recovered(found, FORCES, within=0.02)


def test_without_a_mode_none_is_found():
    found = fit(made("radial_force", FORCES, None))
    assert_recovered(found, FORCES)
    assert not found.modes
    assert fit(made("axial_torque", FORCES[:1], None)).modes == ()


def test_lines_that_fill_one_bin_each_are_taken_by_window_none():
    frequency = np.arange(0.0, 300.0, 0.5)
    psd = np.full((len(TURNS), len(frequency)), 1e-12)
    for order, coefficient, _ in FORCES[:2]:
        bins = np.rint(order * TURNS / 0.5).astype(int)
        size = coefficient * (2 * np.pi * TURNS) ** 2
        psd[np.arange(len(TURNS)), bins] += 0.5 * size**2 / 0.5
    found = fit(Waterfall("axial_torque", 2 * np.pi * TURNS, frequency, psd, "none"))
    assert len(found.orders) == 2
    for line, (order, coefficient, _) in zip(found.orders, FORCES, strict=False):
        assert line.order.value == pytest.approx(order, rel=1e-3)
        assert line.coefficient.value == pytest.approx(coefficient, rel=0.01)


def test_what_cannot_be_fitted_is_told():
    with pytest.raises(FitError, match="no order stands out"):
        fit(made("radial_force", (), None, noise=1e-6))
    few = made("radial_force", FORCES, None, seconds=4.0)
    with pytest.raises(FitError, match="at least 8 speeds, got 5"):
        fit(Waterfall("radial_force", few.speed[:5], few.frequency, few.psd[:5]))
    with pytest.raises(FitError, match="none but zeros"):
        fit(Waterfall("radial_force", few.speed, few.frequency, 0.0 * few.psd))
