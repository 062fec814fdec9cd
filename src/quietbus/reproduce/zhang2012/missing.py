"""What the paper misses: each with a number and a picture."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from quietbus.analysis.control.channels import Channel
from quietbus.analysis.control.controlled import controlled
from quietbus.analysis.control.coupled import analyze_coupled
from quietbus.analysis.control.rational import peak
from quietbus.dynamics.linearize import linearize
from quietbus.model.legs.kinematics import leg_motion
from quietbus.model.motion import Motion
from quietbus.model.satellite import Satellite
from quietbus.model.variants import without_rotation
from quietbus.plots.style import COLOURS, DASHES, MARKERS, draw_line, new_figure, share_legend
from quietbus.reproduce.parts import Findings
from quietbus.reproduce.zhang2012.bench import Bench
from quietbus.reproduce.zhang2012.control import printed_channel
from quietbus.studies.linear import Study

HEIGHTS = np.union1d(np.linspace(-1.2, 2.0, 33), np.linspace(-0.1, 0.2, 61))  # [m] over the bus


def universal_joint(bench: Bench) -> Findings:
    """The leg's spin by the paper's eq. 12 on a base that rotates."""
    satellite = bench.study.satellite
    run = bench.flight("zhang2012-slew")["isolated"].isel(time=slice(None, None, 50))
    time, rates = run["time"].to_numpy(), run["bus_rate"].to_numpy()
    s, ours, paper, violation, violation_paper = _spins(satellite, rates)
    legs = satellite.hexapods[0].bodies
    axial = np.asarray(legs.upper.axial_inertia + legs.lower.axial_inertia)
    missing = ours - paper  # [rad/s] (time, leg)
    momentum_B = np.einsum("l,tl,tli->ti", axial, missing, s)
    moment = np.gradient(momentum_B, time, axis=0) + np.cross(rates, momentum_B)

    figure = new_figure(4.6, "The paper's universal joint on a turning base (slew)")
    spin, momentum = figure.subplots(2, 1, sharex=True)
    for i in range(missing.shape[1]):
        wide = i < 3  # opposite legs coincide: the first three wide and pale below the others
        look = {
            "color": COLOURS[i],
            "linestyle": "-" if wide else DASHES[1],
            "linewidth": 4.0 if wide else 1.3,
            "alpha": 0.45 if wide else 1.0,
            "label": f"leg {i}",
        }
        draw_line(spin, time, np.degrees(missing[:, i]), **look)
    spin.set_ylabel("leg's spin that\nthe paper misses [deg/s]")
    momentum.plot(time, np.linalg.norm(momentum_B, axis=1), color=COLOURS[0])
    momentum.set(xlabel="time [s]", ylabel="angular momentum\nthat is missing [N m s]")
    share_legend(figure, spin)
    held = np.degrees(np.max(np.abs(missing)))
    norm = np.linalg.norm(momentum_B, axis=1)
    whole = _peak_momentum(bench)
    numbers = {
        "joint_spin_error": float(held),
        "joint_momentum_error": float(norm.max()),
        "joint_momentum_relative": float(norm.max() / whole),
        "joint_moment_error": float(np.linalg.norm(moment, axis=1).max()),
        "joint_violation": float(np.max(np.abs(violation))),
        "joint_violation_paper": float(np.max(np.abs(violation_paper))),
    }
    broken = numbers["joint_violation_paper"] > 1e6 * numbers["joint_violation"]
    numbers["joint_error_shown"] = float(broken)
    text = (
        "Eq. 12 has ω_s = -(ω·h)/(s·h): no turn of the leg about h, seen from inertial space. A "
        "universal joint holds the leg *relative to its base*, (ω_l - ω_b)·h = 0. On the slewing "
        f"satellite the paper's legs turn in their joints about h by up to "
        f"{np.degrees(numbers['joint_violation_paper']):.2g} deg/s, ours by "
        f"{np.degrees(numbers['joint_violation']):.0e} deg/s."
    )
    caption = (
        f"Up to {held:.2g} deg/s of each leg's spin and {norm.max():.1e} N m s of angular momentum "
        f"go missing, {numbers['joint_momentum_relative']:.1e} of the bus's {whole:.3g} N m s "
        f"in the slew; the false moment is up to {numbers['joint_moment_error']:.1e} N m. The legs "
        "are light, so the paper's curves do not show it; a check of conserved momentum does, and "
        "the error grows with the legs' axial inertia."
    )
    return Findings(figure, caption, numbers, text)


def _spins(satellite: Satellite, rates: np.ndarray) -> tuple[np.ndarray, ...]:
    """Legs on a bus and plate that turn as one at rates (time, 3) [rad/s], bus axes.

    Returns:
        Directions s (time, leg, 3); spin ours and by eq. 12 (time, leg) [rad/s]; the violation of
        the joint by both, the leg's turn relative to the base about h (time, leg) [rad/s].
    """
    legs, mount = satellite.hexapods[0].geometry, satellite.mounts[0]

    def turning(w_B: Array):
        bus = Motion(jnp.eye(3), jnp.zeros(3), jnp.zeros(3), w_B)
        return leg_motion(legs, mount.motion(bus), bus)

    motion = jax.jit(jax.vmap(turning))(jnp.asarray(rates))
    s, s_rate, k, ours = (np.asarray(v) for v in (motion.s, motion.s_rate, motion.k, motion.spin))
    h = np.cross(np.cross(k, s), k)
    turn = np.cross(s, s_rate)
    paper = -np.sum(turn * h, axis=2) / np.sum(s * h, axis=2)
    unit = h / np.linalg.norm(h, axis=2, keepdims=True)
    violations = (
        np.sum((turn + spin[:, :, None] * s - rates[:, None]) * unit, axis=2)
        for spin in (ours, paper)
    )
    return s, ours, paper, *violations


def _peak_momentum(bench: Bench) -> float:
    """[N m s] Largest angular momentum of the bus in the slew, the size to compare with."""
    rates = bench.flight("zhang2012-slew")["isolated"]["bus_rate"].to_numpy()
    inertia = np.asarray(bench.study.satellite.bus.I_XXcm_X)
    return float(np.linalg.norm(rates @ inertia, axis=1).max())


def margins_by_height(bench: Bench) -> Findings:
    """Margins per axis and coupled as the platform's offset grows."""
    study = bench.study
    pid, axes_alone = study.pid, study.loop_analyses
    if pid is None or axes_alone is None:
        raise RuntimeError("zhang2012 has no control")
    here = float(study.satellite.mounts[0].p_BX_B[2])
    heights = np.unique(np.append(HEIGHTS, here))
    limits = study.limits_by_height(heights)
    coupled = 20.0 * np.log10(limits[:, 1] / pid.gain)
    figure = new_figure(3.8, "Margin against more gain, K = 2500")
    axes = figure.subplots()
    axes.plot(heights, coupled, color="black", linewidth=1.8, label="whole satellite, all axes")
    numbers = {}
    for i, (axis, found) in enumerate(axes_alone.items()):
        margin = min(m for m in found.gain_margins_db if m > 0.0)
        look: dict[str, Any] = {"color": COLOURS[i], "linestyle": DASHES[i]}
        axes.axhline(margin, label=f"per axis, {axis}", **look)
        numbers[f"margin_{axis}"] = margin
    own = float(coupled[np.searchsorted(heights, here)])
    axes.plot([here], [own], "o", color="black")
    axes.annotate(f"here: {own:.2f} dB", (here, own), (6, 8), textcoords="offset points")
    axes.set_xlabel("height of the upper plate over the bus mass centre [m]")
    axes.set_ylabel("gain margin [dB]")
    share_legend(figure, axes)
    numbers |= {
        "margin_coupled": own,
        "margin_coupled_level": float(np.interp(0.0, heights, coupled)),
        "margin_coupled_high": float(coupled[-1]),
    }
    text = (
        "The paper takes each axis alone, and the torque on the base plate about *its* centre. But "
        "a torque on the plate also pushes it sideways, and that force turns the bus about its "
        "mass centre, with the platform's height as lever (docs/analysis.md)."
    )
    caption = (
        f"Per axis {numbers['margin_x']:.2f}, {numbers['margin_y']:.2f} and "
        f"{numbers['margin_z']:.2f} dB, wherever the platform is; the whole satellite bears "
        f"{numbers['margin_coupled_level']:.1f} dB with the platform level with the mass centre, "
        f"{own:.2f} dB where it is ({here:.3f} m) and {numbers['margin_coupled_high']:.2f} dB at "
        f"{heights[-1]:g} m."
    )
    return Findings(figure, caption, numbers, text)


def corner(bench: Bench) -> Findings:
    """What the paper calls the corner frequency."""
    channels = bench.study.channels
    figure = new_figure(5.6, 'The "corner frequency" of the torque channels')
    panels, zooms = figure.subplots(2, 2, height_ratios=(1.2, 1.0))
    hz = np.geomspace(0.3, 30.0, 800)
    numbers: dict[str, float] = {}
    for axes, zoom, name, printed in zip(panels, zooms, ("x", "z"), (2.46, 4.58), strict=True):
        channel: Channel = getattr(channels, name)
        near = np.linspace(0.93 * printed, 1.14 * printed, 300)
        for each, at in ((axes, hz), (zoom, near)):
            each.plot(at, np.abs(channel.response(2.0 * np.pi * at)), color=COLOURS[0])
            each.plot([channel.peak_frequency_hz], [channel.peak_gain], "o", color=COLOURS[1])
        marks = [("undamped", value, 1) for value in channel.undamped_frequencies_hz]
        marks += [
            ("damped", pole.damped_frequency_hz, 2) for pole in channel.poles if pole.imag > 0.0
        ]
        if channel.minus_3db_frequency_hz is not None:
            marks.append(("-3 dB", channel.minus_3db_frequency_hz, 3))
        for label, value, look in marks:
            for each in (axes, zoom):
                each.axvline(value, color=COLOURS[look], linestyle=DASHES[look], label=label)
        for each in (axes, zoom):
            each.axvline(printed, color="black", linewidth=3, alpha=0.25, label="paper")
        axes.set(xscale="log", yscale="log")
        axes.set_title(f"about {name}: peak {channel.peak_gain:.3f} at the dot")
        zoom.set(xlim=(near[0], near[-1]), xlabel="frequency [Hz]", title="the same near the peak")
    for name, channel in zip("xyz", channels, strict=True):
        numbers[f"corner_{name}"] = channel.peak_frequency_hz
        numbers[f"corner_{name}_gain"] = channel.peak_gain
        numbers[f"corner_{name}_undamped"] = min(channel.undamped_frequencies_hz)
        damped = [pole.damped_frequency_hz for pole in channel.poles if pole.imag > 0.0]
        numbers[f"corner_{name}_damped"] = min(damped)
        if name == "z":
            there = float(np.abs(channel.response(np.array([2.0 * np.pi * 4.58])))[0])
            numbers["corner_z_below"] = 20.0 * float(np.log10(channel.peak_gain / there))
        numbers[f"corner_{name}_3db"] = channel.minus_3db_frequency_hz or np.nan
    legs = bench.study.satellite.hexapods[0]
    stiffness, damping, *_ = legs.tangent
    as_printed = printed_channel(float(stiffness[0]), float(damping[0]))
    numbers["printed_corner"] = peak(*as_printed)[0] / (2.0 * np.pi)
    loops = bench.study.loop_analyses
    numbers["decade"] = numbers["corner_x"] / (loops["x"].bandwidth_hz or np.nan) if loops else 0.0
    for each in (panels[0], zooms[0]):
        each.set_ylabel("torque passed on [-]")
    handles, labels = panels[1].get_legend_handles_labels()
    known = dict(zip(labels, handles, strict=True))
    figure.legend(known.values(), known.keys(), loc="outside lower center", ncols=5)
    text = (
        "A corner frequency is commonly where attenuation begins or where the asymptotes meet. "
        "The paper's 2.46 Hz is neither: it is where the gain is *largest*."
    )
    caption = (
        f"About x the gain peaks at {numbers['corner_x']:.3f} Hz ({numbers['corner_x_gain']:.2f} "
        f"times); the natural frequency is {numbers['corner_x_undamped']:.2f} Hz, and nothing is "
        f"attenuated to -3 dB below {numbers['corner_x_3db']:.2f} Hz. About z the paper's 4.58 Hz "
        f"is none of: peak {numbers['corner_z']:.2f}, damped {numbers['corner_z_damped']:.2f}, "
        f"undamped {numbers['corner_z_undamped']:.2f}, -3 dB {numbers['corner_z_3db']:.2f} Hz. The "
        f"gain there is {numbers['corner_z_below']:.3f} dB below its flat maximum: a read-off."
    )
    return Findings(figure, caption, numbers, text)


def neglected(bench: Bench) -> Findings:
    """Fixed base, leg mass, joint friction and rotor momentum, one at a time."""
    study = bench.study
    rows = study.truth
    if rows is None:
        raise RuntimeError("zhang2012 has no control")
    names = [str(row["case"]) for row in rows]
    limits = [float(row["stable_gain_range"][-1][1]) for row in rows]
    turned, still = (_limit_in_slew(bench, spinning) for spinning in (True, False))
    names += ["gimbals as mid-slew, rotors at a standstill", "gimbals as mid-slew, rotors spinning"]
    limits += [still, turned]
    figure = new_figure(4.6, "Upper limit of K as simplifications are lifted")
    axes = figure.subplots()
    places = np.arange(len(names))[::-1]
    kinds = {  # label: which rows
        "each axis alone, as in the paper": [name.startswith("per axis") for name in names],
        "all axes, with gimbal servo": ["servo" in name for name in names],
        "all axes, without gimbal servo": [
            not name.startswith("per axis") and "servo" not in name for name in names
        ],
    }
    for i, (label, chosen) in enumerate(kinds.items()):
        marked = np.array(chosen)
        axes.plot(
            np.array(limits)[marked], places[marked], MARKERS[i], color=COLOURS[i], label=label
        )
    for place, limit in zip(places, limits, strict=True):
        axes.annotate(
            f"{limit:.0f}", (limit, place), (7, 0), textcoords="offset points", va="center"
        )
    share_legend(figure, axes)
    axes.axvline(2500.0, color="0.3", linewidth=1.0, linestyle=":")
    axes.set_yticks(places, names)
    axes.set(xscale="log", xlim=(1e3, 2e5), xlabel="upper limit of K [N m s/rad] (dotted: chosen)")
    axes.grid(visible=False, axis="y")
    own = dict(zip(names, limits, strict=True))
    base, friction = own["the same, platform where it is"], own["with joint friction"]
    legs, momentum = own["with leg mass"], own["with rotor momentum"]
    fixed, free = (study.modes[kind] for kind in ("fixed_base", "free"))
    numbers = {
        "limit_free_base": base,
        "effect_friction": 100.0 * (friction / base - 1.0),
        "effect_leg_mass": 100.0 * (legs / friction - 1.0),
        "effect_momentum": 100.0 * (momentum / legs - 1.0),
        "effect_momentum_slew": 100.0 * (turned / still - 1.0),
        "lowest_mode_fixed": fixed[0].frequency_hz,
        "lowest_mode_free": free[0].frequency_hz,
        "highest_mode_fixed": fixed[-1].frequency_hz,
        "highest_mode_free": free[-1].frequency_hz,
    }
    text = (
        "The paper's control analysis fixes the base and neglects the legs' mass, the joints' "
        "friction and the rotors' momentum. The fixed base hides most: that the force on it turns "
        "the bus as well as the torque. With the bus free the platform's modes rise from "
        f"{numbers['lowest_mode_fixed']:.2f} ... "
        f"{numbers['highest_mode_fixed']:.2f} Hz to {numbers['lowest_mode_free']:.2f} ... "
        f"{numbers['highest_mode_free']:.2f} Hz."
    )
    caption = (
        f"With base free and all axes closed K < {base:.0f}, not {own[names[0]]:.0f}. On top of "
        f"that friction changes the limit by {numbers['effect_friction']:+.4f} %, leg mass by "
        f"{numbers['effect_leg_mass']:+.2g} %, rotor momentum by "
        f"{numbers['effect_momentum']:+.4f} % at zero gimbal angles, where it cancels, and by "
        f"{numbers['effect_momentum_slew']:+.2g} % at the gimbal angles of the slew's fastest "
        "instant (satellite at rest). The last two are without the gimbal servo: to be compared "
        f"with each other and with {momentum:.0f}, not with the servo's row."
    )
    return Findings(figure, caption, numbers, text)


def _limit_in_slew(bench: Bench, spinning: bool) -> float:
    """Upper limit of K with the gimbals as at the slew's largest rate, satellite at rest."""
    run = bench.flight("zhang2012-slew")["isolated"]
    fastest = int(np.argmax(np.linalg.norm(run["bus_rate"].to_numpy(), axis=1)))
    study = Study(bench.study.scenario, run["gimbal_angle"].to_numpy()[fastest])
    satellite = study.satellite if spinning else without_rotation(study.satellite)
    if study.pid is None:
        raise RuntimeError("zhang2012 has no control")
    found = analyze_coupled(controlled(linearize(satellite, study.point, "ideal"), study.pid))
    return float(found.stable_gain_range[-1][1] or np.inf)
