"""Pictures of jitter show the amplitudes that were put in, name the orders, and say what is not."""

import re
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr

import quietbus as qb
from quietbus import plots
from quietbus.analysis.jitter.lines import KINDS
from quietbus.model.moments import ORDERS
from quietbus.plots import (
    compare_figures,
    envelope_comparison,
    jitter_figures,
    run_figures,
    save_figures,
)
from quietbus.results import VARIABLES
from quietbus.results.motion import RotorLines, last_lines
from quietbus.scenario import load_scenario
from quietbus.studies.jitter import jitter_of_designs

PASSED = np.array([0.01, 0.02, 0.05])  # what the synthetic platform leaves, per axis
RNG = np.random.default_rng(7)
# (cmg, order, axis) [rad/s] of the rigid mount; nothing at the second order
SIZE = np.stack([RNG.uniform(1e-6, 8e-6, (4, 3)), np.zeros((4, 3))], axis=1)
SHIFT = RNG.uniform(-3.0, 3.0, (4, 2, 3))
PHASES = np.array([0.0, 0.7, 1.4, 2.1])  # the scenario's


def synthetic(mount, size=SIZE, count=50, **attributes):
    """A harmonic run of which the jitter grows linearly to twice ``size``, from t = 0 to 4.9 s."""
    scenario = load_scenario("zhang2012").with_overrides(
        {"isolator.mount": mount, "simulation.output_rate": 10.0}
    )
    time = np.arange(count) / 10.0
    sizes = {"axis": 3, "quaternion": 4, "cmg": 4, "leg": 6}
    data = {}
    for name, (dimensions, unit, _) in VARIABLES.items():
        shape = (count, *(sizes[dimension] for dimension in dimensions))
        data[name] = (("time", *dimensions), np.full(shape, 1e-3), {"units": unit})
    data["bus_attitude"] = (("time", "quaternion"), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)))
    speed = np.full((count, 4), 200.0 * np.pi)
    data["rotor_speed"] = (("time", "cmg"), speed, {"units": "rad/s"})
    angle = PHASES + speed * time[:, None]
    data["rotor_angle"] = (("time", "cmg"), angle, {"units": "rad"})
    if mount == "isolated":
        size = size * PASSED
    grown = size * (1.0 + time / 4.9)[:, None, None, None]
    lines = ("time", "cmg", "order", "axis")
    data["bus_rate_jitter_amplitude"] = (lines, grown)
    data["bus_rate_jitter_phase"] = (lines, np.broadcast_to(SHIFT, grown.shape))
    for name, share in (("envelope", 0.8), ("worst_case", 1.0), ("rss", 0.5), ("rms", 0.4)):
        data[f"bus_rate_jitter_{name}"] = (("time", "axis"), share * grown.sum(axis=(1, 2)))
    data["jitter_change_error"] = ("time", 1e-4 * np.sin(time))
    attributes = {
        "title": f"zhang2012, {mount}",
        "mount": mount,
        "method": "harmonic",
        "status": "complete",
        "scenario": scenario.to_yaml(),
    } | attributes
    return xr.Dataset(data, {"time": time, "order": list(ORDERS)}, attributes)


def pair(**options):
    return {mount: synthetic(mount, **options) for mount in ("isolated", "rigid")}


@pytest.fixture(scope="module")
def study():
    return qb.jitter("zhang2012")


@pytest.fixture(scope="module")
def figures(study):
    return jitter_figures(study)


def line(axes, label):
    (found,) = [line for line in axes.lines if line.get_label().startswith(label)]
    return np.array(found.get_data())


def texts(figure):
    return " ".join(text.get_text() for axes in figure.axes for text in axes.texts)


def labels(figure):
    both = [label for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel())]
    return [label for label in both if label]


def prefix(label):
    """The power of ten in an axis's label, as a factor on deg/s."""
    found = re.search(r"\[(?:\$10\^\{(-?\d+)\}\$ )?deg/s\]$", label)
    return 10.0 ** int(found[1] or 0)


def test_every_picture_is_saved_and_every_label_has_a_unit(figures, tmp_path):
    drawn = [figures, run_figures(synthetic("rigid")), compare_figures(pair())]
    for i, each in enumerate(drawn):
        for path in save_figures(each, tmp_path / str(i)):
            assert np.ptp(mpl.image.imread(path)) > 0.5
        for figure in each.values():
            assert labels(figure)
            assert all(re.search(r"\[.+\]$", label) for label in labels(figure)), labels(figure)
            for axes in figure.axes:
                # the axis of the orders' names, above the first panel of a spectrum, is a child
                assert axes.lines or axes.patches or axes.texts


def test_a_harmonic_run_has_the_pictures_of_a_direct_one():
    expected = {"attitude", "rates", "gimbals", "spectrum", "control"}
    assert run_figures(synthetic("rigid")).keys() == expected
    assert run_figures(synthetic("isolated")).keys() == expected | {"struts"}


@pytest.mark.parametrize(
    ("label", "share"), [("envelope", 0.8), ("worst case", 1.0), ("root of sum of squares", 0.5)]
)
def test_jitter_over_time_is_drawn_per_axis_in_the_unit_of_its_label(label, share):
    figure = run_figures(synthetic("rigid"))["rates"]
    _, *panels, _ = figure.axes
    factor = prefix(panels[0].get_ylabel())
    for i, axes in enumerate(panels):
        time, values = line(axes, label)
        expected = np.rad2deg(share * SIZE[:, :, i].sum()) * (1.0 + time / 4.9)
        assert factor * values == pytest.approx(expected)
        assert axes.get_yscale() == "log"
        low, high = axes.get_ylim()
        assert low < values.min() < values.max() < high


def test_noise_of_the_rotors_is_drawn_beside_the_lines():
    run = synthetic("rigid")
    noise = np.full((run.sizes["time"], 3), [1e-5, 2e-5, 3e-5])
    run["bus_rate_noise_rms"] = (("time", "axis"), noise)
    _, *panels, _ = run_figures(run)["rates"].axes
    factor = prefix(panels[0].get_ylabel())
    for i, axes in enumerate(panels):
        _, values = line(axes, "RMS of the rotors' noise")
        assert factor * values == pytest.approx(np.rad2deg(noise[:, i]))
        assert axes.get_ylim()[1] > values.max()


def test_the_estimated_error_is_drawn_in_percent_and_its_largest_value_told():
    axes = run_figures(synthetic("rigid"))["rates"].axes[-1]
    time, values = np.array(axes.lines[0].get_data())
    assert values == pytest.approx(100.0 * 1e-4 * np.sin(time))
    assert "at most 0.01 %, at 1.6 s" in axes.get_title(loc="left")


def test_the_spectrum_names_orders_and_leaves_out_what_is_zero():
    figure = run_figures(synthetic("rigid"))["spectrum"]
    (top,) = figure.axes[0].child_axes
    assert [name.get_text() for name in top.get_xticklabels()] == ["1Ω, 100 Hz"]
    title = figure.axes[0].get_title(loc="left")
    assert "left out" in title
    assert "2Ω, 200 Hz" in title
    names = [name.get_text() for name in figure.axes[-1].get_xticklabels()]
    assert names == ["rotor 0", "rotor 1", "rotor 2", "rotor 3", "all"]


def test_stems_are_the_amplitudes_at_the_end_and_their_sum_with_phases():
    """A brute-force sum of cosines reaches, over a turn, the height of the stem of all."""
    panels = run_figures(synthetic("rigid"))["spectrum"].axes
    factor = prefix(panels[0].get_ylabel())
    turn = np.linspace(0.0, 2.0 * np.pi, 4001)[:, None]
    for i, axes in enumerate(panels):
        _, heights = line(axes, "without platform")
        assert factor * heights[:4] == pytest.approx(np.rad2deg(2.0 * SIZE[:, 0, i]))
        waves = 2.0 * SIZE[:, 0, i] * np.cos(turn + PHASES + SHIFT[:, 0, i])
        assert factor * heights[4] == pytest.approx(np.rad2deg(waves.sum(axis=1).max()), rel=1e-5)


def test_lines_of_one_frequency_stand_together_whatever_their_orders_and_senses():
    """Rotor 1 turns backwards at twice the speed: its first order meets the others' second."""
    frequency = np.array([[1.0, 2.0], [-2.0, -4.0]])
    amplitude = RNG.normal(size=(2, 2, 3)) + 1j * RNG.normal(size=(2, 2, 3))
    phase = np.array([[0.3, 0.6], [-0.8, -1.6]])
    lines = RotorLines(amplitude, frequency, phase, (1, 2))
    assert lines.by_frequency() == [[(0, 0)], [(0, 1), (1, 0)], [(1, 1)]]
    group = lines.by_frequency()[1]
    assert lines.name(group) == "1Ω, 2Ω, 0.31831 Hz"
    time = np.linspace(0.0, np.pi, 4001)[:, None]
    waves = sum((amplitude[at] * np.exp(1j * (frequency[at] * time + phase[at]))) for at in group)
    assert lines.together(group) == pytest.approx(waves.real.max(axis=0), rel=1e-5)


def test_a_rotor_of_its_own_speed_has_its_own_line_and_no_sum():
    run = synthetic("rigid", size=np.ones((4, 2, 3)) * 1e-6)
    scenario = load_scenario("zhang2012")
    units = [
        {
            "position": list(unit.position),
            "gimbal_axis": list(unit.gimbal_axis),
            "spin_axis": list(unit.spin_axis),
            "rotor": {"speed": 2.0 * np.pi * (100.0 + j)},
        }
        for j, unit in enumerate(scenario.cluster.placed())
    ]
    changed = scenario.with_overrides({"cluster.pyramid": None, "cluster.units": units})
    run.attrs["scenario"] = changed.to_yaml()
    run["rotor_speed"] = run["rotor_speed"] + 2.0 * np.pi * np.arange(4)
    figure = run_figures(run)["spectrum"]
    (top,) = figure.axes[0].child_axes
    named = [name.get_text() for name in top.get_xticklabels()]
    assert named == [f"{h}Ω, {h * (100 + j)} Hz" for h in (1, 2) for j in range(4)]
    assert len(last_lines(run).by_frequency()) == 8
    assert figure.axes[0].get_title(loc="left") == ""


def test_the_comparison_shows_both_envelopes_and_the_share_left_in_percent():
    figure = envelope_comparison(pair())
    grid = np.reshape(figure.axes, (3, 3))
    factor = prefix(grid[1, 0].get_ylabel())
    for i in range(3):
        for label, share in (("without platform", 1.0), ("with platform", PASSED[i])):
            time, values = line(grid[1, i], label)
            expected = np.rad2deg(0.8 * share * SIZE[:, :, i].sum()) * (1.0 + time / 4.9)
            assert factor * values == pytest.approx(expected)
        _, left = np.array(grid[2, i].lines[0].get_data())
        assert left == pytest.approx(100.0 * PASSED[i])
        assert (grid[0, i].get_yscale(), grid[1, i].get_yscale()) == ("linear", "log")
    assert grid[2, 0].get_ylabel().endswith("[%]")
    assert "at most 5 %" in figure.get_suptitle()


def test_a_run_that_stopped_early_is_compared_as_far_as_both_came(tmp_path):
    runs = pair()
    runs["rigid"] = runs["rigid"].isel(time=slice(0, 20)).assign_attrs(status="stopped")
    figures = compare_figures(runs)
    save_figures(figures, tmp_path)
    time, left = np.array(figures["rates"].axes[6].lines[0].get_data())
    assert time[-1] == pytest.approx(1.9)
    assert left == pytest.approx(100.0 * PASSED[0])
    assert "rigid, stopped at 1.9 s" in figures["rates"].get_suptitle()


def test_runs_of_different_methods_are_not_compared():
    runs = pair()
    runs["rigid"].attrs["method"] = "direct"
    with pytest.raises(ValueError, match="one method"):
        compare_figures(runs)


def test_an_axis_without_jitter_says_so(tmp_path):
    size = SIZE * [1.0, 1.0, 0.0]
    figures = compare_figures(pair(size=size))
    save_figures(figures, tmp_path)
    assert "no jitter" in figures["rates"].axes[5].texts[0].get_text()
    assert not figures["rates"].axes[4].texts


def test_no_imbalance_gives_pictures_that_say_so(tmp_path):
    runs = pair(size=0.0 * SIZE)
    compared, single = compare_figures(runs), run_figures(runs["isolated"])
    for i, each in enumerate((compared, single)):
        save_figures(each, tmp_path / str(i))
        assert "no jitter" in texts(each["rates"])
        assert "no jitter" in texts(each["spectrum"])
    scenario = load_scenario("zhang2012").with_overrides(
        {"cluster.rotor.static_imbalance": 0.0, "cluster.rotor.dynamic_imbalance": 0.0}
    )
    figures = jitter_figures(qb.jitter(scenario))
    save_figures(figures, tmp_path / "study")
    assert figures.keys() == {"spectrum", "budget", "worst"}
    assert all("no jitter" in texts(figure) for figure in figures.values())


def test_the_study_spectrum_shows_the_amplitudes_of_both_mounts(study, figures):
    panels = figures["spectrum"].axes
    factor = prefix(panels[0].get_ylabel())
    for mount, label in (("rigid", "without platform"), ("isolated", "with platform")):
        for i, axes in enumerate(panels):
            _, heights = line(axes, label)
            expected = np.rad2deg(np.abs(study.bus_rate(mount)[:, 0, i]))
            assert factor * heights[:4] == pytest.approx(expected)
            together = np.rad2deg(study.combined(mount).envelope[i])  # one frequency only
            assert factor * heights[4] == pytest.approx(together)


def test_the_budget_stacks_the_kinds_and_names_those_left_out(study, figures):
    figure = figures["budget"]
    panels = np.reshape(figure.axes, (3, 2))
    for column, mount in enumerate(("rigid", "isolated")):
        factor = prefix(panels[0, column].get_ylabel())
        sizes = np.rad2deg(np.abs(study.budget[mount]))  # (kind, cmg, order, axis)
        for i, axes in enumerate(panels[:, column]):
            assert [bars.get_label() for bars in axes.containers] == [
                "static imbalance, 1Ω",
                "dynamic imbalance, 1Ω",
            ]
            static, dynamic = ([bar.get_height() for bar in bars] for bars in axes.containers)
            assert factor * np.array(static) == pytest.approx(sizes[0, :, 0, i])
            assert factor * np.array(dynamic) == pytest.approx(sizes[1, :, 0, i])
            assert [bar.get_y() for bar in axes.containers[1]] == pytest.approx(static)
            _, diamonds = line(axes, "each rotor")
            whole = np.rad2deg(np.abs(study.bus_rate(mount)[:, 0, i]))
            assert factor * diamonds == pytest.approx(whole)
    caption = figure.legends[0].get_title().get_text().replace("\n", " ")
    assert "worst case" in caption
    assert "installation error, asymmetry and products" in caption


def test_a_budget_without_platform_writes_the_sum_and_the_share_that_is_left(study, figures):
    panels = np.reshape(figures["budget"].axes, (3, 2))
    sums = {
        mount: np.rad2deg(np.abs(study.bus_rate(mount)).sum(axis=(0, 1)))
        for mount in ("rigid", "isolated")
    }
    for i in range(3):
        value = sums["rigid"][i] / prefix(panels[i, 0].get_ylabel())
        assert f": {value:.4g}" in panels[i, 0].texts[0].get_text()
        percent = 100.0 * sums["isolated"][i] / sums["rigid"][i]
        assert f"({percent:.3g} %)" in panels[i, 1].texts[0].get_text()


def test_the_worst_angles_are_compared_with_the_scenarios(study, figures):
    for axes, mount in zip(figures["worst"].axes, ("rigid", "isolated"), strict=True):
        factor = prefix(axes.get_ylabel())
        here, there = (factor * np.array([b.get_height() for b in c]) for c in axes.containers)
        sums = np.rad2deg(np.abs(study.bus_rate(mount)).sum(axis=(0, 1)))
        assert here == pytest.approx([*sums, np.linalg.norm(sums)])
        assert there[3] == pytest.approx(np.linalg.norm(there[:3]))
        assert there[3] >= here[3]
        angles = np.deg2rad([float(a) for a in re.findall(r"(-?\d+)°", axes.get_title(loc="left"))])
        again = jitter_of_designs([study.satellite(mount)], angles)["bus_rate"][0]
        norm = np.linalg.norm(np.rad2deg(np.abs(again).sum(axis=(0, 1))))
        assert there[3] == pytest.approx(norm, rel=1e-3)  # the angles are written as whole degrees


def test_a_kind_at_a_second_order_has_its_own_hatched_bar():
    """A made-up study, since a scenario's rotors have no unequal transverse inertias."""
    budget = np.zeros((4, 2, 2, 3), complex)
    budget[0, :, 0] = 3e-6
    budget[3, :, 1] = 1e-6j
    same = {"isolated": budget, "rigid": budget}
    study = SimpleNamespace(
        scenario=SimpleNamespace(name="made up"),
        budget=same,
        kinds=KINDS[:4],
        orders=ORDERS,
        imbalance_orders=ORDERS,
        gimbal_angle=np.zeros(2),
        bus_rate=lambda _: budget.sum(axis=0),
        combined=lambda _: SimpleNamespace(worst_case=np.full(3, 8e-6)),
    )
    axes = plots.jitter.budget(study).axes[0]
    named = {bars.get_label(): bars for bars in axes.containers}
    assert named.keys() == {"static imbalance, 1Ω", "asymmetry and products, 2Ω"}
    assert named["static imbalance, 1Ω"][0].get_hatch() != (
        named["asymmetry and products, 2Ω"][0].get_hatch()
    )
    _, diamonds = line(axes, "each rotor")
    assert prefix(axes.get_ylabel()) * diamonds == pytest.approx(np.rad2deg(4e-6))
