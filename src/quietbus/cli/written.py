"""What the commands write: runs, and the numbers and pictures of studies."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quietbus.cli.session import status

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def save(run: xr.Dataset, output: Path) -> list[str]:
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


def write_study(
    name: str, numbers: Mapping[str, Any], draw: Callable[[], dict[str, Figure]], output: Path
) -> None:
    """NAME.json and the pictures of a study into a folder."""
    from quietbus.plots import save_figures

    with status() as tell:
        tell("drawing")
        figures = draw()
        save_figures(figures, output)
    (output / f"{name}.json").write_text(json.dumps(numbers, indent=2) + "\n")
    print(f"wrote {name}.json and {len(figures)} pictures to {output}/")
