"""How the ratio of the residual rates moves with what the paper does not state."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes

from quietbus import api
from quietbus.build import build_satellite
from quietbus.plain import RPM
from quietbus.plots.style import COLOURS, DASHES, new_figure, share_legend, span_text
from quietbus.reproduce.parts import Findings
from quietbus.reproduce.zhang2012.bench import Bench, jitter_peak
from quietbus.scenario import Scenario

AXES = ("x", "y", "z")
PUBLISHED = 3.0  # [%]
DRAWS = 2000  # of rotor phases
TRANSVERSE = 0.6  # [-] of the spin inertia, as the scenario assumes
Sweep = tuple[str, str, np.ndarray, float, Callable[[Scenario, float], Scenario]]
TICKS = {"speed": (2000, 4000, 6000, 10000), "momentum": (5, 10, 20, 40)}


def sensitivity(bench: Bench) -> Findings:
    """The ratio against rotor speed, momentum, platform offset, imbalance split and phases."""
    scenario, gimbals = bench.study.scenario, bench.end_angles
    own = _ratios(scenario, gimbals)
    figure = new_figure(5.6, "Residual rate, with over without the platform")
    panels = figure.subplots(2, 3, sharey=True).ravel()
    numbers: dict[str, float] = {"sensitivity_own": own[3]}
    momentum, speed, _ = _rotor(scenario)
    height = scenario.isolator.offset[2]
    sweeps: tuple[Sweep, ...] = (
        ("speed", "rotor speed [rpm]", np.geomspace(2000, 12000, 13), speed * RPM, _speed),
        ("momentum", "rotor momentum [N m s]", np.geomspace(5, 60, 13), momentum, _momentum),
        ("offset", "offset of the base plate [m]", np.linspace(-1, 1.2, 12), height, _offset),
        ("split", "dynamic imbalance / paper's [-]", np.geomspace(0.01, 100, 13), 1.0, _split),
    )
    for k, (name, label, values, here, change) in enumerate(sweeps):
        bench.shop.tell(f"sensitivity to {name}", 0.2 * k)
        ratios = np.array([_ratios(change(scenario, value), gimbals) for value in values])
        _draw(panels[k], values, ratios)
        panels[k].plot([here], [own[3]], "o", color="black", zorder=5)
        panels[k].set(xlabel=label, xscale="linear" if name == "offset" else "log")
        if name in TICKS:
            panels[k].set_xticks(TICKS[name], [f"{tick:g}" for tick in TICKS[name]])
            panels[k].set_xticks([], minor=True)
        numbers[f"sensitivity_{name}_low"] = float(ratios[:, 3].min())
        numbers[f"sensitivity_{name}_high"] = float(ratios[:, 3].max())
    phases = np.random.default_rng(2012).uniform(0.0, 2.0 * np.pi, (DRAWS, len(gimbals)))
    drawn = _ratios_by_phase(scenario, gimbals, phases)
    panels[4].hist(drawn[:, 3], bins=40, orientation="horizontal", color=COLOURS[3], alpha=0.7)
    panels[4].axhline(PUBLISHED, color="0.3", linewidth=1.0, linestyle=":")
    panels[4].plot([0.0], [own[3]], "o", color="black", clip_on=False, zorder=5)
    panels[4].set(xlabel=f"{DRAWS} draws of rotor phases")
    low, high = np.quantile(drawn[:, 3], [0.05, 0.95])
    numbers |= {"sensitivity_phases_low": float(low), "sensitivity_phases_high": float(high)}
    panels[5].set_axis_off()
    for axes in (panels[0], panels[3]):
        axes.set(ylabel="ratio [%]", yscale="log")
    share_legend(figure, panels[0])
    caption = (
        "The harmonic solver's ratio at the end of the stabilisation, one assumption changed at a "
        "time (dots: the assumed values). Worst axis over worst axis: with rotor speed "
        + _span(numbers, "speed")
        + ", momentum "
        + _span(numbers, "momentum")
        + ", platform offset "
        + _span(numbers, "offset")
        + ", split of static and dynamic imbalance "
        + _span(numbers, "split")
        + ", 90 % of random rotor phases "
        + _span(numbers, "phases")
        + ". The dotted line is the paper's 3 %: several of its missing parameters could account "
        "for the rest, and none was moved to meet it. What was chosen: speed and momentum, once, "
        "so that the rates have the paper's size, which sets the rates' level and, through the "
        "speed, the ratio; offset, split and phases were not fitted to any number of the paper."
    )
    return Findings(figure, caption, numbers)


def _span(numbers: dict[str, float], name: str) -> str:
    low, high = numbers[f"sensitivity_{name}_low"], numbers[f"sensitivity_{name}_high"]
    return f"{span_text(low, high, 2)} %"


def _draw(axes: Axes, values: np.ndarray, ratios: np.ndarray) -> None:
    for i, label in enumerate((*AXES, "worst axis over worst axis")):
        axes.plot(values, ratios[:, i], color=COLOURS[i], linestyle=DASHES[i], label=label)
    axes.axhline(PUBLISHED, color="0.3", linewidth=1.0, linestyle=":", label="paper, 3 %")


def _ratios(scenario: Scenario, gimbals: np.ndarray) -> np.ndarray:
    """[%] Peak rate isolated over rigid: per axis, and worst axis over worst axis (4,)."""
    phases = np.asarray(scenario.units.phases(), float)
    return _ratios_by_phase(scenario, gimbals, phases[None])[0]


def _ratios_by_phase(scenario: Scenario, gimbals: np.ndarray, phases: np.ndarray) -> np.ndarray:
    """As ``_ratios`` for rotor phases (n, cmg): (n, 4)."""
    study = api.jitter(scenario, gimbals)
    isolated, rigid = (
        np.array([jitter_peak(study.bus_rate(mount), each) for each in phases])
        for mount in ("isolated", "rigid")
    )
    worst = isolated.max(axis=1) / rigid.max(axis=1)
    return 100.0 * np.column_stack([isolated / rigid, worst])


def _rotor(scenario: Scenario) -> tuple[float, float, float]:
    """Momentum [N m s], speed [rad/s] and dynamic imbalance [kg m^2] of a rotor."""
    cluster = build_satellite(scenario).clusters[0].units
    imbalance = np.linalg.norm(np.asarray(cluster.I_RRcm_R)[0, 0, 1:])
    return float(cluster.momentum[0]), float(cluster.rotor_speed[0]), float(imbalance)


def _speed(scenario: Scenario, rpm: float) -> Scenario:
    """Other speed, momentum kept: the rotor's inertia follows."""
    return _with_inertia(scenario, "speed", rpm / RPM, _rotor(scenario)[0] * RPM / rpm)


def _momentum(scenario: Scenario, momentum: float) -> Scenario:
    """Other momentum, speed kept: the rotor's inertia follows."""
    return _with_inertia(scenario, "momentum", momentum, momentum / _rotor(scenario)[1])


def _with_inertia(scenario: Scenario, key: str, value: float, spin_inertia: float) -> Scenario:
    transverse = TRANSVERSE * spin_inertia
    return scenario.with_overrides(
        {f"cluster.rotor.{key}": value, "cluster.rotor.transverse_inertia": transverse}
    )


def _offset(scenario: Scenario, height: float) -> Scenario:
    return scenario.with_overrides({"isolator.offset": [0.0, 0.0, height]})


def _split(scenario: Scenario, factor: float) -> Scenario:
    imbalance = factor * _rotor(scenario)[2]
    return scenario.with_overrides({"cluster.rotor.dynamic_imbalance": imbalance})
