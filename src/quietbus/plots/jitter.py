"""Pictures of jitter at one operating point, and of its lines, each named by its rotor's order."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from quietbus.plots.signals import AXES, LINES
from quietbus.plots.style import COLOURS, explain, new_figure, scaled, share_legend, style
from quietbus.results.motion import NOISE, RotorLines

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quietbus.studies.jitter import JitterStudy

NO_JITTER = f"no jitter: the rotors shake the bus by less than {NOISE:g} deg/s"
ROUNDING = 1e-9  # of the largest line: lines that are left out
MINOR = 1e-6  # of all amplitudes together: parts of a budget that are left out
HATCHES = ("", "////")  # of the orders of imbalance in a budget
CROWDED = 12  # names side by side; more are turned


def jitter_figures(study: JitterStudy) -> dict[str, Figure]:
    """All pictures of a study by name; without jitter they say so. ``worst`` needs gimbals."""
    with style():
        figures = {"spectrum": spectrum(study), "budget": budget(study)}
        if not study.held:
            figures["worst"] = worst(study)
        if study.noise("isolated") is not None:
            figures["noise"] = noise(study)
        return figures


def spectrum(study: JitterStudy) -> Figure:
    """Amplitudes of the bus rate at every order of every rotor, on both mounts."""
    figure = new_figure(5.6, f"Lines of the bus rate ({study.scenario.name})")
    lines = {
        mount: RotorLines(
            np.rad2deg(1.0) * study.bus_rate(mount),
            study.frequency,
            np.outer(study.satellite(mount).rotor_phase, study.orders),
            study.orders,
        )
        for mount in LINES
    }
    draw_lines_by_order(figure, lines)
    return figure


def draw_lines_by_order(figure: Figure, lines: Mapping[str, RotorLines]) -> None:
    """Stems for each axis, by rising frequency; where rotors share a frequency, also their sum.

    Args:
        figure: an empty one.
        lines: of the same rotors, by mount.
    """
    largest = max(float(np.abs(these.amplitude).max(initial=0.0)) for these in lines.values())
    if largest < NOISE:
        explain(figure.subplots(), NO_JITTER)
        return
    panels = figure.subplots(3, 1, sharex=True, sharey=True)
    ticks: list[str] = []
    sizes: list[np.ndarray] = []  # (mount, axis) [deg/s] of each stem
    names: dict[float, str] = {}  # of the frequencies, by their middles
    missing: list[str] = []
    first = next(iter(lines.values()))
    for group in first.by_frequency():
        each = [np.abs([these.amplitude[line] for these in lines.values()]) for line in group]
        if np.max(each) <= ROUNDING * largest:
            missing.append(first.name(group))
            continue
        stems = [f"rotor {j}" for j, _ in group]
        if len(group) > 1:
            stems.append("all")
            each.append(np.array([these.together(group) for these in lines.values()]))
        names[len(ticks) + 0.5 * (len(stems) - 1)] = first.name(group)
        for axes in panels:
            axes.axvline(len(ticks) - 0.5, color="0.6", linewidth=0.8)
        ticks += stems
        sizes += each
    _draw_stems(panels, list(lines), np.array(sizes), ROUNDING * largest)
    panels[-1].set_xlim(-0.5, len(ticks) - 0.5)
    panels[-1].set_xticks(range(len(ticks)), ticks, rotation=90 * (len(ticks) > CROWDED))
    top = panels[0].secondary_xaxis("top")
    top.set_xticks(list(names), list(names.values()), rotation=90 * (len(names) > CROWDED // 2))
    top.tick_params(length=0)
    top.spines["top"].set_visible(False)
    notes = []
    if "all" in ticks:
        notes.append("all: rotors of one frequency, added with their phases")
    if missing:
        notes.append(f"left out, less than {_power(ROUNDING)} of the largest: {'; '.join(missing)}")
    panels[0].set_title("\n".join(textwrap.fill(note, 100) for note in notes))
    share_legend(figure, panels[0])


def _draw_stems(
    panels: Sequence[Axes], mounts: Sequence[str], sizes: np.ndarray, least: float
) -> None:
    """Stems of (stem, mount, axis) [deg/s] on a logarithmic scale; none up to ``least``."""
    factor, unit = scaled(float(sizes.max()), "deg/s")
    floor = 0.3 * factor * sizes[sizes > least].min()
    offsets = np.linspace(-0.1, 0.1, len(mounts)) if len(mounts) > 1 else [0.0]
    for i, axes in enumerate(panels):
        for m, (mount, offset) in enumerate(zip(mounts, offsets, strict=True)):
            label, look = LINES[mount]
            at = np.flatnonzero(sizes[:, m, i] > least)
            tops = factor * sizes[at, m, i]
            axes.vlines(at + offset, floor, tops, color=look["color"], linewidth=1.6)
            marker = "s" if mount == "rigid" else "o"
            axes.plot(at + offset, tops, marker, color=look["color"], markersize=5, label=label)
        log_scale(axes, floor, 3.0 * factor * sizes.max())
        axes.grid(visible=False, axis="x")
        axes.set_ylabel(f"about {AXES[i]}\n[{unit}]")


def _power(value: float) -> str:
    """A power of ten in mathematical notation."""
    return f"$10^{{{round(np.log10(value))}}}$"


def log_scale(axes: Axes, low: float, high: float) -> None:
    """A logarithmic ordinate with plain numbers, also where it spans less than a decade."""
    axes.set(yscale="log", ylim=(low, high))
    few = high < 300.0 * low
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def budget(study: JitterStudy) -> Figure:
    """The bus rate's amplitudes by rotor and kind of imbalance, stacked, on both mounts."""
    figure = new_figure(6.2, f"Bus rate by rotor and kind of imbalance ({study.scenario.name})")
    stack = _budget_parts(study)
    parts = {  # (part, cmg, axis)
        mount: np.stack(
            [
                np.rad2deg(np.abs(study.budget[mount][part.kind][:, part.at])).sum(axis=1)
                for part in stack
            ]
        )
        for mount in LINES
    }
    if max(float(values.max(initial=0.0)) for values in parts.values()) < NOISE:
        explain(figure.subplots(), NO_JITTER)
        return figure
    share = np.max([v.sum(axis=(1, 2)) / (v.sum() or 1.0) for v in parts.values()], axis=0)
    shown = share >= MINOR  # (part,)
    panels = figure.subplots(3, 2, sharex=True, sharey="col")
    rotors = np.arange(len(study.gimbal_angle))
    sums = {mount: np.rad2deg(study.combined(mount).worst_case) for mount in LINES}
    for column, (mount, (title, _)) in enumerate(LINES.items()):
        whole = np.rad2deg(np.abs(study.bus_rate(mount))).sum(axis=1)  # (cmg, axis)
        highest = float(np.sum(parts[mount][shown], axis=0).max())
        factor, unit = scaled(highest, "deg/s")
        panels[0, column].set_title(title)
        for i, axes in enumerate(panels[:, column]):
            bottom = np.zeros(len(rotors))
            for k in np.flatnonzero(shown):
                height = factor * parts[mount][k, :, i]
                axes.bar(
                    rotors,
                    height,
                    0.6,
                    bottom,
                    color=COLOURS[stack[k].kind],
                    edgecolor="white",
                    linewidth=0.0,
                    hatch=stack[k].hatch,
                    label=f"{stack[k].name}, {stack[k].order}",
                )
                bottom += height
            label = "each rotor, phases as given"
            axes.plot(rotors, factor * whole[:, i], "kD", markersize=4, label=label)
            note = f"all rotors, any phases: {factor * sums[mount][i]:.4g}"
            if mount == "isolated" and sums["rigid"][i] > NOISE:
                note += f" ({100.0 * sums[mount][i] / sums['rigid'][i]:.3g} %)"
            axes.annotate(
                note,
                (0.99, 0.98),
                xycoords="axes fraction",
                ha="right",
                va="top",
                fontsize=8,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
            )
            axes.set_ylim(0.0, 1.3 * factor * highest)
            axes.set_ylabel(f"about {AXES[i]}\n[{unit}]")
            axes.grid(visible=False, axis="x")
    turned = 90 * (len(rotors) > CROWDED // 2)
    for axes in panels[-1]:
        axes.set_xticks(rotors, [f"rotor {j}" for j in rotors], rotation=turned)
    figure.legend(
        *panels[0, 0].get_legend_handles_labels(),
        loc="outside lower left",
        ncols=3,
        title=_budget_caption(stack, shown),
        title_fontsize=8,
        alignment="left",
    )
    return figure


def noise(study: JitterStudy) -> Figure:
    """Spectral density of the bus rate by the rotors' broadband disturbance, on both mounts."""
    figure = new_figure(5.6, f"Bus rate by broadband disturbance ({study.scenario.name})")
    panels = figure.subplots(3, 1, sharex=True, sharey=True)
    for mount, (label, look) in LINES.items():
        spectra = study.noise(mount)
        assert spectra is not None
        density = np.rad2deg(np.sqrt(spectra.psd["bus_rate"][0].sum(axis=1)))
        rms = np.rad2deg(np.sqrt(spectra.variance("bus_rate", 1)[0]))
        for i, axes in enumerate(panels):
            said = f"{label}, RMS {rms[i]:.3g} deg/s"
            axes.loglog(spectra.frequency, density[:, i], **{**look, "label": said})
            axes.set_ylabel(f"about {AXES[i]}\n[deg/s/√Hz]")
            axes.legend(loc="best")
    panels[-1].set_xlabel("frequency [Hz]")
    return figure


class _Part(NamedTuple):
    """One part of a stack."""

    kind: int  # among those of the study
    name: str  # of the kind
    order: str
    at: list[int]  # positions of its orders
    hatch: str


def _budget_parts(study: JitterStudy) -> list[_Part]:
    """Imbalance has two orders, told apart by hatches; those of tables are taken together."""
    parts = []
    for kind, name in enumerate(study.kinds):
        if name == "order tables":
            parts.append(_Part(kind, name, "all orders", list(range(len(study.orders))), ""))
            continue
        for order, hatch in zip(study.imbalance_orders, HATCHES, strict=True):
            parts.append(_Part(kind, name, f"{order}Ω", [study.orders.index(order)], hatch))
    return parts


def _budget_caption(parts: Sequence[_Part], shown: np.ndarray) -> str:
    """What the stacks mean, and which parts are left out."""
    text = (
        "Stacked: the amplitudes of the kinds; they reach the top only if all are in phase, the "
        "worst case. Diamonds: the rotor's amplitude, its kinds added with their phases."
    )
    drawn = {part.name for part, there in zip(parts, shown, strict=True) if there}
    gone = [part for part, there in zip(parts, shown, strict=True) if not there]
    missing = dict.fromkeys(
        f"{part.name} at {part.order}" if part.name in drawn else part.name for part in gone
    )
    if missing:
        text += f" Left out, less than {_power(MINOR)} of the total: {', '.join(missing)}."
    return textwrap.fill(text, 125)


def worst(study: JitterStudy) -> Figure:
    """Jitter at the scenario's gimbal angles and at the worst ones, on both mounts."""
    figure = new_figure(3.9, f"Jitter at the worst gimbal angles ({study.scenario.name})")
    found = {mount: study.worst(mount) for mount in LINES}
    if max(np.rad2deg(angles.value) for angles in found.values()) < NOISE:
        explain(figure.subplots(), NO_JITTER)
        return figure
    panels = figure.subplots(1, 2)
    for axes, (mount, (label, look)) in zip(panels, LINES.items(), strict=True):
        angles = found[mount].gimbal_angle
        here, there = study.worst_phases(mount), study.worst_phases(mount, angles)
        both = np.rad2deg([np.append(sums, np.linalg.norm(sums)) for sums in (here, there)])
        factor, unit = scaled(float(both.max()), "deg/s")
        bars = ((-0.2, "white", "at the scenario's angles"), (0.2, look["color"], "at the worst"))
        for values, (offset, colour, when) in zip(factor * both, bars, strict=True):
            drawn = axes.bar(
                np.arange(4) + offset, values, 0.36, color=colour, edgecolor=look["color"]
            )
            drawn.set_label(when)
            axes.bar_label(drawn, fmt="{:.3g}", fontsize=8, padding=1)
        said = ", ".join(f"{angle:.0f}°" for angle in np.rad2deg(angles))
        axes.set_title(f"{label}\n{textwrap.fill(f'worst: {said}', 55)}")
        axes.set_ylim(0.0, 1.35 * factor * both.max())
        axes.set_xticks(range(4), [*(f"about {axis}" for axis in AXES), "norm"])
        axes.set_ylabel(f"bus rate, any phases [{unit}]")
        axes.grid(visible=False, axis="x")
        axes.legend(loc="upper left")
    return figure
