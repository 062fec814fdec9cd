"""Pictures of a fitted waterfall: measured, fitted and residual side by side, and the lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import LogNorm, Normalize

from quietbus.plain import RPM
from quietbus.plots.style import COLOURS, DASHES, MARKERS, new_figure, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quietbus.analysis.signals.waterfall import ComponentFit, Waterfall
    from quietbus.measured import WaterfallFit

RESIDUAL = 10.0  # [dB] at the ends of the residual's colours
DECADES = 7.0  # of power that colours tell apart
COLUMNS = 256  # of a map
NAME = (0.14, 0.05)  # width and height of an order's name over those of a map
NAMED = 8  # orders named on their rays; more would cover the map


def waterfall_figures(fitted: WaterfallFit) -> dict[str, Figure]:
    """Maps and lines of every component by name."""
    figures = {}
    with style():
        for name, each in fitted.components.items():
            figures[f"waterfall-{name}"] = maps(each)
            figures[f"lines-{name}"] = lines(each)
    return figures


def maps(fitted: ComponentFit) -> Figure:
    """Measured and fitted power spectral density and their ratio, over frequency and speed."""
    measured = fitted.measured
    step, said = measured.bin, measured.component.replace("_", " ")
    figure = new_figure(4.3, f"Waterfall of the {said}: measured, fitted, residual")
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    highest = float(measured.psd.max())
    least = max(float(fitted.fitted.min()), highest * 10.0**-DECADES)
    powers = LogNorm(0.5 * least, highest)
    ratio = _pooled(measured.psd, np.add) / _pooled(fitted.fitted, np.add)
    residual = 10.0 * np.log10(np.maximum(ratio, 10.0 ** (-0.2 * RESIDUAL)))
    decibels = Normalize(-RESIDUAL, RESIDUAL)
    unit = "N²/Hz" if measured.component.endswith("force") else "N²m²/Hz"
    for axes, title, values, norm, colours in (
        (panels[0], "measured", _pooled(measured.psd, np.maximum), powers, "viridis"),
        (panels[1], "fitted", _pooled(fitted.fitted, np.maximum), powers, "viridis"),
        (panels[2], "measured over fitted", residual, decibels, "RdBu_r"),
    ):
        mesh = axes.pcolormesh(
            measured.frequency[:: _pool(measured.psd)] + 0.5 * (_pool(measured.psd) - 1) * step,
            RPM * measured.speed,
            np.maximum(values, 0.5 * least) if norm is powers else values,
            norm=norm,
            cmap=colours,
            shading="nearest",
            rasterized=True,
        )
        axes.grid(visible=False)
        axes.set_title(title)
        axes.set_xlabel("frequency [Hz]")
        if norm is decibels:
            bar = figure.colorbar(mesh, ax=axes, location="bottom", extend="both")
            bar.set_label("residual [dB]")
        elif title == "fitted":
            bar = figure.colorbar(mesh, ax=panels[:2], location="bottom", extend="min", aspect=40)
            bar.set_label(f"power spectral density [{unit}]")
            _overlay(axes, fitted)
    panels[0].set_ylabel("rotor speed [rpm]")
    panels[0].set(
        xlim=(measured.frequency[0], measured.frequency[-1]),
        ylim=(RPM * measured.speed[0], RPM * measured.speed[-1]),
    )
    if fitted.modes:
        panels[1].legend(loc="lower right", fontsize=8, labelcolor="white")
    return figure


def _pool(values: np.ndarray) -> int:
    """Bins that share a column of the picture, so that no line falls between two dots."""
    return max(1, -(-values.shape[1] // COLUMNS))


def _pooled(values: np.ndarray, how: np.ufunc) -> np.ndarray:
    return how.reduceat(values, np.arange(0, values.shape[1], _pool(values)), axis=1)


def _overlay(axes: Axes, fitted: ComponentFit) -> None:
    """Rays of the orders, named along the edge where they leave, and the modes' whirl."""
    measured = fitted.measured
    strongest = sorted(fitted.orders, key=lambda line: -line.coefficient.value)[:NAMED]
    for line in fitted.orders:
        h = line.order.value
        axes.plot(h * measured.turns, RPM * measured.speed, color="white", lw=0.5, ls=":")
    name_rays(axes, measured, sorted(line.order.value for line in strongest))
    for k, whirl in enumerate(fitted.whirl_hz(measured.speed)):
        label = "modes" if k == 0 else None
        axes.plot(whirl, RPM * measured.speed, color=COLOURS[4], lw=1.2, ls=DASHES[1], label=label)


def name_rays(axes: Axes, measured: Waterfall, orders: list[float]) -> None:
    """Names to the right of rays, as high as they find room, on no other ray if that can be."""
    width, height = measured.frequency[-1] - measured.frequency[0], np.ptp(measured.turns)
    first, last = measured.turns[0], measured.turns[-1]
    taken: list[tuple[float, float]] = []

    def free(x: float, y: float) -> bool:
        return all(
            abs(x - other[0]) > NAME[0] * width or abs(y - other[1]) > NAME[1] * height
            for other in taken
        )

    def crossed(h: float, x: float, y: float) -> bool:
        return any(x - 0.01 * width < o * y < x + NAME[0] * width for o in orders if o != h)

    for h in orders:
        top = min(last, (1.0 - 1.2 * NAME[0]) * measured.frequency[-1] / h)
        places = [
            (h * turn + 0.015 * width, turn)
            for turn in first + np.linspace(0.95, 0.25, 29) * (top - first)
        ]
        room = [place for place in places if free(*place)]
        best = [place for place in room if not crossed(h, *place)] or room
        if not best:
            continue  # the picture of the lines names it
        taken.append(best[0])
        x, y = best[0]
        axes.annotate(f"{h:.3g}", (x, 60.0 * y), color="white", fontsize=7, va="center")


def lines(fitted: ComponentFit) -> Figure:
    """Measured and fitted amplitude of every order over speed."""
    measured = fitted.measured
    said = measured.component.replace("_", " ")
    figure = new_figure(4.4, f"Lines of the {said} over speed")
    axes = figure.subplots()
    unit = "N" if measured.component.endswith("force") else "N m"
    lowest = np.inf
    for k, (line, speed, amplitude) in enumerate(
        zip(fitted.orders, fitted.line_speed, fitted.line_amplitude, strict=True)
    ):
        colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k // len(COLOURS) % len(MARKERS)]
        seen = amplitude > 0.0
        axes.plot(RPM * speed[seen], amplitude[seen], marker, color=colour, markersize=3)
        fine = np.linspace(speed[0], speed[-1], 600)
        curve = fitted.amplitude(k, fine)
        lowest = min(lowest, float(curve.min()))
        back = ", backward" if line.whirl == "backward" else ""
        axes.plot(RPM * fine, curve, color=colour, label=f"order {line.order.value:.3f}{back}")
    axes.set_yscale("log")
    axes.set_ylim(bottom=0.5 * lowest)
    axes.set(xlabel="rotor speed [rpm]", ylabel=f"amplitude [{unit}]")
    axes.set_title("points: measured, floor taken off; lines: fitted")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure
