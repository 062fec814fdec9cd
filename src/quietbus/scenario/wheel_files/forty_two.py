"""Wheel files of 42, the spacecraft simulator of NASA Goddard.

42's force is -K (n Omega)^2 times the resonance factor, at the angle n (phi + phase), so that the
coefficient is K n^2 and the phase turned by half a turn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from quietbus.scenario.units import Quantity, whole_number
from quietbus.scenario.wheel_files.lines import Line, Problems, decimal_comma
from quietbus.scenario.wheel_files.table import ANGLE, COEFFICIENT, ORDER, Row, WheelTable, merged

# what stands behind the exclamation mark
_HEAD = {
    "mass": "rotor mass",
    "ratio": "jt/jr",
    "imbalance_phase": "phase of static",
    "radial": "lateral mode",
    "rocking": "rocking mode",
    "static": "static imbalance",
    "dynamic": "dynamic imbalance",
    "count": "number of harmonics",
}
_HARMONIC = {
    "order": "harmonic number",
    "static": "static imbalance",
    "dynamic": "dynamic imbalance",
    "phase": "phase angle",
}
_OPTIONAL = ("mass", "static", "dynamic")  # older and newer files lack them
_FREQUENCY = Quantity("a frequency", "Hz", above=0.0)
_DAMPING = Quantity("a damping ratio", "", above=0.0)
_RATIO = Quantity("a ratio of inertias", "", above=0.0)


@dataclass(frozen=True)
class _Entry:
    """A line of the file: values, and what it says they are."""

    line: int
    values: list[str]
    label: str


def read(file: Path, lines: Sequence[Line]) -> WheelTable:
    """Orders, as imbalances turning at n times the speed, and the modes of the rotor."""
    problems = Problems(file)
    commas: list[str] = []
    entries = [_entry(i, line, commas) for i, line in lines if "!" in line]
    middle = next((k for k, e in enumerate(entries) if _HEAD["count"] in e.label), None)
    if middle is None:
        problems.add("expected a line '... ! Number of Harmonics', as 42's wheel files have it")
    problems.raise_any()
    assert middle is not None
    head = _labelled(_HEAD, entries[: middle + 1], problems)
    for name, label in _HEAD.items():
        if name not in head and name not in _OPTIONAL:
            problems.add(f"expected a line '... ! {label}', got none")
    problems.raise_any()
    rows = _rows(file, head, entries[middle + 1 :], problems)
    resonances = {}
    for name in ("radial", "rocking"):
        entry = head[name]
        if len(entry.values) != 2:
            got = len(entry.values)
            problems.add(f"expected frequency and damping, got {got} numbers", name, entry.line)
            continue
        resonances[name] = {
            "frequency": problems.read(_FREQUENCY, f"{entry.values[0]} Hz", name, entry.line),
            "damping": problems.read(_DAMPING, entry.values[1], name, entry.line),
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
        mass = head["mass"].values[0]
        notes.append(f"the file's rotor has {mass} kg; the scenario's own mass holds")
    if any("coulomb" in entry.label for entry in entries):
        notes.append("drag parameters are no disturbance at orders and are left out")
    if commas:
        notes.append(f"decimal commas: {commas[0]} is read as {decimal_comma(commas[0])}")
    return WheelTable(str(file), "42", merged(str(file), rows), resonances, tuple(notes))


def _entry(number: int, line: str, commas: list[str]) -> _Entry:
    """Values of a line; those with a decimal comma are noted in ``commas``."""
    text, _, label = line.partition("!")
    values = []
    for word in text.split():
        value = decimal_comma(word)
        if value is not None:
            commas.append(word)
        values.append(word.removesuffix(",") if value is None else value)
    return _Entry(number, values, label.strip().lower())


def _labelled(
    known: Mapping[str, str], entries: Sequence[_Entry], problems: Problems
) -> dict[str, _Entry]:
    """Entries by name; what no label fits is left out if it comes before the jitter."""
    found: dict[str, _Entry] = {}
    for entry in entries:
        name = next((name for name, words in known.items() if words in entry.label), None)
        if name is None:
            if known is _HARMONIC:
                problems.add(f"expected one of {', '.join(known.values())}", entry.label,
                             entry.line)  # fmt: skip
        elif not entry.values:
            problems.add("expected a number, got nothing", entry.label, entry.line)
        else:
            found[name] = entry
    return found


def _rows(
    file: Path, head: Mapping[str, _Entry], rest: Sequence[_Entry], problems: Problems
) -> list[Row]:
    """All harmonics, the fundamental of older files among them."""
    count, per = head["count"].values[0], len(_HARMONIC)
    if not whole_number(count) or int(count) * per != len(rest):
        problems.add(
            f"expected harmonics with {per} lines each, as many as the number says ({count}), "
            f"got {len(rest)} lines",
            "Number of Harmonics",
            head["count"].line,
        )
    problems.raise_any()
    tilt = _number(problems, ANGLE, head["imbalance_phase"], "deg", "imbalance phase")
    rows: list[Row] = []
    if "static" in head and "dynamic" in head:
        line = head["static"].line
        first = {"order": _Entry(line, ["1"], ""), "phase": _Entry(line, ["0"], "")}
        rows += _harmonic(file, {**head, **first}, tilt, problems)
    for k in range(int(count)):
        block = _labelled(_HARMONIC, rest[per * k : per * (k + 1)], problems)
        if len(block) == per:
            rows += _harmonic(file, block, tilt, problems)
    return rows


def _number(problems: Problems, quantity: Quantity, entry: _Entry, unit: str, column: str) -> float:
    return problems.read(quantity, f"{entry.values[0]} {unit}".strip(), column, entry.line)


def _harmonic(
    file: Path, block: Mapping[str, _Entry], tilt: float, problems: Problems
) -> list[Row]:
    """Force and torque of one of 42's harmonics; ``tilt`` is the phase of static to dynamic."""
    order = _number(problems, ORDER, block["order"], "", "harmonic number")
    phase = _number(problems, ANGLE, block["phase"], "deg", "phase")
    rows = []
    for kind, name, unit, angle in (
        ("radial_force", "static", "g*cm", tilt + phase),
        ("radial_torque", "dynamic", "g*cm^2", phase),
    ):
        line = block[name].line
        imbalance = _number(problems, COEFFICIENT[kind], block[name], unit, f"{name} imbalance")
        coefficient, turned = imbalance * order * order, order * angle + math.pi
        if math.isinf(coefficient) or math.isinf(turned):
            problems.add("imbalance times order squared, or order times phase, is not finite",
                         f"{name} imbalance", line)  # fmt: skip
            continue
        turned = math.remainder(turned, 2.0 * math.pi)
        rows.append(Row(file, line, order, kind, coefficient, turned))
    return rows
