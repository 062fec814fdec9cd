"""Pictures of pointing: cumulative power spectra by contributor, metrics against exposure time."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import FuncFormatter

from quietbus.analysis.pointing.contributors import powers
from quietbus.analysis.pointing.power import cumulative
from quietbus.plain import ARCSEC
from quietbus.plots.jitter import log_scale
from quietbus.plots.style import COLOURS, DASHES, explain, literal, new_figure, share_legend, style

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quietbus.analysis.pointing.power import Power
    from quietbus.studies.verdict import Verdict
    from quietbus.studies.verification import Verification


def pointing_figures(verification: Verification) -> dict[str, Figure]:
    """All pictures of a verification by name: of each line of sight, and of all requirements."""
    with style():
        figures = {
            f"cumulative-{name}": cumulative_spectrum(
                f"Image motion of {name} ({verification.scenario.name}, "
                f"{verification.run.attrs['mount']})",
                powers(verification.motion(name), _stretch(verification, name)),
            )
            for name in dict.fromkeys(v.line_of_sight for v in verification.verdicts)
        }
        return figures | {"exposure": exposure(verification)}


def _stretch(verification: Verification, name: str) -> tuple[float, float]:
    """The longest stretch over which a line of sight is judged."""
    own = [v.stretch for v in verification.verdicts if v.line_of_sight == name]
    return max(own, key=lambda stretch: stretch[1] - stretch[0])


def cumulative_spectrum(title: str, parts: Mapping[str, Power]) -> Figure:
    """Cumulative power spectrum as RMS, contributors by name, from above and from below.

    Args:
        title: of the figure.
        parts: mean square [rad^2] by frequency of each contributor, taken as independent.
    """
    figure = new_figure(4.6, title)
    if not parts or not any(part.total > 0.0 for part in parts.values()):
        explain(figure.subplots(), "no image motion to show")
        return figure
    corners = np.concatenate([part.corners for part in parts.values()])
    low, high = np.min(corners[corners > 0.0]), 1.6 * np.max(corners)
    panels = figure.subplots(1, 2, sharey=True)
    titles = ("from above: RMS of all above a frequency", "from below: RMS of all below it")
    sums = [cumulative(parts, way, (low / 1.6, high)) for way in ("backward", "forward")]
    top = ARCSEC * np.sqrt(max(float(np.max(each.whole)) for each in sums))
    for axes, each, text in zip(panels, sums, titles, strict=True):
        axes.set_title(text)
        for i, (name, values) in enumerate(each.parts.items()):
            look: dict[str, Any] = {  # the first ones widest: equal contributors lie on each other
                "linewidth": 1.0 + 2.5 * (1.0 - i / len(each.parts)),
                "color": COLOURS[i % (len(COLOURS) - 1)],
                "linestyle": DASHES[i % len(DASHES)],
            }
            _curve(axes, each.frequency_hz, values, label=name, **look)
        _curve(axes, each.frequency_hz, each.whole, color="k", linewidth=2.0, label="all", zorder=1)
        axes.set(xscale="log", yscale="log", xlim=(low / 1.6, high), xlabel="frequency [Hz]")
    smallest = min(np.sqrt(part.total) for part in parts.values() if part.total > 0.0)
    panels[0].set_ylim(0.2 * ARCSEC * smallest, 2.0 * top)
    panels[0].set_ylabel("image motion, RMS [arcsec]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _curve(axes: Axes, f: np.ndarray, mean_square: np.ndarray, **look: Any) -> None:
    """Root of a cumulative mean square; rounding below 1e-12 of the whole is nothing."""
    rounded = np.where(mean_square > 1e-12 * np.max(mean_square), mean_square, 0.0)
    axes.plot(f, ARCSEC * np.sqrt(rounded), **look)


def exposure(verification: Verification) -> Figure:
    """Each windowed metric against exposure time, with its requirement."""
    found = [
        (verdict, curve)
        for i, verdict in enumerate(verification.verdicts)
        if (curve := verification.curve(i)) is not None
    ]
    title = f"Pointing against exposure time ({verification.scenario.name}, "
    title += f"{verification.run.attrs['mount']})"
    if not found:
        figure = new_figure(2.6, title)
        explain(figure.subplots(), "no requirement on a metric with an exposure window")
        return figure
    rows = (len(found) + 1) // 2
    figure = new_figure(0.6 + 2.7 * rows, title)
    panels = figure.subplots(rows, min(2, len(found)), squeeze=False).ravel()
    for axes, (verdict, curve) in zip(panels, found, strict=False):
        _exposure(axes, verdict, *curve)
    free = panels[len(found) :]
    for axes in free:
        axes.set_axis_off()
        axes.legend(*panels[0].get_legend_handles_labels(), loc="center")
    if len(free) == 0:
        share_legend(figure, panels[0])
    return figure


def _exposure(axes: Axes, verdict: Verdict, windows: np.ndarray, values: np.ndarray) -> None:
    """One metric: the curve, the limit at the required window, and where that window lies."""
    metric, scale = verdict.metric, 1e3
    axes.plot(scale * windows, verdict.scale * values, color=COLOURS[0], label="metric")
    axes.axhline(verdict.shown(verdict.limit), color=COLOURS[1], linestyle=DASHES[1], label="limit")
    axes.axvline(scale * metric.window, color="0.6", linewidth=0.8, linestyle=DASHES[3])
    value = verdict.shown(verdict.value)
    axes.plot(
        scale * metric.window,
        value,
        "o" if verdict.met else "X",
        color="k",
        markersize=6,
        label="value at the required exposure:\nmet (dot) or not (cross)",
    )
    every = np.array([*(verdict.scale * values), value, verdict.shown(verdict.limit)])
    log_scale(axes, 0.5 * float(np.min(every[every > 0.0])), 2.0 * float(np.max(every)))
    axes.set(xscale="log", xlabel="exposure [ms]")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    unit = "" if verdict.unit == "1" else f" [{verdict.unit}]"
    axes.set_ylabel(f"{metric.name}{unit or ' [-]'}")
    name, margin = literal(verdict.line_of_sight), verdict.margin_percent
    shown = f"{value:.3g}" if verdict.unit == "1" else f"{value:.3g} {verdict.unit}"
    said = f"{name}: {shown}, {verdict.word}, margin {margin:.3g} %"
    axes.set_title(textwrap.fill(f"{said}; {verdict.meaning}", 46), fontsize=8.5)
