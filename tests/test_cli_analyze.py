"""`quietbus analyze`: JSON with the promised keys, tables, pictures, exit codes."""

import copy
import json
import subprocess
import sys

import matplotlib.image
import pytest
from matplotlib.figure import Figure

import quietbus as qb
from oracles.scenarios import mixed, payload
from quietbus import cli
from quietbus.cli.given import load
from quietbus.plots import analysis_figures
from quietbus.scenario import load_scenario
from quietbus.scenario.text import write_yaml

FIGURES = {
    "bode",
    "nyquist",
    "root-locus",
    "gain-by-height",
    "transmissibility",
    "modes",
    "isolator",
}


def run(*arguments, capsys):
    """Exit code, standard output and error of the command, in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["quietbus", "analyze", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
    captured = capsys.readouterr()
    return stopped.value.code or 0, captured.out, captured.err


def test_json_has_what_the_interface_promises(capsys):
    code, out, err = run("zhang2012", "--json", capsys=capsys)
    assert (code, err) == (0, "")
    found = json.loads(out)
    for axis in "xyz":
        channel, loop = found["channels"][axis], found["loop"][axis]
        assert {"numerator", "denominator", "peak_frequency_hz", "peak_gain"} <= channel.keys()
        assert {"P", "N1", "N2", "N", "Z"} <= loop["nyquist"].keys()
        assert len(loop["gain_margins_db"]) == len(loop["gain_margin_frequencies_hz"]) == 2
        assert {"phase_margin_deg", "crossover_hz"} <= loop.keys()
        ((low, high),) = loop["stable_gain_range"]
        assert low < 2500 < high
    assert set(found["channels"]) == set("xyz")
    ((low, high),) = found["coupled"]["stable_gain_range"]
    assert (low, high) == pytest.approx((0.5924, 3866.0), rel=1e-3)
    assert found["coupled"]["gain_margin_db"] == pytest.approx(3.786, abs=1e-3)
    assert found["coupled"]["disk_margin"] == pytest.approx(0.429, abs=1e-3)
    for base in ("fixed_base", "free"):
        assert len(found["modes"][base]) == 6
        assert {"frequency_hz", "damping"} <= found["modes"][base][0].keys()


@pytest.mark.slow
def test_json_comes_from_a_process_of_its_own_too():
    """Nothing that a library prints gets into it."""
    command = [sys.executable, "-m", "quietbus", "analyze", "zhang2012-slew", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["scenario"] == "zhang2012-slew"


def test_no_upper_end_is_null(tmp_path, capsys):
    """A rigid-like platform on the axis: very stiff struts have no upper limit per axis."""
    stiff = qb.load_scenario("zhang2012").with_overrides({"isolator.legs.damping": 20_000.0})
    file = tmp_path / "stiff.yaml"
    file.write_text(stiff.to_yaml())
    code, out, _ = run(file, "--json", capsys=capsys)
    assert code == 0
    json.loads(out, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))


@pytest.mark.slow
def test_tables_and_pictures(tmp_path, capsys):
    folder = tmp_path / "new" / "out"
    code, out, _ = run("zhang2012", "-o", folder, capsys=capsys)
    assert code == 0
    for text in (
        "What the analysis per axis says, and what is so",
        "0.5924 - 3866",
        "0.45 - 7463",
        "Design rule",
        "free satellite: rotation z",
        "Stable at K = 2500 (conditionally",
        "100 Hz",
    ):
        assert text in out
    assert max(len(line) for line in out.splitlines() if "Stable" not in line) < 170
    assert {path.stem for path in folder.glob("*.png")} == FIGURES
    for path in folder.glob("*.png"):
        image = matplotlib.image.imread(path)
        assert image.shape[1] == 1125
        assert image[..., :3].std() > 0.02
    assert json.loads((folder / "analysis.json").read_text())["scenario"] == "zhang2012"


@pytest.mark.slow
def test_every_axis_of_every_picture_has_a_label_with_a_unit():
    figures = analysis_figures(qb.analyze("zhang2012"))
    assert figures.keys() == FIGURES
    for name in ("bode", "root-locus", "gain-by-height", "transmissibility", "isolator"):
        figure = figures[name]
        assert isinstance(figure, Figure)
        labels = [axes.get_xlabel() + axes.get_ylabel() for axes in figure.axes]
        assert sum("[" in label for label in labels) >= len(labels) - 2
        assert figure.get_suptitle()


@pytest.mark.slow
def test_pictures_without_control_say_so():
    study = qb.analyze(qb.load_scenario("zhang2012").with_overrides({"control": "none"}))
    figures = analysis_figures(study)
    for name in ("bode", "nyquist", "root-locus", "gain-by-height"):
        (axes,) = figures[name].axes
        assert "no attitude control" in axes.texts[0].get_text().replace("\n", " ")
    assert len(figures["modes"].axes) == 12


def two_clusters():
    """Two groups of CMGs."""
    data = mixed()
    return data | {"cluster": [data["cluster"][0], copy.deepcopy(data["cluster"][0])]}


def wheels():
    """Reaction wheels alone."""
    return load_scenario("wheels-demo").to_dict()


def test_gimbal_angles_may_have_units(capsys):
    angles = "--gimbal-angles", "30 deg, -30 deg, 0.1, 0"
    code, out, _ = run("zhang2012", "--json", *angles, capsys=capsys)
    assert code == 0
    assert json.loads(out)["gimbal_angle"] == pytest.approx([0.5235988, -0.5235988, 0.1, 0.0])


@pytest.mark.parametrize(
    ("make", "paths"),
    [
        (mixed, {"cluster[0]": [0.5, -0.5, 0.1, 0.2]}),
        (payload, {"cluster": [0.5, -0.5, 0.1, 0.2]}),
        (two_clusters, {"cluster[0]": [0.5, -0.5, 0.1, 0.2], "cluster[1]": [0.3, 0.4, 0.6, 0.7]}),
    ],
)
def test_gimbal_angles_are_of_all_cmgs_in_their_order(make, paths, tmp_path):
    file = tmp_path / "own.yaml"
    file.write_text(write_yaml(make()))
    angles = [angle for own in paths.values() for angle in own]
    said = ", ".join(f"{angle} rad" for angle in angles)
    scenario = load(str(file), None, None, gimbal_angles=said)
    of_blocks = {path: block.gimbal_angles for path, block in scenario.sites[0].blocks_at}
    for path, own in paths.items():
        assert of_blocks[path] == pytest.approx(own)
    turning = scenario.units.turning
    assert scenario.units.gimbal_angles[turning] == pytest.approx(angles)
    assert not scenario.units.gimbal_angles[~turning].any()


@pytest.mark.parametrize(
    ("make", "said", "message"),
    [
        (two_clusters, "1, 2, 3", "expected 8 angles, one for each CMG (4 of cluster[0], 4 of"),
        (
            two_clusters,
            "1, 2, 3, 4, 5, 6, 7, 8 m",
            "with --gimbal-angles: cluster[1].gimbal",
        ),
        (mixed, "1, 2, 3", "cluster[0].gimbal_angles"),
        (wheels, "1, 2, 3", "--gimbal-angles: expected none, since no unit has a gimbal"),
    ],
)
def test_wrong_gimbal_angles_of_groups_name_the_option(make, said, message, tmp_path, capsys):
    file = tmp_path / "own.yaml"
    file.write_text(write_yaml(make()))
    code, _, err = run(str(file), "--gimbal-angles", said, "--json", capsys=capsys)
    assert code == 2
    assert message in " ".join(err.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no-such-scenario"], "no-such-scenario"),
        (["zhang2012", "--gimbal-angles", "1, 2"], "gimbal_angles"),
        (["zhang2012", "--gimbal-angles", "1, 2, 3, many"], "gimbal_angles"),
        (["zhang2012", "--gimbal-angles", "1 m, 2, 3, 4"], "gimbal_angles"),
    ],
)
def test_bad_input_is_one_message_and_code_2(arguments, message, capsys):
    code, out, err = run(*arguments, "--json", capsys=capsys)
    assert code == 2
    assert out == ""
    assert message in err
    assert "Traceback" not in err


def test_singular_cluster_is_bad_input(tmp_path, capsys):
    law = {"control.steering": {"law": "pseudo_inverse"}, "cluster.gimbal_angles": ["90 deg"] * 4}
    file = tmp_path / "singular.yaml"
    file.write_text(qb.load_scenario("zhang2012").with_overrides(law).to_yaml())
    code, out, err = run(file, "--json", capsys=capsys)
    assert (code, out) == (2, "")
    assert "singular" in err


def test_singular_cluster_with_robust_steering_has_no_stable_gain(capsys):
    """Torque about one axis cannot be had: analysed and said."""
    angles = ",".join(["90 deg"] * 4)
    code, out, _ = run("zhang2012", "--json", "--gimbal-angles", angles, capsys=capsys)
    assert code == 0
    coupled = json.loads(out)["coupled"]
    assert coupled["stable"] is False
    assert coupled["stable_gain_range"] == []
