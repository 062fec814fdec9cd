"""Whatever the window and the noise, the lines are found that were made, and no others."""

import functools
import json

import numpy as np
import pytest

from oracles.spectra import map_of
from quietbus.analysis.signals.waterfall import FitError, Waterfall, fit
from quietbus.analysis.signals.waterfall.window import seen_window

RPM = np.arange(600, 3001, 200)
WINDOWS = ["hann", "hamming", "blackman", "flattop", "boxcar", "tukey 0.25"]
SOME = ((1.0, 1e-6), (2.0, 3e-7), (4.42, 1.5e-7))


@functools.cache
def made(window, noise, lines=SOME[:1], declared="as made", **options):
    name, *numbers = window.split()
    given = (name, *map(float, numbers)) if numbers else name
    frequency, psd = map_of(lines, given, noise, RPM, **options)
    told = window if declared == "as made" else declared
    return Waterfall("radial_force", RPM * np.pi / 30, frequency, psd, told)


def assert_found(found, lines, within):
    assert [line.order.value for line in found.orders] == pytest.approx(
        [order for order, _ in lines], rel=2e-4
    )
    for line, (_, coefficient) in zip(found.orders, lines, strict=True):
        assert line.coefficient.value == pytest.approx(coefficient, rel=within)
        assert abs(line.coefficient.value - coefficient) < 4 * line.coefficient.deviation
        assert line.doubt is None
    assert found.modes == ()
    assert found.explained.total > 0.98
    json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("noise", [1e-8, 2e-5, 2e-3])
def test_a_line_alone_is_found_alone(window, noise):
    found = fit(made(window, noise))
    assert_found(found, SOME[:1], 1e-3)
    assert found.window.tested
    # a floor that leakage hides is an upper bound, elsewhere it is the noise's
    true = noise**2 / 512
    inside = (found.floor_frequency > 8) & (found.floor_frequency < 500)
    assert np.all(found.floor[inside] > 0.5 * true)
    seen = inside & ~found.floor_bounded
    assert found.floor[seen] == pytest.approx(true, rel=0.5)


@pytest.mark.parametrize("window", ["hamming", "flattop", "boxcar"])
def test_several_lines_are_found_through_each_other_s_leakage(window):
    assert_found(fit(made(window, 1e-6, SOME)), SOME, 2e-3)


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("noise", [1e-8, 2e-3])
def test_a_window_that_is_not_declared_is_found(window, noise):
    seen = seen_window(made(window, noise, declared=None))
    assert (seen.name, seen.source) == (window, "lines")


@pytest.mark.parametrize(
    ("window", "declared"),
    [
        ("hann", "hamming"),
        ("hamming", "hann"),
        ("blackman", "hann"),
        ("flattop", "none"),
        ("boxcar", "tukey 0.25"),
        ("tukey 0.25", "hann"),
    ],
)
def test_a_window_that_is_declared_falsely_is_found_out(window, declared):
    message = f"'{declared}' is declared, but lines have the shape of '{window}'"
    for noise in (1e-8, 2e-3):
        with pytest.raises(FitError, match=message):
            fit(made(window, noise, declared=declared))


def test_without_a_line_that_tells_hann_is_assumed_and_said():
    """Lines 4 to 10 times their background tell no shape."""
    weak = ((1.0, 3e-8),)
    rows = np.array([2000, *range(2100, 3001, 100)])
    frequency, psd = map_of(weak, "hann", 1e-2, rows)
    found = fit(Waterfall("radial_force", rows * np.pi / 30, frequency, psd))
    assert (found.window.name, found.window.source, found.window.tested) == (
        "hann",
        "assumed",
        False,
    )
    assert "no line is strong enough to tell" in found.notes[0]


def test_a_speed_that_changes_within_rows_is_seen_and_does_not_bias():
    found = fit(made("hann", 1e-3, SOME, change=15.0))
    assert_found(found, SOME, 2e-3)
    assert found.window.smear * 60 == pytest.approx(15.0, rel=0.3)
    assert any("change of speed of 15 rpm" in note for note in found.notes)


def test_lines_of_a_fixed_frequency_spoil_nothing_and_are_told():
    clean = made("hann", 1e-4, SOME)
    psd = clean.psd.copy()
    psd[:, 50] += 1e-3
    found = fit(Waterfall("radial_force", clean.speed, clean.frequency, psd, "hann"))
    assert_found(found, SOME, 2e-3)
    assert any("at every speed the same, no part of the floor: 50 Hz" in n for n in found.notes)
    near = np.argmin(np.abs(found.floor_frequency - 50))
    assert found.floor[near] == pytest.approx(1e-8 / 512, rel=0.5)
