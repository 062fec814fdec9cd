"""Tables for the terminal: the numbers of runs, of checks and of the linear analysis."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from quietbus.scenario.as_read import as_read

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import numpy as np

    from quietbus.analysis.signals.waterfall import FittedMode
    from quietbus.measured import WaterfallFit
    from quietbus.results import Summary
    from quietbus.scenario import Scenario
    from quietbus.studies.linear import Study
    from quietbus.validate import Check

AXES = ("x", "y", "z")
NOISE = 1e-10  # [deg/s] jitter that is the integrator's; a ratio to it says nothing
Ranges = tuple[tuple[float, float | None], ...]


def _titled(title: str) -> Table:
    return Table(title=title, box=SIMPLE_HEAD, title_justify="left")


def as_read_table(scenario: Scenario) -> Table:
    """The main values of a scenario in usual units."""
    table = Table(box=None, show_header=False, title_justify="left")
    table.title = Text(f"{scenario.name}, as read")
    table.add_column()
    table.add_column(overflow="fold")
    for part, values in as_read(scenario):
        table.add_row(part, Text(values))
    return table


def summary_table(summaries: Mapping[str, Summary]) -> Table:
    """The numbers of one run, or of two side by side with their ratio."""
    both = len(summaries) == 2
    first = next(iter(summaries.values()))
    table = _titled(f"Residual motion {first.residual_note}")
    table.add_column("")
    table.add_column("unit")
    for mount in summaries:
        table.add_column(mount, justify="right")
    if both:
        table.add_column("isolated / rigid", justify="right")

    def row(name: str, unit: str, value: Callable[[Summary], float], ratio: bool = False) -> None:
        values = [value(summary) for summary in summaries.values()]
        cells = ["n/a" if math.isnan(v) else f"{v:.4g}" for v in values]
        if both:
            known = ratio and not math.isnan(sum(values)) and values[1] > NOISE
            cells.append(f"{100 * values[0] / values[1]:.3g} %" if known else "")
        table.add_row(name, unit, *cells)

    rates = [
        ("rate jitter {}, peak", "residual_rate"),
        ("rate jitter {}, RMS", "residual_rate_rms"),
        ("rate jitter {}, any phases", "worst_phases_rate"),
        ("slow rate {}, peak", "slow_rate"),
    ]
    if all(summary.worst_phases_rate is None for summary in summaries.values()):
        del rates[2]
    for name, field in rates:
        for i, axis in enumerate(AXES):
            value = lambda s, i=i, field=field: _degrees(getattr(s, field), i)  # noqa: E731
            row(name.format(axis), "deg/s", value, ratio=field != "slow_rate")
    row("pointing error at the end", "deg", lambda s: math.degrees(s.pointing_error))
    if first.rotor_speeds is None or first.peak_gimbal_rate > 0.0:
        row("peak gimbal rate", "deg/s", lambda s: math.degrees(s.peak_gimbal_rate))
    if first.rotor_speeds is not None:
        row("least rotor speed", "rpm", lambda s: _rpm(s.rotor_speeds, 0))
        row("largest rotor speed", "rpm", lambda s: _rpm(s.rotor_speeds, 1))
        row("peak rotor torque", "N m", lambda s: _known(s.peak_rotor_torque))
    row("largest strut stroke", "mm", lambda s: 1e3 * s.peak_stroke)
    row("largest strut force", "N", lambda s: s.peak_strut_force)
    row("least singularity measure", "-", lambda s: s.minimum_singularity)
    row("peak control torque", "N m", lambda s: s.peak_control_torque)
    if first.minimum_torque_share is not None:
        row("least torque share", "%", lambda s: 100.0 * _known(s.minimum_torque_share))
    return table


def _degrees(vector: Sequence[float] | None, i: int) -> float:
    return math.nan if vector is None else math.degrees(vector[i])


def _rpm(speeds: np.ndarray | None, i: int) -> float:
    return math.nan if speeds is None else speeds[i] * 30.0 / math.pi


def _known(value: float | None) -> float:
    return math.nan if value is None else value


def checks_table(name: str, checks: Sequence[Check]) -> Table:
    """Errors, bounds and verdicts of a validation."""
    table = _titled(f"{name}: quietbus against MuJoCo")
    table.add_column("check")
    table.add_column("error", justify="right")
    table.add_column("bound", justify="right")
    table.add_column("verdict")
    for check in checks:
        verdict = "pass" if check.passed else "FAIL"
        what = f"{check.name}: {check.compares}"
        table.add_row(what, f"{check.error:.1e}", f"{check.bound:.0e}", verdict)
    return table


def analysis_tables(study: Study) -> Iterator[Table | str]:
    """All that ``quietbus analyze`` prints: tables and sentences, in order."""
    yield _channels(study)
    loops, coupled = study.loop_analyses, study.coupled
    if loops and coupled and study.rules:
        yield _loops(study)
        yield from (f"{axis}: {loop.verdict}" for axis, loop in loops.items())
        yield from (f"{axis}: {note}" for axis, loop in loops.items() for note in loop.notes)
        yield _truth(study)
        yield f"All axes together: {coupled.verdict}"
        if coupled.stable:
            yield (
                f"Every axis may at once change by {_number(coupled.disk_gain_margin_db)} dB or "
                f"{coupled.disk_phase_margin_deg:.3g} deg (disk margin {coupled.disk_margin:.3g})."
            )
        yield "\nDesign rule, the isolator's corner about a decade above the control bandwidth:"
        for axis, rule in study.rules.items():
            yield f"{axis}: {'met' if rule.passed else 'NOT MET'}. {rule.words}"
    yield _modes(study)
    yield _transmissibility(study)
    yield from (f"note: {note}" for note in study.notes)


def range_text(ranges: Ranges) -> str:
    """Stable gains in short: ``0.55 - 9122``."""
    parts = [f"{low:.4g} - {'any' if high is None else f'{high:.4g}'}" for low, high in ranges]
    return ", ".join(parts) or "none"


def _table(title: str, *columns: str) -> Table:
    """The first column holds names, the others numbers."""
    table = _titled(title)
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left", overflow="fold")
    return table


def _number(value: float | None) -> str:
    return "-" if value is None else "inf" if math.isinf(value) else f"{value:.4g}"


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.4g}" for value in values) or "-"


def _channels(study: Study) -> Table:
    table = _table(
        f"{study.scenario.name}: torque channels of the platform, base fixed, massless legs",
        "axis",
        "peak\nHz",
        "peak\ngain",
        "-3 dB\nHz",
        "undamped\nHz",
        "damped\nHz",
        "damping\n-",
        "to other\naxes",
    )
    for channel in study.channels:
        table.add_row(
            channel.axis,
            _number(channel.peak_frequency_hz),
            _number(channel.peak_gain),
            _number(channel.minus_3db_frequency_hz),
            _numbers(channel.undamped_frequencies_hz),
            _numbers([pole.damped_frequency_hz for pole in channel.poles]),
            _numbers([pole.damping_ratio for pole in channel.poles]),
            _number(channel.coupling),
        )
    return table


def _loops(study: Study) -> Table:
    assert study.loop_analyses is not None
    gain = next(iter(study.loop_analyses.values())).gain
    table = _table(
        f"Attitude loops, each axis on its own, K = {gain:.4g}", "", *(f"{a}" for a in AXES)
    )
    loops = study.loop_analyses.values()
    table.add_row("stable K", *(range_text(loop.stable_gain_range) for loop in loops))
    table.add_row("gain margins, dB", *(_numbers(loop.gain_margins_db) for loop in loops))
    table.add_row("  at, Hz", *(_numbers(loop.gain_margin_frequencies_hz) for loop in loops))
    table.add_row("phase margin, deg", *(_number(loop.phase_margin_deg) for loop in loops))
    table.add_row("crossover, Hz", *(_number(loop.crossover_hz) for loop in loops))
    table.add_row("bandwidth, Hz", *(_number(loop.bandwidth_hz) for loop in loops))
    table.add_row("delay margin, s", *(_number(loop.delay_margin_s) for loop in loops))
    counts = [loop.nyquist for loop in loops]
    table.add_row(
        "P, N1, N2, N, Z",
        *("-" if n is None else f"{n.P}, {n.N1:g}, {n.N2:g}, {n.N:g}, {n.Z:g}" for n in counts),
    )
    return table


def _truth(study: Study) -> Table:
    table = _table(
        "What the analysis per axis says, and what is so",
        "",
        "stable K",
        "gain margins\ndB",
        "disk\nmargin",
    )
    for row in study.truth or ():
        table.add_row(
            row["case"],
            range_text(row["stable_gain_range"]),
            _numbers(row["gain_margins_db"]),
            _number(row.get("disk_margin")),
        )
    return table


def _modes(study: Study) -> Table:
    table = _table("Modes of the platform", "", "undamped\nHz", "damped\nHz", "damping\n-")
    for base, title in (("fixed_base", "base fixed"), ("free", "free satellite")):
        for mode in study.modes[base]:
            table.add_row(
                f"{title}: {mode.name}",
                _number(mode.frequency_hz),
                _number(mode.damped_frequency_hz),
                f"{mode.damping:.3f}",
            )
    return table


def _transmissibility(study: Study) -> Table:
    frequencies = study.rotor_frequencies_hz
    table = _table(
        "What passes at the rotors' frequencies, largest over all directions",
        "",
        *(f"{frequency:.4g} Hz" for frequency in frequencies),
    )
    passed = study.transmissibility(frequencies)
    for i, cause in enumerate(("force", "torque")):
        base = (f"{100 * value:.3g} %" for value in passed.largest_base[:, i])
        table.add_row(f"{cause} on the plate to {cause} on the base", *base)
    for i, cause in enumerate(("force", "torque")):
        rate = (f"{100 * value:.3g} %" for value in passed.rate_ratio[:, i])
        table.add_row(f"bus rate by a {cause}, isolated over rigid", *rate)
    return table


def verification_tables(numbers: Mapping[str, Any]) -> Iterator[Table | str]:
    """What ``quietbus verify`` says, from ``Verification.to_dict``: a table, and what is meant."""
    table = _titled(f"{numbers['scenario']}, {numbers['mount']}: pointing, {numbers['method']} run")
    for column in ("", "metric", "line of sight", "value", "limit", "margin", "verdict"):
        right = column in ("value", "limit", "margin")
        table.add_column(column, justify="right" if right else "left")
    notes = []
    for i, row in enumerate(numbers["requirements"], 1):
        unit = "" if row["unit"] == "1" else f" {row['unit']}"
        table.add_row(
            str(i),
            row["name"],
            row["line_of_sight"],
            f"{row['value']:.3g}",
            f"{row['limit']:.3g}{unit}",
            f"{row['margin_percent']:.1f} %",
            "met" if row["met"] else "NOT MET" if row["decided"] else "UNDECIDED",
        )
        notes.append(f"{i}: {row['meaning']}; {row['from_s']:g} s to {row['until_s']:g} s")
        if not row["decided"]:
            notes.append(
                f"{i}: the value may be off by {row['uncertainty']:.3g}{unit}: the jitter changes "
                "faster than modes settle, or they still ring from a line that crossed them. Use "
                "--method direct, or another stretch (start, end)"
            )
    yield table
    yield from notes


def jitter_tables(numbers: Mapping[str, Any]) -> Iterator[Table]:
    """What ``quietbus jitter`` says, from ``JitterStudy.to_dict``."""
    angles = ", ".join(f"{angle:.4g}" for angle in numbers["gimbal_angle_deg"])
    where = f"gimbals at {angles} deg" if numbers["worst"] else "wheels at the start"
    lines = _titled(f"Bus rate at each rotor order, {where}, in deg/s")
    for column in ("rotor", "order", "frequency", "axis", "isolated", "rigid", "left", "dB"):
        lines.add_column(column, justify="left" if column == "axis" else "right")
    shaken = [
        line
        for line in numbers["orders"]
        if max(line["rigid"]["bus_rate_amplitude_deg_s"]) > NOISE
        or max(line["isolated"]["bus_rate_amplitude_deg_s"]) > NOISE
    ]
    for line in shaken:
        for i, axis in enumerate(AXES):
            lines.add_row(
                *(
                    (str(line["cmg"]), f"{line['order']:g}", f"{line['frequency_hz']:.5g} Hz")
                    if i == 0
                    else ("", "", "")
                ),
                axis,
                *(f"{line[m]['bus_rate_amplitude_deg_s'][i]:.3e}" for m in ("isolated", "rigid")),
                *_left(line, i),
            )
    if not shaken:
        lines.caption = f"no rotor shakes the bus by more than {NOISE:g} deg/s"
    elif len(shaken) < len(numbers["orders"]):
        lines.caption = f"orders below {NOISE:g} deg/s left out"

    combined = numbers["combined"]
    together = _titled("All rotors and orders together")
    for column in ("", "axis", "unit", "isolated", "rigid", "left", "dB"):
        together.add_column(column, justify="right" if column not in ("", "axis") else "left")
    rows = [
        ("envelope, phases as given", "envelope"),
        ("worst case, any phases", "worst_case"),
        ("root sum of squares", "rss"),
        ("RMS, phases as given", "rms"),
    ]
    if any(max(combined[m]["bus_rate_noise_rms_deg_s"]) for m in ("isolated", "rigid")):
        rows.append(("RMS of noise alone", "noise_rms"))
    for title, key in rows:
        for name, unit in (("bus_rate", "deg_s"), ("bus_attitude", "arcsec")):
            for i, axis in enumerate(AXES):
                values = [combined[m][f"{name}_{key}_{unit}"][i] for m in ("isolated", "rigid")]
                both = _left(combined, i) if (key, name) == ("envelope", "bus_rate") else ("", "")
                together.add_row(
                    title if (name, i) == ("bus_rate", 0) else "",
                    axis,
                    unit.replace("deg_s", "deg/s"),
                    *(f"{value:.3e}" for value in values),
                    *both,
                )
    yield together
    if numbers["sweep"] is not None:
        yield critical_table(numbers["sweep"], "gimbals held, " if numbers["worst"] else "")
    yield lines

    own = numbers["mount"]
    parts = _titled(f"Budget, {own}: bus rate by rotor and kind of imbalance, in deg/s")
    for column in ("rotor", "kind", "order", *AXES):
        parts.add_column(column, justify="left" if column == "kind" else "right")
    for part in numbers["budget"][own]:
        if max(part["bus_rate_amplitude_deg_s"]) > NOISE:
            cells = [f"{value:.3e}" for value in part["bus_rate_amplitude_deg_s"]]
            parts.add_row(str(part["cmg"]), part["kind"], f"{part['order']:g}", *cells)
    parts.caption = f"parts below {NOISE:g} deg/s left out"
    yield parts

    if numbers["worst"]:
        yield _worst_angles(numbers["worst"])


LEAST_Q = 2.0  # [-] quality factor from which a critical speed is one to keep away from


def _worst_angles(found_worst: Mapping[str, Any]) -> Table:
    worst = _titled("Worst gimbal angles: norm over axes of the sum of all amplitudes, in deg/s")
    for column in ("mount", "here", "worst", "at gimbal angles, deg"):
        worst.add_column(column, justify="right")
    for mount, found in found_worst.items():
        worst.add_row(
            mount,
            f"{found['bus_rate_norm_here_deg_s']:.3e}",
            f"{found['bus_rate_norm_deg_s']:.3e}",
            ", ".join(f"{angle:.1f}" for angle in found["gimbal_angle_deg"]),
        )
    return worst


def critical_table(sweep: Mapping[str, Any], held: str) -> Table:
    """Speeds at which an order that shakes the bus meets a mode of platform or rotor.

    Args:
        held: "gimbals held, " if there are any.
    """
    found = sweep["isolated"]["critical_speeds"] + sweep["isolated"]["bearing_critical_speeds"]
    found = sorted(found, key=lambda critical: critical["factor"])
    most = sweep["speed_rpm"][-1]
    table = _titled(f"Critical speeds on the platform, {held}up to {most:.5g} rpm")
    columns = ("speed\nrpm", "order", "frequency\nHz", "damping\n-", "Q\n-", "bus rate\ndeg/s")
    for column in columns:
        table.add_column(column, justify="right")
    table.add_column("mode", overflow="fold")
    excited = [critical for critical in found if critical["excited"]]
    shown = [critical for critical in excited if critical["amplification"] >= LEAST_Q]
    for critical in sorted(shown, key=lambda critical: -critical["amplification"]):
        table.add_row(
            f"{critical['speed_rpm']:.1f}",
            f"{critical['order']:g}",
            f"{critical['frequency_hz']:.3f}",
            f"{critical['damping']:.3f}",
            _number(critical["amplification"]),
            f"{math.hypot(*critical['bus_rate_amplitude_deg_s']):.2e}",
            critical["mode"],
        )
    left_out = len(excited) - len(shown)
    notes = ["bus rate: norm of the sums of the rotors' amplitudes" if shown else "none"]
    if left_out:
        notes.append(
            f"{left_out} of modes damped to a Q below {LEAST_Q:g}, with no peak to speak of"
        )
    if len(excited) < len(found):
        notes.append("crossings of orders that shake nothing")
    table.caption = f"{notes[0]}; left out: {' and '.join(notes[1:])}" if notes[1:] else notes[0]
    return table


def fit_tables(fitted: WaterfallFit) -> Iterator[Table]:
    """Fitted numbers of each component of a measured map, with their standard deviations."""
    for name, each in fitted.components.items():
        unit = "kg m" if name.endswith("force") else "kg m^2"
        table = _titled(f"Orders of the {name.replace('_', ' ')}")
        columns = ("order", "+-", f"coefficient\n{unit}", "+- %", "whirl", "speeds", "explained\n%")
        for column in columns:
            table.add_column(column, justify="left" if column == "whirl" else "right")
        splits = any(mode.split for mode in each.modes)
        for line, speeds, share in zip(
            each.orders, each.line_speed, each.explained.by_order[:-1], strict=True
        ):
            relative = line.coefficient.relative
            table.add_row(
                f"{line.order.value:.4f}" + ("?" if line.doubt else ""),
                f"{line.order.deviation:.1e}",
                f"{line.coefficient.value:.3e}",
                "unknown" if relative is None else f"{100.0 * relative:.2g}",
                line.whirl if splits else "",
                str(len(speeds)),
                f"{100.0 * share:.3g}",
            )
        said = [_mode_text(mode) for mode in each.modes]
        said.append(f"lines: measured over fitted, RMS error {100.0 * each.line_error:.2g} %")
        said.append(f"misfit {each.misfit:.2g} of the spectra's scatter")
        said.append(f"{100.0 * each.explained.total:.3g} % of the power explained")
        table.caption = "; ".join(said)
        yield table


def _mode_text(mode: FittedMode) -> str:
    def near(deviation: float | None) -> str:
        return "+- unknown" if deviation is None else f"+- {deviation:.1g}"

    said = (
        f"mode: {mode.frequency.value:.5g} Hz ({near(mode.frequency.deviation)}), "
        f"damping {mode.damping.value:.4g} ({near(mode.damping.deviation)})"
    )
    if mode.split is None:
        return said
    split = mode.split
    return f"{said}, spin over transverse inertia {split.value:.4g} ({near(split.deviation)})"


def _left(numbers: Mapping[str, Any], axis: int) -> tuple[str, str]:
    """What the isolator leaves, in percent and dB."""
    percent, db = numbers["ratio_percent"][axis], numbers["ratio_db"][axis]
    return ("" if percent is None else f"{percent:.3g} %", "" if db is None else f"{db:.1f}")
