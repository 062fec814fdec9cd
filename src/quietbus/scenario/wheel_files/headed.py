"""Tables with a header: columns in any order, values with any unit."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from quietbus.scenario.units import shown
from quietbus.scenario.wheel_files.lines import Line, Problems, read_cells
from quietbus.scenario.wheel_files.table import ANGLE, COEFFICIENT, KINDS, ORDER, Row

COLUMNS = ("order", "kind", "coefficient", "unit", "phase", "whirl")
_LETTER = re.compile(r"[^\W\d]")
_EXPONENT = re.compile(r"(?<=[\d.])[eE][+-]?\d")


def read_table(
    file: Path, lines: Sequence[Line], kind: str | None
) -> tuple[list[Row], tuple[str, ...]]:
    """Rows of a table, and notes."""
    problems = Problems(file)
    cells = read_cells(file, lines)
    (at, header), *rows = cells.rows
    header = [name.lower() for name in header]
    for i, name in enumerate(header):
        if name not in COLUMNS:
            problems.add(f"unknown column {shown(name)}; known: {', '.join(COLUMNS)}", line=at)
        elif name in header[:i]:
            problems.add("this column appears twice", name, at)
    needed = ["order", "coefficient"] + ([] if kind else ["kind"])
    for name in needed:
        if name not in header:
            problems.add(f"expected a column '{name}', got {shown(', '.join(header))}", line=at)
    problems.raise_any()
    found: list[Row] = []
    last: dict[tuple[str, str], float] = {}
    for number, row in rows:
        if len(row) != len(header):
            problems.add(f"expected {len(header)} cells, got {len(row)}", line=number)
            continue
        read = _row(file, dict(zip(header, row, strict=True)), number, kind, problems)
        if read is None:
            continue
        before = last.get((read.kind, read.whirl), 0.0)
        if read.order <= before:
            problems.add(
                f"expected an order above {before:g}, the one before of {read.kind}, "
                f"got {read.order:g}",
                "order",
                number,
            )
        last[read.kind, read.whirl] = read.order
        found.append(read)
    if not rows:
        problems.add("expected rows below the header, got none")
    problems.raise_any()
    return found, cells.notes


def _row(
    file: Path, cells: dict[str, str], line: int, kind: str | None, problems: Problems
) -> Row | None:
    before = len(problems.found)
    given = cells.get("kind") or kind or ""
    if given not in KINDS:
        problems.add(f"expected one of {', '.join(KINDS)}, got {shown(given)}", "kind", line)
        return None
    if kind and "kind" in cells and given != kind:
        problems.add(f"expected {kind}, as asked for, got {given}", "kind", line)
    order = problems.read(ORDER, cells["order"], "order", line)
    text = _coefficient(cells, given, line, problems)
    coefficient = math.nan
    if len(problems.found) == before:
        coefficient = problems.read(COEFFICIENT[given], text, "coefficient", line)
    phase: float | str = cells.get("phase") or "random"
    if phase != "random":
        phase = problems.read(ANGLE, str(phase), "phase", line)
    whirl = cells.get("whirl") or "forward"
    if whirl not in ("forward", "backward"):
        problems.add(f"expected forward or backward, got {shown(whirl)}", "whirl", line)
    if len(problems.found) > before:
        return None
    return Row(file, line, order, given, coefficient, phase, whirl)


def _coefficient(cells: dict[str, str], kind: str, line: int, problems: Problems) -> str:
    """Number and unit of a row, which is told if it has none or one with a doubtful speed."""
    expects, value = COEFFICIENT[kind], cells["coefficient"]
    column = "unit" if "unit" in cells else "coefficient"
    if "unit" in cells and _LETTER.search(_EXPONENT.sub("", value)):
        problems.add(f"expected a number, its unit in its own column, got {shown(value)}",
                     "coefficient", line)  # fmt: skip
    text = f"{value} {cells.get('unit', '')}".strip()
    if not _LETTER.search(_EXPONENT.sub("", text)):
        problems.add(
            f"expected a unit, such as {expects.unit} or "
            f"{'N' if kind.endswith('force') else 'N*m'}/rpm^2, got none",
            column,
            line,
        )
    elif "hz" in text.lower() or "hertz" in text.lower():
        problems.add(
            f"speed squared in Hz: turns or radians? write /rpm^2, /(rev/s)^2 or /(rad/s)^2; "
            f"got {shown(text)}",
            column,
            line,
        )
    return text
