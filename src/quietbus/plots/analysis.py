"""Pictures of the linear analysis of a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import Circle

from quietbus.analysis.control.isolator import CROSSING, transmissibility, transmissibility_peak
from quietbus.analysis.control.loop_response import frequency_response, root_locus
from quietbus.plots.shapes import mode_shapes
from quietbus.plots.style import COLOURS, DASHES, MARKERS, explain, new_figure, share_legend, style

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quietbus.studies.linear import Study

AXES = ("x", "y", "z")
LINES: list[dict[str, Any]] = [{"color": COLOURS[i], "linestyle": DASHES[i]} for i in range(3)]
NO_LOOP = "no loop to show: the scenario has no attitude control"
FREQUENCY = "frequency [Hz]"


def analysis_figures(study: Study) -> dict[str, Figure]:
    """All pictures of a study by name; those of a loop that is not there say so."""
    drawn: dict[str, Callable[[Study], Figure]] = {
        "bode": bode,
        "nyquist": nyquist,
        "root-locus": locus,
        "gain-by-height": gain_by_height,
        "transmissibility": transmission,
        "modes": mode_shapes,
        "isolator": isolator,
    }
    with style():
        return {name: draw(study) for name, draw in drawn.items()}


def _figure(study: Study, height: float, what: str) -> Figure:
    return new_figure(height, f"{what} ({study.scenario.name})")


def bode(study: Study) -> Figure:
    """Open loops per axis and with the other axes closed, whole and near the crossover."""
    figure = _figure(study, 5.8, "Open attitude loops")
    loops, analyses, system = study.loops, study.loop_analyses, study.controlled
    if loops is None or analyses is None or system is None:
        explain(figure.subplots(), NO_LOOP)
        return figure
    panels = figure.subplots(2, 2, sharex="col", height_ratios=(1.2, 1))
    omega = np.unique(np.concatenate([frequency_response(loop).omega for loop in loops.values()]))
    hz = omega / (2.0 * np.pi)
    whole = system.axis_loops(omega)
    for i, (axis, loop) in enumerate(loops.items()):
        response, look, found = frequency_response(loop, omega), LINES[i], analyses[axis]
        faint = {"color": look["color"], "linewidth": 2.6, "alpha": 0.35}
        marker = {"color": look["color"], "marker": MARKERS[i], "linestyle": "", "markersize": 5}
        for gain, phase in panels.T:
            gain.plot(hz, response.magnitude_db, label=f"{axis} on its own", **look)
            phase.plot(hz, response.phase_deg, **look)
            gain.plot(hz, _db(whole[:, i]), label=f"{axis} on the whole satellite", **faint)
            phase.plot(hz, _continuous_phase(whole[:, i], response.phase_deg), **faint)
            at, margins = found.gain_margin_frequencies_hz, np.array(found.gain_margins_db)
            gain.plot(at, -margins, zorder=5, **marker)
            if found.phase_margin_deg is not None:
                phase.plot(
                    [found.crossover_hz], [found.phase_margin_deg - 180.0], zorder=5, **marker
                )
    crossovers = [c for found in analyses.values() for c in found.crossovers_hz] or [1.0]
    for gain, phase in panels.T:
        gain.axhline(0.0, color="0.4", linewidth=0.8)
        phase.axhline(-180.0, color="0.4", linewidth=0.8)
        gain.set(xscale="log")
        phase.set(xlabel=FREQUENCY, yticks=range(-1080, 1081, 90))
    panels[0, 0].set(ylabel="gain [dB]", ylim=(-120, 120), xlim=(1e-4 * min(crossovers), hz[-1]))
    panels[1, 0].set(ylabel="phase [°]", ylim=(-560, -60))
    panels[0, 1].set(ylim=(-45, 20), xlim=(0.3 * min(crossovers), 50.0 * max(crossovers)))
    panels[1, 1].set_ylim(-380, -60)
    panels[0, 0].set_title("marks: gain at -180°, phase at the crossover")
    panels[0, 1].set_title("near the crossover")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _db(response: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore"):
        return 20.0 * np.log10(np.abs(response))


def _continuous_phase(response: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Phase [deg] without jumps, starting within half a turn of another line."""
    phase = np.degrees(np.unwrap(np.angle(response)))
    return phase + 360.0 * np.round((near[0] - phase[0]) / 360.0)


def nyquist(study: Study) -> Figure:
    """Nyquist plots: the whole on a compressed radius, and the critical point's neighbourhood."""
    figure = _figure(study, 4.6, "Nyquist plots for rising frequency")
    loops, coupled, system = study.loops, study.coupled, study.controlled
    if loops is None or coupled is None or system is None:
        explain(figure.subplots(), NO_LOOP)
        return figure
    whole, near = figure.subplots(1, 2)
    for i, (axis, loop) in enumerate(loops.items()):
        response = frequency_response(loop)
        L = response.response
        L_whole = system.axis_loops(response.omega)[:, i]
        faint = {"color": LINES[i]["color"], "linewidth": 2.6, "alpha": 0.35}
        for axes, shown in ((whole, _compressed), (near, np.asarray)):
            axes.plot(shown(L).real, shown(L).imag, label=f"{axis} on its own", **LINES[i])
            label = f"{axis} on the whole satellite"
            axes.plot(shown(L_whole).real, shown(L_whole).imag, label=label, **faint)
    for size in (0.1, 1.0, 10.0, 1e3):
        radius = size / (1.0 + size)
        whole.add_patch(Circle((0.0, 0.0), radius, fill=False, color="0.75", linewidth=0.6))
        whole.annotate(f"{size:g}", (0.0, radius), fontsize=7, color="0.4", ha="center")
    whole.add_patch(Circle((0.0, 0.0), 1.0, fill=False, color="0.4", linewidth=0.8))
    whole.plot([-0.5], [0.0], "k+", markersize=9)
    whole.set_title("all of it: radius abs(L)/(1 + abs(L)), rim at infinity")
    whole.set(xlim=(-1.05, 1.05), ylim=(-1.05, 1.05))
    whole.set_axis_off()
    near.add_patch(Circle((0.0, 0.0), 1.0, fill=False, color="0.6", linewidth=0.8))
    near.plot([-1.0], [0.0], "k+", markersize=9)
    near.set_title("near the critical point -1 (grey: unit circle)")
    near.set(xlabel="real part of L", ylabel="imaginary part of L", xlim=(-2, 1), ylim=(-1.5, 1.5))
    for axes in (whole, near):
        axes.set_aspect("equal")
    handles, labels = near.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _compressed(values: np.ndarray) -> np.ndarray:
    finite = np.isfinite(values)  # a pole on the axis has no place in the picture
    return np.where(finite, values, np.nan) / (1.0 + np.abs(np.where(finite, values, 0.0)))


def locus(study: Study) -> Figure:
    """Closed-loop poles over the gain: each axis on its own, and all together."""
    figure = _figure(study, 6.6, "Closed-loop poles over the gain K")
    loops, system = study.loops, study.controlled
    if (
        study.pid is None
        or loops is None
        or system is None
        or study.loop_analyses is None
        or study.coupled is None
    ):
        explain(figure.subplots(), NO_LOOP)
        return figure
    panels = figure.subplots(2, 2).ravel()
    gains = system.gain * np.geomspace(1e-4, 1e3, 700)
    many = np.array([system.poles(gain) for gain in gains])
    for i, (axis, loop) in enumerate(loops.items()):
        branches = root_locus(loop, np.unique(np.append(gains, system.gain))).poles
        ranges = study.loop_analyses[axis].stable_gain_range
        panels[i].set_title(f"{axis} on its own: {_ranges(ranges)}")
        for axes in (panels[i], _inset(panels[i])):
            for branch in branches.T:
                axes.plot(branch.real, branch.imag, color=COLOURS[i], linewidth=1.2)
            _mark(axes, loop.closed_loop_poles, system.gain, ranges)
    ranges = study.coupled.stable_gain_range
    panels[3].set_title(f"whole satellite: {_ranges(ranges)}")
    for axes in (panels[3], _inset(panels[3])):
        axes.plot(many.real.ravel(), many.imag.ravel(), ".", color="0.35", markersize=1.5)
        _mark(axes, system.poles, system.gain, ranges)
    fastest = 1.25 * max(abs(pole.imag) for pole in study.coupled.poles) or 1.0
    slow = 1.6 * max(abs(zero) for zero in study.pid.zeros) if study.pid.zeros else 0.1
    for axes in panels:
        axes.set(xlabel="real part [rad/s]", ylabel="imaginary part [rad/s]")
        axes.set(xlim=(-1.2 * fastest, 0.4 * fastest), ylim=(-0.03 * fastest, fastest))
        (inset,) = axes.child_axes
        inset.set(xlim=(-slow, 0.3 * slow), ylim=(-0.04 * slow, 0.6 * slow))
        for each in (axes, inset):
            each.axvline(0.0, color="0.4", linewidth=0.8)
    handles, labels = panels[3].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5)
    return figure


def _inset(axes: Axes) -> Axes:
    """The neighbourhood of the origin, where the slow poles are."""
    inset = axes.inset_axes((0.13, 0.14, 0.32, 0.3))
    inset.set_title("near the origin", fontsize=7)
    inset.tick_params(labelsize=6.5)
    return inset


def _mark(
    axes: Axes,
    poles: Callable[[float], np.ndarray],
    gain: float,
    ranges: tuple[tuple[float, float | None], ...],
) -> None:
    """The poles at the chosen gain and at the ends of the stable ranges."""
    ends = [end for low_high in ranges for end in low_high if end]
    marks = [(1e-6 * gain, "x", "K near 0", "k"), (gain, "o", f"chosen K = {gain:.4g}", COLOURS[2])]
    marks += [(end, "D", "K at a limit", COLOURS[1]) for end in ends]
    seen: set[str] = set()
    for value, marker, label, colour in marks:
        at = poles(value)
        axes.plot(
            at.real,
            at.imag,
            marker,
            color=colour,
            markersize=5,
            fillstyle="none" if marker == "D" else "full",
            label=None if label in seen else label,
            zorder=5,
        )
        seen.add(label)


def _ranges(ranges: tuple[tuple[float, float | None], ...]) -> str:
    parts = [f"{low:.3g} < K" + (f" < {high:.4g}" if high else "") for low, high in ranges]
    return " or ".join(parts) or "no stable K"


def gain_by_height(study: Study) -> Figure:
    """Largest stable gain against where the platform sits."""
    figure = _figure(study, 4.4, "Where the platform sits decides the largest stable gain")
    axes = figure.subplots()
    if study.pid is None or study.loop_analyses is None:
        explain(axes, NO_LOOP)
        return figure
    here = float(study.satellite.mounts[0].p_BX_B[2])
    reach = 1.5 * max(abs(here), 0.6)
    near = np.geomspace(0.005, 0.1, 8) * reach  # where the limit changes fast
    heights = np.unique(np.concatenate([np.linspace(-reach, reach, 41), near, [here]]))
    limits = study.limits_by_height(heights)
    axes.plot(heights, limits[:, 1], color="k", label="whole satellite, all axes: upper limit of K")
    for i, (axis, loop) in enumerate(study.loop_analyses.items()):
        tops = [high for _, high in loop.stable_gain_range if high]
        for j, high in enumerate(tops):
            label = f"per axis, {axis} (the height does not enter)" if j == 0 else None
            axes.axhline(high, label=label, **LINES[i])
    axes.axhline(study.pid.gain, color="0.5", linewidth=3.0, alpha=0.5, label="chosen K")
    at_here = limits[np.searchsorted(heights, here), 1]
    if np.isfinite(at_here):
        axes.plot([here], [at_here], "o", color=COLOURS[1], zorder=5)
        axes.annotate(f"here: {at_here:.4g}", (here, at_here), (6, 6), textcoords="offset points")
    axes.set(yscale="log", xlim=(-reach, reach))
    axes.set_xlabel("height of the upper plate's origin over the bus mass centre [m]")
    axes.set_ylabel("K [N m s/rad]")
    axes.set_title(
        "A torque on the plate also swings it sideways. This swing's force turns the bus too:\n"
        "against the torque, if the platform is above the bus mass centre"
    )
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def transmission(study: Study) -> Figure:
    """What of forces and torques on the plate reaches the base and turns the bus."""
    figure = _figure(study, 6.4, "What passes the platform, free satellite")
    rotor = study.rotor_frequencies_hz
    hz = np.unique(np.append(np.geomspace(0.1, max(300.0, 3.0 * rotor.max()), 500), rotor))
    passed = study.transmissibility(hz)
    (force, torque), (ratio, table) = figure.subplots(2, 2)
    for i, axis in enumerate(AXES):
        force.plot(hz, np.abs(passed.base[:, i, i]), label=axis, **LINES[i])
        torque.plot(hz, np.abs(passed.base[:, 3 + i, 3 + i]), label=axis, **LINES[i])
    for k, axes in enumerate((force, torque)):
        axes.plot(hz, passed.largest_base[:, k], color="0.6", linewidth=3, alpha=0.5, zorder=1)
        axes.plot([], [], color="0.6", linewidth=3, alpha=0.5, label="any direction")
        axes.set_title(
            f"{('force', 'torque')[k]} on the plate to {('force', 'torque')[k]} on the base"
        )
        axes.legend(fontsize=8)
    for k, name in enumerate(("by a force", "by a torque")):
        look = {"color": COLOURS[3 + k], "linestyle": DASHES[k]}
        ratio.plot(hz, passed.rate_ratio[:, k], label=name, **look)
    ratio.set_title("bus rate, isolated over rigid (any direction)")
    ratio.legend(fontsize=8)
    for axes in (force, torque, ratio):
        axes.set(xscale="log", yscale="log", xlabel=FREQUENCY, ylabel="[-]")
        axes.axhline(1.0, color="0.4", linewidth=0.8)
        for line in rotor:
            axes.axvline(line, color="0.6", linewidth=0.8, linestyle=":")
    at = int(np.searchsorted(hz, rotor[0]))
    _matrix(table, np.abs(passed.base[at]))
    table.set_title(f"6 × 6 at the rotors' {rotor[0]:.4g} Hz")
    return figure


def _matrix(axes: Axes, values: np.ndarray) -> None:
    """The magnitudes of a 6 x 6 matrix, written and shaded."""
    with np.errstate(divide="ignore"):
        shade = np.log10(values)
    axes.imshow(np.clip(shade, -5.0, 0.0), cmap="Blues", vmin=-5.0, vmax=1.0, aspect="auto")
    for (i, j), value in np.ndenumerate(values):
        if value > 1e-12:
            colour = "white" if value > 10**-1.5 else "black"
            text = f"{value:.1e}"
            axes.text(j, i, text, ha="center", va="center", fontsize=6.5, color=colour)
    names = [f"${kind}_{axis}$" for kind in "FT" for axis in AXES]
    axes.set_xticks(range(6), names)
    axes.set_yticks(range(6), names)
    axes.set(xlabel="on the plate", ylabel="on the base, about its centre")
    axes.grid(visible=False)


def isolator(study: Study) -> Figure:
    """One strut with a mass (fig. 1b of Zhang and Xu 2012), and this platform's struts on it."""
    figure = _figure(study, 4.2, "Single-axis isolator: force on the mass to force on the base")
    axes = figure.subplots()
    gamma = np.geomspace(0.1, 20.0, 600)
    for i, xi in enumerate((0.1, 0.5, 1.0)):
        axes.plot(gamma, transmissibility(gamma, xi), label=rf"$\xi$ = {xi:g}", **LINES[i])
        axes.plot(*transmissibility_peak(xi), MARKERS[i], color=COLOURS[i], markersize=4)
    vertical = study.vertical_isolator
    natural = vertical.natural_frequency
    label = rf"this platform along z, $f_n$ = {natural / (2.0 * np.pi):.3g} Hz"
    own = vertical.transmissibility(gamma * natural)
    axes.plot(gamma, own, color="0.5", linewidth=3, alpha=0.6, label=label)
    axes.axvline(CROSSING, color="0.4", linewidth=0.8, linestyle=":")
    axes.annotate(
        "every curve passes 1 at $\\sqrt{2}$:\nonly above does a strut isolate",
        (CROSSING, 1.0),
        (2.2, 2.2),
        arrowprops={"arrowstyle": "-", "color": "0.4"},
    )
    axes.set(xscale="log", yscale="log", xlim=(0.1, 20.0), ylim=(2e-3, 10.0))
    axes.set_xlabel(r"frequency ratio $\gamma = \omega/\omega_n$ [-]")
    axes.set_ylabel(r"transmissibility $\mu_F$ [-]")
    share_legend(figure, axes)
    return figure
