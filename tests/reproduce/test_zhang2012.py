"""Our values for Zhang and Xu (2012), a handful of them by other means."""

import math
from collections import Counter
from types import SimpleNamespace

import control
import numpy as np
import pytest
import xarray as xr
from scipy.optimize import minimize_scalar

from quietbus import api
from quietbus.reproduce import load_paper
from quietbus.reproduce.zhang2012 import claims, flights, missing
from quietbus.reproduce.zhang2012 import control as loop_figures
from quietbus.reproduce.zhang2012.bench import Envelope, jitter_of_flight, jitter_peak
from quietbus.reproduce.zhang2012.sliding import Sliding

A, B, D = 2.0, math.sqrt(2.0) / 4.0, 0.25  # hexapod stiffness over k, docs/analysis.md
MASS, INERTIA, STIFFNESS, DAMPING = 82.8, 8.8, 20e3, 500.0


@pytest.fixture(scope="module")
def bench():
    return SimpleNamespace(study=api.analyze("zhang2012"))


@pytest.fixture(scope="module")
def loop():
    """The loop about x from the closed form of eq. 31, by python-control."""
    u, s = np.array([DAMPING, STIFFNESS]), np.array([1.0, 0.0])
    lever = D - B * math.sqrt(2.0) / 4.0
    delta = A * D - B**2
    uu, ss = np.polymul(u, u), np.polymul(s, s)
    top = np.polyadd(lever * MASS * np.polymul(ss, u), delta * uu)
    bottom = np.polyadd(
        np.polyadd(
            MASS * INERTIA * np.polymul(ss, ss),
            (MASS * D + INERTIA * A) * np.polymul(ss, u),
        ),
        delta * uu,
    )
    channel = control.tf(top, bottom)
    return channel, control.tf([2500.0, 200.0, 0.1], [1.0, 0.0]) * channel * control.tf(
        [1.0], [1100.0, 0.0, 0.0]
    )


def closed_loop_is_stable(loop, factor):
    top, bottom = loop.num[0][0], loop.den[0][0]
    return np.all(np.roots(np.polyadd(factor * top, bottom)).real < 0.0)


def test_ends_of_the_gain_range_are_where_roots_of_the_closed_form_cross(bench, loop):
    found = loop_figures.locus(bench).numbers
    for name, inward in (("gain_low", 1.0), ("gain_high", -1.0)):
        factor = found[name] / 2500.0
        assert closed_loop_is_stable(loop[1], factor * (1.0 + 1e-4 * inward))
        assert not closed_loop_is_stable(loop[1], factor * (1.0 - 1e-4 * inward))


def test_coefficients_are_those_of_the_closed_form(bench):
    found = loop_figures.locus(bench).numbers
    unit = (D - B * math.sqrt(2.0) / 4.0) * MASS
    assert found["tf_s4"] == pytest.approx(MASS * INERTIA / unit, rel=1e-8)
    assert found["tf_cs3"] == pytest.approx((MASS * D + INERTIA * A) / unit, rel=1e-8)
    assert found["tf_k2"] == pytest.approx((A * D - B**2) / unit, rel=1e-8)
    assert found["tf_numerator_kcs"] == pytest.approx(2.0 * (A * D - B**2) / unit, rel=1e-8)
    assert found["tf_z_s2"] == pytest.approx(15.0 / 0.75, rel=1e-8)


def test_margins_are_those_of_python_control(bench, loop):
    found = loop_figures.bode(bench).numbers
    gain, phase, _, at_gain, at_phase, _ = control.stability_margins(loop[1], returnall=True)
    rising = [20.0 * math.log10(g) for g in gain if g > 1.0]
    assert found["gain_margin"] == pytest.approx(min(rising), rel=1e-6)
    assert found["gain_margin_frequency"] == pytest.approx(max(at_gain) / (2 * np.pi), rel=1e-6)
    assert found["phase_margin"] == pytest.approx(phase[0], rel=1e-6)
    assert found["bandwidth"] == pytest.approx(at_phase[0] / (2 * np.pi), rel=1e-6)


def test_corner_frequency_is_the_largest_gain_of_the_closed_form(bench, loop):
    found = missing.corner(bench).numbers
    peak = minimize_scalar(
        lambda w: -abs(loop[0](1j * w)), bounds=(10.0, 20.0), options={"xatol": 1e-10}
    )
    assert found["corner_x"] == pytest.approx(peak.x / (2 * np.pi), rel=1e-6)
    assert found["corner_x_gain"] == pytest.approx(-peak.fun, rel=1e-9)


def test_the_papers_universal_joint_turns_where_it_cannot(bench):
    """Turning as one with the bus a leg has the bus's rate; eq. 12 takes out its part along h."""
    rate = np.array([0.01, -0.02, 0.015])
    time = np.arange(400) / 4.0
    flown = xr.Dataset(
        {"bus_rate": (("time", "axis"), np.tile(rate, (400, 1)))}, coords={"time": time}
    )
    flying = SimpleNamespace(study=bench.study, flight=lambda _name: {"isolated": flown})
    found = missing.universal_joint(flying).numbers
    lower, upper = bench.study.scenario.isolator.joints()
    s = upper - lower
    s = s / np.linalg.norm(s, axis=1, keepdims=True)
    k = np.asarray(bench.study.satellite.hexapods[0].geometry.k_B)
    h = s - np.sum(k * s, axis=1, keepdims=True) * k
    along = h @ rate
    missed = along / np.sum(s * h, axis=1)
    momentum = 2e-4 * missed @ s
    assert found["joint_spin_error"] == pytest.approx(np.degrees(np.abs(missed).max()))
    assert found["joint_momentum_error"] == pytest.approx(np.linalg.norm(momentum))
    assert found["joint_moment_error"] == pytest.approx(np.linalg.norm(np.cross(rate, momentum)))
    turned = np.abs(along / np.linalg.norm(h, axis=1)).max()
    assert found["joint_violation_paper"] == pytest.approx(turned)
    assert found["joint_violation"] < 1e-15


def test_a_sliding_leg_needs_the_moment_that_eq_22_lacks():
    """A mass at r(t) = (a + b t) s(t), s turning at w: m r x d2r/dt2 = 2 m a b w for w across s."""
    s, w = np.array([0.0, 0.6, 0.8]), np.array([0.3, 0.0, 0.0])
    leg = Sliding(2.0, 0.4, 0.05, s, w)
    assert leg.coriolis_moment() == pytest.approx(2.0 * 2.0 * 0.4 * 0.05 * w)
    assert leg.moment_of_path() == pytest.approx(leg.coriolis_moment(), rel=1e-3, abs=1e-12)
    tilted = Sliding(2.0, 0.4, 0.05, s, np.array([0.3, 0.2, -0.1]))
    whole = tilted.coriolis_moment() + tilted.printed_moment()
    assert tilted.moment_of_path() == pytest.approx(whole, rel=1e-3)
    assert np.linalg.norm(tilted.printed_moment()) > 0.0


def test_the_lower_limit_of_the_gain_is_rouths_without_the_platform(bench):
    """s^3 I + K (s^2 + (tp + tq) s + tp tq): stable for K > I tp tq/(tp + tq)."""
    found = loop_figures.locus(bench).numbers
    expected = 1100.0 * 0.079 * 5e-4 / 0.0795
    assert found["gain_low_alone"] == pytest.approx(expected, rel=1e-6)
    for factor, stable in ((1.001, True), (0.999, False)):
        K = factor * expected
        roots = np.roots([1100.0, K, K * 0.0795, K * 0.079 * 5e-4])
        assert bool(np.all(roots.real < 0.0)) == stable


def test_peak_of_the_jitter_is_that_of_the_sum_of_all_lines():
    rng = np.random.default_rng(1)
    lines = rng.normal(size=(5, 4, 2, 3)) + 1j * rng.normal(size=(5, 4, 2, 3))
    phases = rng.uniform(0.0, 6.0, 4)
    angle = np.linspace(0.0, 2 * np.pi, 20001)
    whole = np.zeros((5, 3, len(angle)))
    for j in range(4):
        for i in range(2):
            wave = np.exp(1j * (i + 1) * (angle + phases[j]))
            whole += np.real(lines[:, j, i, :, None] * wave)
    assert jitter_peak(lines, phases) == pytest.approx(np.abs(whole).max(axis=2), rel=1e-3)


def test_jitter_of_a_flight_is_what_rides_on_the_slow_motion():
    time = np.arange(5001) / 500.0
    slow = np.stack([0.1 * np.sin(0.3 * time), 0.2 + 0.0 * time, -0.1 * time], axis=1)
    shake = np.array([1e-5, 2e-5, 3e-6]) * np.sin(2 * np.pi * 100.0 * time + 0.4)[:, None]
    run = xr.Dataset({"bus_rate": (("time", "axis"), slow + shake)}, coords={"time": time})
    seconds, peaks = jitter_of_flight(run, Envelope(time[::25], slow[::25], np.zeros((201, 3))))
    assert len(seconds) == 10
    expected = np.tile([1e-5, 2e-5, 3e-6], (8, 1))
    assert peaks[1:-1] == pytest.approx(expected, rel=0.01)


def test_the_papers_own_rates_have_the_papers_ratio():
    assert flights.printed_ratio() == pytest.approx(1.1e-5 / 3.4e-4)


def test_euler_angles_of_the_pictures_are_yaw_pitch_roll():
    roll, pitch, yaw = np.radians([60.0, 30.0, -60.0])
    product = np.array([1.0, 0.0, 0.0, 0.0])
    for angle, axis in ((yaw, 3), (pitch, 2), (roll, 1)):
        turn = np.zeros(4)
        turn[0], turn[axis] = np.cos(angle / 2), np.sin(angle / 2)
        w, v = product[0], product[1:]
        product = np.append(
            w * turn[0] - v @ turn[1:], w * turn[1:] + turn[0] * v + np.cross(v, turn[1:])
        )
    assert flights.euler(product[None])[0] == pytest.approx([roll, pitch, yaw])


def test_every_claim_is_told_apart_and_says_where_it_stands_and_why():
    paper = load_paper("zhang2012")
    names = Counter(claim.name for claim in paper.claims)
    assert max(names.values()) == 1
    titles = (claims.ISOLATION, claims.INFLUENCE, claims.SIMULATIONS, claims.CONCLUSIONS)
    for claim in paper.claims:
        assert claim.place.startswith(("eq.", "fig.", *titles))
        assert claim.given or math.isfinite(claim.published)
        assert claim.why
        assert claim.repeats is None or names[claim.repeats] == 1
    files = Counter(part.name for part in paper.parts)
    assert max(files.values()) == 1
    wanted = ("01b", "04", "06", "07", "08", "09", "10", "11", "12")
    assert {f"figure-{number}" for number in wanted} <= set(files)
