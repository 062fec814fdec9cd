"""The satellite as its scenario describes it: platform, frames, legs, units and their momentum.

Drawn from the scenario alone: nothing is built or compiled.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from quietbus.plots.layout import EDGES, Layout, layout
from quietbus.plots.leg import leg_figure
from quietbus.plots.pane import Pane, View, along, perspective
from quietbus.plots.style import COLOURS, DASHES, literal, new_figure, style
from quietbus.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEG, MOMENTUM, PLATE, GIMBAL, SIGHT, ROTOR, INK = COLOURS
BASE = "0.45"
ALONG = (0.5, 0.35, 0.65, 0.22, 0.78)  # places on a leg for its number, the best first
VIEWS: dict[str, View] = {
    "in perspective": perspective,
    "from above": along(0, 1),
    "from the front (along y)": along(0, 2),
    "from the side": along(1, 2),
}


def geometry_figures(scenario: Scenario) -> dict[str, Figure]:
    """The pictures of a scenario's geometry by name: platform, satellite, frames, leg, units."""
    placed = layout(scenario)
    with style():
        return {
            "platform": platform(scenario, placed),
            "satellite": satellite(scenario, placed),
            "frames": frames(scenario, placed),
            "leg": leg_figure(scenario, placed),
            "units": units(scenario, placed),
        }


def platform(scenario: Scenario, placed: Layout) -> Figure:
    """Three views and a perspective of plates, legs, units and momentum."""
    site, several = scenario.sites[0], len(scenario.sites) > 1
    mount = "" if site.isolator.mount == "isolated" else ", rigid mount: legs not in use"
    mount = f", {site.name}, the first of {len(scenario.sites)}{mount}" if several else mount
    figure = new_figure(7.6, f"Platform, bus frame ({scenario.name}{mount})")
    around, reach = _extent(placed)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 0.62), wspace=0.2)
    for k, (name, view) in enumerate(VIEWS.items()):
        pane = view(figure, grid[divmod(k, 2)], placed.size)
        pane.axes.set_title(name)
        _plates(pane, placed)
        _units(pane, placed, reach)
        _legs(pane, scenario, placed, named=pane.shows_all)
        pane.bound(around, 0.1 * placed.size)
        pane.finish(around.mean(axis=0))
    _legend(figure, pane, _momentum_note(placed))
    return figure


def satellite(scenario: Scenario, placed: Layout) -> Figure:
    """Bus, platform and lines of sight in perspective."""
    figure = new_figure(6.2, f"Satellite ({scenario.name})")
    size = float(np.max(np.ptp(placed.corners_B, axis=0)))
    pane = perspective(figure, 111, size)
    for i, (a, b) in enumerate(EDGES):
        label = "bus, as a cuboid" if i == 0 else None
        look: dict[str, Any] = {"color": BASE, "linewidth": 0.9, "linestyle": DASHES[1]}
        pane.line(placed.corners_B[[a, b]], label=label, **look)
    _plates(pane, placed)
    _legs(pane, scenario, placed, named=False)
    around, reach = _extent(placed)
    _units(pane, placed, reach, named=False)
    _triad(pane, np.zeros(3), np.eye(3), 0.3 * size, "B")
    shown = [*placed.corners_B, *around]
    for name, line in scenario.lines_of_sight.items():
        if line.direction is not None:
            along = 0.75 * size * np.array(line.direction)
            pane.arrow(np.zeros(3), along, SIGHT)
            pane.line([np.zeros(3), along], color=SIGHT, label=f"line of sight {literal(name)}")
            pane.label(along, literal(name), fontsize=8, color=SIGHT)
            shown.append(along)
    pane.bound(np.array(shown), 0.05 * size)
    pane.finish(np.zeros(3))
    note = "The bus's shape is not in the scenario: the cuboid is the homogeneous one of its mass\n"
    _legend(figure, pane, note + "and inertia about its mass centre, the origin of frame B.")
    return figure


def frames(scenario: Scenario, placed: Layout) -> Figure:
    """The frames of bus, base plate, upper plate and first unit, and what lies between them."""
    figure = new_figure(6.4, f"Frames ({scenario.name})")
    first, size = placed.units[0], placed.size
    pane = perspective(figure, 111, size)
    _plates(pane, placed)
    origins = {"B": np.zeros(3), "D": placed.p_BD_B, "P": placed.p_BP_B, "G": first.position}
    _triad(pane, origins["B"], np.eye(3), 0.3 * size, "B")
    _triad(pane, origins["D"], placed.R_BD, 0.22 * size, "D")
    _triad(pane, origins["P"], placed.R_BD, 0.22 * size, "P")
    if first.gimbal is None:
        pane.arrow(first.position, 0.25 * size * first.spin, INK)
        pane.label(first.position + 0.28 * size * first.spin, "s", fontsize=8)
    else:
        t = np.cross(first.gimbal, first.spin)
        for letter, axis in (("s", first.spin), ("t", t), ("g", first.gimbal)):
            pane.arrow(first.position, 0.25 * size * axis, INK, 1.2)
            pane.label(first.position + 0.28 * size * axis, letter, fontsize=8)
    steps = (("B", "D", "offset"), ("D", "P", "separation"), ("P", "G", "position of unit 0"))
    for colour, (a, b, name) in zip((LEG, MOMENTUM, GIMBAL), steps, strict=True):
        between = origins[b] - origins[a]
        pane.arrow(origins[a], between, colour)
        text = f"{name}: {_listed(between)} m, {np.linalg.norm(between):.4g} m long"
        pane.line([origins[a], origins[b]], color=colour, label=text)
    ends = np.array([*origins.values(), *placed.lower_B, *placed.upper_B])
    reached = origins["B"] + 0.3 * size * np.eye(3)
    pane.bound(np.concatenate([ends, reached, [first.position + 0.25 * size * first.spin]]), 0.08)
    pane.finish(ends.mean(axis=0))
    axes = "s spin" if first.gimbal is None else "s spin, t = g × s, g gimbal"
    _legend(
        figure,
        pane,
        "B: bus, origin at its mass centre. D: base plate. P: upper plate, nominal pose.\n"
        f"Unit 0: axes {axes}. All vectors in the bus frame.",
    )
    return figure


def units(scenario: Scenario, placed: Layout) -> Figure:
    """The cluster: gimbal axes, rotors and momentum, in perspective and from above."""
    wheels = placed.units[0].gimbal is None
    noun = "Reaction wheels" if wheels else "CMGs"
    figure = new_figure(4.9, f"{noun} and their momentum ({scenario.name})")
    reach = _extent(placed)[1]
    points = np.array([unit.position for unit in placed.units])
    ends = np.concatenate([points + reach * sign * v for sign in (-1, 1) for v in np.eye(3)])
    grid = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0), wspace=0.2)
    for k, name in enumerate(("in perspective", "from above")):
        pane = VIEWS[name](figure, grid[k], placed.size)
        pane.axes.set_title(name)
        pane.fill(_ring(placed.upper_B, placed.R_BD), PLATE, "upper plate")
        _units(pane, placed, reach)
        pane.bound([*ends, *placed.upper_B], 0.05 * placed.size)
        pane.finish(points.mean(axis=0))
    pyramid = scenario.units.blocks[0].pyramid
    said = ""
    if pyramid is not None:
        leaning = "spin" if wheels else "gimbal"
        said = (
            f"Pyramid of {pyramid.units}: {leaning} axes lean outwards by the skew, "
            f"{np.degrees(pyramid.skew):.4g}° from the plate's z, radius {pyramid.radius:.4g} m.\n"
        )
    _legend(figure, pane, said + _momentum_note(placed))
    return figure


# ---- parts


def _plates(pane: Pane, placed: Layout) -> None:
    pane.fill(_ring(placed.lower_B, placed.R_BD), BASE, "base plate, on the bus")
    pane.fill(_ring(placed.upper_B, placed.R_BD), PLATE, "upper plate")


def _legs(pane: Pane, scenario: Scenario, placed: Layout, named: bool = True) -> None:
    held = scenario.sites[0].isolator.mount == "rigid"
    for i, (a, u) in enumerate(zip(placed.lower_B, placed.upper_B, strict=True)):
        look = {"linestyle": DASHES[1], "alpha": 0.5} if held else {}
        label = ("legs, not in use on a rigid mount" if held else "legs") if i == 0 else None
        pane.line([a, u], color=LEG, linewidth=1.8, label=label, **look)
        if named:
            pane.label([a + part * (u - a) for part in ALONG], f"leg {i}", fontsize=7, color=LEG)
    marks: dict[str, Any] = {"linestyle": "none", "color": INK, "markersize": 4}
    pane.line(placed.lower_B, marker="s", label="universal joints", **marks)
    pane.line(placed.upper_B, marker="o", label="spherical joints", **marks)


def _units(pane: Pane, placed: Layout, reach: float, named: bool = True) -> None:
    """Rotors as discs across their spin axes, gimbal axes as lines, momentum as arrows."""
    largest = max(float(np.linalg.norm(unit.momentum)) for unit in placed.units)
    noun = "CMG" if placed.units[0].gimbal is not None else "wheel"
    for j, unit in enumerate(placed.units):
        first = j == 0
        pane.fill(_disc(unit.position, unit.spin, 0.45 * reach), ROTOR, "rotor" if first else None)
        if unit.gimbal is not None:
            ends = unit.position + 0.8 * reach * np.outer([-1.0, 1.0], unit.gimbal)
            look = {"linestyle": DASHES[2], "linewidth": 1.3}
            pane.line(ends, color=GIMBAL, label="gimbal axis" if first else None, **look)
        if largest > 0.0:
            along = reach * unit.momentum / largest
            pane.arrow(unit.position, along, MOMENTUM)
            text = f"rotor momentum, longest {largest:.4g} N m s" if first else None
            pane.line([unit.position, unit.position], color=MOMENTUM, label=text)
        if named:
            pane.label(unit.position, f"{noun} {j}", fontsize=7)


def _triad(pane: Pane, origin: np.ndarray, R: np.ndarray, length: float, letter: str) -> None:
    """A frame: its axes are the columns of R."""
    for name, axis in zip("xyz", R.T, strict=True):
        pane.arrow(origin, length * axis, INK, 1.2)
        pane.label(origin + 1.15 * length * axis, f"${name}_{letter}$", fontsize=8)
    pane.label(origin - 0.12 * length * R.sum(axis=1), letter, fontsize=9, fontweight="bold")


def _extent(placed: Layout) -> tuple[np.ndarray, float]:
    """Points that the platform's pictures have to hold, and the length of a momentum arrow [m]."""
    positions = np.array([unit.position for unit in placed.units])
    apart = [float(np.linalg.norm(a - b)) for i, a in enumerate(positions) for b in positions[:i]]
    reach = min([0.3 * placed.size, *(0.6 * d for d in apart if d > 1e-6)])
    ends = [positions + sign * reach * axis for sign in (-1, 1) for axis in np.eye(3)]
    return np.concatenate([placed.lower_B, placed.upper_B, *ends]), reach


def _ring(points: np.ndarray, R_BD: np.ndarray) -> np.ndarray:
    """Points of a plate in the order around its middle."""
    flat = (points - points.mean(axis=0)) @ R_BD
    around: np.ndarray = points[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]), kind="stable")]
    return around


def _disc(centre: np.ndarray, axis: np.ndarray, radius: float) -> np.ndarray:
    """(n, 3) circle across an axis."""
    across = np.linalg.svd(axis[None])[2][1:]
    angles = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    circle: np.ndarray = centre + radius * np.stack([np.cos(angles), np.sin(angles)], 1) @ across
    return circle


def _momentum_note(placed: Layout) -> str:
    total = f"Total rotor momentum {_listed(placed.total_momentum)} N m s (bus frame)"
    if placed.units[0].gimbal is None:
        return f"{total}."
    angles = ", ".join(f"{np.degrees(unit.angle):.4g}" for unit in placed.units[:8])
    more = ", ..." if len(placed.units) > 8 else ""
    return f"{total} at gimbal angles [{angles}{more}]°."


def _listed(vector: np.ndarray) -> str:
    size = float(np.max(np.abs(vector)))
    rounded = np.where(np.abs(vector) < 1e-12 * max(size, 1.0), 0.0, vector)
    return "[" + ", ".join(f"{value:.4g}" for value in rounded) + "]"


def _legend(figure: Figure, pane: Pane, note: str) -> None:
    """What the lines are, below what is to be said of the picture."""
    handles, labels = pane.axes.get_legend_handles_labels()
    widest = max(map(len, labels)) + 8
    columns = next(n for n in (4, 3, 2, 1) if n * widest <= 115 or n == 1)
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=columns,
        fontsize=8,
        title=note,
        title_fontproperties={"size": 8},
    )
