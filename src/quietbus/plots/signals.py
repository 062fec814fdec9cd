"""What pictures of runs share: lines of the mounts, names of axes, headings."""

from typing import Any

import xarray as xr

from quietbus.plots.style import COLOURS, DASHES

AXES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "yaw")
# mount: (what it is called, its line)
LINES: dict[str, tuple[str, dict[str, Any]]] = {
    "rigid": ("without platform (rigid mount)", {"color": COLOURS[1], "linestyle": "-"}),
    "isolated": ("with platform", {"color": COLOURS[0], "linestyle": DASHES[1]}),
}


def heading(run: xr.Dataset, what: str) -> str:
    """Title of a picture of a run."""
    title = run.attrs.get("title", run.attrs["mount"])  # a run that others have made may lack it
    return f"{what} ({title}{cut_short(run)})"


def cut_short(run: xr.Dataset) -> str:
    """That a run ended before its time, and when; empty if it did not."""
    status = run.attrs.get("status", "complete")
    return "" if status == "complete" else f", {status} at {run['time'].to_numpy()[-1]:.4g} s"
