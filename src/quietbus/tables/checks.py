"""The table of a validation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from quietbus.tables.parts import titled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from quietbus.validate import Check


def checks_table(name: str, checks: Sequence[Check]) -> Table:
    """Errors, bounds and verdicts of a validation."""
    table = titled(f"{name}: quietbus against MuJoCo")
    table.add_column("check")
    table.add_column("error", justify="right")
    table.add_column("bound", justify="right")
    table.add_column("verdict")
    for check in checks:
        verdict = "pass" if check.passed else "FAIL"
        what = f"{check.name}: {check.compares}"
        table.add_row(what, f"{check.error:.1e}", f"{check.bound:.0e}", verdict)
    return table
