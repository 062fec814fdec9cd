"""Pictures of a sweep of the rotors' speed: Campbell diagram, waterfall, amplitude by speed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.ticker import FuncFormatter, NullFormatter

from quietbus.plain import RPM
from quietbus.plots.signals import AXES, LINES
from quietbus.plots.style import COLOURS, DASHES, explain, new_figure, scaled, share_legend, style
from quietbus.results.motion import NOISE

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quietbus.analysis.jitter.sweep import SpeedSweep


HERTZ = 0.5 / np.pi
WIDE = 10.0  # times the slowest mode: a frequency axis longer than this is logarithmic
UNDAMPED = 1e-8  # of critical: a mode damped less has no steady amplitude
ENDLESS = 1e6  # times the usual amplitude
LEAST_SPLIT = 0.01  # [%]
MOUNT_DASHES = ("-", DASHES[3])  # in the order of LINES
DECADES = 7.0  # of amplitude that colours tell apart
NO_JITTER = f"no jitter: the rotors shake the bus by less than {NOISE:g} deg/s at every speed"


def sweep_figures(sweep: SpeedSweep, name: str) -> dict[str, Figure]:
    """All pictures of a sweep by name.

    Args:
        name: of the scenario.
    """
    with style():
        return {
            "campbell": campbell(sweep, name),
            "waterfall": waterfall(sweep, name),
            "speeds": speeds(sweep, name),
        }


def campbell(sweep: SpeedSweep, name: str) -> Figure:
    """Modes of the satellite on its platform over rotor speed, the orders' rays, and crossings."""
    figure = new_figure(6.8, f"Modes over rotor speed{_held(sweep)} ({name})")
    axes, change = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    shown = sweep.factor > 0.0
    rpm = RPM * sweep.speed[shown]
    at_rest, frequency = np.split(_mode_frequencies(sweep), [1])
    at_rest = at_rest[0]
    names = sweep.modes["isolated"].modes(0.0)
    drawn = _elastic(sweep)
    for i, k in enumerate(drawn):
        mode, drawn_at = names[k], np.where(frequency[:, k] > 0.0, frequency[:, k], np.nan)
        look = {
            "color": COLOURS[i % len(COLOURS)],
            "linestyle": DASHES[i // len(COLOURS) % len(DASHES)],
        }
        change.plot(rpm, 100.0 * (drawn_at / at_rest[k] - 1.0), **look)
        axes.plot(
            rpm,
            drawn_at,
            **look,
            label="decaying" if mode is None else f"{mode.name} (damping {mode.damping:.2g})",
        )
    inner = _draw_bearings(axes, sweep, shown)
    excited = sweep.excited("isolated")
    for order, speed in _rays(sweep):
        dash = "-" if excited[sweep.orders.index(order)] else ":"
        axes.plot(rpm, HERTZ * order * speed * sweep.factor[shown], dash, color="0.45", linewidth=1)
    for filled, label in ((True, "critical speed"), (False, "crossing, order not excited")):
        found = [
            c
            for c in (*sweep.critical["isolated"], *sweep.bearing_critical)
            if bool(excited[sweep.orders.index(c.order)]) == filled
        ]
        if found:
            axes.plot(
                [RPM * c.factor * np.max(np.abs(sweep.rotor_speed)) for c in found],
                [c.mode.damped_frequency_hz for c in found],
                "ko",
                fillstyle="full" if filled else "none",
                markersize=5,
                label=label,
            )
    frequency = np.concatenate([frequency[:, drawn], inner], axis=1)
    _scale(axes, sweep, frequency, "rotor speed [rpm]", "damped frequency [Hz]", True)
    _name_rays(axes, sweep)
    change.set(xlabel=axes.get_xlabel(), ylabel="split by the\nmomentum [%]")
    if np.abs(change.get_ylim()).max() < LEAST_SPLIT:  # rounding
        change.set_ylim(-LEAST_SPLIT, LEAST_SPLIT)
    axes.set_xlabel("")
    for panel in (axes, change):
        _mark_own_speed(sweep, panel.axvline)
    legend = axes.get_legend_handles_labels()
    title = (
        "modes, named as they are with the rotors still; "
        "where a ray crosses one without a mark, that order does not drive it"
    )
    figure.legend(*legend, loc="outside lower center", ncols=2, title=title, title_fontsize=8)
    return figure


def _held(sweep: SpeedSweep) -> str:
    """At which angles the gimbals are held, since the modes' split depends on it."""
    degrees = np.rad2deg(sweep.gimbal_angle)
    if degrees.size == 0:
        return ""
    alike = np.ptp(degrees) < 1e-9
    angles = f"{degrees[0]:.4g}" if alike else ", ".join(f"{angle:.4g}" for angle in degrees)
    return f", gimbals held at {angles}°"


def _draw_bearings(axes: Axes, sweep: SpeedSweep, shown: np.ndarray) -> np.ndarray:
    """Modes of the rotors on their bearings; their frequencies (speed, branch) [Hz]."""
    drawn: list[np.ndarray] = []
    for bearing in sweep.bearings:
        frequency = np.array([bearing.vibration.frequencies(f) for f in sweep.factor[shown]])
        for branch in range(frequency.shape[1]):
            axes.plot(
                RPM * sweep.speed[shown],
                HERTZ * frequency[:, branch],
                color=COLOURS[-1],
                linestyle=DASHES[1 + len(drawn) % 3],
                linewidth=1.0,
                label=f"rotor on its bearings, {bearing.whirl(branch)}",
            )
            drawn.append(HERTZ * frequency[:, branch])
    return np.array(drawn).T.reshape(int(shown.sum()), len(drawn))


def waterfall(sweep: SpeedSweep, name: str) -> Figure:
    """Amplitude of every line by frequency and speed, on both mounts, with the modes."""
    figure = new_figure(7.4, f"Bus rate by frequency and rotor speed ({name})")
    sizes = {mount: _finite(sweep, mount) for mount in LINES}
    highest = max(float(np.nanmax(size, initial=0.0)) for size in sizes.values())
    if highest < NOISE:
        explain(figure.subplots(), NO_JITTER)
        return figure
    panels = figure.subplots(3, 2, sharex=True, sharey=True)
    norm = LogNorm(_floor(sweep, sizes, highest), highest)
    shown = sweep.factor > 0.0
    rpm = RPM * sweep.speed[shown]
    modes = _mode_frequencies(sweep)[shown]
    drawn = _elastic(sweep)
    lines = None
    for column, (mount, (title, _)) in enumerate(LINES.items()):
        panels[0, column].set_title(title)
        excited = sweep.excited(mount)
        few = excited.sum() < 3
        for i, axes in enumerate(panels[:, column]):
            if mount == "isolated":
                for k in drawn:
                    shape = np.where(modes[:, k] > 0.0, modes[:, k], np.nan)
                    axes.plot(
                        shape,
                        rpm,
                        color="0.35",
                        linewidth=0.7,
                        label="mode" if k == drawn[0] else None,
                    )
            for order, speed in _rays(sweep):
                o = sweep.orders.index(order)
                if not excited[o]:
                    continue
                rotors = np.isclose(np.abs(sweep.rotor_speed), speed)
                size = np.rad2deg(np.abs(sweep.bus_rate[mount][:, rotors, o, i])).sum(axis=1)
                x = HERTZ * order * speed * sweep.factor[shown]
                lines = _coloured(axes, x, rpm, size[shown], norm, 4.0 if few else 2.0)
            _scale(axes, sweep, modes[:, drawn], "frequency [Hz]" if i == 2 else "", "", False)
            _mark_own_speed(sweep, axes.axhline)
            axes.set_ylabel(f"about {AXES[i]}\nrotor speed [rpm]" if column == 0 else "")
    if lines is not None:
        bar = figure.colorbar(lines, ax=panels, extend="min", aspect=45)
        bar.set_label("sum of the rotors' amplitudes [deg/s]")
        bar.ax.grid(visible=False)
    share_legend(figure, panels[0, 1])
    return figure


def speeds(sweep: SpeedSweep, name: str) -> Figure:
    """Amplitude of every order over rotor speed, on both mounts."""
    figure = new_figure(6.0, f"Bus rate over rotor speed ({name})")
    sizes = {mount: _finite(sweep, mount) for mount in LINES}
    highest = max(float(np.nanmax(size, initial=0.0)) for size in sizes.values())
    if highest < NOISE:
        explain(figure.subplots(), NO_JITTER)
        return figure
    panels = figure.subplots(3, 1, sharex=True, sharey=True)
    factor, unit = scaled(highest, "deg/s")
    shown = sweep.factor > 0.0
    excited = np.flatnonzero(np.any([sweep.excited(mount) for mount in LINES], axis=0))
    for i, axes in enumerate(panels):
        for k, o in enumerate(excited):
            look = look_of_order(k)
            axes.plot([], [], **look, label=f"order {sweep.orders[o]:g}")
            for (mount, _), dashes in zip(LINES.items(), MOUNT_DASHES, strict=True):
                if sweep.excited(mount)[o]:
                    size = factor * sizes[mount][shown, o, i]
                    own = {"linestyle": dashes, "gid": f"order {sweep.orders[o]:g}, {mount}"}
                    axes.plot(RPM * sweep.speed[shown], size, **look | own)
        for (label, _), dashes in zip(LINES.values(), MOUNT_DASHES, strict=True):
            axes.plot([], [], color="0.3", linestyle=dashes, label=label)
        axes.set(xscale="log", yscale="log")
        for c in sweep.critical["isolated"]:
            if sweep.excited("isolated")[sweep.orders.index(c.order)]:
                at = RPM * c.factor * np.max(np.abs(sweep.rotor_speed))
                axes.axvline(at, color="0.7", linewidth=0.8, zorder=0)
        axes.set_ylim(factor * _floor(sweep, sizes, highest), 2.0 * factor * highest)
        axes.set_ylabel(f"about {AXES[i]}\n[{unit}]")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        _mark_own_speed(sweep, axes.axvline)
    least = np.concatenate(
        [factor * np.nanmin(size[shown], axis=(1, 2), initial=np.inf) for size in sizes.values()]
    )
    start = RPM * sweep.speed[shown][0]
    if np.any(least > 0.0):
        panels[0].set_xlim(max(start, 1e-3 * RPM * sweep.speed[-1]), RPM * sweep.speed[-1])
    panels[0].set_title("sum of the rotors' amplitudes; grey: critical speeds on the platform")
    panels[-1].set_xlabel("rotor speed [rpm]")
    share_legend(figure, panels[0])
    return figure


def look_of_order(k: int) -> dict[str, Any]:
    """Colour of an order, and from the eighth on marks, so that none looks like another."""
    turn = k // len(COLOURS)
    marked = {"marker": "ov^sDPX"[(turn - 1) % 7], "markevery": 0.08, "markersize": 3.5}
    return {"color": COLOURS[k % len(COLOURS)], "linewidth": 1.1} | (marked if turn else {})


def _finite(sweep: SpeedSweep, mount: str) -> np.ndarray:
    """Sum of the rotors' amplitudes (speed, order, axis) [deg/s], NaN where they are infinite.

    On a mode that nothing damps, not even the attitude loop, rounding over rounding is computed.
    """
    size = np.rad2deg(sweep.by_order(mount))
    usual = np.median(size, axis=0)
    for critical in sweep.critical[mount]:
        if abs(critical.mode.damping) < UNDAMPED:
            o = sweep.orders.index(critical.order)
            there = np.isclose(sweep.factor, critical.factor, rtol=1e-9, atol=0.0)
            there &= np.any(size[:, o] > ENDLESS * usual[o], axis=1)
            size[there, o] = np.nan
    return size


def _floor(sweep: SpeedSweep, sizes: dict[str, np.ndarray], highest: float) -> float:
    """The least amplitude drawn: of the orders drawn, but not below what colours tell apart."""
    drawn = np.concatenate([sizes[m][:, sweep.excited(m)].ravel() for m in LINES])
    least = float(drawn[drawn > 0.0].min(initial=highest))
    return min(max(least, highest * 10.0**-DECADES), 0.1 * highest)


def _mode_frequencies(sweep: SpeedSweep) -> np.ndarray:
    """Damped frequencies (speed, mode) [Hz] on the platform."""
    modes = sweep.modes["isolated"]
    return HERTZ * np.array([modes.frequencies(factor) for factor in sweep.factor])


def _elastic(sweep: SpeedSweep) -> list[int]:
    """Places of the modes that oscillate with the rotors still.

    Not of a rigid body's, which nutates at speed, far more slowly.
    """
    return np.flatnonzero(sweep.modes["isolated"].frequencies(0.0) > 0.0).tolist()


def _rays(sweep: SpeedSweep) -> list[tuple[float, float]]:
    """Order and rotor speed [rad/s] at factor 1 of every ray."""
    distinct = np.unique(np.round(np.abs(sweep.rotor_speed), 9))
    return [(order, float(speed)) for speed in distinct if speed > 0.0 for order in sweep.orders]


def _coloured(
    axes: Axes, x: np.ndarray, y: np.ndarray, size: np.ndarray, norm: LogNorm, width: float
) -> LineCollection:
    """A line whose colour is the size, not drawn where that is too small for one."""
    points = np.stack([x, y], axis=1)
    middle = 0.5 * (size[1:] + size[:-1])
    lines = LineCollection(
        np.stack([points[:-1], points[1:]], axis=1),  # type: ignore[arg-type]
        cmap="viridis",
        norm=norm,
        linewidths=width,
        capstyle="round",
    )
    lines.set_array(np.ma.masked_less(middle, norm.vmin or 0.0))
    axes.add_collection(lines)
    return lines


def _scale(
    axes: Axes, sweep: SpeedSweep, modes: np.ndarray, x: str, y: str, speed_along_x: bool
) -> None:
    """Limits and labels; logarithmic where the modes are far below the orders."""
    most = RPM * sweep.speed[-1]
    highest = HERTZ * float(sweep.frequency.max())
    oscillating = modes[modes > 0.0]
    slowest = float(oscillating.min(initial=highest))
    limits = {"speed": (0.0, most), "frequency": (0.0, highest)}
    if highest > WIDE * slowest:
        low = 0.3 * slowest
        limits = {"speed": (most * low / highest, most), "frequency": (low, highest)}
        axes.set(xscale="log", yscale="log")
        few = highest < 100.0 * low  # decades
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(FuncFormatter(_between_decades) if few else NullFormatter())
    names = ("speed", "frequency") if speed_along_x else ("frequency", "speed")
    axes.set(xlabel=x, ylabel=y, xlim=limits[names[0]], ylim=limits[names[1]])


def _between_decades(value: float, _: object) -> str:
    """Labels of 2 and 5 alone: there is no room for all digits."""
    return f"{value:g}" if f"{value:e}"[0] in "25" else ""


def _name_rays(axes: Axes, sweep: SpeedSweep) -> None:
    """The order at each ray's end, outside the axes, where no curve is; labels keep their distance.

    Rays that end at the right are named from the top down, those at the top from right to left.
    """
    most, highest = axes.get_xlim()[1], axes.get_ylim()[1]
    fastest = np.max(np.abs(sweep.rotor_speed))
    fraction = axes.transAxes.inverted()
    last = {"right": np.inf, "top": np.inf}
    for order, speed in sorted(_rays(sweep), key=lambda ray: -ray[0] * ray[1]):
        slope = HERTZ * order * speed / (RPM * fastest)  # [Hz/rpm]
        end = min(most, highest / slope)
        x, y = fraction.transform(axes.transData.transform((end, slope * end)))
        side = "right" if end >= most * (1.0 - 1e-9) else "top"
        at = min(y if side == "right" else x, last[side] - (0.035 if side == "right" else 0.06))
        last[side] = at
        axes.annotate(
            f"{order:g}Ω",
            (x, y),
            (1.015, at) if side == "right" else (at, 1.03),
            xycoords="axes fraction",
            textcoords="axes fraction",
            ha="left" if side == "right" else "center",
            va="center",
            fontsize=8,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": "0.6", "linewidth": 0.5, "shrinkA": 0},
        )


def _mark_own_speed(sweep: SpeedSweep, line: Callable[..., object]) -> None:
    own = RPM * float(np.max(np.abs(sweep.rotor_speed)))
    if own <= RPM * sweep.speed[-1] * (1.0 + 1e-9):
        line(own, color="0.2", linewidth=0.8, linestyle=DASHES[3], label="the rotors' own speed")
