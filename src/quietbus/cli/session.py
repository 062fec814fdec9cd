"""What a command shows while it works, and how Ctrl-C and SIGTERM stop it."""

from __future__ import annotations

import gc
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from quietbus.cli.guard import FAILED, remove_empty_folders
from quietbus.words import visible_lines

if TYPE_CHECKING:
    from rich.table import Table

    from quietbus.scenario import Scenario


class Stop:
    """What Ctrl-C and SIGTERM do: a flag, since an exception amid JAX would be lost or worse."""

    keeping = False  # a run is under way, whose results are to be kept
    asked = False


def on_interrupt(number: int, _frame: object) -> None:
    # os.write, since Python's own buffers may be in use where the signal comes in between
    if Stop.keeping and not Stop.asked:
        Stop.asked = True
        again = b"; Ctrl-C again quits at once" if number == signal.SIGINT else b""
        os.write(2, b"\nquietbus: stopping and keeping what is computed" + again + b"\n")
        return
    os.write(2, b"\nquietbus: interrupted\n")
    remove_empty_folders()
    os._exit(FAILED)


@contextmanager
def keeping_results() -> Iterator[None]:
    """From here the first Ctrl-C or SIGTERM stops the run, not the program."""
    Stop.keeping, Stop.asked = True, False
    try:
        yield
    finally:
        Stop.keeping = False


def import_heavy() -> None:
    """JAX takes a second or two to load; say so."""
    gc.disable()  # nothing of what is loaded is garbage
    if sys.stderr.isatty():
        with status() as tell:
            tell("loading JAX")
            import quietbus.api
    import jax

    import quietbus.api  # noqa: F401
    from quietbus.asked import ImplausibleValue

    if jax.config.jax_disable_jit:  # type: ignore[attr-defined]
        print(
            "note: JAX_DISABLE_JIT is set, so nothing is compiled: a flight of 10 ms takes minutes",
            file=sys.stderr,
        )
    gc.freeze()
    gc.enable()
    # what is odd in a scenario has been told when it was read
    warnings.simplefilter("ignore", ImplausibleValue)


@contextmanager
def progress(runs: Mapping[str, float]) -> Iterator[Callable[[str, float], None]]:
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
        TextColumn("{task.description:>22}", markup=False),
        BarColumn(),
        TextColumn("{task.completed:g} of {task.total:g} s"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True, markup=False, emoji=False)) as bars:
        tasks = {run: bars.add_task(f"{run}: compiling", total=t) for run, t in runs.items()}

        def tell(run: str, t: float) -> None:
            bars.update(tasks[run], completed=t, description=run)
            if Stop.asked:
                raise KeyboardInterrupt

        yield tell


@contextmanager
def fraction() -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error for one thing after the other, each from 0 to 1."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:>40}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True, markup=False, emoji=False)) as bars:
        task = bars.add_task("", total=1.0)

        def tell(what: str, fraction: float) -> None:
            bars.update(task, completed=fraction, description=what)
            if Stop.asked:
                raise KeyboardInterrupt

        yield tell


@contextmanager
def status() -> Iterator[Callable[[str], None]]:
    """A line on standard error that says what is being done."""
    from rich.console import Console
    from rich.text import Text

    with Console(stderr=True, markup=False, emoji=False).status("") as status:
        yield lambda text: status.update(Text(text))


@contextmanager
def notes() -> Iterator[None]:
    """Warnings of the package as notes on standard error, after the progress bars."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for warning in caught:
        if warning.category.__name__ == "QuietbusWarning":
            print(f"note: {visible_lines(str(warning.message))}", file=sys.stderr)


def print_table(table: Table) -> None:
    from rich.console import Console

    Console(markup=False, emoji=False).print(table)


def show_as_read(scenario: Scenario) -> None:
    """The main values that a command goes by."""
    from quietbus.tables.runs import as_read_table

    print_table(as_read_table(scenario))
