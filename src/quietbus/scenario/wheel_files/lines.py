"""Text files of tables: their lines and cells, decimal signs, and what is wrong with them."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic_core import PydanticCustomError

from quietbus.scenario.errors import Problem, ScenarioError
from quietbus.scenario.files import UnreadableError, read_text
from quietbus.scenario.units import Quantity, shown

Line = tuple[int, str]  # number and text
COMMENTS = ("#", "//")
_TOLD = 5  # problems of a file: of a long one all have one cause
_WITH_COMMA = re.compile(r"(?<!\d)([+-]?\d++),(\d++)(?![.,\d])")
_WITH_POINT = re.compile(r"(?<!\d)[+-]?\d*+\.\d")


class Problems:
    """Collects what is wrong with a file."""

    def __init__(self, source: str | Path) -> None:
        self.source = str(source)
        self.found: list[Problem] = []

    def add(self, message: str, column: str = "", line: int | None = None) -> None:
        """One more problem."""
        self.found.append(Problem(message, (column,) if column else (), line))

    def read(self, quantity: Quantity, value: str, column: str, line: int) -> float:
        """The value in SI, or NaN with the problem noted."""
        try:
            return quantity.read(value)
        except PydanticCustomError as error:
            self.add(str(error), column, line)
            return math.nan

    def raise_any(self) -> None:
        """Tell what is wrong, of many problems the first."""
        if self.found:
            told, left = self.found[:_TOLD], len(self.found) - _TOLD
            more = [Problem(f"and {left} problems more")] if left > 0 else []
            raise ScenarioError(self.source, [*told, *more])


def read_lines(file: Path) -> list[Line]:
    """The lines that are not empty."""
    problems = Problems(file)
    text = ""
    try:
        text = read_text(file)
    except UnreadableError as error:
        problems.add(str(error))
    problems.raise_any()
    lines = [(i, line.strip()) for i, line in enumerate(text.splitlines(), 1)]
    lines = [(i, line) for i, line in lines if line]
    if not lines:
        problems.add("expected a table, got an empty file")
    problems.raise_any()
    return lines


@dataclass(frozen=True)
class Cells:
    """Rows of cells with the numbers of their lines."""

    rows: list[tuple[int, list[str]]]
    notes: tuple[str, ...] = ()


def read_cells(file: Path, lines: Sequence[Line]) -> Cells:
    """Rows without comments; parted by semicolons, tabs, commas or spaces, as the first one is.

    Where commas do not part the cells they are decimal signs.
    """
    kept = [(i, line.partition("//")[0].strip()) for i, line in lines if not line.startswith("#")]
    kept = [(i, line) for i, line in kept if line]
    separator = _separator(kept[0][1]) if kept else ","
    if separator is None:
        rows = [(i, line.split()) for i, line in kept]
    else:
        rows = [(i, _parted(file, i, line, separator)) for i, line in kept]
    if separator == ",":
        return Cells(rows)
    return _with_points(file, rows)


def _parted(file: Path, number: int, line: str, separator: str) -> list[str]:
    """Cells of a line by itself: a quoted cell may not go on in the next one."""
    try:
        (cells,) = csv.reader([line], delimiter=separator, skipinitialspace=True)
    except csv.Error as error:
        problems = Problems(file)
        problems.add(f"cannot be parted into cells: {error}", line=number)
        problems.raise_any()
    return [cell.strip() for cell in cells]


def _separator(line: str) -> str | None:
    """What parts the cells of a line; None for spaces."""
    if ";" in line:
        return ";"
    spaced = line.replace("\t", " ")
    if "," in line and (", " in spaced or not _spaced_numbers(line)):
        return "," if "\t" not in line or ", " in spaced else "\t"
    return "\t" if "\t" in line else None if " " in line else ","


def _spaced_numbers(line: str) -> bool:
    """Whether spaces or tabs part numbers that have a decimal comma: ``1,0  2,5e-8``."""
    fields = line.split()
    return len(fields) > 1 and all(decimal_comma(field) for field in fields)


def decimal_comma(text: str) -> str | None:
    """The text with a point in the place of its first number's decimal comma; None without one."""
    match = _WITH_COMMA.match(text)
    return f"{match[1]}.{match[2]}{text[match.end() :]}" if match else None


def _with_points(file: Path, rows: list[tuple[int, list[str]]]) -> Cells:
    """Decimal commas as points; refused where both occur."""
    if not any("," in cell for _, cells in rows for cell in cells):
        return Cells(rows)
    first: tuple[int, str] | None = None
    point: tuple[int, str] | None = None
    read = []
    for line, cells in rows:
        changed = []
        for cell in cells:
            text = decimal_comma(cell)
            if text is not None:
                first = first or (line, cell)
            elif _WITH_POINT.match(cell):
                point = point or (line, cell)
            changed.append(cell if text is None else text)
        read.append((line, changed))
    if first and point:
        problems = Problems(file)
        problems.add(
            f"which is the decimal sign? {shown(first[1])} stands in line {first[0]}, "
            f"{shown(point[1])} in line {point[0]}"
        )
        problems.raise_any()
    notes = (f"decimal commas: {first[1]} is read as {decimal_comma(first[1])}",) if first else ()
    return Cells(read, notes)
