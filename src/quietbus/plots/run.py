"""Pictures of one run."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quietbus.plots.signals import (
    ANGLES,
    AXES,
    degrees,
    euler_angles,
    heading,
    jitter,
    rate_spectrum,
    rotor_frequencies,
)
from quietbus.plots.style import (
    COLOURS,
    DASHES,
    MARKERS,
    draw_line,
    draw_lines,
    explain,
    new_figure,
    scaled,
    share_legend,
    style,
)
from quietbus.results import aliasing, scenario_of

TIME = "time [s]"


def run_figures(run: xr.Dataset) -> dict[str, Figure]:
    """All pictures of a run by name; ``struts`` only where the plate stands on its struts.

    What a run is too short or too coarse to show is an empty picture that says so.
    """
    with style():
        figures = {
            "attitude": attitude(run),
            "rates": rates(run),
            "gimbals": gimbals(run),
            "spectrum": spectrum(run),
            "control": control(run),
        }
        if run.attrs["mount"] != "rigid":
            figures["struts"] = struts(run)
    return figures


def attitude(run: xr.Dataset) -> Figure:
    """Euler angles of the bus and of the target."""
    time = run["time"].to_numpy()
    bus, target = euler_angles(run)
    figure = new_figure(3.4, heading(run, "Attitude of the bus"))
    axes = figure.subplots()
    draw_lines(axes, time, bus, ANGLES)
    for i in range(3):
        label = "target" if i == 0 else None
        draw_line(axes, time, target[:, i], color="k", linestyle=":", linewidth=0.9, label=label)
    axes.set(xlabel=TIME, ylabel="Euler angle, 3-2-1 [deg]")
    share_legend(figure, axes)
    return figure


def rates(run: xr.Dataset) -> Figure:
    """Rates of the bus: the whole run, and the jitter at its end for each axis."""
    figure = new_figure(5.2, heading(run, "Angular rate of the bus"))
    grid = figure.add_gridspec(2, 3)
    whole = figure.add_subplot(grid[0, :])
    draw_lines(whole, run["time"].to_numpy(), degrees(run, "bus_rate"), AXES)
    whole.set(xlabel=TIME, ylabel="rate [deg/s]", title="whole run")
    share_legend(figure, whole)
    try:
        last = jitter(run)
    except ValueError as reason:
        explain(figure.add_subplot(grid[1, :]), f"no jitter to show: {reason}")
        return figure
    factor, unit = scaled(float(last.peak.max()), "deg/s")
    first = None
    for i, axis in enumerate(AXES):
        first = panel = figure.add_subplot(grid[1, i], sharey=first)
        panel.plot(last.time, factor * last.rate[:, i], color=COLOURS[i])
        panel.set(xlabel=f"time after {last.start:.4g} s [ms]", title=f"jitter about {axis}")
        if i == 0:
            panel.set_ylabel(f"rate less slow motion\n[{unit}]")
        else:
            panel.tick_params(labelleft=False)
    return figure


def gimbals(run: xr.Dataset) -> Figure:
    """Gimbal angles and rates."""
    return _two_rows(
        run,
        heading(run, "Gimbals"),
        [
            (degrees(run, "gimbal_angle"), "angle [deg]"),
            (degrees(run, "gimbal_rate"), "rate [deg/s]"),
        ],
        "CMG",
    )


def struts(run: xr.Dataset) -> Figure:
    """Strokes and forces of the struts."""
    figure = _two_rows(
        run,
        heading(run, "Struts of the isolation platform"),
        [
            (1e3 * run["leg_stroke"].to_numpy(), "stroke [mm]"),
            (run["leg_force"].to_numpy(), "force (tension positive) [N]"),
        ],
        "leg",
    )
    if figure.axes[1].collections:
        figure.axes[1].set_title("bands: vibration, peak to peak")
    return figure


def spectrum(run: xr.Dataset) -> Figure:
    """Amplitude spectrum of the bus rate, the rotors' lines marked."""
    figure = new_figure(3.8, heading(run, "Spectrum of the bus rate"))
    axes = figure.subplots()
    try:
        lines, span = rate_spectrum(run)
    except ValueError as reason:
        explain(axes, f"no spectrum: {reason}")
        return figure
    for i, axis in enumerate(AXES):
        axes.plot(
            lines.frequency,
            lines.amplitude[:, i],
            color=COLOURS[i],
            linestyle=DASHES[i],
            linewidth=1.0,
            label=axis,
        )
    axes.set(xlabel="frequency [Hz]", ylabel="amplitude [deg/s]", title=f"last {span:.3g} s")
    finish_spectrum([axes], run)
    share_legend(figure, axes)
    return figure


def control(run: xr.Dataset) -> Figure:
    """Attitude error, torque asked for, and how far the cluster is from singular."""
    time = run["time"].to_numpy()
    figure = new_figure(5.6, heading(run, "Attitude control"))
    error, torque, measure = figure.subplots(3, 1, sharex=True, height_ratios=(3, 3, 2))
    draw_lines(error, time, degrees(run, "attitude_error"), AXES)
    error.set_ylabel("attitude error [deg]")
    draw_lines(torque, time, run["control_torque"].to_numpy(), AXES)
    torque.set_ylabel("torque [N m]")
    draw_line(measure, time, run["singularity_measure"].to_numpy(), color="black")
    measure.set(xlabel=TIME, ylabel="singularity\nmeasure [-]")
    measure.set_ylim(0.0, 1.1 * max(measure.get_ylim()[1], 1e-6))
    share_legend(figure, error)
    return figure


def finish_spectrum(panels: Sequence[Axes], run: xr.Dataset) -> None:
    """Scales of spectra, the rotors' lines and multiples marked; says if they are aliased.

    Six decades are shown: what is smaller is rounding and the solver's tolerance.
    """
    lines = [np.array(line.get_data()) for axes in panels for line in axes.lines]
    low, high = min(x[0] for x, _ in lines), max(x[-1] for x, _ in lines)
    peak = max(float(np.max(y)) for _, y in lines)
    warning = aliasing(scenario_of(run))
    if warning:
        panels[0].set_title(f"aliased: {warning.partition(':')[0]}", color=COLOURS[1])
    for axes in panels:
        axes.set(xscale="log", yscale="log", xlim=(low, high))
        if peak > 0.0:
            axes.set_ylim(1e-6 * peak, 10.0 * peak)
        _mark_rotors(axes, run, (low, high))


def _mark_rotors(axes: Axes, run: xr.Dataset, limits: tuple[float, float]) -> None:
    """Bands at the rotors' frequencies and their multiples, a marker on the peak of each line."""
    slowest, fastest = rotor_frequencies(run)
    lines = list(axes.lines)
    speeds = f"{slowest:.4g}" if np.isclose(slowest, fastest) else f"{slowest:.4g}–{fastest:.4g}"
    for order in range(1, 5):
        start, end = order * slowest, order * fastest
        if not limits[0] < start <= end < limits[1]:
            break
        axes.axvspan(start, end, color="0.7", linewidth=0.8, zorder=0)
        first = order == 1
        axes.annotate(
            f"rotors {speeds} Hz" if first else f"{order}×",
            (start if first else end, 1.0),
            (-3 if first else 2, -2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="right" if first else "left",
            va="top",
            fontsize=8,
            color="0.3",
        )
        for line, marker in zip(lines, MARKERS, strict=False):
            x, y = np.array(line.get_data())
            near = np.flatnonzero((x > 0.98 * start) & (x < 1.02 * end))
            if near.size:
                top = near[np.argmax(y[near])]
                axes.plot(x[top], y[top], marker, color=line.get_color(), markersize=5)


def _two_rows(run: xr.Dataset, title: str, rows: list[tuple[np.ndarray, str]], what: str) -> Figure:
    """Two pictures above each other, a line for each CMG or leg."""
    figure = new_figure(4.8, title)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, (values, label) in zip(panels, rows, strict=True):
        names = [f"{what} {number}" for number in range(values.shape[1])]
        draw_lines(axes, run["time"].to_numpy(), values, names)
        axes.set_ylabel(label)
    panels[-1].set_xlabel(TIME)
    share_legend(figure, panels[0])
    return figure
