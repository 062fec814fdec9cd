"""Jitter and MTF_loss with noise against windows drawn in time, by the metrics' definitions.

Draws: ``tests/oracles/pointing_members.py``, which shares nothing with quietbus. The spectrum is
red, as of a free satellite, with a lightly damped mode and a floor; two parts of different colour
and correlation.
"""

import numpy as np
import pytest

from oracles.pointing_members import draw, jitter, loss, nodes
from quietbus.analysis.pointing.chi_square import MeanSquare, UnsoundStatisticError, quantile
from quietbus.analysis.pointing.metrics import evaluate
from quietbus.analysis.pointing.motion import ImageMotion, Lines, SampledSignal
from quietbus.analysis.pointing.noise import Noise
from quietbus.analysis.pointing.statistic import Statistic
from quietbus.analysis.pointing.window_noise import WindowNoise
from quietbus.analysis.pointing.windows import Metric

HIGHEST = 300.0
F = np.unique(np.concatenate([np.geomspace(1.0, HIGHEST, 60), np.linspace(35.0, 45.0, 81)]))
MODE = 1.0 / ((1.0 - (F / 40.0) ** 2) ** 2 + (0.04 * F / 40.0) ** 2)
PARTS = [
    (F, 1e-2 / F**4 + 2e-9, np.array([[1.0, 0.5], [0.5, 0.6]])),
    (F, 1e-8 * MODE + 3e-8, np.array([[0.3, -0.3], [-0.3, 1.0]])),
]
END = 100.0
LINE_HZ = 73.3
TWO = np.array([[2.0, 1.0j], [1.2, 0.8j]]) * 1.5e-3  # of two rotors at one speed
LEVELS = (0.1, 0.5, 0.9, 0.99, 0.997)
WINDOWS = np.geomspace(3e-3, 0.2, 20)  # from 0.9 to 60 periods of the highest frequency
DRAWS = 20_000


def still(components, end=END):
    t = np.linspace(0.0, end, 1001)
    return SampledSignal(t, np.zeros((len(t), components)))


def noise_of(parts):
    f = parts[0][0]
    density = np.stack([S[:, None, None] * A for _, S, A in parts], axis=1)[None]
    return Noise(np.array([0.0]), f, density, tuple("ab"[: len(parts)]))


NOISE = noise_of(PARTS)
LINES = Lines(
    np.tile(TWO, (1001, 1, 1)),
    np.full(2, 2 * np.pi * LINE_HZ),
    np.zeros(2),
    np.arange(2),
    np.ones(2),
)
MOTIONS = {
    "lines": ImageMotion(still(2), LINES),
    "noise": ImageMotion(still(2), None, NOISE),
    "both": ImageMotion(still(2), LINES, NOISE),
}


def line_in(t, phasors):
    """(n, time, c) of phasors (n, c)."""
    return (phasors[:, None] * np.exp(2j * np.pi * LINE_HZ * t)[:, None]).real


def close(value, drawn, p, rel=0.03):
    """Within ``rel`` and three standard deviations of the drawn quantile."""
    n, order = len(drawn), np.sort(drawn)
    off = 3.0 * np.sqrt(n * p * (1.0 - p))
    low, high = (order[int(np.clip(n * p + side * off, 0, n - 1))] for side in (-1, 1))
    assert (1.0 - rel) * low <= value <= (1.0 + rel) * high


@pytest.mark.slow
@pytest.mark.parametrize("window", WINDOWS)
def test_jitter_has_the_quantiles_of_windows_in_time(window):
    """Five levels, lines, noise and both, temporal and mixed.

    The worst member has both lines in phase (their ellipses are alike but for 5 %).
    """
    rng = np.random.default_rng(1)
    t, w = nodes(window, HIGHEST)
    noise = draw(t, PARTS, DRAWS, rng)
    turns = np.exp(1j * rng.uniform(0.0, 2.0 * np.pi, (DRAWS, 2)))
    moved = {
        "temporal": line_in(t, turns[:, :1] * TWO.sum(axis=0)),
        "mixed": line_in(t, turns @ TWO),
    }
    for how, lines in moved.items():
        for what, y in (("lines", lines), ("noise", noise), ("both", noise + lines)):
            drawn = jitter(t, w, y)
            values = [
                evaluate(MOTIONS[what], Metric("jitter", window), (0.0, END), Statistic(p, how))
                for p in LEVELS
            ]
            assert np.all(np.diff(values) >= 0.0)
            for p, value in zip(LEVELS, values, strict=True):
                close(value, drawn, p)


@pytest.mark.parametrize("window", [0.004, 0.05, 0.2])
def test_jitter_of_noise_has_the_quantiles_of_windows_in_time(window):
    """The same in a few windows of few degrees of freedom, some, and many."""
    t, w = nodes(window, HIGHEST)
    drawn = jitter(t, w, draw(t, PARTS, 10_000, np.random.default_rng(2)))
    metric = Metric("jitter", window)
    for p in LEVELS:
        close(evaluate(MOTIONS["noise"], metric, (0.0, END), Statistic(p), 0.2), drawn, p)
    rms = evaluate(MOTIONS["noise"], metric, (0.0, END), Statistic())
    assert rms == pytest.approx(np.sqrt(np.mean(drawn**2)), rel=0.03)


WHITE = np.array([1.0, 60.0])
NU = 0.12


def white(correlation, components):
    matrix = np.array([[1.0, correlation], [correlation, 1.0]])[:components, :components]
    return [(WHITE, np.full(2, 0.02), matrix)]


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("window", [0.01, 0.05, 0.15, 0.4, 0.9])
def test_loss_is_that_of_windows_in_time(window, correlation, components):
    """Each window's covariance is its own: that of isotropic noise is not isotropic."""
    parts = white(correlation, components)
    t, w = nodes(window, WHITE[-1])
    drawn = loss(t, w, draw(t, parts, 10_000, np.random.default_rng(3)), window, NU)
    motion = ImageMotion(still(components), None, noise_of(parts))
    metric = Metric("MTF_loss", window, spatial_frequency=NU)
    mean = evaluate(motion, metric, (0.0, END), Statistic())
    assert mean == pytest.approx(np.mean(drawn), rel=0.03)
    for p in (0.5, 0.95):
        close(evaluate(motion, metric, (0.0, END), Statistic(p)), drawn, p, 0.02)
    if (window, correlation, components) == (0.05, 0.0, 2):
        assert mean == pytest.approx(0.340, rel=0.02)  # found by others, in time


def test_loss_of_lines_with_noise_is_that_of_windows_in_time():
    """A line with few and with many periods in the window, its rotor's phase as it comes."""
    parts = white(0.3, 2)
    rng = np.random.default_rng(4)
    for window, hz in ((0.05, 31.0), (0.9, 57.0)):
        t, w = nodes(window, WHITE[-1])
        phasor = np.array([1.1, 0.6j])
        lines = Lines(
            np.tile(phasor, (1001, 1, 1)),
            np.array([2 * np.pi * hz]),
            np.zeros(1),
            np.zeros(1, int),
            np.ones(1),
        )
        turn = np.exp(1j * (rng.uniform(0, 2 * np.pi, (10_000, 1)) + 2 * np.pi * hz * t))
        y = draw(t, parts, 10_000, rng) + (turn[..., None] * phasor).real
        motion = ImageMotion(still(2), lines, noise_of(parts))
        metric = Metric("MTF_loss", window, spatial_frequency=0.08)
        drawn = loss(t, w, y, window, 0.08)
        mean = evaluate(motion, metric, (0.0, END), Statistic())
        assert mean == pytest.approx(np.mean(drawn), rel=0.03)
        for way in ("temporal", "mixed"):
            close(evaluate(motion, metric, (0.0, END), Statistic(0.9, way)), drawn, 0.9, 0.02)


@pytest.mark.parametrize("name", ["jitter", "MTF_loss"])
def test_largest_value_in_a_stretch_is_that_of_members_in_time(name):
    """``ensemble``: a bound, of jitter by 15 % at the median and a few percent above."""
    window, length, count = 0.05, 0.6, 600
    t = np.arange(0.0, length, 1.0 / 1500.0)
    y = draw(t, PARTS, count, np.random.default_rng(5))
    n = round(window * 1500.0)
    x = (np.arange(n) - 0.5 * (n - 1)) / 1500.0
    nu = 300.0
    looks = [
        jitter(x, np.full(n, 1.0 / n), y[:, i : i + n])
        if name == "jitter"
        else loss(x, np.full(n, 1.0 / n), y[:, i : i + n], n / 1500.0, nu)
        for i in range(0, len(t) - n, 5)
    ]
    largest = np.max(looks, axis=0)
    metric = Metric(name, window, spatial_frequency=nu)
    for p in (0.5, 0.9, 0.99):
        value = evaluate(
            MOTIONS["noise"], metric, (10.0, 10.0 + length), Statistic(p, "ensemble"), 0.3
        )
        most = 1.25 if name == "MTF_loss" else 1.2 if p < 0.9 else 1.12
        assert 0.97 * np.quantile(largest, p) < value < most * np.quantile(largest, p)


@pytest.mark.parametrize("what", ["noise", "both"])
@pytest.mark.parametrize("metric", ["jitter", "MTF_loss"])
def test_values_change_steadily_with_the_window_and_the_level(what, metric):
    """Over where the highest frequency, and the line, come to have many periods in it."""
    edges = [46.0 / (np.pi * f) for f in (HIGHEST, LINE_HZ)]
    for edge in edges:
        values = [
            evaluate(
                MOTIONS[what],
                Metric(metric, edge * side, spatial_frequency=30.0),
                (0.0, END),
                Statistic(p, "temporal", "given"),
                0.5,
            )
            for p in (0.5, 0.99)
            for side in (0.999, 1.001)
        ]
        slack = 1e-2 if metric == "jitter" else 3e-2
        assert values[1] == pytest.approx(values[0], rel=slack)
        assert values[3] == pytest.approx(values[2], rel=slack)
        assert values[2] > values[0]


def test_noise_alone_keeps_between_one_degree_of_freedom_and_many():
    """Of a level that one degree of freedom passes with more than 31.7 %, at least the RMS."""
    from scipy.stats import chi2

    for window in (0.003, 0.03, 0.2):
        metric = Metric("jitter", window)
        rms = evaluate(MOTIONS["noise"], metric, (0.0, END), Statistic())
        for p in (0.9, 0.997):
            value = evaluate(MOTIONS["noise"], metric, (0.0, END), Statistic(p))
            assert rms < value <= 1.001 * rms * np.sqrt(chi2.ppf(p, 1))


def test_statistics_that_contradict_their_moments_are_withheld():
    """The variance of frequencies that a window does not see was the fault: a shape near zero."""
    one = np.ones(1)
    for wrong in ((one, 1.5 * one, one), (one, 0.1 * one, 0.5 * one), (one, np.nan * one, one)):
        with pytest.raises(UnsoundStatisticError, match="mean square"):
            MeanSquare(*wrong).check()
    whole, elsewhere = MeanSquare(one, 0.1 * one, 0.01 * one), MeanSquare(9 * one, one, one)
    with pytest.raises(UnsoundStatisticError, match="outside"):
        quantile(0.9, whole, elsewhere, np.zeros(1))


def test_largest_parts_and_the_rest_add_up_to_the_whole():
    noise = WindowNoise(
        NOISE, 0.03, np.linspace(1.0, 99.0, 64), np.array([LINE_HZ]), np.zeros((64, 6, 2))
    )
    z = np.tile(TWO.sum(axis=0), (64, 1, 1))
    known = np.full(64, 0.5 * np.sum(np.abs(z[0]) ** 2))
    whole = noise.mean_squares(known, z, slice(None))
    rest, drawn = noise.conditioned(whole, z, slice(None), 2**16)
    mean, variance = whole.moments
    assert np.mean(rest.c1 + drawn) == pytest.approx(mean, rel=2e-3)
    assert np.mean(2.0 * rest.c2) + np.var(rest.c1 + drawn) == pytest.approx(variance, rel=2e-2)
