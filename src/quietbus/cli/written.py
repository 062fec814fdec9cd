"""What the commands write: runs, and the numbers and pictures of studies."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quietbus.cli.session import status
from quietbus.writing import OutputError, write_json

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def save(run: xr.Dataset, output: Path) -> list[str]:
    """Write a run; where that fails, elsewhere under a safe name, so that it is not lost.

    What went wrong, for the user, or nothing.
    """
    from quietbus.results import save_run

    try:
        save_run(run, output)
    except (OSError, ValueError) as error:
        told = str(error) if isinstance(error, OutputError) else f"{output}: {error}"
        for folder in (tempfile.gettempdir(), Path.cwd(), Path.home()):
            try:
                refuge = Path(tempfile.mkdtemp(prefix="quietbus-", dir=folder))
                save_run(run, refuge / "run.nc")
            except (OSError, ValueError):
                continue
            return [f"{told}; the run is in {refuge / 'run.nc'}"]
        return [f"{told}; nor is there any other place for the run"]
    print(f"wrote {output}")
    return []


def write_study(
    name: str, numbers: Mapping[str, Any], draw: Callable[[], dict[str, Figure]], output: Path
) -> None:
    """NAME.json and the pictures of a study into a folder."""
    from quietbus.plots import save_figures

    with status() as tell:
        tell("drawing")
        figures = draw()
        save_figures(figures, output)
    write_json(output / f"{name}.json", numbers)
    print(f"wrote {name}.json and {len(figures)} pictures to {output}/")
