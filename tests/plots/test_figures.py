"""Pictures of synthetic runs: complete, labelled, and honest about what cannot be shown."""

import itertools
import re

import matplotlib.image
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from quietbus.plots import compare_figures, run_figures, save_figures
from quietbus.plots.style import (
    draw_line,
    envelope,
    new_figure,
    scaled,
    share_legend,
    span_text,
    style,
)
from quietbus.results import VARIABLES
from quietbus.results.motion import euler_angles, jitter, rate_spectrum, rotor_frequencies
from quietbus.scenario import load_scenario

SLOW, ROTOR = 1e-3, 100.0  # [rad/s], [Hz]
AMPLITUDE = {"rigid": np.array([9e-6, 8e-6, 3e-6]), "isolated": np.array([1e-7, 2e-7, 1.5e-7])}
RUN_FIGURES = {"attitude", "rates", "gimbals", "spectrum", "control", "struts"}


def synthetic(mount="isolated", count=4000, rate=1000.0, cmgs=4, legs=6, status="complete"):
    """A run whose bus turns slowly about roll and vibrates at the rotors' frequency."""
    scenario = load_scenario("zhang2012").with_overrides(
        {"isolator.mount": mount, "simulation.output_rate": rate}
    )
    time = np.arange(count) / rate
    sizes = {"axis": 3, "quaternion": 4, "cmg": cmgs, "leg": legs}
    wave = np.sin(2 * np.pi * ROTOR * time + 0.3)
    data = {}
    for name, (dimensions, unit, _) in VARIABLES.items():
        shape = (count, *(sizes[dimension] for dimension in dimensions))
        values = 1e-3 * np.sin(np.arange(np.prod(shape)).reshape(shape))
        data[name] = (("time", *dimensions), values, {"units": unit})
    speed = np.full((count, cmgs), 2 * np.pi * ROTOR)
    data["rotor_speed"] = (("time", "cmg"), speed, {"units": "rad/s"})
    half = 0.5 * SLOW * time
    quaternion = np.column_stack([np.cos(half), np.sin(half), 0 * half, 0 * half])
    data["bus_attitude"] = (("time", "quaternion"), quaternion)
    error = np.column_stack([2 * np.sin(half), 0 * half, 0 * half])
    data["attitude_error"] = (("time", "axis"), error)
    data["bus_rate"] = (("time", "axis"), [SLOW, 0, 0] + wave[:, None] * AMPLITUDE[mount])
    attributes = {
        "title": f"zhang2012, {mount}",
        "method": "direct",
        "mount": mount,
        "status": status,
        "scenario": scenario.to_yaml(),
    }
    return xr.Dataset(data, {"time": time}, attributes)


def pair(**options):
    return {mount: synthetic(mount, **options) for mount in ("isolated", "rigid")}


def texts(figure):
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_a_run_has_all_pictures_and_a_rigid_one_no_struts():
    assert run_figures(synthetic()).keys() == RUN_FIGURES
    assert run_figures(synthetic("rigid")).keys() == RUN_FIGURES - {"struts"}


def test_every_labelled_axis_has_a_unit():
    figures = [*run_figures(synthetic()).values(), *compare_figures(pair()).values()]
    for figure in figures:
        labels = [label for a in figure.axes for label in (a.get_xlabel(), a.get_ylabel()) if label]
        assert labels
        assert all(re.search(r"\[.+\]$", label) for label in labels), labels


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_pictures_are_saved(tmp_path, suffix):
    figures = run_figures(synthetic())
    paths = save_figures(figures, tmp_path / "new" / "folder", suffix)
    assert [path.name for path in paths] == [f"{name}{suffix}" for name in figures]
    for path in paths:
        assert 1000 < path.stat().st_size < 2_000_000
        if suffix == ".png":
            assert np.ptp(matplotlib.image.imread(path)) > 0.5


@pytest.mark.parametrize("count", [2, 3, 10])
def test_a_run_of_few_samples_has_pictures_that_say_what_is_missing(tmp_path, count):
    runs = pair(count=count, status="interrupted")
    figures = run_figures(runs["isolated"])
    save_figures(figures, tmp_path)
    assert any("no spectrum" in text for text in texts(figures["spectrum"]))
    assert "interrupted" in figures["attitude"].get_suptitle()
    both = compare_figures(runs)
    save_figures(both, tmp_path / "both")
    if count < 8:
        assert any("no residual" in text for text in texts(both["residual"]))


def test_runs_of_different_length_are_compared(tmp_path):
    runs = {"isolated": synthetic(count=5, status="stopped"), "rigid": synthetic("rigid")}
    figures = compare_figures(runs)
    save_figures(figures, tmp_path)
    assert "isolated, stopped" in figures["attitude"].get_suptitle()
    assert "no spectrum" in figures["spectrum"].axes[0].get_title(loc="left")


def test_too_low_an_output_rate_is_told_instead_of_showing_aliased_jitter(tmp_path):
    runs = pair(rate=200.0)
    figures = run_figures(runs["isolated"])
    assert any("cannot show" in text.replace("\n", " ") for text in texts(figures["rates"]))
    assert "aliased" in figures["spectrum"].axes[0].get_title(loc="left")
    save_figures(compare_figures(runs), tmp_path)


@pytest.mark.parametrize(("cmgs", "legs"), [(1, 8), (16, 30)])
def test_any_number_of_cmgs_and_legs(cmgs, legs):
    figures = run_figures(synthetic(cmgs=cmgs, legs=legs))
    for name, count in (("gimbals", cmgs), ("struts", legs)):
        looks = {
            (str(line._dash_pattern), line.get_color()) for line in figures[name].axes[0].lines
        }
        assert len(looks) == min(count, 28)


def test_a_comparison_needs_both_mounts():
    with pytest.raises(ValueError, match="rigid and isolated"):
        compare_figures({"rigid": synthetic("rigid")})


def test_jitter_and_spectrum_show_the_amplitude_that_was_put_in():
    for mount, run in pair().items():
        amplitude = np.rad2deg(AMPLITUDE[mount])
        last = jitter(run)
        assert last.time[-1] == pytest.approx(1e3 * 10 / ROTOR)
        assert np.max(abs(last.rate), axis=0) == pytest.approx(amplitude, rel=5e-3)
        lines, span = rate_spectrum(run)
        assert np.max(lines.amplitude, axis=0) == pytest.approx(amplitude, rel=2e-3)
        assert span == pytest.approx(2.0, abs=0.01)


def test_the_picture_for_newcomers_tells_the_reduction():
    story = compare_figures(pair())["rates"].get_suptitle()
    assert "20 to 90 times less" in story


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (17.96, 18.04, "18"),
        (17.0, 18.04, "17 to 18"),
        (0.00999, 0.01, "0.01"),
        (0.0, 2.0, "0 to 2"),
    ],
)
def test_a_range_whose_ends_read_alike_is_one_number(low, high, text):
    assert span_text(low, high, 2) == text


def test_attitude_is_roll_pitch_yaw_and_the_target_stands_still():
    run = synthetic(count=4001)
    bus, target = euler_angles(run)
    assert bus[-1] == pytest.approx([np.rad2deg(4.0 * SLOW), 0.0, 0.0], abs=1e-9)
    assert np.max(abs(target)) < 1e-9


def test_angles_beyond_half_a_turn_do_not_jump():
    run = synthetic(count=100)
    angle = np.linspace(3.0, 3.4, 100)  # rad about z, over pi
    zero = 0.0 * angle
    run["bus_attitude"].values = np.column_stack([np.cos(angle / 2), zero, zero, np.sin(angle / 2)])
    run["attitude_error"].values = np.column_stack([zero, zero, 2 * np.sin((angle - 3.3) / 2)])
    bus, target = euler_angles(run)
    assert bus[:, 2] == pytest.approx(np.rad2deg(angle))
    assert target[:, 2] == pytest.approx(np.rad2deg(3.3))


def test_an_envelope_keeps_the_extremes_of_every_stretch():
    time = np.arange(100_003.0)
    values = np.random.default_rng(0).normal(size=time.size)
    t, low, high = envelope(time, values, bins=1000)
    edges = np.append(np.arange(1000) * time.size // 1000, time.size)
    for i, (start, end) in enumerate(itertools.pairwise(edges)):
        part = values[start:end]
        assert (low[i], high[i]) == (part.min(), part.max())
        assert t[i] == pytest.approx(0.5 * (start + end - 1))


@pytest.mark.parametrize(("count", "bands"), [(10, 0), (2400, 0), (100_000, 1)])
def test_a_long_line_is_drawn_with_its_band(count, bands):
    axes = Figure().subplots()
    values = np.sin(np.arange(count))
    values[count // 2] = 7.0
    draw_line(axes, np.arange(count), values, color="k")
    assert len(axes.collections) == bands
    assert axes.dataLim.y1 == 7.0
    assert len(axes.lines[0].get_xdata()) <= 2400


@pytest.mark.parametrize(
    ("peak", "factor", "unit"),
    [(3e-4, 1e6, r"$10^{-6}$ N"), (1e-3, 1e3, r"$10^{-3}$ N"), (5.0, 1.0, "N"), (0.0, 1.0, "N")],
)
def test_small_values_are_shown_in_powers_of_a_thousand(peak, factor, unit):
    got = scaled(peak, "N")
    assert got[0] == pytest.approx(factor)
    assert got[1] == unit


def test_rotors_are_marked_where_they_turn_at_the_end():
    """Wheels that changed their speed are no longer where the scenario has them."""
    run = synthetic(count=4000)
    speed = 2 * np.pi * np.outer(np.linspace(0.0, 1.0, 4000), [20.0, -60.0, 40.0, 0.0])
    run["rotor_speed"] = run["rotor_torque"] = (("time", "cmg"), speed)
    last = run.isel(time=slice(2000, None))  # what its spectrum is from
    spins = np.abs(last["rotor_speed"].to_numpy()) / (2 * np.pi)
    expected = pytest.approx((spins[spins > 0.0].min(), 60.0), rel=1e-3)
    assert rotor_frequencies(run) == expected
    assert "rotors 10" in " ".join(texts(run_figures(run)["spectrum"]))


@pytest.mark.parametrize("words", ["ab", "order 1, without platform (rigid mount)", "x" * 90])
def test_a_legend_stays_inside_the_picture(words):
    with style():
        figure = new_figure(3.0, "title")
        axes = figure.subplots()
        for i in range(7):
            axes.plot([0, 1], [i, i], label=f"{words} {i}")
        share_legend(figure, axes)
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()
    assert len(words) > 80 or (box.x0 >= 0.0 and box.x1 <= figure.bbox.x1)
    columns = figure.legends[0]._ncols
    assert columns == {2: 7, 39: 2, 90: 1}[len(words)]
