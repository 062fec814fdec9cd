"""Wheel files of S2E, the simulator of the University of Tokyo's ISSL.

Its tables have two columns without a header: order, and amplitude over the rotor speed squared in
rad/s (its description says Hz, its source multiplies by rad/s). Its ini file names them.
"""

from __future__ import annotations

import configparser
import os
from collections.abc import Sequence
from pathlib import Path

from quietbus.scenario.units import Quantity, shown, whole_number
from quietbus.scenario.wheel_files.lines import Line, Problems, read_cells, read_lines
from quietbus.scenario.wheel_files.table import COEFFICIENT, KINDS, ORDER, Row, WheelTable, merged

# Present names of the keys, then those before they were renamed.
_FILES = {
    "radial_force": (
        "radial_force_harmonics_coefficient_file",
        "radial_force_harmonics_coef_path",
    ),
    "radial_torque": (
        "radial_torque_harmonics_coefficient_file",
        "radial_torque_harmonics_coef_path",
    ),
}
_RESONANCE = ("structural_resonance_frequency_Hz", "structural_resonance_freq")
_ON = ("jitter_calculation", "calculation")
_NO_INI = "not an ini file: expected [section], then key = value"
WHIRL_NOTE = (
    "S2E turns its lines against the rotor (sine along x, cosine along y of a wheel that spins "
    "about z); here they turn with it, as an imbalance does; whirl: backward on an order gives "
    "S2E's sense"
)


def read_table(
    file: Path, lines: Sequence[Line], kind: str | None, count: int | None = None
) -> tuple[list[Row], tuple[str, ...]]:
    """Rows of a table, the first ``count`` of them, and notes."""
    problems = Problems(file)
    kind = kind or _kind_of(file, problems)
    expects, rows = COEFFICIENT[kind], []
    plain = Quantity(f"{expects.name} in {expects.unit}, a plain number,", "", least=0.0)
    cells = read_cells(file, lines)
    for line, row in cells.rows:
        if len(row) != 2:
            problems.add(f"expected two cells, order and coefficient, got {len(row)}", line=line)
            continue
        order = problems.read(ORDER, row[0], "column 1", line)
        value = problems.read(plain, row[1], "column 2", line)
        rows.append(Row(file, line, order, kind, value))
    notes = list(cells.notes)
    if count is not None and len(rows) < count:
        problems.add(f"expected {count} rows, as harmonics_degree says, got {len(rows)}")
    elif count is not None and len(rows) > count:
        notes.append(
            f"{file.name}: the first {count} of {len(rows)} rows are taken, as harmonics_degree "
            "says; S2E itself computes all of them"
        )
    if not cells.rows:
        problems.add("expected rows of order and coefficient, got none")
    problems.raise_any()
    return rows[:count], tuple(notes)


def _kind_of(file: Path, problems: Problems) -> str:
    named = [kind for kind in KINDS if kind in file.stem.lower()]
    if len(named) != 1:
        problems.add(
            "a table without a header: expected the file's name to say its kind, or --kind "
            f"(kind=...) to be one of {', '.join(KINDS)}; a header has a column 'order'"
        )
        problems.raise_any()
    return named[0]


def read_ini(file: Path, lines: Sequence[Line], wheel: str | None) -> WheelTable:
    """The tables that a file of one wheel or of several names."""
    problems = Problems(file)
    parser = configparser.ConfigParser(
        comment_prefixes=("//", "#", ";"), inline_comment_prefixes=("//",), interpolation=None
    )
    numbered = dict(lines)
    try:
        parser.read_string("\n".join(numbered.get(i, "") for i in range(1, max(numbered) + 1)))
    except (configparser.DuplicateSectionError, configparser.DuplicateOptionError) as error:
        name = getattr(error, "option", error.section)
        problems.add(f"{shown(name)} stands in the file twice", line=error.lineno)
    except configparser.MissingSectionHeaderError as error:
        problems.add(_NO_INI, line=error.lineno)
    except configparser.ParsingError as error:
        problems.add(_NO_INI, line=error.errors[0][0])
    problems.raise_any()
    keys = [key for names in _FILES.values() for key in names]
    wheels = [name for name in parser.sections() if any(key in parser[name] for key in keys)]
    if not wheels:
        problems.add(f"expected a section with {keys[0]}, got none")
    elif wheel is not None and wheel not in wheels:
        problems.add(f"expected --wheel (wheel=...) to be one of {', '.join(wheels)}, "
                     f"got {shown(wheel)}")  # fmt: skip
    problems.raise_any()
    tables = {name: _read_wheel(file, parser[name]) for name in wheels if wheel in (None, name)}
    first, *others = tables.values()
    if any((other.orders, other.lost) != (first.orders, first.lost) for other in others):
        problems.add(
            f"expected --wheel (wheel=...) to be one of {', '.join(wheels)}, whose tables differ"
        )
    problems.raise_any()
    if not others:
        return first
    note = f"one table for the wheels {', '.join(wheels)}, which agree"
    return WheelTable(str(file), "s2e", first.orders, {}, (*first.notes, note), first.lost)


def _read_wheel(file: Path, section: configparser.SectionProxy) -> WheelTable:
    problems = Problems(file)
    count = section.get("harmonics_degree", "")
    if not whole_number(count) or int(count) < 1:
        problems.add(
            f"expected a count of at least 1, got {shown(count or None)}",
            f"{section.name}: harmonics_degree",
        )
    named: dict[str, Path] = {}
    for kind, keys in _FILES.items():
        key = next((key for key in keys if key in section), keys[0])
        name = section.get(key, "")
        if not name:
            problems.add("expected the name of a file, got nothing", f"{section.name}: {key}")
            continue
        named[kind] = _beside(file, name)
    problems.raise_any()
    rows, notes = [], [WHIRL_NOTE]
    for kind, table in named.items():
        found, more = read_table(table, read_lines(table), kind, int(count))
        rows += found
        notes += more
    if any(section.get(key, "").upper() == "DISABLE" for key in _ON):
        notes.append(f"{section.name}: its jitter is switched off in S2E; it is read all the same")
    lost: tuple[str, ...] = ()
    if section.get("considers_structural_resonance", "").upper() in ("ENABLE", "1"):
        frequency = next((section[key] for key in _RESONANCE if key in section), "?")
        lost = (
            f"structural resonance at {frequency} Hz: S2E filters all lines alike, and passes "
            "what is far above it; a rotor on its bearings passes nothing there",
        )
    return WheelTable(str(file), "s2e", merged(str(file), rows), {}, tuple(notes), lost)


def _beside(file: Path, name: str) -> Path:
    """A file that S2E's ini names, whose folders may be placeholders or relative to elsewhere.

    Never outside the folder of the ini file: names in a file from elsewhere could be any.
    """
    path = Path(name.replace("\\", "/"))
    parts = [part for part in path.parts if part not in ("..", path.anchor)] or [name]
    places = [file.parent.joinpath(*parts[i:]) for i in range(len(parts))]
    return next((place for place in places if os.path.isfile(place)), places[-1])
