"""Lines over time for a page: their look, and long ones drawn from fewer points that keep peaks."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from quietbus.plots.style import COLOURS

DASHES = ("solid", "dash", "dot", "dashdot")  # one for each round through the colours
GREY = "#5f6b76"
_AXIS: dict[str, Any] = {
    "gridcolor": "#e4e8ec",
    "zerolinecolor": "#c3cad1",
    "linecolor": "#8a949e",
    "showline": True,
    "ticks": "outside",
    "tickcolor": "#8a949e",
    "exponentformat": "power",
    "automargin": True,
    "title": {"standoff": 10},
}


@dataclass(frozen=True)
class Picture:
    """A figure of the page, or the reason why there is none."""

    name: str  # of the element in the page
    title: str
    caption: str  # what is drawn, for people; empty if the title says it all
    content: go.Figure | str


@dataclass(frozen=True)
class Panel:
    """Lines that share an axis."""

    label: str
    unit: str
    values: np.ndarray  # (n, line)
    names: Sequence[str]  # (line,)
    scale: Literal["linear", "tozero", "log"] = "linear"
    reference: bool = False  # draw the second half of the lines thin, in the first half's colours


@dataclass(frozen=True)
class Drawing:
    """Panels above each other over time, before they are drawn."""

    name: str
    title: str
    caption: str
    time: np.ndarray  # (n,) [s]
    panels: Sequence[Panel]

    @property
    def lines(self) -> int:
        """Number of lines in all panels."""
        return sum(panel.values.shape[1] for panel in self.panels)

    def picture(self, buckets: int) -> Picture:
        """The picture, each line reduced by ``decimate``; a name has one entry in the legend."""
        rows = len(self.panels)
        figure = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.06)
        named: set[str] = set()
        for row, panel in enumerate(self.panels, 1):
            for line in panel_lines(self.time, panel, buckets):
                line.showlegend = line.name not in named and panel.values.shape[1] > 1
                figure.add_trace(line, row=row, col=1)
                named.add(line.name)
            figure.update_yaxes(
                title_text=f"{panel.label} [{panel.unit}]",
                type="log" if panel.scale == "log" else "linear",
                rangemode="tozero" if panel.scale == "tozero" else "normal",
                row=row,
                col=1,
            )
        figure.update_xaxes(title_text="time [s]", row=rows, col=1)
        finished(figure, rows)
        figure.layout.height += 8 * max(0, len(named) - 6)  # the legend's further lines
        return Picture(self.name, self.title, self.caption, figure)


def panel_lines(time: np.ndarray, panel: Panel, buckets: int) -> list[go.Scatter]:
    """The lines of a panel, reduced."""
    count = panel.values.shape[1]
    drawn = []
    for i, name in enumerate(panel.names):
        values = panel.values[:, i]
        kept = decimate(values, buckets)
        look = line_look(i, alone=count == 1)
        if panel.reference and i >= count // 2:
            look = line_look(i - count // 2) | {"dash": "dot", "width": 1.0}
        drawn.append(
            go.Scatter(
                x=time[kept],
                y=values[kept],
                mode="lines" if len(time) > 1 else "markers",
                line=look,
                marker={"color": look["color"]},
                name=name,
                legendgroup=name,
                hovertemplate=f"{name}: %{{y:.5g}} {panel.unit}<br>%{{x:.6g}} s<extra></extra>",
            )
        )
    return drawn


def decimate(values: np.ndarray, buckets: int) -> np.ndarray:
    """Indices of the samples to draw: the smallest and the largest of each stretch, and both ends.

    All samples if there are no more than two for each stretch. What is left has every peak of the
    whole at its place, so that the line looks the same at any width up to ``buckets`` dots. A value
    that is not a number counts as the largest and the smallest: gaps stay.

    Args:
        values: (n,).
        buckets: number of stretches of equal length.

    Returns:
        (m,) ascending, m at most 2 * buckets + 2.
    """
    if len(values) <= 2 * buckets:
        return np.arange(len(values))
    kept = [0, len(values) - 1]
    for stretch in np.array_split(np.arange(len(values)), buckets):
        part = values[stretch]
        kept += [stretch[np.argmin(part)], stretch[np.argmax(part)]]
    return np.unique(kept)


def line_look(i: int, alone: bool = False) -> dict[str, Any]:
    """Colour, dashes and width of line number ``i``."""
    return {
        "color": "#222222" if alone else COLOURS[i % len(COLOURS)],
        "dash": DASHES[i // len(COLOURS) % len(DASHES)],
        "width": 1.4,
        "simplify": False,  # plotly.js makes visible corners in smooth lines
    }


def finished(figure: go.Figure, rows: int = 1, height: int = 320) -> go.Figure:
    """A figure in the house's look; ``height`` [px] if it has one row."""
    figure.update_layout(
        template="none",
        height=height if rows == 1 else 110 + 205 * rows,
        margin={"l": 64, "r": 14, "t": 32, "b": 48},
        paper_bgcolor="#ffffff",
        plot_bgcolor="#ffffff",
        font={"family": "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif", "size": 12},
        legend={
            "orientation": "h",
            "x": 0.0,
            "xanchor": "left",
            "y": 0.0,
            "yanchor": "bottom",
            "yref": "container",
        },
        hovermode="closest",
        modebar={"color": "#6b7680", "activecolor": COLOURS[0]},
    )
    figure.update_xaxes(**_AXIS)
    figure.update_yaxes(**_AXIS)
    return figure
