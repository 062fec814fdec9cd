"""The table of pointing requirements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.table import Table

from quietbus.tables.parts import titled

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping


def verification_tables(numbers: Mapping[str, Any]) -> Iterator[Table | str]:
    """What ``quietbus verify`` says, from ``Verification.to_dict``: a table, and what is meant."""
    table = titled(f"{numbers['scenario']}, {numbers['mount']}: pointing, {numbers['method']} run")
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
