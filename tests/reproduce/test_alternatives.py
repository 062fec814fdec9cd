"""Six filters and an isolator per CMG: the report's numbers by other means."""

from types import SimpleNamespace

import numpy as np
import pytest

from quietbus import api
from quietbus.analysis.control.isolator import SingleAxisIsolator
from quietbus.reproduce.zhang2012 import filters, per_cmg

SHARE = np.array([2.0, 2.0, 2.0, 0.25, 0.25, 0.75])  # hexapod stiffness over k, docs/analysis.md
MASS = np.array([82.8, 82.8, 82.8, 8.8, 8.8, 15.0])
HEIGHT = 0.6 + 0.25 * np.sqrt(2.0)  # [m] of the plate over the bus mass centre
OMEGA = 200.0 * np.pi


@pytest.fixture(scope="module")
def bench():
    return SimpleNamespace(
        study=api.analyze("zhang2012"), shop=SimpleNamespace(tell=lambda _what, _fraction: None)
    )


@pytest.fixture(scope="module")
def of_filters(bench):
    return filters.filters(bench)


def bolted_filters_by_hand():
    """Bus rate (cmg, axis) of rotors behind filters on one rigid body, legs without mass."""
    weight = 82.8 / 1082.8
    lift, z = weight * HEIGHT, np.array([0.0, 0.0, 1.0])  # of the mass centre of all
    across = np.diag([1.0, 1.0, 0.0])
    bus = np.array([[1100, -20, -10], [-20, 900, -15], [-10, -15, 800]], float)
    inertia = bus + 1000.0 * lift**2 * across + np.diag(MASS[3:])
    inertia = inertia + 82.8 * (HEIGHT - lift) ** 2 * across
    isolators = [
        SingleAxisIsolator(m, s * 2e4, s * 500.0) for m, s in zip(MASS, SHARE, strict=True)
    ]
    s = 1j * OMEGA
    gain = np.array([np.polyval(i.numerator, s) / np.polyval(i.denominator, s) for i in isolators])
    skew, rates = np.deg2rad(53.13), []
    for azimuth in 0.5 * np.pi * np.arange(4):
        r = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        g = np.sin(skew) * r + np.cos(skew) * z
        spin = np.cross(z, r)
        turning = np.cross(g, spin) - 1j * g  # the direction of the imbalance, t cos + g sin
        force = 1.36e-5 * OMEGA**2 * turning
        # principal axes tilted: torque spin x (w x H) of the product of inertia
        torque = 1.7e-6 * OMEGA**2 * np.cross(turning, spin) * -1.0
        wrench = gain * np.concatenate([force, np.cross(0.42 * r, force) + torque])
        about_all = wrench[3:] + np.cross((HEIGHT - lift) * z, wrench[:3])
        rates.append(np.linalg.solve(inertia, about_all) / s)
    return np.array(rates)


def test_filters_are_those_of_eq_1_on_one_rigid_body(bench, of_filters):
    """Rotors' forces, filters and the bolted satellite by hand; the isolated one by qb.jitter."""
    numbers = of_filters.numbers
    expected = np.sqrt(SHARE * 2e4 / MASS) / (2.0 * np.pi)
    for i, axis in enumerate("xyz"):
        assert numbers[f"filter_frequency_{axis}"] == pytest.approx(expected[i], rel=2e-3)
        assert numbers[f"filter_frequency_about_{axis}"] == pytest.approx(expected[3 + i], rel=2e-3)
    scenario = bench.study.scenario.with_overrides({"control": "none"})
    full = api.jitter(scenario).bus_rate("isolated")[:, 0]
    by_hand = bolted_filters_by_hand()
    for i, axis in enumerate("xyz"):
        ratio = np.linalg.norm(by_hand[:, i]) / np.linalg.norm(full[:, i])
        assert numbers[f"filters_{axis}"] == pytest.approx(ratio, rel=0.01)
        error = np.linalg.norm(by_hand[:, i] - full[:, i]) / np.linalg.norm(full[:, i])
        assert numbers[f"filters_{axis}_error"] == pytest.approx(error, abs=0.01)


def test_filters_are_good_about_z_and_least_wrong_near_the_centre_of_stiffness(of_filters):
    numbers = of_filters.numbers
    assert numbers["filters_z_error"] < filters.GOOD < numbers["filters_x_error"]
    assert numbers["filters_centre"] == pytest.approx(-0.125 * np.sqrt(2.0), abs=0.03)
    assert "1.41 and 1.39 times" in of_filters.caption


def test_one_isolator_per_cmg_against_the_existing_analyses(bench, monkeypatch):
    for name, fewer in (("SWEEP_HZ", [100.0]), ("SCALES", [1.0]), ("ANGLES", 1)):
        monkeypatch.setattr(per_cmg, name, np.array(fewer) if name != "ANGLES" else fewer)
    numbers = per_cmg.per_cmg(bench).numbers
    study = bench.study
    limit = study.coupled.stable_gain_range[-1][1]
    assert numbers["per_cmg_gain_limit_one"] == pytest.approx(limit, rel=1e-6)
    free = [mode.frequency_hz for mode in study.modes["free"]]
    assert numbers["per_cmg_lowest_mode_one"] == pytest.approx(free[0], rel=1e-6)
    assert numbers["per_cmg_highest_mode_one"] == pytest.approx(free[-1], rel=1e-6)
    jitter = api.jitter("zhang2012")
    left = jitter.combined("isolated").worst_case / jitter.combined("rigid").worst_case
    for i, axis in enumerate("xyz"):
        assert numbers[f"per_cmg_left_one_{axis}"] == pytest.approx(left[i], rel=1e-9)
        ratio = numbers[f"per_cmg_left_{axis}"] / numbers[f"per_cmg_left_one_{axis}"]
        assert numbers[f"per_cmg_ratio_{axis}"] == pytest.approx(ratio)
    # about z: a sixteenth of the plate's inertia, and one CMG over its own centre
    cos, sin = np.cos(np.deg2rad(53.13)), np.sin(np.deg2rad(53.13))
    rotor = 0.6 * 15.0 / OMEGA  # across the spin axis, which lies level
    small = 1.296304220486920 / 16.0 + 0.06 * (cos**2 + sin**2) + rotor
    assert numbers["per_cmg_lighter_z"] == pytest.approx(15.0 / small, rel=1e-3)
    passed = (15.0 / small) / 16.0  # four small hexapods: a quarter of c, at half the arm
    assert numbers["per_cmg_passes_z"] == pytest.approx(passed, rel=1e-3)
