"""Harmonic tables of rotors from files: CSV, the S2E simulator's wheel files, and 42's.

A table says how large the line at order h of a rotor is: coefficient times rotor speed squared.
The layouts are documented in docs/import.md.
"""

from __future__ import annotations

import configparser
import csv
import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic_core import PydanticCustomError

from quietbus.scenario.errors import Problem, ScenarioError
from quietbus.scenario.text import write_yaml
from quietbus.scenario.units import Quantity, shown

KINDS = ("radial_force", "axial_force", "radial_torque", "axial_torque")
COLUMNS = ("order", "kind", "coefficient", "unit", "phase", "whirl")
_ORDER = Quantity("an order, a plain number,", "", above=0.0)
_COEFFICIENT = {
    kind: Quantity("a force over speed squared", "kg*m", least=0.0)
    if kind.endswith("force")
    else Quantity("a torque over speed squared", "kg*m^2", least=0.0)
    for kind in KINDS
}
_ANGLE = Quantity("random, or an angle", "rad")
_FREQUENCY = Quantity("a frequency", "Hz", above=0.0)
_DAMPING = Quantity("a damping ratio", "", above=0.0)
_RATIO = Quantity("a ratio of inertias", "", above=0.0)


@dataclass(frozen=True)
class WheelTable:
    """What a file says of a rotor, in the form of a scenario's ``rotor.disturbance``."""

    source: str
    layout: Literal["csv", "s2e", "42"]
    orders: tuple[dict[str, Any], ...]  # ascending; SI
    resonances: dict[str, dict[str, float]]
    notes: tuple[str, ...] = ()  # what else the file says, which belongs elsewhere
    lost: tuple[str, ...] = ()  # what the disturbance has in the file and cannot have here

    def to_dict(self) -> dict[str, Any]:
        """The mapping that stands below ``disturbance``."""
        data: dict[str, Any] = {"orders": [dict(order) for order in self.orders]}
        return data | ({"resonances": self.resonances} if self.resonances else {})

    def to_yaml(self) -> str:
        """YAML text of the block ``disturbance``, in SI units."""
        return write_yaml({"disturbance": self.to_dict()})


def read_wheel_table(path: str | os.PathLike[str], kind: str | None = None) -> WheelTable:
    """Read a harmonic table; its layout is recognised by its content.

    Args:
        path: of a CSV file, with a header or as S2E has it without one; of S2E's ``.ini`` file of
            a wheel, which names two of these; or of 42's ``Whl_*.txt``.
        kind: one of "radial_force", "axial_force", "radial_torque" and "axial_torque", where
            neither a column nor the file's name tells.

    Raises:
        ScenarioError: file, line and column of everything wrong, what was expected and what came.
        ValueError: an unknown ``kind``.
    """
    if kind is not None and kind not in KINDS:
        raise ValueError(f"kind: expected one of {', '.join(KINDS)}, got {kind!r}")
    file = Path(path)
    lines = _lines(file)
    first = next((line for _, line in lines if not line.startswith("#")), "")
    if first.startswith("<<<"):
        return _read_42(file, lines)
    if first.startswith(("[", "//")) or file.suffix == ".ini":
        return _read_s2e_ini(file)
    if re.search(r"[^\W\d]{2}", first.split(",")[0].split(";")[0]):
        return _read_csv(file, kind)
    rows = _read_s2e_csv(file, kind)
    return WheelTable(str(file), "s2e", _merged(file, rows), {})


@dataclass(frozen=True)
class _Row:
    line: int
    order: float
    kind: str
    coefficient: float  # SI
    phase: float | str = "random"
    whirl: str = "forward"


class _Problems:
    """Collects what is wrong with a file."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.found: list[Problem] = []

    def add(self, message: str, column: str = "", line: int | None = None) -> None:
        self.found.append(Problem(message, (column,) if column else (), line))

    def read(self, quantity: Quantity, value: str, column: str, line: int) -> float:
        """The value in SI, or NaN with the problem noted."""
        try:
            return quantity.read(value)
        except PydanticCustomError as error:
            self.add(str(error), column, line)
            return math.nan

    def raise_any(self) -> None:
        if self.found:
            raise ScenarioError(str(self.file), self.found)


def _lines(file: Path) -> list[tuple[int, str]]:
    """Numbers and texts of the lines that are not empty."""
    problems = _Problems(file)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        problems.add("no such file")
    except UnicodeDecodeError:
        problems.add("not a UTF-8 text file")
    except (OSError, ValueError) as error:
        problems.add(f"cannot be read: {getattr(error, 'strerror', None) or error}")
    problems.raise_any()
    lines = [(i, line.strip()) for i, line in enumerate(text.splitlines(), 1)]
    lines = [(i, line) for i, line in lines if line]
    if not lines:
        problems.add("expected a table, got an empty file")
    problems.raise_any()
    return lines


def _cells(file: Path) -> Iterator[tuple[int, list[str]]]:
    """Rows of a CSV file, without comments; cells are parted by commas or semicolons."""
    for number, line in _lines(file):
        if not line.startswith("#"):
            delimiter = ";" if ";" in line else ","
            (cells,) = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
            yield number, [cell.strip() for cell in cells]


def _read_csv(file: Path, kind: str | None) -> WheelTable:
    """A table with a header, its columns in any order."""
    problems = _Problems(file)
    rows = list(_cells(file))
    at, header = rows[0]
    header = [name.lower() for name in header]
    for i, name in enumerate(header):
        if name not in COLUMNS:
            problems.add(f"unknown column {shown(name)}; known: {', '.join(COLUMNS)}", line=at)
        if name in header[:i]:
            problems.add("this column appears twice", name, at)
    needed = ["order", "coefficient"] + ([] if kind else ["kind"])
    for name in needed:
        if name not in header:
            problems.add(f"expected a column '{name}', got {', '.join(header)}", line=at)
    problems.raise_any()
    found: list[_Row] = []
    for number, cells in rows[1:]:
        if len(cells) != len(header):
            problems.add(f"expected {len(header)} cells, got {len(cells)}", line=number)
            continue
        row = _csv_row(dict(zip(header, cells, strict=True)), number, kind, problems)
        if row is not None:
            before = [r for r in found if (r.kind, r.whirl) == (row.kind, row.whirl)]
            if before and row.order <= before[-1].order:
                problems.add(
                    f"expected an order above {before[-1].order:g}, the one before of "
                    f"{row.kind}, got {row.order:g}",
                    "order",
                    number,
                )
            found.append(row)
    if len(rows) == 1:
        problems.add("expected rows below the header, got none")
    problems.raise_any()
    return WheelTable(str(file), "csv", _merged(file, found), {})


def _csv_row(
    cells: dict[str, str], line: int, kind: str | None, problems: _Problems
) -> _Row | None:
    before = len(problems.found)
    given = cells.get("kind") or kind or ""
    if given not in KINDS:
        problems.add(f"expected one of {', '.join(KINDS)}, got {shown(given)}", "kind", line)
        return None
    if kind and "kind" in cells and given != kind:
        problems.add(f"expected {kind}, as asked for, got {given}", "kind", line)
    order = problems.read(_ORDER, cells["order"], "order", line)
    value, unit = cells["coefficient"], cells.get("unit", "")
    expects = _COEFFICIENT[given]
    if "unit" in cells and re.search(r"[^\W\d]", re.sub(r"[eE][+-]?\d", "", value)):
        problems.add(f"expected a number, its unit in its own column, got {shown(value)}",
                     "coefficient", line)  # fmt: skip
    text = f"{value} {unit}".strip()
    if not re.search(r"[^\W\d]", re.sub(r"\d[eE][+-]?\d", "", text)):
        problems.add(
            f"expected a unit, such as {expects.unit} or "
            f"{'N' if given.endswith('force') else 'N*m'}/rpm^2, got none",
            "unit" if "unit" in cells else "coefficient",
            line,
        )
    elif re.search(r"Hz|hertz", text):
        problems.add(
            f"speed squared in Hz: turns or radians? write /rpm^2, /(rev/s)^2 or /(rad/s)^2; "
            f"got {shown(text)}",
            "unit" if "unit" in cells else "coefficient",
            line,
        )
    coefficient = math.nan
    if len(problems.found) == before:
        coefficient = problems.read(expects, text, "coefficient", line)
    phase: float | str = cells.get("phase") or "random"
    if phase != "random":
        phase = problems.read(_ANGLE, str(phase), "phase", line)
    whirl = cells.get("whirl") or "forward"
    if whirl not in ("forward", "backward"):
        problems.add(f"expected forward or backward, got {shown(whirl)}", "whirl", line)
    if len(problems.found) > before:
        return None
    return _Row(line, order, given, coefficient, phase, whirl)


def _merged(file: Path, rows: Sequence[_Row]) -> tuple[dict[str, Any], ...]:
    """Rows of all kinds as the scenario's list of orders."""
    problems = _Problems(file)
    lines: dict[tuple[float, bool], dict[str, _Row]] = {}
    for row in rows:
        same = lines.setdefault((row.order, row.whirl == "backward"), {})
        if row.kind in same:
            first = same[row.kind].line
            problems.add(
                f"order {row.order:g} of {row.kind} stands in line {first} already",
                "order",
                row.line,
            )
        same[row.kind] = row
    problems.raise_any()
    orders: list[dict[str, Any]] = []
    for (order, backward), by_kind in sorted(lines.items()):
        phases = {kind: row.phase for kind, row in by_kind.items()}
        one = set(phases.values())
        data: dict[str, Any] = {"order": order}
        data |= {kind: float(f"{row.coefficient:.12g}") for kind, row in by_kind.items()}
        if backward:
            data["whirl"] = "backward"
        orders.append(data | {"phase": one.pop() if len(one) == 1 else phases})
    return tuple(orders)


def _read_s2e_csv(file: Path, kind: str | None, count: int | None = None) -> list[_Row]:
    """Two columns without a header: order, and amplitude over (rad/s)^2 [kg m, kg m^2]."""
    problems = _Problems(file)
    kind = kind or next((k for k in KINDS if k in file.stem), None)
    if kind is None:
        problems.add(
            "a table without a header: expected the file's name to say its kind, or --kind "
            f"(kind=...) to be one of {', '.join(KINDS)}; a header has a column 'order'"
        )
        problems.raise_any()
    assert kind is not None
    expects, rows = _COEFFICIENT[kind], []
    for line, cells in _cells(file):
        if len(cells) != 2:
            problems.add(f"expected two cells, order and coefficient, got {len(cells)}", line=line)
            continue
        order = problems.read(_ORDER, cells[0], "column 1", line)
        value = problems.read(
            Quantity(f"{expects.name} in {expects.unit}, a plain number,", "", least=0.0),
            cells[1],
            "column 2",
            line,
        )
        rows.append(_Row(line, order, kind, value))
    if count is not None and len(rows) < count:
        problems.add(f"expected {count} rows, as harmonics_degree says, got {len(rows)}")
    problems.raise_any()
    return rows[:count]


_S2E_FILES = {
    "radial_force": "radial_force_harmonics_coefficient_file",
    "radial_torque": "radial_torque_harmonics_coefficient_file",
}


def _read_s2e_ini(file: Path) -> WheelTable:
    """S2E's file of a wheel, which names the tables and how many of their rows count."""
    problems = _Problems(file)
    parser = configparser.ConfigParser(
        comment_prefixes=("//", "#", ";"),
        inline_comment_prefixes=("//",),
        strict=False,
        interpolation=None,
    )
    try:
        parser.read_string(file.read_text(encoding="utf-8-sig"))
    except configparser.Error as error:
        problems.add(f"not an ini file: {' '.join(str(error).split())}")
    problems.raise_any()
    key = _S2E_FILES["radial_force"]
    wheels = [name for name in parser.sections() if key in parser[name]]
    if len(wheels) != 1:
        said = f"{len(wheels)} of them: {', '.join(wheels)}" if wheels else "none"
        problems.add(f"expected one section with {key}, got {said}")
    problems.raise_any()
    wheel = parser[wheels[0]]
    try:
        count = int(wheel.get("harmonics_degree", ""))
    except ValueError:
        count = 0
    if count < 1:
        problems.add(
            f"expected a count of at least 1, got {shown(wheel.get('harmonics_degree'))}",
            "harmonics_degree",
        )
    problems.raise_any()
    rows: list[_Row] = []
    for kind, name in _S2E_FILES.items():
        if name not in wheel:
            problems.add("expected the name of a file, got nothing", name)
            continue
        rows += _read_s2e_csv(_beside(file, wheel[name]), kind, count)
    problems.raise_any()
    lost: tuple[str, ...] = ()
    if wheel.get("considers_structural_resonance", "").upper() in ("ENABLE", "1"):
        lost = (
            "structural resonance at "
            f"{wheel.get('structural_resonance_frequency_Hz', '?')} Hz: S2E filters all lines "
            "alike, and passes what is far above it; a rotor on its bearings passes nothing there",
        )
    return WheelTable(str(file), "s2e", _merged(file, rows), {}, (), lost)


def _beside(file: Path, name: str) -> Path:
    """A file that S2E's ini names, whose folders may be placeholders or relative to elsewhere."""
    parts = Path(name).parts
    places = [file.parent.joinpath(*parts[i:]) for i in range(len(parts))]
    return next((place for place in places if place.is_file()), places[-1])


# 42: what stands behind the exclamation mark
_42_HEAD = {
    "mass": "rotor mass",
    "ratio": "jt/jr",
    "imbalance_phase": "phase of static",
    "radial": "lateral mode",
    "rocking": "rocking mode",
    "static": "static imbalance",
    "dynamic": "dynamic imbalance",
    "count": "number of harmonics",
}
_42_HARMONIC = {
    "order": "harmonic number",
    "static": "static imbalance",
    "dynamic": "dynamic imbalance",
    "phase": "phase angle",
}
_42_OPTIONAL = ("mass", "static", "dynamic")  # older and newer files lack them


def _read_42(file: Path, lines: list[tuple[int, str]]) -> WheelTable:
    """42's wheel file: its orders are imbalances turning at n times the speed.

    42's force is -K (n Omega)^2 times the resonance factor, at the angle n (phi + phase), so that
    the coefficient is K n^2 and the phase turned by half a turn.
    """
    problems = _Problems(file)
    entries = [(i, *_entry(line)) for i, line in lines if "!" in line]
    middle = next((k for k, e in enumerate(entries) if _42_HEAD["count"] in e[2]), None)
    if middle is None:
        problems.add("expected a line '... ! Number of Harmonics', as 42's wheel files have it")
    problems.raise_any()
    assert middle is not None
    head = _labelled(_42_HEAD, entries[: middle + 1], problems)
    for name, label in _42_HEAD.items():
        if name not in head and name not in _42_OPTIONAL:
            problems.add(f"expected a line '... ! {label}', got none")
    problems.raise_any()
    count_line, (count,) = head["count"]
    per, rest = len(_42_HARMONIC), entries[middle + 1 :]
    if not count.isdigit() or int(count) * per != len(rest):
        problems.add(
            f"expected harmonics with {per} lines each, as many as the number says ({count}), "
            f"got {len(rest)} lines",
            "Number of Harmonics",
            count_line,
        )
    problems.raise_any()
    tilt = _number(problems, _ANGLE, head["imbalance_phase"], "deg", "imbalance phase")
    rows: list[_Row] = []
    if "static" in head and "dynamic" in head:
        first = {"order": (head["static"][0], ["1"]), "phase": (head["static"][0], ["0"])}
        rows += _42_rows({**head, **first}, tilt, problems)
    for k in range(int(count)):
        block = _labelled(_42_HARMONIC, rest[per * k : per * (k + 1)], problems)
        if len(block) == per:
            rows += _42_rows(block, tilt, problems)
    resonances = {}
    for name in ("radial", "rocking"):
        line, values = head[name]
        if len(values) != 2:
            problems.add(f"expected frequency and damping, got {len(values)} numbers", name, line)
            continue
        resonances[name] = {
            "frequency": problems.read(_FREQUENCY, f"{values[0]} Hz", name, line),
            "damping": problems.read(_DAMPING, values[1], name, line),
        }
    if not rows:
        problems.add("expected at least one harmonic, got none")
    ratio = 0.5 * _number(problems, _RATIO, head["ratio"], "", "inertia ratio")
    problems.raise_any()
    notes = [
        f"the rocking mode splits with the scenario's own rotor inertias; the file's transverse "
        f"inertia is {ratio:g} of that about the spin axis"
    ]
    if "mass" in head:
        notes.append(f"the file's rotor has {head['mass'][1][0]} kg; the scenario's own mass holds")
    if any("coulomb" in label for _, _, label in entries):
        notes.append("drag parameters are no disturbance at orders and are left out")
    return WheelTable(str(file), "42", _merged(file, rows), resonances, tuple(notes))


def _entry(line: str) -> tuple[list[str], str]:
    """Values of a line, and what it says they are."""
    values, _, label = line.partition("!")
    return values.split(), label.strip().lower()


def _labelled(
    known: dict[str, str], entries: list[tuple[int, list[str], str]], problems: _Problems
) -> dict[str, tuple[int, list[str]]]:
    """Line and values by name; what no label fits is left out if it comes before the jitter."""
    found: dict[str, tuple[int, list[str]]] = {}
    for line, values, label in entries:
        name = next((name for name, words in known.items() if words in label), None)
        if name is None:
            if known is _42_HARMONIC:
                problems.add(f"expected one of {', '.join(known.values())}", label, line)
        elif not values:
            problems.add("expected a number, got nothing", label, line)
        else:
            found[name] = (line, values)
    return found


def _number(
    problems: _Problems, quantity: Quantity, entry: tuple[int, list[str]], unit: str, column: str
) -> float:
    line, values = entry
    return problems.read(quantity, f"{values[0]} {unit}".strip(), column, line)


def _42_rows(
    block: dict[str, tuple[int, list[str]]], tilt: float, problems: _Problems
) -> list[_Row]:
    """Force and torque of one of 42's harmonics; ``tilt`` is the phase of static to dynamic."""
    order = _number(problems, _ORDER, block["order"], "", "harmonic number")
    phase = _number(problems, _ANGLE, block["phase"], "deg", "phase")
    rows = []
    for kind, name, unit, angle in (
        ("radial_force", "static", "g*cm", tilt + phase),
        ("radial_torque", "dynamic", "g*cm^2", phase),
    ):
        imbalance = _number(problems, _COEFFICIENT[kind], block[name], unit, f"{name} imbalance")
        turned = math.remainder(order * angle + math.pi, 2.0 * math.pi)
        rows.append(_Row(block[name][0], order, kind, imbalance * order**2, turned))
    return rows
