"""A harmonic table: its rows as a file gives them, and the scenario's list of orders."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from quietbus.scenario.text import write_yaml
from quietbus.scenario.units import Quantity
from quietbus.scenario.wheel_files.lines import Problems

KINDS = ("radial_force", "axial_force", "radial_torque", "axial_torque")
ORDER = Quantity("an order, a plain number,", "", above=0.0)
ANGLE = Quantity("random, or an angle", "rad")
COEFFICIENT = {
    kind: Quantity("a force over speed squared", "kg*m", least=0.0)
    if kind.endswith("force")
    else Quantity("a torque over speed squared", "kg*m^2", least=0.0)
    for kind in KINDS
}


@dataclass(frozen=True)
class Row:
    """One line at one order, and where it stands."""

    file: Path
    line: int
    order: float
    kind: str
    coefficient: float  # SI
    phase: float | str = "random"
    whirl: str = "forward"


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


def merged(source: str, rows: Iterable[Row]) -> tuple[dict[str, Any], ...]:
    """Rows of all kinds as the scenario's list of orders."""
    problems = Problems(source)
    lines: dict[tuple[float, bool], dict[str, Row]] = {}
    for row in rows:
        same = lines.setdefault((row.order, row.whirl == "backward"), {})
        first = same.setdefault(row.kind, row)
        if first is not row:
            place = "" if first.file == row.file else f" of {first.file.name}"
            problems.add(
                f"order {row.order:g} of {row.kind} stands in line {first.line}{place} already",
                "order",
                row.line,
            )
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
