"""The application, on which each family of commands registers its own, and the entry point."""

from __future__ import annotations

import signal
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from quietbus.cli.given import Asked
from quietbus.cli.guard import BAD_INPUT, FAILED, BadInput, remove_empty_folders
from quietbus.cli.own_parts import load_parts
from quietbus.cli.session import on_interrupt
from quietbus.processes import DeviceError
from quietbus.words import visible_lines
from quietbus.writing import OutputError

ORDER = [
    *("init", "simulate", "compare", "plot", "report", "analyze", "jitter", "verify"),
    *("import", "fit", "validate", "reproduce"),
]


class _InOrderOfWork(TyperGroup):
    """Commands as an engineer comes to need them."""

    def list_commands(self, ctx: Any) -> list[str]:
        return sorted(super().list_commands(ctx), key=ORDER.index)


app = typer.Typer(
    cls=_InOrderOfWork,
    name="quietbus",
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
    rich_markup_mode=None,
)


def _print_version(asked: bool) -> None:
    if asked:
        print(f"quietbus {version('quietbus')}")
        raise typer.Exit


@app.callback()
def _common(
    _: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
    parts: Annotated[
        list[Path] | None,
        typer.Option(
            "--parts",
            metavar="FILE.py",
            help="A Python file that registers parts of your own; may be given again.",
        ),
    ] = None,
) -> None:
    """Design, simulate and verify vibration isolation platforms for CMGs on satellites."""
    for file in parts or ():
        load_parts(file)


def main() -> None:
    """Entry point: one clear message for bad input, no traceback; 1 after Ctrl-C and SIGTERM."""
    for ending in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(ending) != signal.SIG_IGN:  # as of a command in a script's background
            signal.signal(ending, on_interrupt)
    try:
        app()
    except OutputError as error:  # a disk that has become full, or the like
        print(f"quietbus: {error}", file=sys.stderr)
        sys.exit(FAILED)
    except Exception as error:
        from quietbus.scenario import ScenarioError  # here, so that --help need not load it

        if not isinstance(error, ScenarioError | BadInput | DeviceError):
            raise
        told = Asked.told(error) if isinstance(error, ScenarioError) else error
        print(f"quietbus: {visible_lines(str(told))}", file=sys.stderr)
        sys.exit(BAD_INPUT)
    finally:
        remove_empty_folders()
