"""Interactive pictures of a run, for a page: which there are, and what each one shows."""

from collections.abc import Iterator

import numpy as np
import plotly.graph_objects as go
import xarray as xr

from quietbus.plain import RPM
from quietbus.plots.signals import ANGLES, AXES
from quietbus.report.harmonic import harmonic_pictures
from quietbus.report.lines import GREY, Drawing, Panel, Picture, decimate, finished, line_look
from quietbus.results import aliasing, has_gimbals, method_of, rate_of, scenario_of
from quietbus.results.envelope import jitter_over_time
from quietbus.results.motion import degrees, euler_angles, jitter, rate_spectrum, rotor_frequencies

BUCKETS = 2000  # stretches that a long line is cut into, each drawn by two points
POINTS = 160_000  # over time on a page, about 3.5 MB
SPECTRUM_BUCKETS = 6000  # more: on a logarithmic axis the lowest stretches are seen one by one
ORDERS = range(1, 5)  # multiples of the rotors' frequencies that are marked in a spectrum


def pictures(run: xr.Dataset) -> tuple[list[Picture], int | None]:
    """All pictures of a run, and the stretches that its lines over time are reduced to, if any.

    What a run is too short or too coarse to show is a reason instead of a figure.
    """
    parts = list(_parts(run))
    lines = sum(part.lines for part in parts if isinstance(part, Drawing))
    buckets = min(BUCKETS, POINTS // (2 * lines))
    shown = [part.picture(buckets) if isinstance(part, Drawing) else part for part in parts]
    return shown, buckets if run.sizes["time"] > 2 * buckets else None


def is_harmonic(run: xr.Dataset) -> bool:
    """Whether a run holds the slow motion and the jitter's amplitudes apart."""
    return method_of(run).jitter_apart


def _parts(run: xr.Dataset) -> Iterator[Drawing | Picture]:
    """The pictures in the order of the page."""
    yield _attitude(run)
    yield _control(run)
    yield _rates(run)
    if is_harmonic(run):
        yield from harmonic_pictures(run)
    else:
        yield _jitter(run)
        yield _last_turns(run)
        yield _spectrum(run)
    if has_gimbals(run):
        yield _gimbals(run)
    if "rotor_torque" in run:
        yield _rotors(run)
    yield _struts(run)
    if "spherical_force" in run:
        yield _joints(run)


def _attitude(run: xr.Dataset) -> Drawing:
    names = [*ANGLES, *(f"target {angle}" for angle in ANGLES)]
    both = np.column_stack(euler_angles(run))
    return Drawing(
        "attitude",
        "Attitude",
        "Euler angles of the bus, sequence 3-2-1, and of its target (thin, dotted).",
        run["time"].to_numpy(),
        [Panel("Euler angle", "deg", both, names, reference=True)],
    )


def _control(run: xr.Dataset) -> Drawing:
    measure = run["singularity_measure"].to_numpy()[:, None]
    caption = (
        "Attitude error and the torque that the controller commands, in the bus frame; how far "
        + (
            "the cluster is from a singular set of gimbal angles, where the measure is zero."
            if has_gimbals(run)
            else "the wheels are from giving no torque about some axis, where the measure is zero."
        )
    )
    if scenario_of(run).control is None:
        caption += " This scenario has no control: no torque is commanded."
    return Drawing(
        "control",
        "Attitude control",
        caption,
        run["time"].to_numpy(),
        [
            Panel("attitude error", "deg", degrees(run, "attitude_error"), AXES),
            Panel("torque", "N m", run["control_torque"].to_numpy(), AXES),
            Panel("singularity", "-", measure, ["singularity measure"], "tozero"),
        ],
    )


def _rates(run: xr.Dataset) -> Drawing:
    panels = [Panel("bus", "deg/s", degrees(run, "bus_rate"), AXES)]
    caption = "Angular velocity of the bus in inertial space, bus frame."
    moving = [site for site in scenario_of(run).sites if site.isolator.mount != "rigid"]
    for site in moving:
        name = {"plate": "platform"}.get(site.name, site.name)
        panels.append(Panel(name, "deg/s", degrees(run, rate_of(site.name)), AXES))
    if moving:
        caption += " Below, of what stands on struts, each along its own axes."
    if is_harmonic(run):
        caption += " The slow motion only: the jitter is in the next pictures."
    return Drawing("rates", "Rates", caption, run["time"].to_numpy(), panels)


def _jitter(run: xr.Dataset) -> Drawing | Picture:
    """Jitter of the bus rate over the whole run."""
    name, title = "jitter", "Jitter over time"
    try:
        time, rate, envelope, span = jitter_over_time(run)
    except ValueError as reason:
        return Picture(name, title, "", f"No jitter to show: {reason}.")
    caption = (
        "Bus rate less its slow motion, a cubic through the second around each instant, which is "
        "why the run's first and last half seconds are missing. Below, its envelope: the largest "
        f"magnitude in the {span:.3g} s around each instant. What is faster than the cubic counts "
        "as jitter, also the platform's own ringing after a step."
    )
    return Drawing(
        name,
        title,
        caption,
        time,
        [
            Panel("jitter", "deg/s", rate, AXES),
            Panel("envelope", "deg/s", envelope, AXES, "log"),
        ],
    )


def _last_turns(run: xr.Dataset) -> Picture:
    """Jitter of the bus rate over the last turns of the rotors."""
    name, title = "turns", "Jitter at the end"
    try:
        last = jitter(run)
    except ValueError as error:
        reason = str(error).removeprefix("not shown: ")
        return Picture(name, title, "", f"No jitter to show: {reason}.")
    figure = go.Figure()
    for i, axis in enumerate(AXES):
        figure.add_scatter(
            x=last.time,
            y=last.rate[:, i],
            mode="lines",
            line=line_look(i),
            name=axis,
            hovertemplate=f"{axis}: %{{y:.4g}} deg/s<br>%{{x:.4g}} ms<extra></extra>",
        )
    figure.update_xaxes(title_text=f"time after {last.start:.6g} s [ms]")
    figure.update_yaxes(title_text="jitter [deg/s]")
    caption = (
        "Bus rate less its slow motion over the last turns of the rotors, a smooth curve through "
        "the samples."
    )
    return Picture(name, title, caption, finished(figure))


def _spectrum(run: xr.Dataset) -> Picture:
    """Amplitude spectrum of the bus rate, the rotors' frequencies and multiples marked."""
    name, title = "spectrum", "Spectrum"
    try:
        lines, span = rate_spectrum(run)
    except ValueError as reason:
        return Picture(name, title, "", f"No spectrum: {reason}.")
    figure = go.Figure()
    for i, axis in enumerate(AXES):
        kept = decimate(lines.amplitude[:, i], SPECTRUM_BUCKETS)
        figure.add_scatter(
            x=lines.frequency[kept],
            y=lines.amplitude[kept, i],
            mode="lines",
            line=line_look(i) | {"width": 1.2},
            name=axis,
            hovertemplate=f"{axis}: %{{y:.4g}} deg/s<br>%{{x:.5g}} Hz<extra></extra>",
        )
    low, high = float(lines.frequency[0]), float(lines.frequency[-1])
    figure.update_xaxes(
        title_text="frequency [Hz]", type="log", range=np.log10([low, high]), dtick="D2"
    )
    figure.update_yaxes(title_text="amplitude [deg/s]", type="log", dtick=1)
    peak = float(lines.amplitude.max())
    if peak > 0.0:  # six decades: what is smaller is rounding and the solver's tolerance
        figure.update_yaxes(range=[np.log10(peak) - 6.0, np.log10(peak) + 1.0])
    _mark_rotors(figure, run, low, high)
    caption = (
        f"Amplitude of each line of the bus rate in the last {span:.3g} s, flat-top window: a sine "
        "of amplitude A reads A. Dotted: the rotors' frequencies and their multiples up to "
        f"{ORDERS[-1]}."
    )
    warning = aliasing(scenario_of(run))
    if warning:
        caption += f" Aliased: {warning.partition(':')[0]}."
    finished(figure, height=400).update_xaxes(exponentformat="none")
    figure.update_layout(margin_t=60)
    return Picture(name, title, caption, figure)


def _mark_rotors(figure: go.Figure, run: xr.Dataset, low: float, high: float) -> None:
    slowest, fastest = rotor_frequencies(run)
    for order in ORDERS:
        for frequency in {order * slowest, order * fastest}:
            if low < frequency < high:
                figure.add_shape(
                    type="line",
                    x0=frequency,
                    x1=frequency,
                    y0=0.0,
                    y1=1.0,
                    yref="paper",
                    layer="below",
                    line={"color": GREY, "width": 1.2, "dash": "dot"},
                )
        if low < order * fastest < high:
            figure.add_annotation(
                x=np.log10(order * fastest),  # unlike a shape's
                y=1.0,
                yref="paper",
                yanchor="bottom",
                yshift=12 * (order % 2),  # in a narrow window they would touch
                text="rotors" if order == 1 else f"{order}×",
                showarrow=False,
                font={"size": 11, "color": GREY},
            )


def _gimbals(run: xr.Dataset) -> Drawing:
    control = scenario_of(run).control
    held = control is None or control.steering.law == "none"
    names = [f"CMG {number}" for number in range(run.sizes["cmg"])]
    return Drawing(
        "gimbals",
        "Gimbals",
        "Angles and rates of the gimbals, relative to the plate."
        + (" This scenario holds them where they are." if held else ""),
        run["time"].to_numpy(),
        [
            Panel("angle", "deg", degrees(run, "gimbal_angle"), names),
            Panel("rate", "deg/s", degrees(run, "gimbal_rate"), names),
        ],
    )


def _rotors(run: xr.Dataset) -> Drawing:
    kind = "CMG" if has_gimbals(run) else "Wheel"
    names = [f"{kind} {number}" for number in range(run.sizes["cmg"])]
    speed = RPM * run["rotor_speed"].to_numpy()
    return Drawing(
        "rotors",
        "Rotors",
        "Speeds of the rotors, and torques of the motors that change them.",
        run["time"].to_numpy(),
        [
            Panel("speed", "rpm", speed, names),
            Panel("motor torque", "N m", run["rotor_torque"].to_numpy(), names),
        ],
    )


def _struts(run: xr.Dataset) -> Drawing | Picture:
    name, title = "struts", "Struts"
    if run.attrs["mount"] == "rigid":
        return Picture(
            name, title, "", "The mount is rigid: it holds the plate, and the struts do not move."
        )
    return Drawing(
        name,
        title,
        "Length of each leg less its nominal value; force of spring and damper, tension positive.",
        run["time"].to_numpy(),
        [
            Panel("stroke", "mm", 1e3 * run["leg_stroke"].to_numpy(), _legs(run)),
            Panel("force", "N", run["leg_force"].to_numpy(), _legs(run)),
        ],
    )


def _joints(run: xr.Dataset) -> Drawing:
    def magnitude(name: str) -> np.ndarray:
        return np.linalg.norm(run[name].transpose("time", "leg", "axis").to_numpy(), axis=2)

    return Drawing(
        "joints",
        "Joints",
        "Magnitudes of the forces in the joints at the ends of each leg.",
        run["time"].to_numpy(),
        [
            Panel("spherical", "N", magnitude("spherical_force"), _legs(run)),
            Panel("universal", "N", magnitude("universal_force"), _legs(run)),
        ],
    )


def _legs(run: xr.Dataset) -> list[str]:
    return [f"leg {number}" for number in range(run.sizes["leg"])]
