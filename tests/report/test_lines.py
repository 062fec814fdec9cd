"""Long lines drawn from fewer points: no peak is lost, nothing is invented."""

import numpy as np
import pytest

from quietbus.report.figures import pictures
from quietbus.report.lines import Drawing, Panel, decimate
from report.runs import SLOW, harmonic, synthetic


@pytest.mark.parametrize("count", [1, 2, 199, 200, 201, 1000, 12_345])
def test_every_stretch_keeps_its_extremes_and_the_line_its_ends(count):
    values = np.random.default_rng(count).normal(size=count)
    kept = decimate(values, 100)
    assert np.all(np.diff(kept) > 0)
    assert len(kept) <= 202
    assert (kept[0], kept[-1]) == (0, count - 1)
    for stretch in np.array_split(np.arange(count), 100):
        if len(stretch):
            drawn = values[np.intersect1d(kept, stretch)]
            assert (drawn.min(), drawn.max()) == (values[stretch].min(), values[stretch].max())


def test_short_lines_are_drawn_whole():
    np.testing.assert_array_equal(decimate(np.zeros(200), 100), np.arange(200))


def test_a_spike_of_one_sample_is_drawn_at_its_place():
    values = np.sin(np.arange(100_001.0))
    values[54_321] = 7.0
    time = np.arange(100_001.0) / 1000.0
    drawing = Drawing("a", "A", "", time, [Panel("a", "N", values[:, None], ["a"])])
    line = drawing.picture(1000).content.data[0]
    assert len(line.x) <= 2002
    assert line.x[np.argmax(line.y)] == 54.321
    assert max(line.y) == 7.0


def test_a_gap_stays_a_gap():
    values = np.zeros(1000)
    values[500] = np.nan
    assert 500 in decimate(values, 100)


@pytest.mark.parametrize(("legs", "cmgs"), [(6, 4), (30, 16)])
def test_no_more_points_than_a_page_bears(legs, cmgs):
    shown, buckets = pictures(synthetic(count=100_001, legs=legs, cmgs=cmgs))
    points = sum(len(line.x) for picture in shown for line in drawn(picture))
    assert points < 180_000
    assert buckets < 2001


def drawn(picture):
    return () if isinstance(picture.content, str) else picture.content.data


def named(run):
    return {picture.name: picture for picture in pictures(run)[0]}


def test_pictures_of_a_run_and_what_is_missing_of_a_rigid_one():
    common = ["attitude", "control", "rates", "jitter", "turns", "spectrum", "gimbals", "struts"]
    assert list(named(synthetic())) == common
    rigid = named(synthetic("rigid"))
    assert list(rigid) == common
    assert "struts do not move" in rigid["struts"].content


def test_values_are_those_of_the_run_in_the_units_of_the_axes():
    run = synthetic(count=1001)
    shown = named(run)
    force = {line.name: line.y for line in drawn(shown["struts"]) if line.yaxis == "y2"}
    np.testing.assert_array_equal(force["leg 3"], run["leg_force"][:, 3])
    stroke = {line.name: line.y for line in drawn(shown["struts"]) if line.yaxis == "y"}
    np.testing.assert_allclose(stroke["leg 3"], 1e3 * run["leg_stroke"][:, 3])
    assert shown["struts"].content.layout.yaxis.title.text == "stroke [mm]"
    roll = next(line.y for line in drawn(shown["attitude"]) if line.name == "roll")
    np.testing.assert_allclose(roll, np.rad2deg(SLOW * run.time), atol=1e-12)


def test_spectrum_marks_the_rotors_and_shows_the_amplitude_put_in():
    figure = named(synthetic())["spectrum"].content
    marked = sorted(shape.x0 for shape in figure.layout.shapes)
    assert marked == pytest.approx([100.0, 200.0, 300.0, 400.0])
    z = next(line for line in figure.data if line.name == "z")
    assert z.x[np.argmax(z.y)] == pytest.approx(100.0, rel=1e-3)
    assert max(z.y) == pytest.approx(np.rad2deg(2e-5), rel=1e-3)


def test_what_a_scenario_leaves_out_is_said():
    assert "no control" in named(synthetic(control="none"))["control"].caption
    assert "holds them" in named(synthetic(control="none"))["gimbals"].caption
    held = named(synthetic(control__steering={"law": "none"}))
    assert "holds them" in held["gimbals"].caption
    assert "no control" not in held["control"].caption
    assert "holds them" not in named(synthetic())["gimbals"].caption


@pytest.mark.parametrize(("count", "rate"), [(1, 1000.0), (10, 1000.0), (2001, 200.0)])
def test_jitter_that_cannot_be_shown_is_a_reason(count, rate):
    shown = named(synthetic(count=count, rate=rate))
    for name in ("jitter", "turns"):
        assert shown[name].content.startswith("No jitter to show: ")


def test_harmonic_runs_show_the_combined_jitter_and_a_bar_for_each_rotor_and_order():
    run = harmonic()
    shown = named(run)
    assert {"jitter", "turns", "spectrum"}.isdisjoint(shown)
    assert "worst_case, as made by hand" in shown["envelope"].caption
    about_y = {line.name: line.y for line in drawn(shown["envelope"]) if line.yaxis == "y2"}
    assert about_y.keys() == {"envelope", "worst case", "root sum square", "RMS"}
    expected = np.rad2deg(run["bus_rate_jitter_rss"].sel(axis="y"))
    np.testing.assert_allclose(about_y["root sum square"], expected)
    bars = drawn(shown["lines"])
    assert len(bars) == 12
    z_of_2 = next(bar for bar in bars if bar.name == "rotor 2" and bar.yaxis == "y3")
    np.testing.assert_allclose(z_of_2.y, np.rad2deg([0.6 * 3e-6, 0.006 * 3e-6]))
    assert list(z_of_2.x) == ["order 1", "order 2"]
    np.testing.assert_allclose(z_of_2.customdata, [100.0, 200.0])
