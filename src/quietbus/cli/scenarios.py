"""Commands of scenarios: init, validate."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from quietbus.cli.app import app
from quietbus.cli.given import Mount, ScenarioArgument, load
from quietbus.cli.guard import BadInput, check_file, fail
from quietbus.cli.session import import_heavy, print_table, show_as_read, status
from quietbus.writing import write_text

if TYPE_CHECKING:
    from quietbus.scenario import Scenario
    from quietbus.validate import Check


@app.command()
def init(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The scenario file to write.")],
) -> None:
    """Write a commented scenario to start from."""
    from quietbus.scenario import template_text

    if os.path.lexists(file):
        raise BadInput(f"{file}: exists already; choose another name")
    check_file(file, "new scenario (YAML)")
    write_text(file, template_text(), "new scenario (YAML)")
    print(f"wrote {file}; next: quietbus compare {file}")


@app.command()
def validate(
    scenario: ScenarioArgument,
    export: Annotated[
        Path | None, typer.Option(help="Also write the satellite as a MuJoCo model (XML).")
    ] = None,
    mount: Annotated[Mount | None, typer.Option(help="Instead of the scenario's mount.")] = None,
) -> None:
    """Check a scenario against an independent engine (MuJoCo) and conservation laws."""
    checked = load(scenario, mount, None)
    if export is not None:
        check_file(export, "MuJoCo model (XML)")
    from quietbus.tables.checks import checks_table

    try:
        checks = checks_of(checked, export)
    except ImportError as error:
        fail(str(error))
    show_as_read(checked)
    print_table(checks_table(f"{checked.name}, {checked.mount}", checks))
    fail_unless_passed(checks)
    print(f"all {len(checks)} checks passed (errors are relative)")


def checks_of(scenario: Scenario, export: Path | None) -> list[Check]:
    """Check a scenario, and write it as a MuJoCo model if wanted; ImportError without MuJoCo."""
    import_heavy()
    from quietbus import validate as checking

    if export is not None:
        write_text(export, checking.export_mjcf(scenario), "MuJoCo model (XML)")
        print(f"wrote {export}")
    for said in checking.not_covered(scenario):
        print(f"not checked: {said}")
    with status() as tell:
        return checking.validate(scenario, progress=tell)


def fail_unless_passed(checks: Sequence[Check]) -> None:
    failed = [check.name for check in checks if not check.passed]
    if failed:
        fail(f"{len(failed)} of {len(checks)} checks failed: {', '.join(failed)}")
