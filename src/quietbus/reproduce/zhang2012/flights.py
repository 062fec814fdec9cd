"""Figures 9 to 12: stabilisation and slew by the direct solver, the harmonic one drawn over."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from quietbus.plots.style import COLOURS, DASHES, draw_line, draw_lines, new_figure, share_legend
from quietbus.reproduce.parts import Findings
from quietbus.reproduce.zhang2012.bench import MOUNTS, Bench, Envelope, jitter_of_flight
from quietbus.reproduce.zhang2012.claims import CLAIMS
from quietbus.scenario import ScenarioError

AXES = ("x", "y", "z")
TITLES = {"rigid": "without the platform", "isolated": "with the platform"}
ASSUMED = (
    "Assumed, since the paper does not state it: rotors at 6000 rpm with 15 N m s, all imbalance "
    "as in its section on disturbances, rotor phases 0, 0.7, 1.4, 2.1 rad, skew 53.13°, platform "
    "0.6 m above the bus mass centre"
)


def stabilisation(bench: Bench) -> Findings:
    """Figure 9."""
    figure, numbers = _rates(bench, "zhang2012", "Bus rate, stabilisation from 1.5° on each axis")
    arcsec = 3600.0 * numbers["residual_isolated"]
    numbers["stability_arcsec"] = arcsec  # as the paper seems to have it: the rate, in one second
    numbers["jitter_angle_arcsec"] = arcsec / (2.0 * np.pi * bench.study.rotor_frequencies_hz[-1])
    numbers |= _imbalance(bench) | {"printed_ratio": 100.0 * printed_ratio()}
    caption = (
        "Figure 9a and b of the paper: left the rates, which all but coincide (the same angle on "
        "each axis), right the jitter about the slow motion, "
        "largest value in each second by the direct solver (marks) and by the harmonic solver "
        f"(lines). At the end {numbers['residual_rigid']:.2g} deg/s without and "
        f"{numbers['residual_isolated']:.2g} deg/s with the platform on the worst axis, "
        f"{numbers['ratio']:.2g} %; the two solvers differ by at most "
        f"{100 * numbers['solver_difference']:.1g} % there. {ASSUMED}."
    )
    return Findings(figure, caption, numbers)


def printed_ratio() -> float:
    """[-] From the paper's own rates."""
    claims = {claim.name: claim for claim in CLAIMS}
    return claims["residual_isolated"].published / claims["residual_rigid"].published


def _imbalance(bench: Bench) -> dict[str, float]:
    """Imbalance of a rotor, and whether the paper's unit can be that of one."""
    scenario = bench.study.scenario
    cluster = bench.study.satellite.clusters[0].units
    static = float((cluster.rotor_mass * cluster.eccentricity)[0])  # [kg m]
    dynamic = float(np.linalg.norm(np.asarray(cluster.I_RRcm_R)[0, 0, 1:]))  # [kg m^2]
    inertia = np.diag(np.asarray(cluster.I_RRcm_R)[0])
    speed = float(cluster.rotor_speed[0])
    refused = {}
    for kind in ("static", "dynamic"):
        try:
            scenario.with_overrides({f"cluster.rotor.{kind}_imbalance": "1 g/cm^2"})
            refused[kind] = 0.0
        except ScenarioError:
            refused[kind] = 1.0
    return {
        "static_imbalance": 1e5 * static,
        "dynamic_imbalance": 1e7 * dynamic,
        "static_unit_refused": refused["static"],
        "dynamic_unit_refused": refused["dynamic"],
        "imbalance_force": static * speed**2,
        "imbalance_torque": dynamic * speed**2,
        "imbalance_offset": 1e6 * float(cluster.eccentricity[0]),  # [µm]
        "imbalance_tilt": 1e6 * dynamic / abs(float(inertia[0] - inertia[1])),  # [µrad]
    }


def slew_angles(bench: Bench) -> Findings:
    """Figure 10."""
    run = bench.flight("zhang2012-slew")["isolated"]
    time, angles = run["time"].to_numpy(), np.degrees(euler(run["bus_attitude"].to_numpy()))
    figure = new_figure(3.4, "Attitude with the platform, slew to (60, 30, -60)°")
    axes = figure.subplots()
    draw_lines(axes, time, angles, ("roll", "pitch", "yaw"))
    for target in (60.0, 30.0, -60.0):
        axes.axhline(target, color="0.6", linewidth=0.8, zorder=0)
    axes.set(xlabel="time [s]", ylabel="attitude angle [deg]")
    share_legend(figure, axes)
    error = np.degrees(np.linalg.norm(run["attitude_error"].to_numpy()[-1]))
    numbers = {f"slew_{name}": float(angles[-1, i]) for i, name in enumerate(("x", "y", "z"))}
    caption = (
        "Figure 10 of the paper: yaw-pitch-roll angles. At the end the error is "
        f"{3600 * error:.2g} arcsec. The paper states no guidance; assumed is a smooth turn about "
        "one axis of 1.5 deg/s at most, so the curves' course is ours, their ends are the paper's."
    )
    return Findings(figure, caption, numbers)


def slew_rates(bench: Bench) -> Findings:
    """Figure 11."""
    title = "Bus rate, slew to (60, 30, -60)°"
    figure, found = _rates(bench, "zhang2012-slew", title)
    caption = (
        "Figure 11a and b of the paper, drawn as figure 9. At the end "
        f"{found['residual_rigid']:.2g} deg/s without and {found['residual_isolated']:.2g} deg/s "
        f"with the platform on the worst axis, {found['ratio']:.2g} %; the two solvers differ by "
        f"at most {100 * found['solver_difference']:.1g} % there. {ASSUMED}; guidance as in figure "
        f"10."
    )
    return Findings(figure, caption, {f"slew_{name}": value for name, value in found.items()})


def slew_gimbals(bench: Bench) -> Findings:
    """Figure 12."""
    run = bench.flight("zhang2012-slew")["isolated"]
    time, angles = run["time"].to_numpy(), np.degrees(run["gimbal_angle"].to_numpy())
    figure = new_figure(3.4, "Gimbal angles with the platform, slew to (60, 30, -60)°")
    axes = figure.subplots()
    draw_lines(axes, time, angles, [f"CMG {j}" for j in range(angles.shape[1])])
    axes.set(xlabel="time [s]", ylabel="gimbal angle [deg]")
    share_legend(figure, axes)
    least = float(run["singularity_measure"].min())
    rate = float(np.max(np.abs(np.gradient(angles, time, axis=0))))
    caption = (
        f"Figure 12 of the paper. Largest gimbal rate {rate:.3g} deg/s; the singularity measure "
        f"sqrt(det(A Aᵀ)) stays above {least:.3g}, so the cluster is never near a singular state."
    )
    return Findings(figure, caption, {"slew_singularity": least, "slew_gimbal_rate": rate})


def _rates(bench: Bench, name: str, title: str) -> tuple[Figure, dict[str, float]]:
    """Rates and jitter of a scenario's flights, without and with the platform."""
    figure = new_figure(5.4, title)
    panels = figure.subplots(2, 2, sharex=True)
    runs = bench.flight(name)
    numbers: dict[str, float] = {}
    differences = []
    for row, mount in zip(panels, MOUNTS, strict=True):
        run, envelope = runs[mount], bench.envelope(name, mount)
        rate = np.degrees(run["bus_rate"].to_numpy())
        for i, axis in enumerate(AXES):  # the widest first: the three nearly coincide
            look = {"color": COLOURS[i], "linestyle": DASHES[i], "linewidth": 3.4 - 1.2 * i}
            draw_line(row[0], run["time"].to_numpy(), rate[:, i], label=axis, **look)
        seconds, peaks = jitter_of_flight(run, envelope)
        _jitter(row[1], seconds, peaks, envelope)
        row[1].set_title("jitter about the slow motion")
        row[0].set(title=TITLES[mount], ylabel="bus rate [deg/s]")
        row[1].set(yscale="log", ylabel="peak in each second [deg/s]", ylim=(1e-7, 3e-3))
        if peaks[0].max() > 2.0 * peaks[1].max():
            row[1].annotate(
                "first second: start-up, not jitter",
                (seconds[0], float(np.degrees(peaks[0].max()))),
                (0.15, 0.12),
                textcoords="axes fraction",
                fontsize=8,
                arrowprops={"arrowstyle": "-", "color": "0.6"},
            )
        residual = np.degrees(bench.residual_rate(name, mount))
        differences.append(np.abs(np.degrees(envelope.peak[-1]) / residual - 1.0))
        for axis, value in zip(AXES, residual, strict=True):
            numbers[f"residual_{mount}_{axis}"] = float(value)
        numbers[f"residual_{mount}"] = float(np.max(residual))
    for axes in panels[1]:
        axes.set_xlabel("time [s]")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    more = panels[0, 1].get_legend_handles_labels()
    figure.legend(handles + more[0], labels + more[1], loc="outside lower center", ncols=5)
    numbers["solver_difference"] = float(np.max(differences))
    numbers["ratio"] = 100.0 * numbers["residual_isolated"] / numbers["residual_rigid"]
    for axis in AXES:
        isolated, rigid = (numbers[f"residual_{m}_{axis}"] for m in ("isolated", "rigid"))
        numbers[f"ratio_{axis}"] = 100.0 * isolated / rigid
    return figure, numbers


def _jitter(axes: Axes, seconds: np.ndarray, peaks: np.ndarray, envelope: Envelope) -> None:
    every = max(1, len(seconds) // 40)
    for i, look in enumerate(DASHES[:3]):
        axes.plot(
            envelope.time,
            np.degrees(envelope.peak[:, i]),
            color=COLOURS[i],
            linestyle=look,
            linewidth=1.0,
        )
        axes.plot(
            seconds[::every], np.degrees(peaks[::every, i]), "o^s"[i], color=COLOURS[i], ms=2.5
        )
    axes.plot([], [], "ok", ms=2.5, label="direct solver")
    axes.plot([], [], "-k", linewidth=1.0, label="harmonic solver")


def euler(q: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw [rad] (n, 3) of the sequence yaw-pitch-roll from quaternions (n, 4)."""
    return Rotation.from_quat(q, scalar_first=True).as_euler("ZYX")[:, ::-1]
