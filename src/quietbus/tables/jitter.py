"""Tables of the jitter at one operating point, and of critical speeds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rich.table import Table

from quietbus.results.motion import NOISE
from quietbus.tables.parts import AXES, number, titled

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping


def jitter_tables(numbers: Mapping[str, Any]) -> Iterator[Table]:
    """What ``quietbus jitter`` says, from ``JitterStudy.to_dict``."""
    angles = ", ".join(f"{angle:.4g}" for angle in numbers["gimbal_angle_deg"])
    where = f"gimbals at {angles} deg" if numbers["worst"] else "wheels at the start"
    lines = titled(f"Bus rate at each rotor order, {where}, in deg/s")
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
    together = titled("All rotors and orders together")
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
    parts = titled(f"Budget, {own}: bus rate by rotor and kind of imbalance, in deg/s")
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
    worst = titled("Worst gimbal angles: norm over axes of the sum of all amplitudes, in deg/s")
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
    table = titled(f"Critical speeds on the platform, {held}up to {most:.5g} rpm")
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
            number(critical["amplification"]),
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


def _left(numbers: Mapping[str, Any], axis: int) -> tuple[str, str]:
    """What the isolator leaves, in percent and dB."""
    percent, db = numbers["ratio_percent"][axis], numbers["ratio_db"][axis]
    return ("" if percent is None else f"{percent:.3g} %", "" if db is None else f"{db:.1f}")
