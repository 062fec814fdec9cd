"""The ``quietbus`` command: arguments, progress bars and tables.

Heavy modules are imported inside the commands, so that ``quietbus --help`` answers at once.
"""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NoReturn

import typer

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from rich.table import Table

    from quietbus.jitter_study import JitterStudy
    from quietbus.scenario import Scenario, ScenarioError
    from quietbus.study import Study
    from quietbus.validate import Check

BAD_INPUT, FAILED = 2, 1

app = typer.Typer(
    name="quietbus",
    help="Design, simulate and verify vibration isolation platforms for CMGs on satellites.",
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
    rich_markup_mode=None,
)


class Mount(StrEnum):
    """How the upper plate is held."""

    isolated = "isolated"
    rigid = "rigid"


class Method(StrEnum):
    """How the motion is computed."""

    direct = "direct"
    harmonic = "harmonic"


ScenarioArgument = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A scenario file, or a built-in's name.")
]
DurationOption = Annotated[
    str | None, typer.Option(help="Length of the run in s (or '2 min'), instead of the scenario's.")
]
AnglesOption = Annotated[
    str | None,
    typer.Option(help="'30 deg, -30 deg, ...' (or rad), instead of the scenario's."),
]
FolderOption = Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")]


def main() -> None:
    """Entry point: one clear message for bad input, no traceback; Ctrl-C ends with status 1."""
    signal.signal(signal.SIGINT, _on_interrupt)
    try:
        app()
    except Exception as error:
        from quietbus.scenario import ScenarioError  # here, so that --help need not load it

        if not isinstance(error, ScenarioError | _BadInput):
            raise
        told = _Asked.told(error) if isinstance(error, ScenarioError) else error
        print(f"quietbus: {told}", file=sys.stderr)
        sys.exit(BAD_INPUT)


class _Stop:
    """What Ctrl-C does. Set as a flag: an exception in the middle of JAX would be lost or worse."""

    keeping = False  # a run is under way, whose results are to be kept
    asked = False


def _on_interrupt(_signal: int, _frame: object) -> None:
    # os.write, since Python's own buffers may be in use where the signal comes in between
    if _Stop.keeping and not _Stop.asked:
        _Stop.asked = True
        os.write(
            2, b"\nquietbus: stopping and keeping what is computed; Ctrl-C again quits at once\n"
        )
        return
    os.write(2, b"\nquietbus: interrupted\n")
    os._exit(FAILED)


@contextmanager
def _keeping_results() -> Iterator[None]:
    """From here the first Ctrl-C stops the run, not the program."""
    _Stop.keeping, _Stop.asked = True, False
    try:
        yield
    finally:
        _Stop.keeping = False


class _BadInput(Exception):
    """Something that the user asked for and that cannot be; the message says what."""


class _Asked:
    """The scenario in work, so that what is found wrong with it later is told of its file too."""

    file: str = ""
    names: tuple[str, ...] = ()  # under which it tells of its problems
    options: ClassVar[dict[str, str]] = {}  # of the command line, by the path that each has set

    @classmethod
    def told(cls, error: ScenarioError) -> ScenarioError:
        """With the file and its lines, or with the options in whose values the fault lies."""
        from quietbus.scenario import ScenarioError, located
        from quietbus.scenario.errors import dotted

        if error.source not in cls.names:
            return error
        by_option = [
            option
            for path, option in cls.options.items()
            if any(dotted(problem.path).startswith(path) for problem in error.problems)
        ]
        if by_option:
            return ScenarioError(f"{cls.file} with {', '.join(by_option)}", error.problems)
        return located(error, cls.file)


@app.command()
def init(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The scenario file to write.")],
) -> None:
    """Write a commented scenario to start from."""
    from quietbus.scenario import template_text

    _check_folder(file.parent)
    try:
        with file.open("x", encoding="utf-8") as new:
            new.write(template_text())
    except FileExistsError:
        raise _BadInput(f"{file}: exists already; choose another name") from None
    except OSError as error:
        raise _BadInput(f"{file}: cannot be written: {error.strerror}") from None
    print(f"wrote {file}; next: quietbus compare {file}")


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
) -> None:
    """Simulate a scenario; write the run and print what one wants to know of it."""
    checked = _load(scenario, mount, duration, output_rate)
    _import_heavy()
    from quietbus import api
    from quietbus.results import summarize
    from quietbus.solve.harmonic import ResonanceError
    from quietbus.tables import summary_table

    chosen = checked.isolator.mount
    name = f"{re.sub(r'[^A-Za-z0-9._-]+', '-', checked.name)}-{chosen}"
    output = output or Path(f"{name}-harmonic.nc" if method == Method.harmonic else f"{name}.nc")
    _check_file(output)
    if joint_forces and method == Method.harmonic:
        raise _BadInput("--joint-forces needs --method direct")
    if joint_forces and chosen == Mount.rigid:
        raise _BadInput("--joint-forces needs the isolated mount: a rigid one leaves them open")
    failed = ""
    with _keeping_results():
        with _progress({chosen: checked.simulation.duration}) as tell, _notes():
            try:
                run = api.simulate(
                    checked,
                    method.value,
                    output_rate=checked.simulation.output_rate if output_rate else None,
                    joint_forces=joint_forces,
                    progress=lambda t: tell(chosen, t),
                )
            except api.SimulationError as error:
                run, failed = error.run, str(error)
            except ResonanceError as error:
                raise _BadInput(f"{scenario}: {error}") from None
        troubles = _save(run, output)
    if run.sizes["time"] > 1:
        _print(summary_table({chosen: summarize(run)}))
    else:
        print("one instant only, so there is no table")
    if run.attrs["status"] != "complete":
        troubles.append(f"the run is not complete: {run.attrs['stop_reason']}")
    elif failed:
        troubles.append(failed)
    if troubles:
        _fail("; ".join(troubles))


@app.command()
def compare(
    scenario: ScenarioArgument,
    output: FolderOption = Path("out"),
    duration: DurationOption = None,
) -> None:
    """Simulate with the isolator and without, side by side, with pictures."""
    checked = _load(scenario, None, duration)
    _make_folder(output)
    _import_heavy()
    from quietbus import api
    from quietbus.plots import compare_figures, run_figures, save_figures
    from quietbus.results import summarize
    from quietbus.tables import summary_table

    with _keeping_results():
        with _progress(dict.fromkeys(Mount, checked.simulation.duration)) as tell, _notes():
            runs = api.compare(checked, progress=tell)
        troubles = []
        for mount, run in runs.items():
            troubles += _save(run, output / f"{mount}.nc")
            if run.attrs["status"] != "complete":
                troubles.append(f"the {mount} run is not complete: {run.attrs['stop_reason']}")
    if _Stop.asked:
        print(f"no pictures of an interrupted comparison; `quietbus plot {output}/isolated.nc`")
    elif all(run.sizes["time"] > 1 for run in runs.values()):
        summaries = {str(mount): summarize(run) for mount, run in runs.items()}
        _print(summary_table(summaries))
        numbers = {mount: summary.to_dict() for mount, summary in summaries.items()}
        (output / "summary.json").write_text(json.dumps(numbers, indent=2) + "\n")
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
        _fail("; ".join(troubles))


@app.command()
def plot(
    run: Annotated[Path, typer.Argument(metavar="RUN.nc", help="A run of `quietbus simulate`.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder; default RUN's name.")
    ] = None,
    suffix: Annotated[str, typer.Option("--format", help="png, svg or pdf.")] = "png",
) -> None:
    """Draw the pictures of a run."""
    if suffix not in ("png", "svg", "pdf"):
        raise _BadInput(f"--format: expected png, svg or pdf, got '{suffix}'")
    from quietbus.plots import run_figures, save_figures
    from quietbus.results import load_run

    try:
        loaded = load_run(run)
    except (FileNotFoundError, ValueError) as error:
        raise _BadInput(str(error)) from None
    folder = output or run.with_suffix("")
    _make_folder(folder)
    for path in save_figures(run_figures(loaded), folder, f".{suffix}"):
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
        raise _BadInput(str(error)) from None
    scenario = scenario_of(loaded)
    page = output or run.with_suffix(".html")
    _check_file(page)
    if page.resolve() == run.resolve():
        raise _BadInput(f"{page}: is the run itself; expected another name for the page")
    try:
        from quietbus.report import write_report

        checks = _checks(scenario, None) if check else None
    except ImportError as error:
        _fail(str(error))
    try:
        write_report(loaded, page, checks)
    except OSError as error:
        _fail(f"{page}: cannot be written: {error.strerror or error}")
    print(f"wrote {page}")
    _fail_unless_passed(checks or [])


@app.command()
def validate(
    scenario: ScenarioArgument,
    export: Annotated[
        Path | None, typer.Option(help="Also write the satellite as a MuJoCo model (XML).")
    ] = None,
    mount: Annotated[Mount | None, typer.Option(help="Instead of the scenario's mount.")] = None,
) -> None:
    """Check a scenario against an independent engine (MuJoCo) and conservation laws."""
    checked = _load(scenario, mount, None)
    if export is not None:
        _check_file(export)
    from quietbus.tables import checks_table

    try:
        checks = _checks(checked, export)
    except ImportError as error:
        _fail(str(error))
    _print(checks_table(f"{checked.name}, {checked.isolator.mount}", checks))
    _fail_unless_passed(checks)
    print(f"all {len(checks)} checks passed (errors are relative)")


def _checks(scenario: Scenario, export: Path | None) -> list[Check]:
    """Check a scenario, and write it as a MuJoCo model if wanted; ImportError without MuJoCo."""
    _import_heavy()
    from quietbus import validate as checking
    from quietbus.build import build_initial_state, build_satellite

    satellite = build_satellite(scenario)
    state = build_initial_state(scenario, satellite)
    if export is not None:
        export.write_text(checking.write_mjcf(satellite, state), encoding="utf-8")
        print(f"wrote {export}")
    if satellite.disturbance is not None or satellite.motor is not None:
        print("checked without the rotors' disturbances and the gimbal motors' ripple")
    with _status() as tell:
        return checking.validate(satellite, state, progress=tell)


def _fail_unless_passed(checks: Sequence[Check]) -> None:
    failed = [check.name for check in checks if not check.passed]
    if failed:
        _fail(f"{len(failed)} of {len(checks)} checks failed: {', '.join(failed)}")


@app.command()
def analyze(
    scenario: ScenarioArgument,
    output: FolderOption = Path("out"),
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else; no pictures.")
    ] = False,
    gimbal_angles: AnglesOption = None,
) -> None:
    """Modes, isolator channels, gain range and margins: per axis and of the whole satellite."""
    checked = _at_angles(_load(scenario, None, None), gimbal_angles)
    if not as_json:
        _make_folder(output)
    _import_heavy()
    from quietbus import api
    from quietbus.dynamics.linearize import OperatingPointError

    try:
        study = api.analyze(checked)
        if as_json:
            print(json.dumps(study.to_dict(), indent=2, allow_nan=False))
            return
        _print_analysis(study, output)
    except OperatingPointError as error:
        raise _BadInput(f"{scenario}: {error}") from None


def _print_analysis(study: Study, output: Path) -> None:
    from quietbus.plots import analysis_figures
    from quietbus.tables import analysis_tables

    for part in analysis_tables(study):
        print(part) if isinstance(part, str) else _print(part)
    _write_study("analysis", study.to_dict(), lambda: analysis_figures(study), output)


def _write_study(
    name: str, numbers: Mapping[str, Any], draw: Callable[[], dict[str, Figure]], output: Path
) -> None:
    """NAME.json and the pictures of a study into a folder."""
    from quietbus.plots import save_figures

    with _status() as tell:
        tell("drawing")
        figures = draw()
        save_figures(figures, output)
    (output / f"{name}.json").write_text(json.dumps(numbers, indent=2) + "\n")
    print(f"wrote {name}.json and {len(figures)} pictures to {output}/")


@app.command()
def jitter(
    scenario: ScenarioArgument,
    output: FolderOption = Path("out"),
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else; no pictures.")
    ] = False,
    gimbal_angles: AnglesOption = None,
    max_speed: Annotated[
        str | None,
        typer.Option(help="'7000 rpm' of the fastest rotor, end of the sweep; default 1.2 x own."),
    ] = None,
) -> None:
    """Jitter at each rotor order with the isolator and without, and over the rotors' speed."""
    checked = _at_angles(_load(scenario, None, None), gimbal_angles)
    most = None if max_speed is None else _speed(max_speed)
    if not as_json:
        _make_folder(output)
    _import_heavy()
    from quietbus import api

    try:
        with _status() as tell:
            tell("computing (compiles for some seconds the first time)")
            study = api.jitter(checked)
            numbers = study.to_dict(most)
    except ValueError as error:
        raise _BadInput(f"{scenario}: {error}") from None
    if as_json:
        print(json.dumps(numbers, indent=2, allow_nan=False))
        return
    from quietbus.tables import jitter_tables

    for table in jitter_tables(numbers):
        _print(table)
    _write_study("jitter", numbers, lambda: _jitter_pictures(study, most), output)


def _jitter_pictures(study: JitterStudy, max_speed: float | None) -> dict[str, Figure]:
    from quietbus.plots import jitter_figures, sweep_figures

    figures = jitter_figures(study)
    if not study.frequency.any():  # no rotor turns
        return figures
    return figures | sweep_figures(study.sweep(max_speed), study.scenario.name)


def _speed(text: str) -> float:
    """A positive angular velocity [rad/s]."""
    from pydantic_core import PydanticCustomError

    from quietbus.scenario.units import Quantity

    try:
        return Quantity("an angular velocity", "rad/s", above=0.0).read(text)
    except PydanticCustomError as error:
        raise _BadInput(f"--max-speed: {error}") from None


@app.command("import")
def import_(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="CSV, S2E's .ini or .csv, 42's Whl_*.txt.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="YAML file, replaced if old; default: print."),
    ] = None,
    kind: Annotated[
        str | None, typer.Option(help="radial_force, ...; where the file does not say it.")
    ] = None,
) -> None:
    """A harmonic table of a rotor as the scenario's block `disturbance`."""
    from quietbus.scenario import read_wheel_table
    from quietbus.scenario.wheel_files import KINDS

    if kind is not None and kind not in KINDS:
        raise _BadInput(f"--kind: expected one of {', '.join(KINDS)}, got '{kind}'")
    table = read_wheel_table(file, kind)
    for lost in table.lost:
        print(f"note: not taken over: {lost}", file=sys.stderr)
    for note in table.notes:
        print(f"note: {note}", file=sys.stderr)
    _write_block(table.to_yaml(), output)


def _write_block(text: str, output: Path | None) -> None:
    if output is None:
        print(text, end="")
        return
    _check_file(output)
    output.write_text(text, encoding="utf-8")
    print(f"wrote {output}")


@app.command()
def fit(
    file: Annotated[
        Path, typer.Argument(metavar="MAP", help="A measured waterfall, CSV or NetCDF.")
    ],
    output: FolderOption = Path("out"),
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else; no pictures.")
    ] = False,
    most: Annotated[int, typer.Option(min=1, help="Orders looked for in each component.")] = 20,
) -> None:
    """Fit orders, resonances and broadband floor to a measured speed-frequency map of a rotor."""
    from quietbus.analysis.waterfall import FitError
    from quietbus.measured import fit_waterfall

    if not as_json:
        _make_folder(output)
    try:
        with _status() as tell:
            tell("fitting")
            fitted = fit_waterfall(file, most)
    except FitError as error:
        raise _BadInput(f"{file}: {error}") from None
    if as_json:
        print(json.dumps(fitted.to_dict(), indent=2, allow_nan=False))
        return
    from quietbus.plots.waterfall import waterfall_figures
    from quietbus.tables import fit_tables

    for table in fit_tables(fitted):
        _print(table)
    (output / "disturbance.yaml").write_text(fitted.to_yaml(), encoding="utf-8")
    _write_study("fit", fitted.to_dict(), lambda: waterfall_figures(fitted), output)


@app.command()
def verify(
    scenario: ScenarioArgument,
    output: FolderOption = Path("out"),
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else; no pictures.")
    ] = False,
    method: Annotated[
        Method,
        typer.Option(help="harmonic: over all rotor phases; direct: one run, every rotor turn."),
    ] = Method.harmonic,
    mount: Annotated[Mount | None, typer.Option(help="Instead of the scenario's mount.")] = None,
    duration: DurationOption = None,
) -> None:
    """Judge the scenario's pointing requirements: value, margin, verdict. Status 1: one not met."""
    checked = _load(scenario, mount, duration)
    if not checked.requirements:
        from quietbus.scenario.pointing import NO_REQUIREMENTS

        raise _BadInput(f"{scenario}: requirements: {NO_REQUIREMENTS}")
    if not as_json:
        _make_folder(output)
    _import_heavy()
    from quietbus import api
    from quietbus.solve.harmonic import ResonanceError

    try:
        with _progress({method.value: checked.simulation.duration}) as tell, _notes():
            verification = api.verify(
                checked, method.value, progress=lambda t: tell(method.value, t)
            )
    except api.SimulationError as error:
        _fail(str(error))
    except ResonanceError as error:
        raise _BadInput(f"{scenario}: {error}") from None
    numbers = verification.to_dict()
    if as_json:
        print(json.dumps(numbers, indent=2, allow_nan=False))
    else:
        from quietbus.plots import pointing_figures
        from quietbus.tables import verification_tables

        for part in verification_tables(numbers):
            print(part) if isinstance(part, str) else _print(part)
        _write_study("verification", numbers, lambda: pointing_figures(verification), output)
    missed = [f"{v.name} of {v.line_of_sight}" for v in verification.verdicts if not v.met]
    if missed:
        _fail(f"{len(missed)} of {len(verification.verdicts)} not met: {'; '.join(missed)}")


@app.command()
def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="Name of a paper: zhang2012.")],
    output: FolderOption = Path("reproduction"),
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Make everything again, also what is made already.")
    ] = False,
) -> None:
    """Make every figure and number of a paper again; what is made is kept for the next start."""
    from quietbus.reproduce import PAPERS

    if paper not in PAPERS:
        raise _BadInput(f"unknown paper '{paper}'; known: {', '.join(PAPERS)}")
    _make_folder(output)
    _import_heavy()
    from quietbus.reproduce import load_paper
    from quietbus.reproduce.pages import verdicts_table
    from quietbus.reproduce.paper import reproduce as make

    with _keeping_results(), _fraction() as tell, _notes():
        try:
            outcome = make(load_paper(paper), output, tell, fresh)
        except OSError as error:
            raise _BadInput(f"{output}: cannot be written: {error.strerror or error}") from None
    _print(verdicts_table(outcome.table))
    print(
        f"{len(outcome.made)} figures made, {len(outcome.kept)} kept from before; wrote report.md, "
        f"table.md and table.json to {output}/"
    )
    if outcome.interrupted:
        _fail("interrupted; start again to continue here")
    if outcome.failed:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in outcome.failed.items())
        _fail(f"{len(outcome.failed)} figures failed: {reasons}")


def _at_angles(scenario: Scenario, gimbal_angles: str | None) -> Scenario:
    if gimbal_angles is None:
        return scenario
    angles = [angle.strip() for angle in gimbal_angles.split(",")]
    _Asked.options = _Asked.options | {"cluster.gimbal_angles": "--gimbal-angles"}
    return scenario.with_overrides({"cluster.gimbal_angles": angles})


def _load(
    name: str, mount: Mount | None, duration: str | None, output_rate: str | None = None
) -> Scenario:
    """The scenario with the command line's values instead of its own."""
    from quietbus.scenario import load_scenario

    given = {
        "isolator.mount": ("--mount", mount and mount.value),
        "simulation.duration": ("--duration", duration),
        "simulation.output_rate": ("--output-rate", output_rate),
    }
    given = {path: said for path, said in given.items() if said[1] is not None}
    scenario = load_scenario(name)
    _Asked.file, _Asked.names = name, (scenario.name, f"{scenario.name} with overrides")
    _Asked.options = {path: option for path, (option, _) in given.items()}
    return scenario.with_overrides({path: value for path, (_, value) in given.items()})


def _import_heavy() -> None:
    """JAX takes a second or two to load; say so."""
    if sys.stderr.isatty():
        with _status() as tell:
            tell("loading JAX")
            import quietbus.api
    import quietbus.api  # noqa: F401


def _print(table: Table) -> None:
    from rich.console import Console

    Console().print(table)


@contextmanager
def _progress(runs: Mapping[str, float]) -> Iterator[Callable[[str, float], None]]:
    """A bar per run on standard error: simulated time, remaining time."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description:>22}"),
        BarColumn(),
        TextColumn("{task.completed:g} of {task.total:g} s"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bars:
        tasks = {run: bars.add_task(f"{run}: compiling", total=t) for run, t in runs.items()}

        def tell(run: str, t: float) -> None:
            bars.update(tasks[run], completed=t, description=run)
            if _Stop.asked:
                raise KeyboardInterrupt

        yield tell


@contextmanager
def _fraction() -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error for one thing after the other, each from 0 to 1."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:>40}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("", total=1.0)

        def tell(what: str, fraction: float) -> None:
            bars.update(task, completed=fraction, description=what)
            if _Stop.asked:
                raise KeyboardInterrupt

        yield tell


@contextmanager
def _status() -> Iterator[Callable[[str], None]]:
    """A line on standard error that says what is being done."""
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        yield lambda text: status.update(text)


@contextmanager
def _notes() -> Iterator[None]:
    """Warnings of the package as notes on standard error, after the progress bars."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for warning in caught:
        if warning.category.__name__ == "QuietbusWarning":
            print(f"note: {warning.message}", file=sys.stderr)


def _save(run: xr.Dataset, output: Path) -> list[str]:
    """Write a run; where that fails, to the folder for temporary files, so that it is not lost.

    What went wrong, for the user, or nothing.
    """
    from quietbus.results import save_run

    try:
        save_run(run, output)
    except OSError as error:
        refuge = Path(tempfile.mkdtemp(prefix="quietbus-")) / output.name
        save_run(run, refuge)
        return [f"{output}: cannot be written: {error.strerror or error}; the run is in {refuge}"]
    print(f"wrote {output}")
    return []


def _check_folder(folder: Path) -> None:
    if not folder.is_dir():
        raise _BadInput(f"{folder}: no such folder")


def _check_file(file: Path) -> None:
    """Refuse a file that cannot be written, before anything is computed for it."""
    _check_folder(file.parent)
    if file.is_dir():
        raise _BadInput(f"{file}: is a folder; expected the name of a file")
    _check_writable(file.parent, file)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise _BadInput(f"{folder}: is a file; expected the name of a folder") from None
    except OSError as error:
        raise _BadInput(f"{folder}: cannot be made: {error.strerror}") from None
    _check_writable(folder, folder)


def _check_writable(folder: Path, wanted: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _BadInput(f"{wanted}: cannot be written: {error.strerror or error}") from None


def _fail(message: str) -> NoReturn:
    print(f"quietbus: {message}", file=sys.stderr)
    raise typer.Exit(FAILED)
