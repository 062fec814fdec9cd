"""Jitter at one operating point: closed forms, budget, search, derivatives, and the command."""

import json
import sys

import numpy as np
import pytest

import quietbus as qb
from quietbus import cli
from quietbus.analysis.jitter.combine import combine
from quietbus.analysis.jitter.lines import KINDS
from quietbus.studies.jitter import jitter_of_designs, worst_case_norm
from quietbus.tables.jitter import jitter_tables


@pytest.fixture(scope="module")
def study():
    return qb.jitter("zhang2012")


@pytest.fixture(scope="module")
def numbers(study):
    return study.to_dict()


def test_the_worst_case_of_a_direct_run_is_that_over_all_rotor_phases(study):
    """Reached by phases that put all lines of an axis in line; at the angles of the run's end."""
    run = qb.simulate("zhang2012", duration=0.02)
    found = qb.worst_over_phases(run)
    at_end = qb.jitter("zhang2012", run["gimbal_angle"].to_numpy()[-1])
    rate, orders = at_end.bus_rate("isolated"), np.array(at_end.orders)
    for axis in range(3):
        first = rate[:, 0, axis]  # order 2 of a rigid rotor is nothing
        aligned = -np.angle(first)
        turned = rate[..., axis] * np.exp(1j * aligned[:, None] * orders)
        assert found[axis] == pytest.approx(np.abs(turned[:, 0].sum()), rel=1e-6)
    assert np.all(found > 1.001 * at_end.combined("isolated").envelope)


def test_phases_of_zero_let_a_symmetric_cluster_cancel_and_the_default_does_not():
    """An even bus: in phase four CMGs cancel about x and y; left out, phases are typical."""
    even = {"bus.inertia": np.diag([900.0, 900.0, 800.0]).tolist()}
    scenario = qb.load_scenario("zhang2012").with_overrides(even)
    data = scenario.to_dict()
    del data["cluster"]["rotor_phases"]
    typical = qb.jitter(qb.Scenario.from_dict(data)).combined("rigid")
    zero = scenario.with_overrides({"cluster.rotor_phases": [0.0] * 4})
    cancelled = qb.jitter(zero).combined("rigid")
    assert cancelled.worst_case == pytest.approx(typical.worst_case, rel=1e-12)
    norm = lambda values: np.linalg.norm(values[:2])  # noqa: E731
    assert norm(cancelled.envelope) < 0.02 * norm(cancelled.worst_case)
    assert norm(typical.envelope) > 0.2 * norm(typical.worst_case)


def test_static_imbalance_on_a_rigid_mount_has_a_closed_form():
    """A force m e Omega^2 turning in the rotor's plane, on one rigid body without net momentum."""
    light = {"mass": 0, "distance": 0.1, "transverse_inertia": 0, "axial_inertia": 0}
    scenario = qb.load_scenario("zhang2012").with_overrides(
        {
            "control": "none",
            "cluster.rotor.dynamic_imbalance": 0,
            "isolator.legs.upper_part": light,
            "isolator.legs.lower_part": light,
        }
    )
    study = qb.jitter(scenario)
    satellite = study.satellite("rigid")
    cluster = satellite.clusters[0].units
    speed = 2 * np.pi * 100.0
    masses = [float(satellite.bus.mass_X), float(satellite.body("plate").mass_X)]
    places = [np.zeros(3), np.asarray(satellite.mounts[0].p_BX_B)]
    inertias = [np.asarray(satellite.bus.I_XXcm_X), np.asarray(satellite.body("plate").I_XXcm_X)]
    for j in range(4):
        R, C = (
            np.asarray(cluster.R_PG0[j]),
            np.asarray(satellite.mounts[0].p_BX_B + cluster.p_PC_P[j]),
        )
        masses += [float(cluster.gimbal_mass[j]), float(cluster.rotor_mass[j])]
        places += [C, C]
        inertias += [R @ I @ R.T for I in (cluster.I_GGcm_G[j], cluster.I_RRcm_R[j])]
    center = np.average(places, axis=0, weights=masses)
    I = sum(
        J + m * (r @ r * np.eye(3) - np.outer(r, r))
        for J, m, r in zip(inertias, masses, np.array(places) - center, strict=True)
    )
    for j in range(4):
        R = np.asarray(cluster.R_PG0[j])
        t, g = R[:, 1], R[:, 2]
        pull = 1.36e-5 * speed**2 * (t - 1j * g)  # along t cos phi + g sin phi
        arm = places[2 + 2 * j] - center
        expected = np.linalg.solve(I, np.cross(arm, pull)) / (1j * speed)
        found = study.bus_rate("rigid")[j, 0]
        assert np.max(np.abs(found - expected)) < 1e-5 * np.max(np.abs(expected))


def test_it_is_what_a_harmonic_run_comes_to(study):
    for mount in ("isolated", "rigid"):
        settled = qb.load_scenario("zhang2012").with_overrides({"initial": "steady"})
        run = qb.simulate(settled, method="harmonic", mount=mount, duration=0.2)
        envelope = run["bus_rate_jitter_envelope"].isel(time=-1).to_numpy()
        assert study.combined(mount).envelope == pytest.approx(envelope, rel=1e-6)


def test_lines_combine_as_time_signals_do():
    """Two rotors of one speed, one of another: what long sampling of the sum finds."""
    rng = np.random.default_rng(4)
    amplitude = rng.normal(size=(3, 2, 1)) + 1j * rng.normal(size=(3, 2, 1))
    amplitude[:, 1] = 0.0
    frequency = np.outer([700.0, -700.0, 700.0 * np.sqrt(2)], [1, 2])
    phase = np.outer([0.3, 1.1, -2.0], [1, 2])
    t = np.linspace(0, 40, 1_000_001)
    signal = sum(
        (amplitude[j, o, 0] * np.exp(1j * (frequency[j, o] * t + phase[j, o]))).real
        for j in range(3)
        for o in range(2)
    )
    combined = combine(amplitude, frequency, phase)
    assert combined.envelope[0] == pytest.approx(np.max(np.abs(signal)), rel=1e-3)
    assert combined.rms[0] == pytest.approx(np.sqrt(np.mean(signal**2)), rel=1e-3)
    assert combined.worst_case[0] == pytest.approx(np.sum(np.abs(amplitude)))
    assert combined.rss[0] == pytest.approx(np.linalg.norm(amplitude))


def test_the_budget_adds_up_and_names_the_kind(study):
    error = {"alpha": 0.01, "beta": 0.02}
    tilted = study.scenario.with_overrides({"cluster.rotor.installation_error": error})
    for each in (study, qb.jitter(tilted)):
        for mount in ("isolated", "rigid"):
            parts = each.budget[mount]
            whole = each.bus_rate(mount)
            assert np.max(np.abs(parts.sum(axis=0) - whole)) < 1e-12 * np.max(np.abs(whole))
    by_kind = np.max(np.abs(study.budget["isolated"]), axis=(1, 2, 3))
    assert by_kind[0] > 0
    assert by_kind[1] > 0
    assert np.max(by_kind[2:]) < 1e-9 * by_kind[0]
    tilt = np.max(np.abs(qb.jitter(tilted).budget["isolated"]), axis=(1, 2, 3))
    assert 1e-3 < tilt[2] / tilt[0] < 0.5
    only_static = study.scenario.with_overrides({"cluster.rotor.dynamic_imbalance": 0})
    alone = qb.jitter(only_static).bus_rate("isolated")
    part = study.budget["isolated"][KINDS.index("static imbalance")]
    assert np.max(np.abs(part - alone)) < 1e-9 * np.max(np.abs(alone))


def test_no_angles_tried_at_random_are_worse_than_the_worst(study):
    found = study.worst("isolated")
    angles = np.random.default_rng(9).uniform(-np.pi, np.pi, (4000, 4))
    tried = jitter_of_designs([study.satellite("isolated")] * 4000, angles)["bus_rate"]
    norms = worst_case_norm(tried)
    assert found.value > 0.999 * np.max(norms)
    assert found.value > worst_case_norm(study.bus_rate("isolated")[None])[0]
    at = jitter_of_designs([study.satellite("isolated")], found.gimbal_angle)["bus_rate"]
    assert worst_case_norm(at)[0] == pytest.approx(found.value, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("mount", ["isolated", "rigid"])
def test_derivatives_by_scenario_parameters_agree_with_differences(study, mount):
    steps = {
        "isolator.legs.stiffness": 1e-2,
        "isolator.legs.damping": 1e-2,
        "isolator.legs.upper_part.mass": 1e-2,
        "isolator.separation": 1e-3,
        "isolator.plate.mass": 1e-2,
        "bus.mass": 1e-2,
        "bus.inertia[0][0]": 1e-2,
        "cluster.rotor.speed": 1e-3,
        "cluster.rotor.static_imbalance": 1e-1,
        "cluster.rotor.dynamic_imbalance": 1e-1,
        "cluster.gimbal_body.mass": 1e-2,
        "control.pid.kd": 1e-1,
    }
    found = study.derivative(list(steps), mount)
    for path, step in steps.items():
        value = study.scenario.number(path)
        changed = [
            qb.jitter(study.scenario.with_overrides({path: value * (1 + k * step)}))
            for k in (-2, -1, 1, 2)
        ]
        a, b, c, d = (each.bus_rate(mount) for each in changed)
        difference = (8 * (c - b) - (d - a)) / (12 * value * step)
        scale = np.max(np.abs(difference))
        noise = 1e-9 * np.max(np.abs(study.bus_rate(mount))) / (value * step)
        assert np.max(np.abs(found[path] - difference)) < 1e-5 * scale + noise, path


def test_a_derivative_at_the_end_of_a_range_and_a_wrong_path(study):
    at_zero = study.scenario.with_overrides({"cluster.rotor.static_imbalance": 0})
    by = qb.jitter(at_zero).derivative(["cluster.rotor.static_imbalance"], "isolated")
    part = study.budget["isolated"][0] / 1.36e-5  # linear in the imbalance
    found = by["cluster.rotor.static_imbalance"]
    assert np.max(np.abs(found - part)) < 1e-6 * np.max(np.abs(part))
    with pytest.raises(qb.ScenarioError, match=r"cluster\.rotor\.weight: is not in the scenario"):
        study.derivative(["cluster.rotor.weight"], "isolated")
    with pytest.raises(qb.ScenarioError, match=r"bus\.inertia: is not one number"):
        study.derivative(["bus.inertia"], "isolated")


def test_a_preloaded_platform_is_refused():
    scenario = qb.load_scenario("zhang2012").with_overrides({"isolator.legs.free_length": 0.6})
    with pytest.raises(ValueError, match=r"no equilibrium here.*free_length"):
        qb.jitter(scenario)


def test_json_has_what_the_interface_promises(numbers, study):
    line = numbers["orders"][0]
    assert {"cmg", "order", "frequency_hz", "bus_rate_amplitude_deg_s"} <= line.keys()
    assert len(numbers["orders"]) == 8
    assert line["frequency_hz"] == pytest.approx(100.0)
    found = np.rad2deg(np.abs(study.bus_rate("isolated")[0, 0]))
    assert line["bus_rate_amplitude_deg_s"] == pytest.approx(found)
    percent = 100 * found / np.rad2deg(np.abs(study.bus_rate("rigid")[0, 0]))
    assert line["ratio_percent"] == pytest.approx(percent)
    assert line["ratio_db"] == pytest.approx(20 * np.log10(percent / 100))
    arcsec = line["isolated"]["bus_attitude_amplitude_arcsec"]
    assert arcsec == pytest.approx(found * 3600 / (2 * np.pi * 100.0), rel=1e-6)
    for mount in ("isolated", "rigid"):
        combined = numbers["combined"][mount]
        assert combined["bus_rate_worst_case_deg_s"] >= combined["bus_rate_envelope_deg_s"]
    assert json.loads(json.dumps(numbers, allow_nan=False)) == numbers


def run(*arguments, capsys):
    """Exit code, standard output and error of the command, in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["quietbus", "jitter", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
    captured = capsys.readouterr()
    return stopped.value.code or 0, captured.out, captured.err


def test_command_prints_json_and_nothing_else(numbers, capsys):
    code, out, err = run("zhang2012", "--json", capsys=capsys)
    assert (code, err) == (0, "")
    assert json.loads(out)["orders"] == numbers["orders"]


def test_command_prints_tables_and_draws(tmp_path, capsys):
    code, out, _ = run("zhang2012", "-o", tmp_path, capsys=capsys)
    assert code == 0
    for words in ("static imbalance", "dynamic imbalance", "1.5 %", "Worst gimbal angles"):
        assert words in out
    assert (tmp_path / "budget.png").stat().st_size > 10_000
    assert json.loads((tmp_path / "jitter.json").read_text())["axes"] == ["x", "y", "z"]


def test_critical_speeds_are_told_of_wheels_too(numbers):
    """Wheels have no gimbal angles to be worst at, but speeds to keep away from."""
    _, table, *_ = jitter_tables(numbers | {"worst": {}, "gimbal_angle_deg": []})
    assert table.title.startswith("Critical speeds on the platform, up to 7200 rpm")
    assert table.row_count > 0
    titles = [each.title.split(":")[0] for each in jitter_tables(numbers)]
    assert titles[1] == "Critical speeds on the platform, gimbals held, up to 7200 rpm"
    assert titles[-1] == "Worst gimbal angles"


def test_speeds_to_keep_away_from_come_first_and_those_without_a_peak_are_counted(numbers):
    found = [c for c in numbers["sweep"]["isolated"]["critical_speeds"] if c["excited"]]
    sharp = [c for c in found if 0.5 / c["damping"] >= 2.0]
    assert 0 < len(sharp) < len(found)
    _, table, *_ = jitter_tables(numbers)
    assert table.row_count == len(sharp)
    assert f"{len(found) - len(sharp)} of modes damped to a Q below 2" in table.caption


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("zhang2021",), "zhang2021"),
        (("zhang2012", "--gimbal-angles", "1, 2"), "expected 4 angles"),
        (("zhang2012", "--gimbal-angles", "1 kg, 0, 0, 0"), "got '1 kg'"),
        (("zhang2012", "-o", "/proc/nowhere"), "cannot be made"),
    ],
)
def test_wrong_input_is_one_message(arguments, message, capsys):
    code, out, err = run(*arguments, capsys=capsys)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err


def test_no_imbalance_is_no_jitter(capsys):
    none = {"cluster.rotor.static_imbalance": 0, "cluster.rotor.dynamic_imbalance": 0}
    numbers = qb.jitter(qb.load_scenario("zhang2012").with_overrides(none)).to_dict()
    assert all(max(line["bus_rate_amplitude_deg_s"]) < 1e-13 for line in numbers["orders"])
