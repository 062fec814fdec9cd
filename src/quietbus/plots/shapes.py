"""Mode shapes of the platform on the free satellite, from the front and from above."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from quietbus.plots.style import COLOURS, explain, new_figure
from quietbus.spatial.rotation import quaternion_to_matrix

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quietbus.analysis.control.modes import Mode
    from quietbus.studies.linear import Study

AMPLITUDE = 0.12  # [-] largest displacement shown, of the platform's width
PHASES = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)


def mode_shapes(study: Study) -> Figure:
    """Every elastic mode of the free satellite: plate and struts at rest and displaced."""
    modes = [mode for mode in study.modes["free"] if mode.damped_frequency_hz > 0.0][:6]
    figure = new_figure(7.4, f"Modes of the platform, free satellite ({study.scenario.name})")
    if not modes:
        explain(figure.subplots(), "no mode oscillates: all are overdamped")
        return figure
    panels = figure.subplots(4, 3).ravel()
    for axes in panels:
        axes.set_axis_off()
    for k, mode in enumerate(modes):
        row, column = divmod(k, 3)
        above, front = panels[6 * row + column], panels[6 * row + 3 + column]
        above.set_title(
            f"{mode.damped_frequency_hz:.3g} Hz, damping {mode.damping:.2f}\n{mode.name}",
            loc="center",
            fontsize=8.5,
        )
        tilted = abs(mode.shape[1]) + abs(mode.shape[3]) > abs(mode.shape[0]) + abs(mode.shape[4])
        side = 1 if tilted else 0
        _draw(above, study, mode, (0, 1))
        _draw(front, study, mode, (side, 2))
    figure.supxlabel(
        "Upper of two: from above; lower: from the side. Grey: at rest; blue: at the largest\n"
        "displacement (not to scale); pale: half a period later; dots: the joints' paths.",
        fontsize=8,
    )
    return figure


def _draw(axes: Axes, study: Study, mode: Mode, plane: tuple[int, int]) -> None:
    """One view: ``plane`` has the indices of the horizontal and the vertical axis."""
    legs, mount = study.satellite.hexapods[0].geometry, study.satellite.mounts[0]
    p_BP = np.asarray(mount.p_BX_B)
    arms = np.asarray(legs.p_PU_P) @ np.asarray(quaternion_to_matrix(mount.q_BX)).T
    lower, upper = np.asarray(legs.p_BA_B), p_BP + arms
    tops = mode.shape[:3] + np.cross(mode.shape[3:6], arms)
    feet = mode.shape[6:9] + np.cross(mode.shape[9:], lower)
    width = np.ptp(upper, axis=0).max()
    scale = AMPLITUDE * width / np.max(np.abs(np.concatenate([tops, feet])))

    def frame(phase: float, colour: str, alpha: float) -> None:
        turn = scale * np.exp(1j * phase)
        U, A = upper + (turn * tops).real, lower + (turn * feet).real
        for ends, linewidth in ((U, 1.8), (A, 1.2)):
            ring = ends[_round(ends)][:, plane]
            axes.fill(*ring.T, facecolor=colour, alpha=0.15 * alpha)
            axes.fill(*ring.T, fill=False, edgecolor=colour, alpha=alpha, linewidth=linewidth)
        for u, a in zip(U[:, plane], A[:, plane], strict=True):
            axes.plot(*zip(u, a, strict=True), color=colour, alpha=0.6 * alpha, linewidth=0.8)

    frame(0.5 * np.pi - _peak(tops), "0.6", 0.8)
    frame(np.pi - _peak(tops), COLOURS[1], 0.35)
    frame(-_peak(tops), COLOURS[0], 1.0)
    path = upper[:, None] + (scale * np.exp(1j * PHASES)[:, None] * tops[:, None]).real
    axes.plot(*path.reshape(-1, 3)[:, plane].T, ".", color=COLOURS[0], markersize=1.5)
    axes.set_aspect("equal")
    axes.margins(0.12)


def _peak(tops: np.ndarray) -> float:
    """Phase at which the joints are furthest from rest."""
    return 0.5 * float(np.angle(np.sum(tops**2)))


def _round(points: np.ndarray) -> np.ndarray:
    """Order of points around their middle, seen along z."""
    away = points - points.mean(axis=0)
    return np.argsort(np.arctan2(away[:, 1], away[:, 0]))
