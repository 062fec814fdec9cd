"""Orders, noise and ripple: the direct solver against the harmonic one; what is refused."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import welch

import quietbus as qb
from oracles.satellites import with_cluster
from quietbus import cli
from quietbus.build import build_initial_state, build_satellite
from quietbus.solve.direct import Tolerances, integrate
from quietbus.solve.harmonic import integrate_harmonic
from quietbus.solve.noise import with_noise
from quietbus.solve.periodic import on_periodic_solution
from quietbus.solve.validity import refuse_resonance
from quietbus.studies.resolution import refuse_coarse_output

ORDERS = [
    {"order": 1, "radial_force": "2e-6 kg*m", "phase": "random"},
    {"order": 2.83, "radial_torque": "1e-6 kg*m^2", "axial_force": "1e-6 kg*m", "phase": "30 deg"},
    {"order": 4, "radial_torque": 2e-6, "axial_torque": 3e-6, "whirl": "backward"},
]
TABLE = {
    "orders": ORDERS,
    "resonances": {
        "radial": {"frequency": "300 Hz", "damping": 0.02},
        "rocking": {"frequency": "220 Hz", "damping": 0.02},
    },
    "broadband": {
        "radial_force": {"frequency": [10, 150, 280], "psd": ["1e-4 N^2/Hz", 1e-4, 5e-5]},
        "axial_torque": {"frequency": [10, 280], "psd": [1e-7, "1e-7 N^2*m^2/Hz"]},
    },
    "seed": 3,
}
SPEEDS = np.full(4, 200 * np.pi)
DISTURBANCE, STATIC, DYNAMIC = (
    f"cluster.rotor.{kind}" for kind in ("disturbance", "static_imbalance", "dynamic_imbalance")
)
ALONE = {  # what leaves one kind of disturbance
    "static imbalance": {DISTURBANCE: None, DYNAMIC: 0},
    "dynamic imbalance": {DISTURBANCE: None, STATIC: 0},
    "order tables": {STATIC: 0, DYNAMIC: 0},
}
STEADY = {"attitude": [0, 0, 0], "steady": True}


@pytest.fixture(scope="module")
def scenario():
    return qb.load_scenario("zhang2012").with_overrides(
        {
            "cluster.rotor.disturbance": TABLE,
            "initial": STEADY,
            "simulation": {"duration": 1.0, "output_rate": 2000.0},
        }
    )


@pytest.fixture(scope="module")
def satellite(scenario):
    return build_satellite(scenario)


@pytest.fixture(scope="module")
def noisy(satellite):
    return with_noise(satellite, (3, 4, 5, 6), 4.0)


@pytest.fixture(scope="module")
def harmonic(scenario, satellite):
    rest = build_initial_state(scenario, satellite)
    return integrate_harmonic(satellite, rest, 1.0, 20.0, steady=True)


@pytest.fixture(scope="module")
def steady(scenario, satellite):
    return on_periodic_solution(satellite, build_initial_state(scenario, satellite))


def silent(noisy):
    """The same program, its noise zero."""
    (cluster,) = noisy.clusters
    noise = cluster.disturbance.noise
    noise = replace(noise, coefficients=0.0 * noise.coefficients)
    return with_cluster(noisy, disturbance=replace(cluster.disturbance, noise=noise))


def test_orders_come_out_of_the_direct_solver_at_the_harmonic_amplitudes(
    scenario, satellite, noisy, harmonic, steady
):
    """The issue's bound, 1e-4, at each order and axis; and no oscillation besides the lines."""
    direct = integrate(silent(noisy), steady, 1.0, 2000.0, Tolerances(1e-11, 1e-13))
    orders = np.array(scenario.cluster.orders)
    assert list(orders) == [1.0, 2.0, 2.83, 4.0]
    phi = np.asarray(satellite.clusters[0].units.rotor_phase)
    lines = (
        harmonic.jitter.amplitudes["bus_rate"][-1] * np.exp(1j * phi[:, None] * orders)[..., None]
    )
    expected = lines.sum(axis=0)  # (order, axis) at t = 0, all rotors
    t, rate = direct.time, direct.outputs["bus_rate"]
    turn = 200 * np.pi * t[:, None] * orders
    slow = np.vander(t - 0.5, 9)
    columns = np.concatenate([np.cos(turn), np.sin(turn), slow], axis=1)
    found = np.linalg.lstsq(columns, rate, rcond=None)[0]
    amplitude = found[:4] - 1j * found[4:8]
    there = [0, 2, 3]  # at rest order 2, of imbalance alone, is none
    error = np.abs(amplitude - expected)[there] / np.abs(expected)[there]
    assert np.max(error) < 1e-4
    assert np.min(np.abs(expected[there])) > 1e-10
    # what is left: a slow drift by the mean of the second order, and next to no oscillation
    size = np.max(np.abs(rate))
    assert np.max(np.abs(slow @ found[8:])) < 5e-3 * size
    assert np.max(np.abs(rate - columns @ found)) < 1e-4 * size


def test_noise_of_the_direct_solver_has_the_harmonic_spectrum(noisy, harmonic, steady):
    direct = integrate(noisy, steady, 4.0, 2000.0, Tolerances(1e-8, 1e-11))
    settled = direct.time >= 1.0
    f, psd = welch(direct.outputs["bus_rate"][settled], 2000.0, nperseg=1000, axis=0)
    noise = harmonic.jitter.broadband
    expected = noise.psd["bus_rate"][-1].sum(axis=1)
    expected = np.stack([np.interp(f, noise.frequency, column) for column in expected.T], axis=1)
    between = (f > 16) & (f < 270) & (np.abs(f - 100) > 8)  # the lines
    ratio = psd[between] / expected[between]
    assert ratio.mean() == pytest.approx(1.0, abs=0.15)
    halves = np.array_split(ratio, 2)
    assert [half.mean() for half in halves] == pytest.approx([1.0, 1.0], abs=0.25)
    # beyond the tables there is nothing
    assert np.max(psd[(f > 300) & (np.abs(f - 400) > 12)]) < 1e-3 * np.max(expected)


@pytest.mark.slow
def test_ripple_of_moving_gimbals_agrees_in_both_solvers():
    """Gimbals that carry a steady acceleration of the bus, about 0.03 rad/s: lines at 6 Hz."""
    slew = {"max_rate": 0.03, "max_acceleration": 5e-4, "max_jerk": 1e-3}
    ripple = {"ripple": [{"per_turn": 1200, "torque": "0.1 mN*m", "phase": 0.4}]}
    scenario = qb.load_scenario("zhang2012").with_overrides(
        {
            "cluster.rotor.static_imbalance": 0,
            "cluster.rotor.dynamic_imbalance": 0,
            "cluster.gimbal_motor": ripple,
            "initial.attitude": [0, 0, 0],
            "target": {"attitude": [0.6, 0.3, -0.4], "guidance": slew},
            "simulation": {"duration": 6.0, "output_rate": 1000},
        }
    )
    harmonic = qb.simulate(scenario, method="harmonic", output_rate=200.0)
    direct = qb.simulate(scenario)
    both = qb.reconstruct(harmonic, around=5.5, span=1.0, rate=1000.0)
    last = slice(5000, 5000 + len(both))
    smooth = np.vander(np.linspace(-1, 1, len(both)), 5)
    ripples = [
        signal - smooth @ np.linalg.lstsq(smooth, signal, rcond=None)[0]
        for signal in (direct["bus_rate"].to_numpy()[last], both.to_numpy())
    ]
    for axis in (0, 2):  # by fast gimbals; about y there is little
        error = np.std(ripples[0][:, axis] - ripples[1][:, axis])
        assert error < 0.02 * np.std(ripples[0][:, axis])
    size = harmonic["bus_rate_ripple_amplitude"].isel(time=-1).max()
    assert float(harmonic["bus_rate_jitter_worst_case"].isel(time=-1).max()) > float(size) > 1e-9


def test_the_jitter_study_has_orders_and_noise(scenario, satellite, harmonic):
    """Each kind in the budget is what a satellite with it alone has."""
    study = qb.jitter(scenario)
    lines = harmonic.jitter.amplitudes["bus_rate"][-1]
    found = study.bus_rate("isolated")
    assert np.max(np.abs(found - lines)) < 1e-5 * np.max(np.abs(lines))
    parts = dict(zip(study.kinds, study.budget["isolated"], strict=True))
    size = np.max(np.abs(found))
    for kind, others in ALONE.items():
        alone = qb.jitter(scenario.with_overrides(others)).bus_rate("isolated")
        part = parts.pop(kind)
        assert np.max(np.abs(part[:, : alone.shape[1]] - alone)) < 1e-6 * size, kind
        assert np.all(part[:, alone.shape[1] :] == 0.0)
        assert np.max(np.abs(part)) > 1e-3 * size
    for kind, part in parts.items():  # bearings are aligned, rotors round
        assert np.max(np.abs(part)) < 1e-6 * size, kind
    numbers = study.to_dict()
    assert numbers["orders"][2]["frequency_hz"] == pytest.approx(283.0)
    together = numbers["combined"]["isolated"]
    noise = np.array(together["bus_rate_noise_rms_deg_s"])
    alone = np.rad2deg(np.sqrt(harmonic.jitter.broadband.variance("bus_rate", 1)[0]))
    assert noise == pytest.approx(alone, rel=1e-2)
    lines_rms = np.array(together["bus_rate_rms_deg_s"]) ** 2 - noise**2
    phase = np.exp(1j * np.outer([0, 0.7, 1.4, 2.1], study.orders))[..., None]
    expected = 0.5 * np.sum(np.abs(np.sum(found * phase, axis=0)) ** 2, axis=0)
    assert np.deg2rad(np.sqrt(lines_rms)) == pytest.approx(np.sqrt(expected), rel=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"simulation.output_rate": 1000.0},
            r"simulation\.output_rate: expected at least 1024 Hz to show order 4 of rotor \d",
        ),
        (
            {"simulation.output_rate": 600.0, "cluster.rotor.disturbance.orders": None},
            r"simulation\.output_rate: expected at least 716.8 Hz to show the end of the broadband",
        ),
        (
            {"simulation.tolerances.absolute": 1e-3},
            r"simulation\.tolerances\.absolute: expected at most .* by order .* got 0\.001",
        ),
    ],
)
def test_a_direct_run_that_cannot_show_what_is_declared_is_refused(scenario, changes, message):
    with pytest.raises(qb.ScenarioError, match=message):
        qb.simulate(scenario.with_overrides(changes))


def test_a_tolerance_of_the_method_hides_a_line_as_the_scenario_s_does(scenario):
    with pytest.raises(qb.ScenarioError, match=r"expected at most .* by order .* got 0\.001"):
        qb.simulate(scenario, qb.Direct(absolute_tolerance=1e-3))


def test_a_line_without_amplitude_needs_no_output_rate(scenario):
    lines = [*ORDERS[:1], {"order": 9}]
    changes = {
        "cluster.rotor.disturbance": {"orders": lines},
        "simulation.output_rate": 300.0,
    }
    refuse_coarse_output(scenario.with_overrides(changes))
    lines[1]["axial_torque"] = 1e-9
    with pytest.raises(qb.ScenarioError, match=r"order 9 of rotor \d at 900 Hz"):
        refuse_coarse_output(scenario.with_overrides(changes))


def test_command_refuses_a_coarse_output_rate_with_status_2(scenario, tmp_path, capsys):
    path = tmp_path / "wheel.yaml"
    path.write_text(scenario.with_overrides({"simulation.output_rate": 500.0}).to_yaml())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            sys, "argv", ["quietbus", "simulate", str(path), "-o", str(tmp_path / "r.nc")]
        )
        with pytest.raises(SystemExit) as stopped:
            cli.main()
    said = capsys.readouterr().err
    assert stopped.value.code == 2
    assert "simulation.output_rate" in said
    assert "Traceback" not in said


def test_an_order_of_a_table_on_an_undamped_mode_is_named(satellite):
    on_it = np.array([0.0, 2.83j * 200 * np.pi])
    with pytest.raises(qb.ResonanceError, match=r"order 2\.83 of rotor 0 \(283 Hz\).*undamped"):
        refuse_resonance(satellite, "here", on_it, SPEEDS)
    refuse_resonance(satellite, "here", 0.999 * on_it, SPEEDS)
