"""Which reader a file is for."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from quietbus.arguments import listing
from quietbus.arguments import path as argument_path
from quietbus.scenario.wheel_files import forty_two, headed, s2e
from quietbus.scenario.wheel_files.lines import COMMENTS, Line, Problems, read_lines
from quietbus.scenario.wheel_files.table import KINDS, Row, WheelTable, merged

Name = str | os.PathLike[str]
_WORD = re.compile(r"[^\W\d]{2}")  # which no number has


def read_wheel_table(
    path: Name | Sequence[Name], kind: str | None = None, wheel: str | None = None
) -> WheelTable:
    """Read a harmonic table; its layout is recognised by its content.

    Args:
        path: of a CSV file, with a header or as S2E has it without one; of S2E's ``.ini`` file of
            wheels, which name two of these each; or of 42's ``Whl_*.txt``. Several CSV files of
            one wheel are put together.
        kind: one of "radial_force", "axial_force", "radial_torque" and "axial_torque", where
            neither a column nor the file's name tells.
        wheel: section of S2E's ini file, where it has several wheels whose tables differ.

    Raises:
        ScenarioError: file, line and column of everything wrong, what was expected and what came.
        ValueError: an unknown ``kind``, no file, or a kind for several files.
    """
    if kind is not None and kind not in KINDS:
        raise ValueError(f"kind: expected one of {', '.join(KINDS)}, got {kind!r}")
    given = [path] if isinstance(path, str | os.PathLike) else listing("path", path, "files")
    files = [Path(argument_path("path", each)) for each in given]
    if not files:
        raise ValueError("path: expected a file or several, got none")
    if len(files) == 1:
        return _read_one(files[0], kind, wheel)
    if kind is not None:
        raise ValueError("kind: expected none for several files, whose names or columns say it")
    _refuse_wheel(files[0], wheel)
    rows: list[Row] = []
    notes: list[str] = []
    layouts = set()
    for file in files:
        lines = read_lines(file)
        if _first(lines).startswith("<<<") or _is_ini(file, lines):
            problems = Problems(file)
            problems.add("expected a CSV file beside others; a file of 42 or an ini stands alone")
            problems.raise_any()
        has_header = _has_header(file, lines)
        found, more = (headed if has_header else s2e).read_table(file, lines, None)
        layouts.add("csv" if has_header else "s2e")
        rows += found
        notes += more
    source = ", ".join(str(file) for file in files)
    if "s2e" in layouts:
        notes.insert(0, s2e.WHIRL_NOTE)
    layout: Literal["s2e", "csv"] = "s2e" if layouts == {"s2e"} else "csv"
    return WheelTable(source, layout, merged(source, rows), {}, tuple(dict.fromkeys(notes)))


def _read_one(file: Path, kind: str | None, wheel: str | None) -> WheelTable:
    lines = read_lines(file)
    if _is_ini(file, lines):
        return s2e.read_ini(file, lines, wheel)
    _refuse_wheel(file, wheel)
    if _first(lines).startswith("<<<"):
        return forty_two.read(file, lines)
    if _has_header(file, lines):
        rows, notes = headed.read_table(file, lines, kind)
        return WheelTable(str(file), "csv", merged(str(file), rows), {}, notes)
    rows, notes = s2e.read_table(file, lines, kind)
    notes = (s2e.WHIRL_NOTE, *notes)
    return WheelTable(str(file), "s2e", merged(str(file), rows), {}, notes)


def _refuse_wheel(file: Path, wheel: str | None) -> None:
    if wheel is not None:
        problems = Problems(file)
        problems.add("expected an ini file for --wheel (wheel=...), which names one of its wheels")
        problems.raise_any()


def _first(lines: list[Line]) -> str:
    return next((line for _, line in lines if not line.startswith(COMMENTS)), "")


def _is_ini(file: Path, lines: list[Line]) -> bool:
    return file.suffix.lower() == ".ini" or _first(lines).startswith("[")


def _has_header(file: Path, lines: list[Line]) -> bool:
    """Whether the first cell that is no comment is a word, as columns are named by.

    A file that begins like no table is refused without a word of what is in it: a scenario from
    elsewhere may have named a file that is nobody's business.
    """
    cells = re.split(r"[;,\s]+", _first(lines).lower())
    word = _WORD.search(cells[0]) is not None
    if not (set(cells) & set(headed.COLUMNS) if word else re.search(r"\d", cells[0])):
        problems = Problems(file)
        problems.add(
            "expected a table: rows of numbers, or a header with columns among "
            f"{', '.join(headed.COLUMNS)}"
        )
        problems.raise_any()
    return word
