"""One leg along its axis: joints, parts with their mass centres, strut."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from quietbus.plots.layout import Layout
from quietbus.plots.style import COLOURS, new_figure
from quietbus.scenario import Scenario
from quietbus.scenario.struts import StrutKind

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOWER, UPPER, STRUT = COLOURS[0], COLOURS[2], COLOURS[1]


def leg_figure(scenario: Scenario, placed: Layout, leg: int = 0) -> Figure:
    """A leg to scale along its axis; what lies across it is a symbol."""
    legs = scenario.sites[0].isolator.legs
    own = {
        name: value[leg] if isinstance(value := getattr(legs, name), tuple) else value
        for name in type(legs).model_fields
    }
    span = placed.upper_B[leg] - placed.lower_B[leg]
    length = float(np.linalg.norm(span))
    alike = "all alike" if _alike(legs) else f"leg {leg}; others differ"
    figure = new_figure(4.2, f"A leg of {legs.count}, {alike} ({scenario.name})")
    axes = figure.subplots()
    half = 0.045 * length
    _plate(axes, 0.0, length, "base plate D")
    _plate(axes, length, length, "upper plate P")
    # the lower part is the cylinder, the upper one the rod in it
    _tube(axes, 0.06 * length, 0.52 * length, half, LOWER)
    _tube(axes, 0.48 * length, 0.95 * length, 0.45 * half, UPPER)
    _strut(axes, 0.2 * length, 0.8 * length, 3.0 * half)
    axes.plot([0.0, 0.06 * length], [0, 0], color=LOWER, linewidth=2)
    axes.plot([0.95 * length, length], [0, 0], color=UPPER, linewidth=2)
    axes.plot(0.0, 0.0, "s", color="k", markersize=8)
    axes.plot(length, 0.0, "o", color="k", markersize=8)
    for part, at, colour, start in (
        ("lower_part", own["lower_part"].distance, LOWER, 0.0),
        ("upper_part", length - own["upper_part"].distance, UPPER, length),
    ):
        axes.plot(at, 0.0, "P", color="w", markeredgecolor=colour, markersize=9)
        level = -3.2 * half
        _dimension(axes, start, at, level, f"{own[part].distance:.4g} m", colour)
    _dimension(axes, 0.0, length, -5.2 * half, f"length {length:.5g} m", "k")
    k = placed.axes_B[leg]
    angle = np.degrees(np.arccos(np.clip(abs(k @ span) / length, 0.0, 1.0)))
    own_k = ", ".join(f"{value:.3g}" for value in legs.universal_axes[leg])
    axes.text(
        0.0, 2.2 * half, f"universal joint\naxis k [{own_k}] in D,\n{angle:.3g}° from the leg",
        ha="center", va="bottom", fontsize=8,
    )  # fmt: skip
    axes.text(length, 2.2 * half, "spherical joint", ha="center", va="bottom", fontsize=8)
    axes.text(
        0.5 * length, 5.2 * half,
        _law(legs.law, leg),
        ha="center", va="bottom", fontsize=9, color=STRUT,
    )  # fmt: skip
    axes.set_xlim(-0.22 * length, 1.22 * length)
    axes.set_ylim(-6.4 * half, 7.0 * half)
    axes.set_aspect("equal")
    axes.set_axis_off()
    figure.supxlabel(
        f"{_part('Lower part (blue)', own['lower_part'])}\n"
        f"{_part('Upper part (green)', own['upper_part'])}\n"
        f"Crosses: mass centres. Friction: spherical joint {own['spherical_friction']:.4g}, "
        f"universal joint {own['universal_friction']:.4g} N m s/rad. "
        "Along the leg to scale, across it symbols.",
        fontsize=8,
    )
    return figure


def _alike(legs: Any) -> bool:
    rows = ("upper_joints", "lower_joints", "universal_axes")
    values = [getattr(legs, name) for name in type(legs).model_fields if name not in rows]
    return all(len(set(value)) == 1 for value in values if isinstance(value, tuple))


def _law(law: StrutKind, leg: int) -> str:
    """A strut's law in a line."""
    if (known := law.spring_and_damper()) is not None:
        k, c = (each[leg] if isinstance(each, tuple) else each for each in known)
        return f"k = {k:.6g} N/m, c = {c:.6g} N s/m"
    numbers = law.model_dump()
    said = f"strut of type {numbers.pop('type')}"
    own = (f"{key} {x:g}" if isinstance(x, float) else f"{key} {x}" for key, x in numbers.items())
    return f"{said}: {', '.join(own)} (SI)"


def _part(name: str, part: Any) -> str:
    return (
        f"{name}: mass {part.mass:.4g} kg, inertia about its mass centre "
        f"{part.transverse_inertia:.4g} across and {part.axial_inertia:.4g} kg m² along the leg."
    )


def _plate(axes: Axes, x: float, length: float, name: str) -> None:
    side = -1.0 if x == 0.0 else 1.0
    edge = x + side * 0.025 * length
    axes.plot([edge, edge], [-0.12 * length, 0.06 * length], color="0.3", linewidth=4)
    axes.plot([x, edge], [0, 0], color="0.3", linewidth=2)
    ha = "right" if side < 0 else "left"
    axes.text(edge + side * 0.015 * length, -0.09 * length, name, ha=ha, va="center", fontsize=8)


def _tube(axes: Axes, start: float, end: float, half: float, colour: str) -> None:
    axes.fill(
        [start, end, end, start], [-half, -half, half, half],
        facecolor=colour, alpha=0.25, edgecolor=colour, linewidth=1.2,
    )  # fmt: skip


def _strut(axes: Axes, start: float, end: float, level: float) -> None:
    """A spring and a damper side by side, above the leg."""
    span = end - start
    for x in (start, end):
        axes.plot([x, x], [0.0, level * 1.45], color=STRUT, linewidth=0.8, linestyle=":")
    top, low, size = level * 1.45, level * 0.9, 0.18 * level
    turns = np.linspace(0.3, 0.7, 11)
    zigzag = top + size * np.array([0, *([1, -1] * 5)])[: len(turns)] * (turns < 0.7)
    along = start + span * np.array([0.0, *turns, 1.0])
    axes.plot(along, [top, *zigzag, top], color=STRUT, linewidth=1.3)
    a, b, c = start + 0.42 * span, start + 0.5 * span, start + 0.58 * span
    axes.plot([start, b], [low, low], color=STRUT, linewidth=1.3)
    axes.plot([b, b], [low - 0.8 * size, low + 0.8 * size], color=STRUT, linewidth=2)
    axes.plot([a, c, c, a], [low + size, low + size, low - size, low - size], color=STRUT)
    axes.plot([c, end], [low, low], color=STRUT, linewidth=1.3)


def _dimension(axes: Axes, a: float, b: float, y: float, text: str, colour: str) -> None:
    """A length between two ticks."""
    for x in (a, b):
        axes.plot([x, x], [y * 1.06, 0.0], color=colour, linewidth=0.5, alpha=0.6)
    axes.annotate(
        "", (b, y), (a, y),
        arrowprops={
            "arrowstyle": "<|-|>", "color": colour, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0,
        },
    )  # fmt: skip
    axes.text(0.5 * (a + b), y, text, ha="center", va="center", fontsize=8, color=colour,
              bbox={"facecolor": "w", "edgecolor": "none", "pad": 1.0})  # fmt: skip
