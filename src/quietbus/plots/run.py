"""Pictures of one run."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quietbus.plain import RPM
from quietbus.plots.jitter import NO_JITTER, draw_lines_by_order, log_scale
from quietbus.plots.signals import ANGLES, AXES, heading
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
from quietbus.results import aliasing, has_gimbals, scenario_of
from quietbus.results.motion import (
    LIMIT_OF_CHANGE,
    NOISE,
    degrees,
    euler_angles,
    is_harmonic,
    jitter,
    last_lines,
    rate_spectrum,
    rotor_frequencies,
)

TIME = "time [s]"
START = 0.2  # of a run: what settles within it is shown enlarged too
# of a harmonic run's jitter: (what it is called, its line)
COMBINED: dict[str, tuple[str, dict[str, Any]]] = {
    "envelope": ("envelope, phases as given", {"linewidth": 1.8}),
    "worst_case": ("worst case, any phases", {"linewidth": 0.8, "linestyle": DASHES[1]}),
    "rss": ("root of sum of squares", {"linewidth": 0.8, "linestyle": DASHES[3]}),
}


def run_figures(run: xr.Dataset) -> dict[str, Figure]:
    """All pictures of a run by name; ``struts`` only where the plate stands on its struts.

    What a run is too short or too coarse to show is an empty picture that says so.
    """
    with style():
        figures = {
            "attitude": attitude(run),
            "rates": rates_and_envelope(run) if is_harmonic(run) else rates(run),
            **unit_figures(run),
            "spectrum": last_spectrum(run) if is_harmonic(run) else spectrum(run),
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


def rates_and_envelope(run: xr.Dataset) -> Figure:
    """Rates of the bus in a harmonic run: slow motion, jitter over time, its estimated error."""
    figure = new_figure(6.4, heading(run, "Angular rate of the bus"))
    grid = figure.add_gridspec(3, 3, height_ratios=(2.0, 2.6, 1.3))
    time = run["time"].to_numpy()
    whole = figure.add_subplot(grid[0, :])
    draw_lines(whole, time, degrees(run, "bus_rate"), AXES)
    whole.set(ylabel="rate [deg/s]", title="slow motion")
    whole.legend(ncols=3)
    looks = dict(COMBINED)
    values = {name: degrees(run, f"bus_rate_jitter_{name}") for name in looks}
    if "bus_rate_noise_rms" in run:
        looks["noise"] = ("RMS of the rotors' noise", {"linewidth": 0.9, "linestyle": DASHES[2]})
        values["noise"] = degrees(run, "bus_rate_noise_rms")
    largest = max(float(each.max()) for each in values.values())
    if largest < NOISE:
        explain(figure.add_subplot(grid[1:, :]), NO_JITTER)
        return figure
    factor, unit = scaled(largest, "deg/s")
    positive = np.concatenate([each[each > 1e-6 * largest] for each in values.values()])
    first = None
    for i, axis in enumerate(AXES):
        first = panel = figure.add_subplot(grid[1, i], sharey=first)
        for name, (label, look) in looks.items():
            line = {"color": COLOURS[i] if name == "envelope" else "0.25", "label": label} | look
            draw_line(panel, time, factor * values[name][:, i], **line)
        log_scale(panel, 0.5 * factor * float(positive.min()), 2.0 * factor * largest)
        panel.set(xlabel=TIME, title=f"jitter about {axis}")
        if i == 0:
            panel.set_ylabel(f"amplitude [{unit}]")
        else:
            panel.tick_params(labelleft=False)
    _change_error(figure.add_subplot(grid[2, :]), run)
    share_legend(figure, figure.axes[1])
    return figure


def _change_error(axes: Axes, run: xr.Dataset) -> None:
    """Estimated error of a harmonic run's jitter, and what is too much."""
    time, error = run["time"].to_numpy(), 100.0 * run["jitter_change_error"].to_numpy()
    limit, worst = 100.0 * LIMIT_OF_CHANGE, int(np.argmax(error))
    draw_line(axes, time, error, color="black")
    axes.axhline(limit, color=COLOURS[1], linewidth=0.9)
    axes.annotate(
        "above: use method direct",
        (1.0, limit),
        (0, -2),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=8,
        color=COLOURS[1],
    )
    log_scale(axes, 1e-6 * limit, 3.0 * max(limit, error[worst]))
    axes.set(xlabel=TIME, ylabel="error [%]")
    axes.set_title(
        "error of the jitter by the motion's change, estimated: "
        f"at most {error[worst]:.2g} %, at {time[worst]:.4g} s"
    )


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


def unit_figures(run: xr.Dataset) -> dict[str, Figure]:
    """What the units do, by name: ``gimbals`` of CMGs, ``rotors`` where speeds change."""
    figures = {}
    if has_gimbals(run):
        figures["gimbals"] = gimbals(run)
    if "rotor_torque" in run:
        figures["rotors"] = rotors(run)
    return figures


def rotors(run: xr.Dataset) -> Figure:
    """Speeds of the rotors and torques of their motors, with the limits of wheels."""
    figure = _two_rows(
        run,
        heading(run, "Rotors"),
        [
            (RPM * run["rotor_speed"].to_numpy(), "speed [rpm]"),
            (run["rotor_torque"].to_numpy(), "motor torque [N m]"),
        ],
        "CMG" if has_gimbals(run) else "wheel",
    )
    motors = [wheel.motor for _, wheel in scenario_of(run).units.wheels]
    for axes, name, factor in zip(figure.axes, ("speed", "torque"), (RPM, 1.0), strict=True):
        limits = [getattr(motor, f"{name}_limit") for motor in motors]
        for limit in {factor * limit for limit in limits if limit is not None}:
            for side in (-limit, limit):
                # only where it is near: elsewhere it would flatten the lines
                if abs(side) <= 1.5 * np.max(np.abs(axes.get_ylim())):
                    axes.axhline(side, color="0.4", linewidth=0.9, linestyle=":")
    return figure


def struts(run: xr.Dataset) -> Figure:
    """Strokes and forces of the struts."""
    slow = ", slow motion" if is_harmonic(run) else ""
    figure = _two_rows(
        run,
        heading(run, f"Struts of the isolation platform{slow}"),
        [
            (1e3 * run["leg_stroke"].to_numpy(), "stroke [mm]"),
            (run["leg_force"].to_numpy(), "force (tension positive) [N]"),
        ],
        "leg",
    )
    lower = figure.axes[len(figure.axes) // 2]
    if lower.collections:
        lower.set_title("bands: vibration, peak to peak")
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


def last_spectrum(run: xr.Dataset) -> Figure:
    """Lines of the bus rate at the end of a harmonic run, by order and rotor."""
    end = run["time"].to_numpy()[-1]
    figure = new_figure(5.4, heading(run, f"Lines of the bus rate at {end:.4g} s"))
    draw_lines_by_order(figure, {run.attrs["mount"]: last_lines(run)})
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
    """Bands at the rotors' frequencies and those multiples that show, a marker on each peak."""
    slowest, fastest = rotor_frequencies(run)
    lines, floor = list(axes.lines), axes.get_ylim()[0]
    speeds = f"{slowest:.4g}" if np.isclose(slowest, fastest) else f"{slowest:.4g}–{fastest:.4g}"
    reached = limits[0]
    for order in range(1, 5):
        start, end = order * slowest, order * fastest
        if not reached < start <= end < limits[1]:  # bands that overlap tell nothing
            break
        reached = end
        peaks = []
        for line, marker in zip(lines, MARKERS, strict=False):
            x, y = np.array(line.get_data())
            near = np.flatnonzero((x > 0.98 * start) & (x < 1.02 * end))
            top = near[np.argmax(y[near])] if near.size else 0
            if near.size and y[top] > floor:
                peaks.append((x[top], y[top], marker, line.get_color()))
        if order > 1 and not peaks:
            continue
        for x_top, y_top, marker, colour in peaks:
            axes.plot(x_top, y_top, marker, color=colour, markersize=5)
        axes.axvspan(start, end, facecolor="0.94", edgecolor="0.7", linewidth=0.8, zorder=0)
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


def _two_rows(run: xr.Dataset, title: str, rows: list[tuple[np.ndarray, str]], what: str) -> Figure:
    """Two pictures above each other, a line for each CMG or leg; beside them the start, enlarged.

    The enlargement is there where all happens in the first part of a long run.
    """
    time = run["time"].to_numpy()
    start = max(_settled(time, values) for values, _ in rows)
    spans = [len(time)] if start > START * len(time) else [len(time), start]
    figure = new_figure(4.8, title)
    panels = figure.subplots(2, len(spans), sharex="col", squeeze=False)
    for row, (values, label) in zip(panels, rows, strict=True):
        names = [f"{what} {number}" for number in range(values.shape[1])]
        for axes, span in zip(row, spans, strict=True):
            draw_lines(axes, time[:span], values[:span], names)
        row[0].set_ylabel(label)
    for axes in panels[-1]:
        axes.set_xlabel(TIME)
    if len(spans) > 1:
        panels[0, 1].set_title(f"the first {time[start - 1] - time[0]:.2g} s")
    share_legend(figure, panels[0, 0])
    return figure


def _settled(time: np.ndarray, values: np.ndarray) -> int:
    """Samples until lines (n, line) have less than a tenth of their largest swing left."""
    if len(time) < 8:
        return len(time)
    end = values[-len(time) // 4 :].mean(axis=0)
    away = np.abs(values - end)
    moving = np.flatnonzero(np.any(away > 0.1 * np.max(away, axis=0), axis=1))
    last = int(moving[-1]) if moving.size else 0
    return min(len(time), max(2 * last, 8))
