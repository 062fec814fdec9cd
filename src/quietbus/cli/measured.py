"""Commands of measured rotors: import, fit."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from quietbus.cli.app import app
from quietbus.cli.given import OUT, FolderOption, JsonOption
from quietbus.cli.guard import BadInput, check_file, make_folder
from quietbus.cli.session import print_table, status
from quietbus.cli.written import write_study
from quietbus.words import visible_lines
from quietbus.writing import write_text

BLOCK = "disturbance block (YAML)"


@app.command("import")
def import_(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="CSV, S2E's .ini or .csv, 42's Whl_*.txt; several CSV files of one wheel.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="YAML file, replaced if old; default: print."),
    ] = None,
    kind: Annotated[
        str | None, typer.Option(help="radial_force, ...; where the file does not say it.")
    ] = None,
    wheel: Annotated[
        str | None, typer.Option(help="Section of S2E's .ini, where its wheels differ.")
    ] = None,
) -> None:
    """A harmonic table of a rotor as the scenario's block `disturbance`."""
    from quietbus.scenario import read_wheel_table
    from quietbus.scenario.wheel_files import KINDS

    if kind is not None and kind not in KINDS:
        raise BadInput(f"--kind: expected one of {', '.join(KINDS)}, got '{kind}'")
    if output is not None:
        check_file(output, BLOCK)
    if kind is not None and len(files) > 1:
        raise BadInput("--kind: expected one file with it, whose kind it says")
    table = read_wheel_table(files, kind, wheel)
    for lost in table.lost:
        print(f"note: not taken over: {visible_lines(lost)}", file=sys.stderr)
    for note in table.notes:
        print(f"note: {visible_lines(note)}", file=sys.stderr)
    _write_block(table.to_yaml(), output)


def _write_block(text: str, output: Path | None) -> None:
    if output is None:
        print(text, end="")
        return
    write_text(output, text, BLOCK)
    print(f"wrote {output}")


@app.command()
def fit(
    file: Annotated[
        Path, typer.Argument(metavar="MAP", help="A measured waterfall, CSV or NetCDF.")
    ],
    output: FolderOption = OUT,
    as_json: JsonOption = False,
    most: Annotated[int, typer.Option(min=1, help="Orders looked for in each component.")] = 20,
) -> None:
    """Fit orders, resonances and broadband floor to a measured speed-frequency map of a rotor."""
    from quietbus.analysis.signals.waterfall import FitError
    from quietbus.measured import fit_waterfall

    if not as_json and os.path.lexists(output):
        _make_room(output)
    try:
        with status() as tell:
            tell("fitting")
            fitted = fit_waterfall(file, most)
    except FitError as error:
        raise BadInput(f"{file}: {error}") from None
    if not as_json:
        _make_room(output)  # a new folder not before: a wrong map leaves none
    for note in fitted.notes:
        print(f"note: {visible_lines(note)}", file=sys.stderr)
    if as_json:
        print(json.dumps(fitted.to_dict(), indent=2, allow_nan=False))
        return
    from quietbus.plots.waterfall import waterfall_figures
    from quietbus.tables.waterfall import fit_tables

    for table in fit_tables(fitted):
        print_table(table)
    write_text(output / "disturbance.yaml", fitted.to_yaml(), BLOCK)
    write_study("fit", fitted.to_dict(), lambda: waterfall_figures(fitted), output)


def _make_room(folder: Path) -> None:
    make_folder(folder, "fit.json")
    check_file(folder / "disturbance.yaml", BLOCK)
