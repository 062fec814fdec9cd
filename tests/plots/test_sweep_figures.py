"""Pictures of a sweep show the frequencies and amplitudes that were put in, and what is not."""

import dataclasses
import itertools

import numpy as np
import pytest
from matplotlib.collections import LineCollection

from quietbus.analysis.jitter.sweep import SpeedSweep, SpinningModes, critical_speeds
from quietbus.plots.sweep import NO_JITTER, campbell, look_of_order, sweep_figures

OWN = 2 * np.pi * 50.0
FACTOR = np.linspace(0.0, 1.2, 121)


def plant(natural):
    """Two directions on springs, and two of a free body that nutates at speed."""
    gyro = np.kron(np.diag([80.0, 2.0]), [[0.0, 1.0], [-1.0, 0.0]])
    held = np.diag([1.0, 1.0, 0.0, 0.0])
    return SpinningModes(
        np.eye(4),
        4.0 * held,
        gyro,
        natural**2 * held,
        np.zeros((4, 4)),
        {"plate": np.eye(12, 4)},
    )


def made(size):
    modes = {"isolated": plant(2 * np.pi * 20.0), "rigid": plant(1.0)}
    orders = (1.0, 3.5)
    critical = {
        "isolated": critical_speeds(modes["isolated"], np.array([OWN]), orders, 1.2),
        "rigid": (),
    }
    lines = np.zeros((len(FACTOR), 1, 2, 3), complex)
    lines[:, 0, 0, 0] = size * FACTOR**2
    rates = {"isolated": 0.1 * lines, "rigid": lines}
    return SpeedSweep(FACTOR, np.array([OWN]), np.zeros(1), orders, rates, modes, critical)


@pytest.fixture(scope="module")
def figures():
    return sweep_figures(made(1e-4), "made up")


def test_campbell_marks_the_crossings_where_they_are(figures):
    axes, change = figures["campbell"].axes
    sweep = made(1e-4)
    by_label = {line.get_label(): line for line in axes.lines}
    for label, order in (("critical speed", 1.0), ("crossing, order not excited", 3.5)):
        points = by_label[label].get_xydata()
        found = [c for c in sweep.critical["isolated"] if c.order == order]
        assert len(found) == len(points) >= 2
        for (rpm, hertz), critical in zip(points, found, strict=True):
            assert rpm == pytest.approx(critical.speed * 30 / np.pi)
            assert hertz == pytest.approx(order * rpm / 60)
    modes = [line for line in axes.lines if "damping" in str(line.get_label())]
    assert len(modes) == 2
    at_end = sorted(line.get_ydata()[-1] for line in modes)
    half = 0.5 * 1.2 * 80.0
    poles = np.concatenate([np.roots([1, 4 + 2j * s * half, (40 * np.pi) ** 2]) for s in (-1, 1)])
    expected = sorted(poles.imag[poles.imag > 0] / (2 * np.pi))
    assert at_end == pytest.approx(expected)
    still = 20.0 * np.sqrt(1 - (2 / (2 * np.pi * 20.0)) ** 2)
    split = sorted(line.get_ydata()[-1] for line in change.lines[:2])
    assert split == pytest.approx(100 * (np.array(expected) / still - 1), abs=1e-6)
    assert {text.get_text() for text in axes.texts} == {"1Ω", "3.5Ω"}


def test_waterfall_colours_every_excited_ray_by_its_amplitude(figures):
    panels = [axes for axes in figures["waterfall"].axes if axes.get_ylabel() != "" or axes.lines]
    rays = [c for c in panels[0].collections if isinstance(c, LineCollection)]
    assert len(rays) == 1  # order 3.5 shakes nothing
    points = np.array(rays[0].get_segments())
    assert points[-1, 1] == pytest.approx([1.2 * 50.0, 1.2 * 3000.0])
    middle = 0.5 * (FACTOR[2:] ** 2 + FACTOR[1:-1] ** 2) * np.rad2deg(1e-4)
    assert np.ma.getdata(rays[0].get_array()) == pytest.approx(middle)


def test_amplitudes_over_speed_are_drawn_for_both_mounts(figures):
    axes = figures["speeds"].axes[0]
    drawn = {line.get_gid(): line for line in axes.lines if line.get_gid()}
    rigid, isolated = (drawn[f"order 1, {m}"].get_ydata()[-1] for m in ("rigid", "isolated"))
    assert isolated == pytest.approx(0.1 * rigid)
    assert rigid == pytest.approx(1e3 * np.rad2deg(1e-4) * 1.44)  # in 10^-3 deg/s


def test_without_jitter_the_pictures_say_so():
    quiet = sweep_figures(made(0.0), "quiet")
    for name in ("waterfall", "speeds"):
        text = " ".join(quiet[name].axes[0].texts[0].get_text().split())
        assert text == NO_JITTER


def test_amplitudes_fill_the_axis(figures):
    """Colours and heights start at the least that is drawn, not decades below it."""
    least = np.rad2deg(1e-5) * FACTOR[1] ** 2  # on the platform
    bottom, top = figures["speeds"].axes[0].get_ylim()
    assert bottom == pytest.approx(1e3 * least)  # in 10^-3 deg/s
    assert top == pytest.approx(2e3 * np.rad2deg(1e-4) * 1.44)
    rays = next(c for c in figures["waterfall"].axes[0].collections)
    assert rays.norm.vmin == pytest.approx(least)


@pytest.mark.parametrize("natural", [5.0, 60.0, 90.0])
def test_logarithmic_axes_have_room_for_their_numbers(natural):
    sweep = made(1e-4)
    slow = dataclasses.replace(sweep, modes={"isolated": plant(natural), "rigid": plant(1.0)})
    figure = sweep_figures(slow, "slow")["waterfall"]
    figure.draw_without_rendering()
    axes = figure.axes[-2]
    assert axes.get_xscale() == "log"
    low, high = axes.get_xlim()
    boxes = [
        label.get_window_extent()
        for label in axes.get_xticklabels(which="both")
        if label.get_text() and low <= label.get_position()[0] <= high
    ]
    assert len(boxes) >= 2
    boxes.sort(key=lambda box: box.x0)
    for left, right in itertools.pairwise(boxes):
        assert left.x1 < right.x0


def test_an_infinite_amplitude_does_not_hide_the_rest():
    """A mode without damping: what stands at its critical speed is no number."""
    sweep = made(1e-4)
    critical = next(c for c in sweep.critical["isolated"] if c.order == 1.0)
    undamped = dataclasses.replace(critical, mode=dataclasses.replace(critical.mode, damping=0.0))
    at = int(np.argmin(np.abs(FACTOR - critical.factor)))
    factor = FACTOR.copy()
    factor[at] = critical.factor
    rates = {mount: rate.copy() for mount, rate in sweep.bus_rate.items()}
    rates["isolated"][at, 0, sweep.orders.index(critical.order), 0] = 1e8
    endless = dataclasses.replace(
        sweep,
        factor=factor,
        bus_rate=rates,
        critical={"isolated": (undamped,), "rigid": ()},
    )
    drawn = sweep_figures(endless, "endless")["speeds"].axes[0]
    assert drawn.get_ylim()[1] == pytest.approx(2e3 * np.rad2deg(1e-4) * 1.44)
    line = next(each for each in drawn.lines if each.get_gid() == "order 1, isolated")
    assert np.isnan(line.get_ydata()).sum() == 1


def test_no_order_looks_like_another():
    looks = [tuple(sorted((k, str(v)) for k, v in look_of_order(i).items())) for i in range(24)]
    assert len(set(looks)) == len(looks)


def test_campbell_says_where_the_gimbals_are_held():
    """The modes' split by the rotors' momentum depends on it; wheels have no gimbals."""
    still = made(1e-4)
    for angle, words in (((), "speed (a)"), ((1.0, 1.0), "at 57.3°"), ((0.0, 0.5), "at 0, 28.65°")):
        held = dataclasses.replace(still, gimbal_angle=angle)
        assert words in campbell(held, "a").get_suptitle()
