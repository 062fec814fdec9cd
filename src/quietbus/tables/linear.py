"""Tables and sentences of the linear analysis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from quietbus.tables.parts import AXES, number, numbers_table, numbers_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from quietbus.studies.linear import Study


Ranges = tuple[tuple[float, float | None], ...]


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
                f"Every axis may at once change by {number(coupled.disk_gain_margin_db)} dB or "
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


def _channels(study: Study) -> Table:
    table = numbers_table(
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
            number(channel.peak_frequency_hz),
            number(channel.peak_gain),
            number(channel.minus_3db_frequency_hz),
            numbers_text(channel.undamped_frequencies_hz),
            numbers_text([pole.damped_frequency_hz for pole in channel.poles]),
            numbers_text([pole.damping_ratio for pole in channel.poles]),
            number(channel.coupling),
        )
    return table


def _loops(study: Study) -> Table:
    assert study.loop_analyses is not None
    gain = next(iter(study.loop_analyses.values())).gain
    table = numbers_table(
        f"Attitude loops, each axis on its own, K = {gain:.4g}", "", *(f"{a}" for a in AXES)
    )
    loops = study.loop_analyses.values()
    table.add_row("stable K", *(range_text(loop.stable_gain_range) for loop in loops))
    table.add_row("gain margins, dB", *(numbers_text(loop.gain_margins_db) for loop in loops))
    table.add_row("  at, Hz", *(numbers_text(loop.gain_margin_frequencies_hz) for loop in loops))
    table.add_row("phase margin, deg", *(number(loop.phase_margin_deg) for loop in loops))
    table.add_row("crossover, Hz", *(number(loop.crossover_hz) for loop in loops))
    table.add_row("bandwidth, Hz", *(number(loop.bandwidth_hz) for loop in loops))
    table.add_row("delay margin, s", *(number(loop.delay_margin_s) for loop in loops))
    counts = [loop.nyquist for loop in loops]
    table.add_row(
        "P, N1, N2, N, Z",
        *("-" if n is None else f"{n.P}, {n.N1:g}, {n.N2:g}, {n.N:g}, {n.Z:g}" for n in counts),
    )
    return table


def _truth(study: Study) -> Table:
    table = numbers_table(
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
            numbers_text(row["gain_margins_db"]),
            number(row.get("disk_margin")),
        )
    return table


def _modes(study: Study) -> Table:
    table = numbers_table("Modes of the platform", "", "undamped\nHz", "damped\nHz", "damping\n-")
    for base, title in (("fixed_base", "base fixed"), ("free", "free satellite")):
        for mode in study.modes[base]:
            table.add_row(
                f"{title}: {mode.name}",
                number(mode.frequency_hz),
                number(mode.damped_frequency_hz),
                f"{mode.damping:.3f}",
            )
    return table


def _transmissibility(study: Study) -> Table:
    frequencies = study.rotor_frequencies_hz
    table = numbers_table(
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
