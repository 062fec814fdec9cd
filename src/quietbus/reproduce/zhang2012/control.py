"""Figures 1b and 6 to 8: the single strut, and the loop about x as the paper has it."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import brentq

from quietbus.analysis.control.isolator import transmissibility, transmissibility_peak
from quietbus.analysis.control.loop import Loop, attitude_loop
from quietbus.analysis.control.loop_response import frequency_response, root_locus
from quietbus.analysis.control.margins import LoopAnalysis, analyze_loop
from quietbus.analysis.control.pid import PID
from quietbus.dynamics.linearize import platform_inertia
from quietbus.plots.style import COLOURS, DASHES, new_figure, share_legend
from quietbus.reproduce.parts import Findings
from quietbus.reproduce.zhang2012.bench import Bench

DAMPING_RATIOS = (0.1, 0.5, 1.0)
SATELLITE_INERTIA = 1100.0  # [kg m^2] about x, as printed
ZEROS = (0.079, 5e-4)  # [rad/s] t_p and t_q, as printed
CONTROLLER = PID.from_gain_and_zeros(2500.0, ZEROS)
RIM = 0.93  # radius at which the compressed plot has the curve's infinity, the arc's is 1
CRITICAL: dict[str, Any] = {"color": "black", "marker": "+", "markersize": 9, "linestyle": ""}


def printed_channel(k: float, c: float) -> tuple[list[float], list[float]]:
    """Numerator and denominator of eq. 31 with the coefficients as the paper prints them."""
    low = [0.072 * k * c, 0.036 * k**2]
    return [c, 0.036 * c**2 + k, *low], [70.3, 3.69 * c, 3.69 * k + 0.036 * c**2, *low]


def single_strut(_bench: Bench) -> Findings:
    """Figure 1b."""
    figure = new_figure(3.6, "Single-axis isolator: transmissibility for three damping ratios")
    axes = figure.subplots()
    gamma = np.geomspace(0.1, 20.0, 600)
    crossings = []
    for i, xi in enumerate(DAMPING_RATIOS):
        look: dict[str, Any] = {"color": COLOURS[i], "linestyle": DASHES[i]}
        axes.plot(gamma, transmissibility(gamma, xi), label=rf"$\xi$ = {xi:g}", **look)
        axes.plot(*transmissibility_peak(xi), "o", color=COLOURS[i], markersize=4)
        crossings.append(
            brentq(lambda g, xi=xi: float(transmissibility(g, xi)) - 1.0, 1.05, 5.0, xtol=1e-13)
        )
    axes.axvline(crossings[0], color="0.4", linewidth=0.8, linestyle=":")
    axes.plot(crossings[:1], [1.0], "k+", markersize=9)
    axes.set(xscale="log", yscale="log", xlim=(0.1, 20.0), ylim=(2e-3, 10.0))
    axes.set_xlabel(r"frequency ratio $\gamma = \omega/\omega_n$ [-]")
    axes.set_ylabel(r"transmissibility $\mu_F$ [-]")
    axes.legend()
    peaks = [float(transmissibility_peak(xi)[1]) for xi in DAMPING_RATIOS]
    caption = (
        "Figure 1b of the paper, from eq. 2. Dots are the peaks, "
        + ", ".join(f"{peak:.4f}" for peak in peaks)
        + f". All curves pass 1 at γ = {crossings[0]:.4f}: damping lowers the resonance below and "
        "spoils the roll-off above."
    )
    spread = max(crossings) - min(crossings)
    return Findings(figure, caption, {"crossing": crossings[0], "crossing_spread": spread})


def _x_loop(bench: Bench) -> tuple[Loop, LoopAnalysis]:
    study = bench.study
    if study.loops is None or study.loop_analyses is None:
        raise RuntimeError("zhang2012 has no control")
    return study.loops["x"], study.loop_analyses["x"]


def _printed_loop(bench: Bench) -> Loop:
    legs = bench.study.scenario.isolator.legs
    k, c = (float(np.mean(each)) for each in legs.law.spring_and_damper())
    return attitude_loop(*printed_channel(k, c), SATELLITE_INERTIA, CONTROLLER)


def locus(bench: Bench) -> Findings:
    """Figure 6."""
    loop, found = _x_loop(bench)
    printed = analyze_loop(_printed_loop(bench)).stable_gain_range
    alone = analyze_loop(attitude_loop([1.0], [1.0], SATELLITE_INERTIA, CONTROLLER))
    ((least, _),) = alone.stable_gain_range
    ((low, high),) = found.stable_gain_range
    figure = new_figure(3.9, "Root locus, rotation about x")
    whole, near = figure.subplots(1, 2)
    branches = root_locus(loop)
    for axes in (whole, near):
        axes.plot(branches.poles.real, branches.poles.imag, color=COLOURS[0], linewidth=1.2)
        _roots(axes, loop.poles, "x", "black", "open-loop poles")
        _roots(axes, loop.zeros, "o", COLOURS[2], "open-loop zeros")
        _roots(axes, loop.closed_loop_poles(found.gain), "s", COLOURS[4], f"K = {found.gain:g}")
        for i, end in enumerate((low, high)):
            text = f"K = {end:.4g}"
            _roots(axes, loop.closed_loop_poles(end), "D^"[i], COLOURS[1], text)
        axes.axvline(0.0, color="0.4", linewidth=0.8)
        axes.set(xlabel="real part [rad/s]", ylabel="imaginary part [rad/s]")
    whole.set(xlim=(-60, 20), ylim=(-40, 40), title="isolator's poles and zeros")
    near.set(xlim=(-0.1, 0.03), ylim=(-0.06, 0.06), title="near the origin")
    figure.legend(*whole.get_legend_handles_labels(), loc="outside lower center", ncols=5)
    channel = bench.study.channels.x
    numbers = {
        "gain_low": low,
        "gain_high": float(high or np.inf),
        "gain_low_alone": least,
        "conditional_alone": float(least > 0.0),
        "routh": SATELLITE_INERTIA * ZEROS[0] * ZEROS[1] / sum(ZEROS),
        "printed_gain_low": printed[0][0],
        "printed_gain_high": float(printed[0][1] or np.inf),
        "channel_zeros": float(len(np.roots(channel.numerator))),
        "channel_poles": float(len(np.roots(channel.denominator))),
        **_coefficients(bench),
        **_masses(bench),
    }
    caption = (
        f"Figure 6 of the paper. With the channel derived from the geometry {low:.3f} < K < "
        f"{numbers['gain_high']:.0f}; with the coefficients as printed "
        f"{numbers['printed_gain_low']:.3f} < K < {numbers['printed_gain_high']:.0f}. The upper "
        "limit is set by the first rocking mode, the lower one by the integrator: the loop is "
        "conditionally stable. The paper calls the platform the cause; the lower limit is there "
        f"without it too, {least:.4f} (Routh: I t_p t_q/(t_p + t_q) = {numbers['routh']:.4f})."
    )
    return Findings(figure, caption, numbers)


def _roots(axes: Axes, roots: np.ndarray, marker: str, colour: str, label: str) -> None:
    axes.plot(
        roots.real,
        roots.imag,
        marker,
        color=colour,
        label=label,
        markersize=5,
        fillstyle="none",
        zorder=5,
    )


def _arrow(axes: Axes, path: np.ndarray, at: int, colour: str) -> None:
    """The direction of a complex path at one of its points."""
    ends = [(float(value.real), float(value.imag)) for value in path[[at, at + 1]]]
    look = {"arrowstyle": "-|>", "color": colour, "mutation_scale": 12, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", ends[1], ends[0], arrowprops=look)


def _coefficients(bench: Bench) -> dict[str, float]:
    """Coefficients of eq. 31 and 33 by power of s, with k and c as symbols."""
    x, z = bench.study.channels.x.symbolic, bench.study.channels.z.symbolic
    if x is None or z is None:
        raise RuntimeError("legs differ in c/k: there is no channel in k and c")
    top, bottom, twist = x.terms("numerator"), x.terms("denominator"), z.terms("denominator")
    return {
        "tf_s4": bottom[4, 0, 0],
        "tf_cs3": bottom[3, 1, 0],
        "tf_ks2": bottom[2, 0, 1],
        "tf_c2s2": bottom[2, 2, 0],
        "tf_kcs": bottom[1, 1, 1],
        "tf_k2": bottom[0, 0, 2],
        "tf_numerator_c2s2": top[2, 2, 0],
        "tf_numerator_kcs": top[1, 1, 1],
        "tf_numerator_k2": top[0, 0, 2],
        "tf_z_s2": twist[2, 0, 0],
    }


def _masses(bench: Bench) -> dict[str, float]:
    mass, _, inertia = platform_inertia(
        bench.study.satellite, bench.study.gimbal_angle, bench.study.satellite.mounts[0].body
    )
    return {
        "platform_mass": mass,
        "platform_inertia_x": inertia[0, 0],
        "platform_inertia_y": inertia[1, 1],
        "platform_inertia_z": inertia[2, 2],
        "kp": CONTROLLER.kp,
        "ki": CONTROLLER.ki,
        "kd": CONTROLLER.kd,
    }


def bode(bench: Bench) -> Findings:
    """Figure 7."""
    loop, found = _x_loop(bench)
    shown = frequency_response(loop, 2.0 * np.pi * np.geomspace(1e-5, 50.0, 3000))
    figure = new_figure(4.6, "Open loop about x, K = 2500")
    gain, phase = figure.subplots(2, 1, sharex=True)
    gain.plot(shown.frequency_hz, shown.magnitude_db, color=COLOURS[0])
    phase.plot(shown.frequency_hz, shown.phase_deg, color=COLOURS[0])
    gain.axhline(0.0, color="0.4", linewidth=0.8)
    phase.axhline(-180.0, color="0.4", linewidth=0.8)
    margins = dict(zip(found.gain_margins_db, found.gain_margin_frequencies_hz, strict=True))
    for margin, hz in margins.items():
        gain.plot([hz, hz], [0.0, -margin], "o-", color=COLOURS[1], markersize=4)
        gain.annotate(f"{margin:.2f} dB", (hz, -margin), (6, 4), textcoords="offset points")
    crossover, phase_margin = found.crossover_hz or np.nan, found.phase_margin_deg or np.nan
    phase.plot([crossover] * 2, [-180.0, phase_margin - 180.0], "o-", color=COLOURS[1], ms=4)
    phase.annotate(
        f"{phase_margin:.2f}° at {crossover:.4f} Hz",
        (crossover, phase_margin - 180.0),
        (-8, 8),
        textcoords="offset points",
        ha="right",
    )
    gain.set(xscale="log", ylabel="gain [dB]", xlim=(1e-5, 50.0))
    phase.set(
        ylabel="phase [deg]", xlabel="frequency [Hz]", yticks=range(-270, 0, 90), ylim=(-290, -40)
    )
    above = min(margin for margin in margins if margin > 0.0)
    below = max(margin for margin in margins if margin < 0.0)
    numbers = {
        "gain_margin": above,
        "gain_margin_frequency": margins[above],
        "gain_reduction_margin": below,
        "phase_margin": phase_margin,
        "bandwidth": found.bandwidth_hz or np.nan,
    }
    caption = (
        f"Figure 7 of the paper. The loop passes -180° twice: K may rise by {above:.2f} dB (at "
        f"{margins[above]:.2f} Hz) and fall by {-below:.1f} dB (at {margins[below]:.4f} Hz). The "
        f"phase margin is {phase_margin:.2f}° at the crossover, {crossover:.4f} Hz, which the "
        "paper calls the bandwidth."
    )
    return Findings(figure, caption, numbers)


def nyquist(bench: Bench) -> Findings:
    """Figure 8."""
    loop, found = _x_loop(bench)
    counts = found.nyquist
    if counts is None:
        raise RuntimeError("the Nyquist plot passes through -1")
    L = frequency_response(loop, 2.0 * np.pi * np.geomspace(1e-6, 100.0, 6000)).response
    at_zero = int(np.sum(np.abs(loop.poles) < 1e-9))
    figure = new_figure(4.3, "Nyquist plot about x, K = 2500; arrows: rising frequency")
    whole, near = figure.subplots(1, 2)
    squeezed = RIM * L / (1.0 + np.abs(L))
    # s passes the poles at zero on a small quarter circle, L on a large arc of as many quarters
    arc = np.exp(-0.5j * np.pi * np.linspace(0.0, at_zero, 200))
    whole.plot(squeezed.real, squeezed.imag, color=COLOURS[0], label="L(iω), ω > 0")
    whole.plot(
        arc.real,
        arc.imag,
        color=COLOURS[1],
        linestyle=DASHES[1],
        label=f"arc at infinity around {at_zero} poles at zero",
    )
    whole.plot([-0.5 * RIM], [0.0], label="-1", **CRITICAL)
    for path, at in ((arc, 20), (arc, 150), (squeezed, 1500), (squeezed, 4150)):
        _arrow(whole, path, at, COLOURS[1] if path is arc else COLOURS[0])
    up = int(np.argmax((L.imag[:-1] > 0.0) & (L.imag[1:] <= 0.0) & (L.real[:-1] < -1.0)))
    for label, x, at in (("N1", float(squeezed.real[up]), 42), ("N2", -1.0, -42)):
        whole.annotate(
            f"{label} = {getattr(counts, label):g}",
            (x, 0.0),
            (58, at),
            textcoords="offset points",
            ha="center",
            arrowprops={"arrowstyle": "-", "color": "0.3"},
        )
    whole.set(title="all of it; distance from 0 as abs(L)/(1 + abs(L))", xlim=(-1.15, 1.15))
    whole.set(ylim=(-1.15, 1.15), xticks=[], yticks=[])
    whole.set(xlabel="real part, compressed", ylabel="imaginary part, compressed")
    whole.axhline(0.0, color="0.85", linewidth=0.7, zorder=0)
    near.plot(L.real, L.imag, color=COLOURS[0])
    near.plot([-1.0], [0.0], **CRITICAL)
    _arrow(near, L, int(np.argmin(np.abs(L + 0.6j))), COLOURS[0])
    near.set(title="near the critical point -1", xlim=(-1.6, 0.6), ylim=(-1.2, 1.0))
    near.set(xlabel="real part [-]", ylabel="imaginary part [-]")
    circle = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200))
    for axes, size in ((whole, 0.5 * RIM), (near, 1.0)):
        axes.plot(size * circle.real, size * circle.imag, color="0.7", linewidth=0.7)
        axes.set(aspect="equal")
    share_legend(figure, whole)
    numbers = {f"nyquist_{name}": float(getattr(counts, name)) for name in ("P", "N1", "N2", "N")}
    numbers["nyquist_Z"] = float(counts.Z)
    caption = (
        f"Figure 8 of the paper. Crossings of the real axis left of -1: {counts.N1:g} positive "
        f"(the phase rises) and {counts.N2:g} negative, on the arc at infinity by which L passes "
        f"the {at_zero} poles at zero (dashed; drawn outside the curve, since both lie at the "
        f"rim), so N = {counts.N:g} and Z = {counts.P} - 2 N = {counts.Z:g}; the closed loop has "
        f"{found.unstable_poles} poles in the right half-plane, found by its roots. Grey circle: "
        f"abs(L) = 1."
    )
    return Findings(figure, caption, numbers)
