"""Commands of runs: simulate, compare, plot, report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quietbus.cli.app import app
from quietbus.cli.given import (
    OUT,
    DurationOption,
    FolderOption,
    Method,
    Mount,
    ScenarioArgument,
    load,
    method_object,
)
from quietbus.cli.guard import BadInput, check_file, fail, make_folder
from quietbus.cli.scenarios import checks_of, fail_unless_passed
from quietbus.cli.session import (
    Stop,
    import_heavy,
    keeping_results,
    notes,
    print_table,
    progress,
    show_as_read,
)
from quietbus.cli.written import save
from quietbus.words import file_name
from quietbus.writing import write_json

RUN = "run (NetCDF-4)"
LONGEST = 100  # letters of a scenario's name in the name of a file


@app.command()
def simulate(
    scenario: ScenarioArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="NetCDF file; default NAME-MOUNT.nc, replaced if old."),
    ] = None,
    method: Annotated[
        Method, typer.Option(help="direct: every rotor turn; harmonic: slow motion and jitter.")
    ] = Method.direct,
    mount: Annotated[Mount | None, typer.Option(help="Instead of the scenario's mount.")] = None,
    duration: DurationOption = None,
    output_rate: Annotated[
        str | None,
        typer.Option(help="'200 Hz', instead of the scenario's (direct) or 10 Hz (harmonic)."),
    ] = None,
    joint_forces: Annotated[
        bool, typer.Option("--joint-forces", help="Also keep the forces in the legs' joints.")
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where this run was interrupted or killed.")
    ] = False,
) -> None:
    """Simulate a scenario; write the run and print what one wants to know of it."""
    checked, way = load(scenario, mount, duration, output_rate), method_object(method)
    chosen = checked.mount
    name = f"{file_name(checked.name)[:LONGEST]}-{chosen}"
    output = output or Path(f"{name}{'-harmonic' if way.jitter_apart else ''}.nc")
    check_file(output, RUN)
    checkpoint = _checkpoint_of(output, resume)
    if joint_forces and way.jitter_apart:
        raise BadInput("--joint-forces needs --method direct")
    if joint_forces and chosen == Mount.rigid:
        raise BadInput("--joint-forces needs the isolated mount: a rigid one leaves them open")
    import_heavy()
    from quietbus import api
    from quietbus.results import summarize, with_worst_phases
    from quietbus.results.checkpoint import CheckpointError
    from quietbus.runs import SimulationError
    from quietbus.solve.validity import ResonanceError
    from quietbus.tables.runs import summary_table

    failed = ""
    with keeping_results():
        with progress({chosen: checked.simulation.duration}) as tell, notes():
            try:
                run = api.simulate(
                    checked,
                    way,
                    output_rate=checked.simulation.output_rate if output_rate else None,
                    joint_forces=joint_forces,
                    progress=lambda t: tell(chosen, t),
                    checkpoint=checkpoint,
                    resume=resume,
                )
            except CheckpointError as error:
                raise BadInput(str(error)) from None
            except SimulationError as error:
                run, failed = error.run, str(error)
            except ResonanceError as error:
                raise BadInput(f"{scenario}: {error}") from None
        if run.attrs["status"] == "complete":
            run = with_worst_phases(run, api.worst_over_phases(run))
        troubles = save(run, output)
        if not troubles and run.attrs["status"] != "interrupted":
            checkpoint.unlink(missing_ok=True)
    if run.sizes["time"] > 1:
        show_as_read(checked)
        print_table(summary_table({chosen: summarize(run)}))
    else:
        print("one instant only, so there is no table")
    if run.attrs["status"] != "complete":
        troubles.append(f"the run is not complete: {run.attrs['stop_reason']}")
        if checkpoint.exists():
            troubles.append("the same command with --resume goes on from there")
    elif failed:
        troubles.append(failed)
    if troubles:
        fail("; ".join(troubles))


def _checkpoint_of(output: Path, resume: bool) -> Path:
    """The file beside a run that keeps what is computed until the run is written."""
    checkpoint = output.with_name(f"{output.name}.checkpoint")
    check_file(checkpoint, "checkpoint")
    if resume and not checkpoint.exists():
        raise BadInput(f"{checkpoint}: no such file, so there is nothing to resume")
    return checkpoint


@app.command()
def compare(
    scenario: ScenarioArgument,
    output: FolderOption = OUT,
    duration: DurationOption = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where these runs were interrupted or killed.")
    ] = False,
) -> None:
    """Simulate with the isolator and without, side by side, with pictures."""
    checked = load(scenario, None, duration)
    make_folder(output, "summary.json")
    files = {each: output / f"{each}.nc" for each in Mount}
    for file in files.values():
        check_file(file, RUN)
    checkpoints = {each: _checkpoint_of(file, False) for each, file in files.items()}
    if resume and not any(each.exists() for each in checkpoints.values()):
        raise BadInput(f"{output}: no checkpoints in it, so there is nothing to resume")
    import_heavy()
    from quietbus import api
    from quietbus.plots import compare_figures, run_figures, save_figures
    from quietbus.results import summarize, with_worst_phases
    from quietbus.results.checkpoint import CheckpointError
    from quietbus.tables.runs import summary_table

    with keeping_results():
        with progress(dict.fromkeys(Mount, checked.simulation.duration)) as tell, notes():
            try:
                runs = api.compare(
                    checked,
                    progress=tell,
                    checkpoints={each.value: file for each, file in checkpoints.items()},
                    resume=resume,
                )
            except CheckpointError as error:
                raise BadInput(str(error)) from None
        troubles = []
        if not Stop.asked:
            runs = {
                mount: with_worst_phases(run, api.worst_over_phases(run))
                for mount, run in runs.items()
            }
        for mount, run in runs.items():
            troubles += save(run, files[Mount(mount)])
        if not troubles and not Stop.asked:
            for checkpoint in checkpoints.values():
                checkpoint.unlink(missing_ok=True)
        for mount, run in runs.items():
            if run.attrs["status"] != "complete":
                troubles.append(f"the {mount} run is not complete: {run.attrs['stop_reason']}")
    if Stop.asked:
        print(f"no pictures of an interrupted comparison; `quietbus plot {output}/isolated.nc`")
        troubles.append("the same command with --resume goes on from there")
    elif all(run.sizes["time"] > 1 for run in runs.values()):
        summaries = {str(mount): summarize(run) for mount, run in runs.items()}
        show_as_read(checked)
        print_table(summary_table(summaries))
        numbers = {mount: summary.to_dict() for mount, summary in summaries.items()}
        write_json(output / "summary.json", numbers)
        figures = compare_figures(runs) | {
            f"{mount}-{name}": figure
            for mount, run in runs.items()
            for name, figure in run_figures(run).items()
        }
        save_figures(figures, output)
        print(f"wrote summary.json and {len(figures)} pictures to {output}/")
    else:
        print("one instant only, so there are no table and no pictures")
    if troubles:
        fail("; ".join(troubles))


@app.command()
def plot(
    what: Annotated[
        str,
        typer.Argument(
            metavar="RUN.nc|SCENARIO", help="A run, or a scenario (a .yaml file or a built-in)."
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder; default the run's name, or out.")
    ] = None,
    suffix: Annotated[str, typer.Option("--format", help="png, svg or pdf.")] = "png",
) -> None:
    """Draw the pictures of a run, or the satellite that a scenario describes."""
    if suffix not in ("png", "svg", "pdf"):
        raise BadInput(f"--format: expected png, svg or pdf, got '{suffix}'")
    from quietbus.scenario import builtin_names

    path = Path(what)
    mistyped = not path.suffix and not path.exists()  # the name of a built-in, for all we know
    if what in builtin_names() or path.suffix in (".yaml", ".yml") or mistyped:
        scenario = load(what, None, None)
        folder = output or OUT
        make_folder(folder)
        from quietbus.plots import geometry_figures

        figures = geometry_figures(scenario)
    else:
        from quietbus.plots import run_figures
        from quietbus.results import load_run

        try:
            loaded = load_run(what)
        except (FileNotFoundError, ValueError) as error:
            raise BadInput(str(error)) from None
        folder = output or path.with_suffix("")
        make_folder(folder)
        figures = run_figures(loaded)
    from quietbus.plots import save_figures

    for path in save_figures(figures, folder, f".{suffix}"):
        print(f"wrote {path}")


@app.command()
def report(
    run: Annotated[Path, typer.Argument(metavar="RUN.nc", help="A run of `quietbus simulate`.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="HTML file; default RUN's name, replaced if old."),
    ] = None,
    check: Annotated[
        bool, typer.Option("--validate", help="Also check the run's scenario, as `validate` does.")
    ] = False,
) -> None:
    """Write a run as one HTML page: numbers, interactive pictures, scenario, provenance."""
    from quietbus.results import load_run, scenario_of

    try:
        loaded = load_run(run)
    except (FileNotFoundError, ValueError) as error:
        raise BadInput(str(error)) from None
    scenario = scenario_of(loaded)
    page = output or run.with_suffix(".html")
    if page.resolve() == run.resolve():
        raise BadInput(f"{page}: is the run itself; expected another name for the page")
    check_file(page, "page (HTML)")
    try:
        from quietbus.report import write_report

        checks = checks_of(scenario, None) if check else None
    except ImportError as error:
        fail(str(error))
    write_report(loaded, page, checks)
    print(f"wrote {page}")
    fail_unless_passed(checks or [])
