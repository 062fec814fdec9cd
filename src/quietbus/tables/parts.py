"""What tables share: their look, and numbers as text."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

AXES = ("x", "y", "z")


def titled(title: str) -> Table:
    """An empty table under a title."""
    return Table(title=title, box=SIMPLE_HEAD, title_justify="left")


def numbers_table(title: str, *columns: str) -> Table:
    """The first column holds names, the others numbers."""
    table = titled(title)
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left", overflow="fold")
    return table


def number(value: float | None) -> str:
    """Four digits; a dash for what there is not."""
    return "-" if value is None else "inf" if math.isinf(value) else f"{value:.4g}"


def numbers_text(values: Sequence[float]) -> str:
    """The same of several, in a row."""
    return ", ".join(f"{value:.4g}" for value in values) or "-"
