"""The command of published work: reproduce."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quietbus.cli.app import app
from quietbus.cli.given import FolderOption
from quietbus.cli.guard import BadInput, fail, make_folder
from quietbus.cli.session import fraction, import_heavy, keeping_results, notes, print_table

REPRODUCTION = Path("reproduction")  # folder, unless another is given


@app.command()
def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="Name of a paper: zhang2012.")],
    output: FolderOption = REPRODUCTION,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Make everything again, also what is made already.")
    ] = False,
    partial: Annotated[
        bool, typer.Option("--partial", help="Go on without figures whose extras are missing.")
    ] = False,
) -> None:
    """Make every figure and number of a paper again; what is made is kept for the next start."""
    from quietbus.reproduce import PAPERS

    if paper not in PAPERS:
        raise BadInput(f"unknown paper '{paper}'; known: {', '.join(PAPERS)}")
    make_folder(output, "table.json")
    import_heavy()
    from quietbus.reproduce import load_paper
    from quietbus.reproduce.pages import verdicts_table
    from quietbus.reproduce.paper import MissingExtra
    from quietbus.reproduce.paper import reproduce as make

    with keeping_results(), fraction() as tell, notes():
        try:
            outcome = make(load_paper(paper), output, tell, fresh, partial)
        except MissingExtra as error:
            fail(f"{error}, or make the others alone with --partial; nothing is computed yet")
        except OSError as error:
            raise BadInput(f"{output}: cannot be written: {error.strerror or error}") from None
    print_table(verdicts_table(outcome.table))
    print(
        f"{len(outcome.made)} figures made, {len(outcome.kept)} kept from before; wrote report.md, "
        f"table.md and table.json to {output}/"
    )
    if outcome.interrupted:
        fail("interrupted; start again to continue here")
    if outcome.failed:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in outcome.failed.items())
        fail(f"{len(outcome.failed)} figures failed: {reasons}")
