"""Pictures of the same scenario without the platform and with it."""

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quietbus.plots.jitter import draw_lines_by_order, log_scale
from quietbus.plots.run import TIME, finish_spectrum, struts, unit_figures
from quietbus.plots.signals import ANGLES, AXES, LINES, cut_short
from quietbus.plots.style import (
    draw_line,
    explain,
    new_figure,
    scaled,
    share_legend,
    span_text,
    style,
)
from quietbus.results import scenario_of, summarize
from quietbus.results.motion import (
    NOISE,
    Jitter,
    degrees,
    euler_angles,
    is_harmonic,
    jitter,
    last_lines,
    rate_spectrum,
)


def compare_figures(runs: Mapping[str, xr.Dataset]) -> dict[str, Figure]:
    """All pictures of a comparison by name.

    Args:
        runs: "rigid" and "isolated", as ``quietbus.compare`` gives them, of one method.
    """
    if runs.keys() != LINES.keys():
        raise ValueError(f"expected the runs rigid and isolated, got {', '.join(runs) or 'none'}")
    harmonic = is_harmonic(runs["isolated"])
    if harmonic != is_harmonic(runs["rigid"]):
        raise ValueError("expected runs of one method, got a harmonic one and a direct one")
    with style():
        return {
            "rates": envelope_comparison(runs) if harmonic else rates(runs),
            "residual": residual(runs),
            "spectrum": last_spectra(runs) if harmonic else spectrum(runs),
            "attitude": attitude(runs),
            **unit_figures(runs["isolated"]),
            "struts": struts(runs["isolated"]),
        }


def rates(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Rates of the bus: the manoeuvre, and the jitter at its end without and with the platform."""
    figure = new_figure(5.4, _story(runs))
    panels = figure.subplots(3, 3, width_ratios=(1.25, 1, 1))
    for i, axis in enumerate(AXES):
        for mount in LINES:
            _line(panels[i, 0], runs[mount], degrees(runs[mount], "bus_rate")[:, i], mount)
        panels[i, 0].set_ylabel(f"rate about {axis} [deg/s]")
    share_legend(figure, panels[0, 0])
    found: dict[str, Jitter] = {}
    reasons: dict[str, str] = {}
    for mount in LINES:
        try:
            found[mount] = jitter(runs[mount])
        except ValueError as reason:
            reasons[mount] = f"no jitter to show: {reason}"
    peak = max((float(last.peak.max()) for last in found.values()), default=0.0)
    factor, unit = scaled(peak, "deg/s")
    for column, mount in enumerate(LINES, start=1):
        for i, axes in enumerate(panels[:, column]):
            if mount in reasons:
                explain(axes, reasons[mount] if i == 1 else "", columns=26)
                continue
            last = found[mount]
            axes.plot(last.time, factor * last.rate[:, i], color=LINES[mount][1]["color"])
            axes.set_ylim(-1.45 * factor * peak, 1.45 * factor * peak)
            note = f"± {factor * last.peak[i]:.3g}"
            if mount == "isolated" and "rigid" in found and found["rigid"].peak[i] > 0.0:
                note += f"  ({last.peak[i] / found['rigid'].peak[i]:.1%})"
            axes.text(
                0.98,
                0.97,
                note,
                transform=axes.transAxes,
                ha="right",
                va="top",
                fontweight="bold",
            )
            if column == 1:
                axes.set_ylabel(f"jitter [{unit}]")
            else:
                axes.tick_params(labelleft=False)
    what = "rate less slow motion"
    titles = ("whole run", f"without platform:\n{what}", f"with platform:\n{what}")
    for axes, title in zip(panels[0], titles, strict=True):
        axes.set_title(title)
    for axes in panels[:-1].flat:
        axes.tick_params(labelbottom=False)
    panels[-1, 0].set_xlabel(TIME)
    for axes, mount in zip(panels[-1, 1:], LINES, strict=True):
        if mount in found:
            axes.set_xlabel(f"time after {found[mount].start:.4g} s [ms]")
    return figure


@style()
def envelope_comparison(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Jitter over a manoeuvre without and with the platform, and what the platform leaves of it.

    Args:
        runs: harmonic ones, "rigid" and "isolated".
    """
    envelopes = {mount: degrees(runs[mount], "bus_rate_jitter_envelope") for mount in LINES}
    time, passed = _passed(runs, envelopes)
    figure = new_figure(6.2, _titled(runs, _what_is_left(passed)))
    panels = figure.subplots(3, 3, sharex=True, sharey="row", height_ratios=(1.2, 2.0, 1.2))
    largest = max(float(values.max()) for values in envelopes.values())
    factor, unit = scaled(largest, "deg/s")
    for i, (slow, size, ratio) in enumerate(panels.T):
        for mount in LINES:
            _line(slow, runs[mount], degrees(runs[mount], "bus_rate")[:, i], mount)
            if envelopes[mount][:, i].max() > NOISE:
                _line(size, runs[mount], factor * envelopes[mount][:, i], mount)
        ratio.set_xlabel(TIME)
        slow.set_title(f"about {AXES[i]}")
        if not size.lines:
            size.text(0.5, 0.5, "no jitter", transform=size.transAxes, ha="center")
        if np.isfinite(passed[:, i]).any():
            draw_line(ratio, time, 100.0 * passed[:, i], color="black")
            least, most = 100.0 * np.nanmin(passed[:, i]), 100.0 * np.nanmax(passed[:, i])
            ratio.set_title(f"{span_text(least, most, 3)} %")
    if largest > NOISE:
        every = np.concatenate([values[values > 1e-6 * largest] for values in envelopes.values()])
        log_scale(panels[1, 0], 0.5 * factor * float(every.min()), 2.0 * factor * largest)
    highest = 100.0 * float(np.nanmax(passed, initial=0.0))
    panels[2, 0].set_ylim(0.0, 1.15 * highest or 1.0)
    labels = ("slow motion [deg/s]", f"jitter's envelope [{unit}]", "with / without [%]")
    for axes, label in zip(panels[:, 0], labels, strict=True):
        axes.set_ylabel(label)
    figure.align_ylabels(panels[:, 0])
    share_legend(figure, panels[0, 0])
    return figure


def _passed(
    runs: Mapping[str, xr.Dataset], envelopes: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) [s] of both runs, and the share (n, axis) of the jitter that is left; NaN of none.

    The envelope without the platform is interpolated where the runs have other instants.
    """
    times = {mount: runs[mount]["time"].to_numpy() for mount in LINES}
    both = times["isolated"] <= times["rigid"][-1]
    time = times["isolated"][both]
    without = np.column_stack(
        [np.interp(time, times["rigid"], envelopes["rigid"][:, i]) for i in range(3)]
    )
    passed = envelopes["isolated"][both] / np.where(without > NOISE, without, np.nan)
    return time, passed


def _what_is_left(passed: np.ndarray) -> str:
    """What the platform does over the whole manoeuvre, for a title."""
    if not np.isfinite(passed).any():
        return "Angular rate of the bus"
    return f"The platform leaves at most {100.0 * np.nanmax(passed):.2g} % of the jitter"


def residual(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Peak jitter for each axis, and what share of it the platform lets through."""
    figure = new_figure(3.6, _titled(runs, "Residual jitter of the bus rate"))
    axes = figure.subplots()
    peaks = {}
    for mount in LINES:
        summary = summarize(runs[mount])
        if summary.residual_rate is None:
            explain(axes, f"no residual to show: {summary.residual_note}")
            return figure
        peaks[mount] = np.rad2deg(summary.residual_rate)
    values = np.array(list(peaks.values()))
    if not np.all(values > 0.0):
        explain(axes, "no residual to compare: an axis has no jitter at all")
        return figure
    factor, unit = scaled(float(values.max()), "deg/s")
    for mount, offset, hatch in (("rigid", -0.2, ""), ("isolated", 0.2, "///")):
        label, line = LINES[mount]
        axes.bar(
            np.arange(3) + offset,
            factor * peaks[mount],
            0.36,
            color=line["color"],
            edgecolor="white",
            hatch=hatch,
            label=label,
        )
        for i, value in enumerate(peaks[mount]):
            text = f"{factor * value:.3g}"
            if mount == "isolated":
                text += f"\n({value / peaks['rigid'][i]:.1%})"
            axes.annotate(
                text,
                (i + offset, factor * value),
                (0, 2),
                textcoords="offset points",
                ha="center",
                fontsize=8,
            )
    axes.set(yscale="log", ylim=(0.2 * factor * values.min(), 3.0 * factor * values.max()))
    axes.set_title("in brackets: the share that the platform lets through")
    axes.grid(visible=False, axis="x")
    axes.set_xlim(-0.6, 2.6)
    axes.set_xticks(range(3), [f"about {axis}" for axis in AXES])
    axes.set_ylabel(f"peak rate less slow motion\n[{unit}]")
    share_legend(figure, axes)
    return figure


def spectrum(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Amplitude spectra of the bus rate for each axis."""
    figure = new_figure(5.4, _titled(runs, "Spectrum of the bus rate"))
    found, reasons = {}, []
    for mount, (label, _) in LINES.items():
        try:
            found[mount] = rate_spectrum(runs[mount])
        except ValueError as reason:
            reasons.append(f"no spectrum {label}: {reason}")
    if not found:
        explain(figure.subplots(), reasons[0])
        return figure
    panels = figure.subplots(3, 1, sharex=True, sharey=True)
    panels[0].set_title("\n".join(reasons))
    for i, axes in enumerate(panels):
        for mount, (lines, span) in found.items():
            label, line = LINES[mount]
            label = f"{label}, last {span:.3g} s"
            axes.plot(lines.frequency, lines.amplitude[:, i], linewidth=1.0, label=label, **line)
        axes.set_ylabel(f"about {AXES[i]} [deg/s]")
    panels[-1].set_xlabel("frequency [Hz]")
    finish_spectrum(panels, runs["rigid"])
    share_legend(figure, panels[0])
    return figure


def last_spectra(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Lines of the bus rate at the ends of harmonic runs, by order and rotor."""
    figure = new_figure(5.6, _titled(runs, "Lines of the bus rate at the end"))
    draw_lines_by_order(figure, {mount: last_lines(runs[mount]) for mount in LINES})
    return figure


def attitude(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Euler angles of the bus on both mounts, and of the target."""
    figure = new_figure(5.2, _titled(runs, "Attitude of the bus"))
    panels = figure.subplots(3, 1, sharex=True)
    for mount in LINES:
        bus, target = euler_angles(runs[mount])
        time = runs[mount]["time"].to_numpy()
        for i, axes in enumerate(panels):
            _line(axes, runs[mount], bus[:, i], mount)
            if mount == "isolated":
                look = {"color": "k", "linestyle": ":", "linewidth": 0.9, "label": "target"}
                draw_line(axes, time, target[:, i], **look)
    for name, axes in zip(ANGLES, panels, strict=True):
        axes.set_ylabel(f"{name} [deg]")
    panels[-1].set_xlabel(TIME)
    share_legend(figure, panels[0])
    return figure


def _line(axes: Axes, run: xr.Dataset, values: np.ndarray, mount: str) -> None:
    """A run's line: the one without the platform wide, so that both are seen where they agree."""
    label, line = LINES[mount]
    width, alpha = (3.0, 0.6) if mount == "rigid" else (1.3, 1.0)
    draw_line(
        axes,
        run["time"].to_numpy(),
        values,
        color=line["color"],
        linewidth=width,
        alpha=alpha,
        label=label,
    )


def _titled(runs: Mapping[str, xr.Dataset], what: str) -> str:
    cut = "".join(f"; {mount}{cut_short(runs[mount])}" for mount in LINES if cut_short(runs[mount]))
    return f"{what} ({scenario_of(runs['isolated']).name}{cut})"


def _story(runs: Mapping[str, xr.Dataset]) -> str:
    """What the platform does for the satellite, in one line."""
    left = [summarize(runs[mount]).residual_rate for mount in ("isolated", "rigid")]
    title = _titled(runs, "Angular rate of the bus")
    if any(cut_short(run) for run in runs.values()):
        return title
    if left[0] is None or left[1] is None or not np.all(left[0] * left[1] > 0.0):
        return title
    least, most = np.sort(left[1] / left[0])[[0, -1]]
    if least < 1.0:
        return f"{title}: the platform leaves up to {1.0 / least:.2g} times the jitter"
    return f"With the isolation platform the bus jitters {span_text(least, most, 2)} times less"
