"""What else could carry the CMGs: a platform for each instead of one for all."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from quietbus import api
from quietbus.analysis.control.coupled import stable_gain_range
from quietbus.analysis.jitter.filters import platform_at_rest
from quietbus.analysis.jitter.platforms import Platforms
from quietbus.model.satellite import Satellite
from quietbus.model.variants import without_rotation
from quietbus.plots.style import COLOURS, DASHES, MARKERS, new_figure, share_legend
from quietbus.reproduce.parts import Findings
from quietbus.reproduce.zhang2012.bench import Bench
from quietbus.scenario import Scenario, per_cmg_scenarios
from quietbus.studies.platforms import PlatformStudy

SCALES = np.geomspace(0.25, 1.0, 7)  # of the small platforms against the one
SWEEP_HZ = np.geomspace(0.5, 200.0, 36)  # rotor speeds
ANGLES = 24  # draws of gimbal angles
MICRO = 1e6 * 180.0 / np.pi  # [1e-6 deg] of 1 rad
PLATFORM_TEXT = (
    "The paper puts the cluster on one platform; the satellites that it names have an isolator "
    "per wheel. Here each CMG stays where it is and gets a hexapod of its own, half the size "
    "of the paper's (four halves cover the area of the one), with a quarter of the plate, of "
    "the struts' mass, stiffness, damping and joint friction: the sums are those of the one "
    "platform, and so are frequency and damping in translation. The control steers all four "
    "CMGs as before (docs/platforms.md)."
)


def per_cmg(bench: Bench) -> Findings:
    """One platform for the cluster against one isolator per CMG."""
    scenario = bench.study.scenario
    still = np.zeros(scenario.units.count)
    one = api.platforms([scenario], [still])
    four = _each(scenario, still)
    bench.shop.tell("one platform or four, over rotor speed", 0.2)
    swept = np.array([_over_speed(scenario, hz) for hz in SWEEP_HZ])
    scaled = []
    for k, scale in enumerate(SCALES):
        bench.shop.tell("one platform or four, over size", 0.3 + 0.05 * k)
        scaled.append(_figures(_each(scenario, still, scale)))
    angles = np.random.default_rng(2012).uniform(-np.pi, np.pi, (ANGLES, len(still)))
    drawn = np.array(
        [_norm(_each(scenario, a)) / _norm(api.platforms([scenario], [a])) for a in angles]
    )

    figure = new_figure(6.2, "One platform for four CMGs, or an isolator for each: the same budget")
    grid = figure.add_gridspec(2, 6, height_ratios=(1.15, 1.0))
    speed, dots = figure.add_subplot(grid[0, :4]), figure.add_subplot(grid[0, 4:])
    labels = ("no isolator", "one platform", "one isolator per CMG")
    for i, label in enumerate(labels):
        size = MICRO * swept[:, i]
        look: dict[str, Any] = {
            "color": COLOURS[i],
            "linestyle": DASHES[i],
            "marker": MARKERS[i],
            "markersize": 4,
        }
        speed.plot(60.0 * SWEEP_HZ, size, markevery=[-1], label=label, **look)
    speed.set(xscale="log", yscale="log", xlabel="rotor speed [rpm]")
    speed.set_ylabel("bus rate, worst phases [10⁻⁶ deg/s]")
    sizes = [
        s.combined(m).worst_case for s, m in ((one, "rigid"), (one, "isolated"), (four, "isolated"))
    ]
    for i, values in enumerate(sizes):
        dots.plot(range(3), MICRO * values, MARKERS[i], color=COLOURS[i])
    dots.set(yscale="log", xlim=(-0.5, 2.5), xlabel="about, at 6000 rpm")
    dots.set_xticks(range(3), "xyz")
    share_legend(figure, speed)
    own = _figures(one)
    titles = (
        "bus rate, norm\n[10⁻⁶ deg/s]",
        "upper limit of K\n[N m s/rad]",
        "stroke [mm per N m]",
    )
    for k, title in enumerate(titles):
        axes = figure.add_subplot(grid[1, 2 * k : 2 * k + 2])
        axes.axhline(own[k], color=COLOURS[1], linestyle=DASHES[1])
        axes.plot(SCALES, [row[k] for row in scaled], color=COLOURS[2], linestyle=DASHES[2])
        axes.axvline(0.5, color="0.6", linewidth=1.0, linestyle=":")
        axes.set(xlabel="size of each against the one", ylim=(0.0, None))
        axes.set_title(title)
    numbers = _platform_numbers(one, four, own, scaled, drawn, sizes, bench.study.satellite, still)
    return Findings(figure, _platform_caption(numbers), numbers, PLATFORM_TEXT)


def _each(scenario: Scenario, angles: np.ndarray, scale: float | None = None) -> PlatformStudy:
    return api.platforms(per_cmg_scenarios(scenario, scale), [[angle] for angle in angles])


def _norm(study: PlatformStudy, mount: str = "isolated") -> float:
    """[rad/s] over the axes, worst rotor phases."""
    return float(np.linalg.norm(study.combined(mount).worst_case))


def _over_speed(scenario: Scenario, hz: float) -> tuple[float, float, float]:
    """Bus rate [rad/s] without isolator, with one platform, with one per CMG; gimbals held."""
    speed = 2.0 * np.pi * hz
    momentum = scenario.number("cluster.rotor.momentum") / scenario.number("cluster.rotor.speed")
    turned = scenario.with_overrides(
        {
            "control": "none",
            "cluster.rotor.speed": speed,
            "cluster.rotor.momentum": momentum * speed,
        }
    )
    still = np.zeros(scenario.units.count)
    one = api.platforms([turned], [still])
    return _norm(one, "rigid"), _norm(one), _norm(_each(turned, still))


def _figures(study: PlatformStudy) -> tuple[float, float, float]:
    """Bus rate [1e-6 deg/s], upper limit of K, largest stroke [mm] by 1 N m of control torque."""
    if study.pid is None:
        raise RuntimeError("zhang2012 has no control")
    ranges = stable_gain_range(study.platforms.controlled(study.pid))
    limit = float(ranges[-1][1] or np.inf)
    strokes = [np.abs(np.concatenate(study.static_stroke(way))).max() for way in np.eye(3)]
    return MICRO * _norm(study), limit, 1e3 * float(max(strokes))


def _platform_numbers(
    one: PlatformStudy,
    four: PlatformStudy,
    own: tuple[float, ...],
    scaled: Sequence[tuple[float, ...]],
    drawn: np.ndarray,
    sizes: Sequence[np.ndarray],
    satellite: Satellite,
    still: np.ndarray,
) -> dict[str, float]:
    whole = platform_at_rest(satellite, still)
    small = platform_at_rest(four.platforms.satellite, four.platforms.gimbal_angle)
    passed = lambda p: np.diag(np.asarray(p.C)) / np.diag(np.asarray(p.M))  # noqa: E731
    more = passed(small) / passed(whole)
    lighter = np.diag(np.asarray(whole.M)) / np.diag(np.asarray(small.M))
    own_four = _figures(four)
    hz_one, hz_four = one.platforms.modes()[0], four.platforms.modes()[0]
    stopped = without_rotation(four.platforms.satellite)
    hz_still = Platforms(stopped, four.platforms.gimbal_angle).modes()[0]
    numbers = {
        "per_cmg_ratio": own_four[0] / own[0],
        "per_cmg_ratio_low": float(drawn.min()),
        "per_cmg_ratio_median": float(np.median(drawn)),
        "per_cmg_ratio_high": float(drawn.max()),
        "per_cmg_small_ratio": scaled[0][0] / own[0],
        "per_cmg_gain_limit": own_four[1],
        "per_cmg_gain_limit_one": own[1],
        "per_cmg_gain_limit_small": scaled[0][1],
        "per_cmg_gain_limit_large": scaled[-1][1],
        "per_cmg_stroke": own_four[2],
        "per_cmg_stroke_one": own[2],
        "per_cmg_lowest_mode": float(hz_four[0]),
        "per_cmg_highest_mode": float(hz_four[-1]),
        "per_cmg_lowest_mode_one": float(hz_one[0]),
        "per_cmg_highest_mode_one": float(hz_one[-1]),
        "per_cmg_lowest_mode_still": float(hz_still[0]),
        "per_cmg_highest_mode_still": float(hz_still[-1]),
        "per_cmg_torque_peak": float(four.platforms.torque_peaks[0].min()),
        "per_cmg_torque_peak_one": float(one.platforms.torque_peaks[0].min()),
        "per_cmg_lighter_x": float(lighter[3]),
        "per_cmg_lighter_z": float(lighter[5]),
        "per_cmg_passes_x": float(more[3]),
        "per_cmg_passes_z": float(more[5]),
    }
    for i, axis in enumerate("xyz"):
        numbers[f"per_cmg_ratio_{axis}"] = float(sizes[2][i] / sizes[1][i])
        numbers[f"per_cmg_left_{axis}"] = float(sizes[2][i] / sizes[0][i])
        numbers[f"per_cmg_left_one_{axis}"] = float(sizes[1][i] / sizes[0][i])
    return numbers


def _platform_caption(n: dict[str, float]) -> str:
    return (
        "Top: bus rate over rotor speed (gimbals held), norm over the axes for the worst rotor "
        "phases, and per axis at 6000 rpm. Bottom: against the size of the small platforms "
        "(dotted: half; dashed line: the one platform). **One platform is the better isolator for "
        f"this cluster**: one per CMG leaves {n['per_cmg_ratio_x']:.1f}, "
        f"{n['per_cmg_ratio_y']:.1f} and {n['per_cmg_ratio_z']:.1f} times as much about x, y and "
        f"z, {n['per_cmg_ratio']:.1f} times in all, and {n['per_cmg_ratio_low']:.1f} to "
        f"{n['per_cmg_ratio_high']:.1f} times (median {n['per_cmg_ratio_median']:.1f}) at "
        f"{ANGLES} other sets of gimbal angles. It still takes away "
        f"{100 * (1 - n['per_cmg_left_x']):.0f} % about x and "
        f"{100 * (1 - n['per_cmg_left_z']):.0f} % about z. The reason is rotation: a rotor's "
        f"imbalance torque meets {n['per_cmg_lighter_x']:.0f} (x) to "
        f"{n['per_cmg_lighter_z']:.0f} (z) times less inertia, and far above the modes dampers "
        f"pass on C/I, {n['per_cmg_passes_x']:.1f} and {n['per_cmg_passes_z']:.1f} times more. "
        "The same light plates have the rotors' whole momentum on them, which on one platform "
        f"cancels at these angles: modes run from {n['per_cmg_lowest_mode']:.2f} to "
        f"{n['per_cmg_highest_mode']:.1f} Hz (nutation) instead of "
        f"{n['per_cmg_lowest_mode_one']:.2f} to {n['per_cmg_highest_mode_one']:.2f} Hz (with the "
        f"rotors at a standstill {n['per_cmg_lowest_mode_still']:.2f} to "
        f"{n['per_cmg_highest_mode_still']:.1f} Hz). The CMGs' output torque tilts small plates "
        f"more: legs travel {n['per_cmg_stroke']:.2f} mm per N m of control torque, not "
        f"{n['per_cmg_stroke_one']:.3f} mm, its path to the bus peaks at "
        f"{n['per_cmg_torque_peak']:.2f} Hz, not {n['per_cmg_torque_peak_one']:.2f} Hz, and the "
        f"loop bears K < {n['per_cmg_gain_limit']:.0f}, not {n['per_cmg_gain_limit_one']:.0f}. "
        "Smaller platforms shake the bus less "
        f"({n['per_cmg_small_ratio']:.1f} times the one at a quarter of its size) but bear less "
        f"gain ({n['per_cmg_gain_limit_small']:.0f}); of full size they bear "
        f"{n['per_cmg_gain_limit_large']:.0f}."
    )
