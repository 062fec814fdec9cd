"""Commands that answer questions of a design: analyze, jitter, verify."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from quietbus.cli.app import app
from quietbus.cli.given import (
    OUT,
    AnglesOption,
    DurationOption,
    FolderOption,
    JsonOption,
    Method,
    Mount,
    ScenarioArgument,
    load,
    method_object,
    speed,
)
from quietbus.cli.guard import BadInput, fail, make_folder
from quietbus.cli.session import (
    fraction,
    import_heavy,
    notes,
    print_table,
    progress,
    show_as_read,
    status,
)
from quietbus.cli.written import write_study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from quietbus.studies.jitter import JitterStudy
    from quietbus.studies.linear import Study


@app.command()
def analyze(
    scenario: ScenarioArgument,
    output: FolderOption = OUT,
    as_json: JsonOption = False,
    gimbal_angles: AnglesOption = None,
) -> None:
    """Modes, isolator channels, gain range and margins: per axis and of the whole satellite."""
    checked = load(scenario, None, None, gimbal_angles=gimbal_angles)
    if not as_json:
        make_folder(output, "analysis.json")
    import_heavy()
    from quietbus import api
    from quietbus.dynamics.linearize import OperatingPointError

    try:
        study = api.analyze(checked)
        if as_json:
            print(json.dumps(study.to_dict(), indent=2, allow_nan=False))
            return
        _print_analysis(study, output)
    except OperatingPointError as error:
        raise BadInput(f"{scenario}: {error}") from None


def _print_analysis(study: Study, output: Path) -> None:
    from quietbus.plots import analysis_figures
    from quietbus.tables.linear import analysis_tables

    show_as_read(study.scenario)
    for part in analysis_tables(study):
        print(part) if isinstance(part, str) else print_table(part)
    write_study("analysis", study.to_dict(), lambda: analysis_figures(study), output)


@app.command()
def jitter(
    scenario: ScenarioArgument,
    output: FolderOption = OUT,
    as_json: JsonOption = False,
    gimbal_angles: AnglesOption = None,
    max_speed: Annotated[
        str | None,
        typer.Option(help="'7000 rpm' of the fastest rotor, end of the sweep; default 1.2 x own."),
    ] = None,
) -> None:
    """Jitter at each rotor order with the isolator and without, and over the rotors' speed."""
    checked = load(scenario, None, None, gimbal_angles=gimbal_angles)
    most = None if max_speed is None else speed(max_speed)
    if not as_json:
        make_folder(output, "jitter.json")
    import_heavy()
    from quietbus import api
    from quietbus.scenario import ScenarioError

    try:
        with status() as tell, notes():
            tell("computing (compiles for some seconds the first time)")
            study = api.jitter(checked)
            numbers = study.to_dict(most)
    except ScenarioError:
        raise
    except ValueError as error:
        raise BadInput(f"{scenario}: {error}") from None
    if as_json:
        print(json.dumps(numbers, indent=2, allow_nan=False))
        return
    from quietbus.tables.jitter import jitter_tables

    show_as_read(checked)
    for table in jitter_tables(numbers):
        print_table(table)
    write_study("jitter", numbers, lambda: _jitter_pictures(study, most), output)


def _jitter_pictures(study: JitterStudy, max_speed: float | None) -> dict[str, Figure]:
    from quietbus.plots import jitter_figures, sweep_figures

    figures = jitter_figures(study)
    if not study.frequency.any():  # no rotor turns
        return figures
    return figures | sweep_figures(study.sweep(max_speed), study.scenario.name)


@app.command()
def verify(
    scenario: ScenarioArgument,
    output: FolderOption = OUT,
    as_json: JsonOption = False,
    method: Annotated[
        Method,
        typer.Option(help="harmonic: over all rotor phases; direct: one run, every rotor turn."),
    ] = Method.harmonic,
    mount: Annotated[Mount | None, typer.Option(help="Instead of the scenario's mount.")] = None,
    duration: DurationOption = None,
) -> None:
    """Judge the scenario's pointing requirements: value, margin, verdict. Status 1: one not met."""
    checked = load(scenario, mount, duration)
    if not checked.requirements:
        from quietbus.scenario.pointing import NO_REQUIREMENTS

        raise BadInput(f"{scenario}: requirements: {NO_REQUIREMENTS}")
    if not as_json:
        make_folder(output, "verification.json")
    import_heavy()
    from quietbus import api
    from quietbus.analysis.pointing.chi_square import UnsoundStatisticError
    from quietbus.runs import SimulationError
    from quietbus.solve.validity import ResonanceError

    try:
        with progress({method.value: checked.simulation.duration}) as tell, notes():
            verification = api.verify(
                checked, method_object(method), progress=lambda t: tell(method.value, t)
            )
    except SimulationError as error:
        fail(str(error))
    except ResonanceError as error:
        raise BadInput(f"{scenario}: {error}") from None
    try:
        with fraction() as tell:
            verification.judge(curves=not as_json, progress=tell)
    except UnsoundStatisticError as error:
        fail(str(error))
    numbers = verification.to_dict()
    if as_json:
        print(json.dumps(numbers, indent=2, allow_nan=False))
    else:
        from quietbus.plots import pointing_figures
        from quietbus.tables.verification import verification_tables

        show_as_read(checked)
        for part in verification_tables(numbers):
            print(part) if isinstance(part, str) else print_table(part)
        write_study("verification", numbers, lambda: pointing_figures(verification), output)
    missed = [
        f"{v.name} of {v.line_of_sight}{'' if v.decided else ' (undecided)'}"
        for v in verification.verdicts
        if not v.met
    ]
    if missed:
        fail(f"{len(missed)} of {len(verification.verdicts)} not met: {'; '.join(missed)}")
