"""As many modes as a map supports, and deviations that are worth what they say, or none."""

import json

import numpy as np
import pytest

from oracles.spectra import map_of
from quietbus.analysis.signals.waterfall import Waterfall, fit, modes

RPM = np.linspace(600, 6000, 36)
LINES = ((1.0, 1e-6), (2.0, 3e-7), (4.42, 1.5e-7))
SERIES = ((110.0, 0.02), (190.0, 0.03))


def fitted(series, noise, seed=1, rpm=RPM, lines=LINES):
    frequency, psd = map_of(lines, "hann", noise, rpm, series, seconds=8, seed=seed)
    return fit(Waterfall("radial_force", rpm * np.pi / 30, frequency, psd, "hann"))


@pytest.fixture(scope="module")
def realisations():
    return [fitted(SERIES, 1e-2, seed) for seed in range(6)]


def test_two_modes_in_series_are_both_found(realisations):
    for found in realisations:
        assert [line.order.value for line in found.orders] == pytest.approx([1, 2, 4.42], rel=1e-4)
        for mode, (frequency, damping) in zip(found.modes, SERIES, strict=True):
            assert mode.frequency.value == pytest.approx(frequency, rel=1e-3)
            assert mode.damping.value == pytest.approx(damping, rel=0.02)
            assert mode.split is None


def test_stated_deviations_cover_the_truth(realisations):
    """42 estimates; benchmarks/fit_waterfall.py has the same with 350."""
    away = []
    for found in realisations:
        for line, (_, coefficient) in zip(found.orders, LINES, strict=True):
            away.append((line.coefficient.value - coefficient) / line.coefficient.deviation)
        for mode, true in zip(found.modes, SERIES, strict=True):
            for estimate, value in zip((mode.frequency, mode.damping), true, strict=True):
                away.append((estimate.value - value) / estimate.deviation)
    away = np.abs(away)
    assert np.mean(away < 2) > 0.9
    assert np.mean(away < 1) > 0.6
    assert np.sqrt(np.mean(away**2)) > 0.4  # nor are they far too wide


def test_the_misfit_of_a_right_model_is_the_spectra_s_scatter(realisations):
    assert np.mean([found.misfit for found in realisations]) == pytest.approx(0.9, abs=0.25)
    assert min(found.chance for found in realisations) > 1e-3


def test_a_model_too_small_states_no_deviations(monkeypatch):
    monkeypatch.setattr(modes, "MOST_MODES", 1)
    found = fitted(SERIES, 3e-3)
    assert found.misfit > 3
    assert found.chance < 1e-6
    assert all(line.coefficient.deviation is None for line in found.orders)
    assert all(mode.frequency.deviation is None for mode in found.modes)
    assert any("do not follow the model" in note for note in found.notes)
    json.dumps(found.to_dict(), allow_nan=False)


def test_a_mode_that_no_line_comes_near_is_not_invented():
    """Order 1 below 50 Hz feels the modes' stiffness alone: no number is given with confidence."""
    found = fitted(SERIES, 1e-3, rpm=np.linspace(600, 3000, 25), lines=LINES[:1])
    assert found.modes == ()
    assert found.orders[0].coefficient.deviation is None
    assert any("do not follow the model" in note for note in found.notes)


def test_speeds_that_are_read_wrongly_widen_deviations():
    frequency, psd = map_of(LINES, "hann", 1e-4, RPM, seconds=8)
    read = RPM * (1 + 1e-3 * np.random.default_rng(2).normal(size=len(RPM)))
    found = fit(Waterfall("radial_force", read * np.pi / 30, frequency, psd, "hann"))
    assert found.modes == ()
    for line, (_, coefficient) in zip(found.orders, LINES, strict=True):
        error = abs(line.coefficient.value - coefficient)
        assert error < 4 * line.coefficient.deviation
        assert 2e-4 < line.coefficient.deviation / coefficient < 1e-2
    assert any("scatter" in note and "widened" in note for note in found.notes)


def test_power_is_told_by_speed_and_order(realisations):
    """Each line's power is half its amplitude squared."""
    found = realisations[0]
    speed = RPM * np.pi / 30
    f = speed / (2 * np.pi)
    through = [
        np.abs((1 + 2j * z * f / f0) / (1 + 2j * z * f / f0 - (f / f0) ** 2)) for f0, z in SERIES
    ]
    amplitude = 1e-6 * speed**2 * through[0] * through[1]
    said = found.to_dict()["explained"]
    assert said["power_by_order"][0] == pytest.approx(np.sum(amplitude**2 / 2), rel=0.01)
    assert said["total"] > 0.98
    assert min(said["by_order"]) > 0.98
    assert len(said["by_speed"]) == len(RPM)
    # a fit without order 2 explains that much less
    two = found.explained
    fitted_less = two.fitted.copy()
    fitted_less[:, 1] = 0.0
    lost = two.measured[:, 1].sum() / two.measured.sum()
    less = type(two)(two.measured, fitted_less).total
    assert less == pytest.approx(two.total - lost, abs=0.01)


def test_a_line_that_strays_is_in_doubt_and_out_of_the_block():
    from quietbus.measured import WaterfallFit

    frequency, psd = map_of(LINES[:2], "hann", 1e-4, RPM, seconds=8)
    clean = Waterfall("radial_force", RPM * np.pi / 30, frequency, psd, "hann")
    rng, wild = np.random.default_rng(4), psd.copy()
    for i, turn in enumerate(RPM / 60):
        near = np.abs(frequency - 2 * turn) < 4  # order 2: amplitudes anyhow
        wild[i, near] *= np.exp(2 * rng.normal(0, 0.6))
    found = fit(Waterfall("radial_force", clean.speed, frequency, wild, "hann"))
    assert [line.doubt is None for line in found.orders] == [True, False]
    assert "stray" in found.orders[1].doubt
    whole = WaterfallFit({"radial_force": found})
    assert [order["order"] for order in whole.disturbance()["orders"]] == [1.0]
    assert any("left out of the block" in note for note in whole.notes)
