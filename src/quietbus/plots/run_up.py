"""Picture of run-ups against the map of constant speeds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from quietbus.analysis.jitter.run_up import TURNS
from quietbus.plain import RPM
from quietbus.plots.signals import AXES
from quietbus.plots.style import COLOURS, DASHES, new_figure, scaled, share_legend, style

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from quietbus.analysis.jitter.run_up import RunUp


def run_up_figure(runs: Mapping[str, RunUp], name: str) -> Figure:
    """Amplitude of one order through run-ups, against the map of constant speeds.

    Args:
        runs: by what they are to be called in the legend, of one order.
        name: of the scenario.
    """
    first = next(iter(runs.values()))
    with style():
        figure = new_figure(
            6.0, f"Run-up against the quasi-steady map, order {first.order:g} ({name})"
        )
        panels = figure.subplots(len(AXES), 1, sharex=True)
        factor, unit = scaled(float(np.rad2deg(first.quasi_steady.max())), "deg/s")
        for i, axes in enumerate(panels):
            for k, (label, run) in enumerate(runs.items()):
                look = {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % len(DASHES)]}
                axes.plot(
                    RPM * run.speed, factor * np.rad2deg(run.amplitude[:, i]), **look, label=label
                )
            widest = max(runs.values(), key=lambda run: float(np.ptp(run.speed)))
            axes.plot(
                RPM * widest.speed,
                factor * np.rad2deg(widest.quasi_steady[:, i]),
                color="k",
                linewidth=0.8,
                label="map of constant speeds",
            )
            axes.set_ylabel(f"about {AXES[i]}\n[{unit}]")
        panels[0].set_title(f"from the middle of the first {TURNS:g} turns, over which is averaged")
        panels[-1].set_xlabel("rotor speed [rpm]")
        share_legend(figure, panels[0])
    return figure
