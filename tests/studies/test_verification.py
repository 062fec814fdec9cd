# ruff: noqa: E501 (a mistake and its message on one line)
"""`quietbus verify` and `qb.verify`: solvers against each other, verdicts, messages, exit codes."""

import json
import re
import sys
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest
import xarray as xr

import quietbus as qb
from quietbus import cli
from quietbus.plain import ARCSEC
from quietbus.plots import pointing_figures
from quietbus.studies.image_motion import body_errors, image_motion, rotors_of

STILL = {"initial": {"attitude": [0, 0, 0], "steady": True}, "simulation.duration": 0.5}
# every motion that there is moves this image, each by about as much
MIRROR = [
    [0.3, -1.0, 0.2, 0.5, 0.1, -0.4, 0.02, 0.01, -0.03, 0.02, -0.01, 0.05],
    [1.0, 0.1, -0.3, 0.2, -0.6, 0.3, 0.01, -0.02, 0.01, -0.03, 0.04, 0.02],
]
STRETCH = {"start": 0.1, "end": 0.5}


def scenario(requirements, line=None, **overrides):
    data = qb.load_scenario("zhang2012").to_dict()
    data["lines_of_sight"] = {"camera": line or {"direction": [0, 0, -1]}}
    data["requirements"] = requirements
    return qb.Scenario.from_dict(data).with_overrides(overrides)


ALL = [
    {"metric": "APE", "confidence": 0.9},
    {"metric": "MPE", "window": 4e-3},
    {"metric": "RPE", "window": 4e-3, "confidence": 0.9},
    {"metric": "PDE", "window": 4e-3, "tau": 13e-3, "confidence": 0.9},
    {"metric": "smear", "window": 4e-3, "confidence": 0.9},
    {"metric": "jitter", "window": 4e-3, "confidence": 0.9},
    {"metric": "rms", "above": 50.0},
    {"metric": "MTF_loss", "window": 4e-3, "spatial_frequency": 2e6, "confidence": 0.9},
]
ALL = [
    {"line_of_sight": "camera", "rotor_phases": "given", "at_most": 1e-3, **each, **STRETCH}
    for each in ALL
]


@pytest.fixture(scope="module")
def both():
    """Harmonic and direct verification of one motion, its image moved by everything."""
    asked = scenario(ALL, {"sensitivity": MIRROR}, **STILL)
    return {
        "harmonic": qb.verify(asked, output_rate=20.0),
        "direct": qb.verify(asked, method="direct"),
    }


def test_image_motion_of_both_solvers_is_the_same(both):
    """Lines reconstructed from the linear sensitivity against attitudes and positions in time."""
    harmonic, direct = (both[method].motion("camera") for method in both)
    t = direct.signal.time[50:-50]
    lines = harmonic.phasors(t).sum(axis=1).real
    truth = direct.signal.at(t)
    truth = truth - truth.mean(axis=0)
    lines = lines - lines.mean(axis=0)
    assert np.max(np.abs(lines - truth)) < 5e-3 * np.max(np.abs(truth))


def test_a_displacement_of_the_whole_satellite_is_one_of_the_bus_alone(both):
    run = both["direct"].run
    shift = np.array([0.1, -0.2, 0.3])
    moved = run.assign({name: run[name] + shift for name in ("bus_position", "platform_position")})
    change = body_errors(moved, both["direct"].scenario) - body_errors(run, both["direct"].scenario)
    expected = np.concatenate([np.zeros(3), shift, np.zeros(6)])
    assert change == pytest.approx(np.broadcast_to(expected, change.shape), abs=1e-6)


@pytest.mark.parametrize("i", range(len(ALL)), ids=[each["metric"] for each in ALL])
def test_harmonic_and_direct_runs_agree_in_every_metric(both, i):
    values = [both[method].verdicts[i].value for method in both]
    assert values[0] == pytest.approx(values[1], rel=1.5e-2)
    assert values[0] > 0.0


def test_meaning_says_what_the_ensemble_is(both):
    assert (
        both["direct"].verdicts[0].meaning == "90 % of the time, rotor phases as given (temporal)"
    )
    assert both["harmonic"].verdicts[1].meaning == "RMS over time, rotor phases as given"


@pytest.fixture(scope="module")
def camera():
    """A camera that looks along -z, while the motion of the step still dies away."""
    asked = scenario(
        [
            "RPE(camera, window = 5 ms, confidence = 0.997) <= 2 arcsec",
            "jitter(camera, window = 5 ms) <= 1e-6 arcsec",
        ]
    )
    return qb.verify(asked, duration=30.0)


def test_values_margins_and_verdicts(camera):
    first, second = camera.verdicts
    assert first.met
    assert not second.met
    assert not camera.met
    assert first.stretch == pytest.approx((27.0, 30.0))
    by_hand = replace(first, value=0.5 / ARCSEC)  # a quarter of the 2 arcsec that are allowed
    assert ARCSEC * by_hand.margin == pytest.approx(1.5)
    assert by_hand.margin_percent == pytest.approx(75.0)
    assert second.margin_percent < -100
    assert first.meaning == "99.7 % of the time for the worst rotor phases (temporal)"
    assert ARCSEC * first.limit == pytest.approx(2.0)
    # looking along z, the image moves by the bus's turns about x and y
    turn = camera.run["bus_attitude_jitter_amplitude"].sel(axis=["x", "y"]).to_numpy()
    lines = camera.motion("camera").lines.amplitude.reshape(*turn.shape)
    assert np.linalg.norm(lines, axis=3) == pytest.approx(np.linalg.norm(turn, axis=3), rel=1e-9)
    assert second.contributions.keys() >= {"slow motion", "rotor 0, 1Ω", "rotor 3, 1Ω"}


def test_json_is_whole(camera):
    numbers = camera.to_dict()
    assert json.loads(json.dumps(numbers, allow_nan=False)) == numbers
    first = numbers["requirements"][0]
    assert (first["unit"], first["limit"]) == ("arcsec", pytest.approx(2.0))
    assert first["margin"] == pytest.approx(2.0 - ARCSEC * camera.verdicts[0].value)
    assert numbers["met"] is False


def test_pictures(camera):
    figures = pointing_figures(camera)
    assert set(figures) == {"cumulative-camera", "exposure"}
    named = [text.get_text() for text in figures["cumulative-camera"].legends[0].get_texts()]
    assert {"rotor 0, 1Ω, 100 Hz", "all", "slow motion, less its cubic trend"} <= set(named)
    for figure in figures.values():
        assert any("[" in axes.get_xlabel() for axes in figure.axes)
    windows, values = camera.curve(1)
    at = np.interp(np.log(5e-3), np.log(windows), values)
    assert at == pytest.approx(camera.verdicts[1].value, rel=0.1)
    limit = figures["exposure"].axes[0].lines[1].get_ydata()
    assert limit == pytest.approx([2.0, 2.0])


@pytest.mark.parametrize(
    ("requirement", "overrides", "method", "said"),
    [
        ("RPE(camera, window = 1 s) <= 1", {}, "harmonic", r"requirements\[0\]: expected a window of at most 0.05 s, the stretch judged \(0.45 s to 0.5 s\); got 1 s"),
        ("PDE(camera, window = 1 ms, tau = 0.1) <= 1", {}, "harmonic", "window and tau together of at most 0.05 s"),
        ("APE(camera, start = 0.2, end = 3) <= 1", {}, "harmonic", "within the run, 0 s to 0.5 s; got 0.2 s to 3 s"),
        ("APE(camera) <= 1", {"simulation.output_rate": 100}, "direct", "output rate of 100 Hz cannot show .* Use method 'harmonic'"),
        ("rms(camera, above = 600) <= 1", {}, "direct", r"requirements\[0\].above: expected less than 500 Hz, half the output rate; got 600 Hz"),
    ],
)  # fmt: skip
def test_what_the_run_cannot_tell_is_refused(requirement, overrides, method, said):
    asked = scenario([requirement], {"sensitivity": MIRROR}, **STILL, **overrides)
    rate = 20.0 if method == "harmonic" else None
    with pytest.raises(qb.ScenarioError, match=said):
        qb.verify(asked, method, output_rate=rate)


def test_no_requirements_is_bad_input_with_an_example():
    with pytest.raises(qb.ScenarioError, match=r"requirements: expected one or more, for example"):
        qb.verify("zhang2012")
    bare = scenario([], **STILL)
    run = qb.simulate(bare, method="harmonic", output_rate=20.0)
    with pytest.raises(ValueError, match="expected one of camera; got 'telescope'"):
        image_motion(run, "telescope")


def test_sensitivities_of_a_wrong_shape_are_refused():
    for given, said in (
        (np.ones((2, 11)), "one to three rows of 12 numbers"),
        (np.ones((4, 12)), "one to three rows of 12 numbers"),
        (np.full((1, 12), np.nan), "all finite"),
    ):
        with pytest.raises(ValueError, match=said):
            qb.simulate("zhang2012", method="harmonic", lines_of_sight={"a": given})


# ---- the command


def run(*arguments, capsys):
    """Exit code, standard output and error of the command, in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["quietbus", "verify", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
    captured = capsys.readouterr()
    return stopped.value.code or 0, captured.out, captured.err


def test_command_writes_table_json_and_pictures(camera, tmp_path, capsys):
    file = tmp_path / "camera.yaml"
    file.write_text(camera.scenario.to_yaml())
    code, out, err = run(file, "-o", tmp_path / "out", capsys=capsys)
    assert code == 1
    assert "1 of 2 not met: jitter 5 ms of camera" in err
    assert "NOT MET" in out
    assert "1: 99.7 % of the time for the worst rotor phases (temporal); 27 s to 30 s" in out
    found = json.loads((tmp_path / "out" / "verification.json").read_text())
    values = [row["value"] for row in found["requirements"]]
    assert values == pytest.approx([ARCSEC * v.value for v in camera.verdicts], rel=1e-9)
    for picture in ("exposure.png", "cumulative-camera.png"):
        image = matplotlib.image.imread(tmp_path / "out" / picture)
        assert image.shape[1] == 1125
        assert image[..., :3].std() > 0.02


def test_command_prints_json_and_nothing_else(camera, tmp_path, capsys):
    file = tmp_path / "camera.yaml"
    loose = camera.scenario.with_overrides({"requirements[1].at_most": "1 deg"})
    file.write_text(loose.to_yaml())
    code, out, _ = run(file, "--json", capsys=capsys)
    assert code == 0
    assert json.loads(out)["met"] is True


def test_command_says_what_is_wrong_with_the_input(tmp_path, capsys):
    code, out, err = run("zhang2012", capsys=capsys)
    assert (code, out) == (2, "")
    assert "zhang2012: requirements: expected one or more, for example" in err
    assert "RPE(camera, window = 5 ms, confidence = 0.997) <= 0.1 arcsec" in err
    file = tmp_path / "short.yaml"
    file.write_text(scenario(["RPE(camera, window = 1 s) <= 1"], **STILL).to_yaml())
    code, _, err = run(file, capsys=capsys)
    assert code == 2
    assert re.search(r"requirements\[0\] \(line \d+\): expected a window of at most 0.05 s", err)
    assert "Traceback" not in err
    code, _, err = run(file, "--method", "magic", capsys=capsys)
    assert code == 2


@pytest.mark.parametrize("command", ["verify", "fit"])
def test_no_empty_folder_is_left_of_bad_input(command, tmp_path, capsys, monkeypatch):
    """Nor those above it; one that was there before stays."""
    file = tmp_path / "short.yaml"
    file.write_text(scenario(["RPE(camera, window = 1 s) <= 1"], **STILL).to_yaml())
    (tmp_path / "before").mkdir()
    for folder in (tmp_path / "a" / "b", tmp_path / "before"):
        monkeypatch.setattr("sys.argv", ["quietbus", command, str(file), "-o", str(folder)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        assert end.value.code == 2
        assert capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["before", "short.yaml"]


def turning_wheels(acceleration):
    """What a run of the wheels' demo tells of its rotors, at constant acceleration [rad/s^2]."""
    time, speed = np.linspace(0.0, 10.0, 101)[:, None], np.array([[100.0, 200.0, -150.0, 120.0]])
    angle = np.array([[0.1, 0.2, 0.3, 0.4]]) + speed * time + 0.5 * acceleration * time**2
    columns = {"rotor_speed": speed + acceleration * time, "rotor_angle": angle}
    return xr.Dataset(
        {name: (("time", "cmg"), values) for name, values in columns.items()},
        {"time": time[:, 0]},
    )


def test_wheels_are_judged_at_their_speeds_if_these_hold_still():
    """Angles at t = 0 follow from the run; 200 rad/s that change by 10 rad/s are 4.8 % too many."""
    speed, phase = rotors_of(turning_wheels(0.0), None)
    np.testing.assert_allclose(speed, [100.0, 200.0, -150.0, 120.0], rtol=1e-12)
    np.testing.assert_allclose(phase, [0.1, 0.2, 0.3, 0.4], atol=1e-9)
    with pytest.raises(ValueError, match=r"by up to 4.76 % from 0 s to 10 s.*Use method 'direct'"):
        rotors_of(turning_wheels(1.0), None)
    slower, _ = rotors_of(turning_wheels(1.0), (9.0, 10.0))  # 0.5 % there
    np.testing.assert_allclose(slower, [109.5, 209.5, -140.5, 129.5], rtol=1e-12)
