"""The page of a run: its pictures, numbers, scenario and where it comes from, in one HTML text."""

import datetime
import importlib.metadata
import importlib.resources
import os
import platform
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from rich.table import Table

try:
    import jinja2
    import plotly.offline

    from quietbus.report.figures import is_harmonic, pictures
    from quietbus.report.lines import Picture
except ModuleNotFoundError as missing:
    if (missing.name or "").partition(".")[0] not in ("jinja2", "plotly"):
        raise
    raise ImportError(
        "quietbus report needs the extra: pip install 'quietbus[report]'"
    ) from missing
from quietbus.results import aliasing, has_gimbals, scenario_of, summarize
from quietbus.tables.checks import checks_table
from quietbus.tables.runs import summary_table
from quietbus.words import visible_lines
from quietbus.writing import check_target, write_text

if TYPE_CHECKING:
    from quietbus.validate import Check

MAKERS = ("quietbus", "jax", "diffrax", "numpy", "scipy", "xarray", "plotly")
# attributes of a run: their names for people; any other is shown under its own
_ATTRIBUTES = {
    "quietbus_version": "quietbus",
    "method": "method",
    "solver": "solver",
    "relative_tolerance": "relative tolerance",
    "absolute_tolerance": "absolute tolerance, SI units",
    "steps": "steps, rejected ones included",
    "rejected_steps": "rejected steps",
    "wall_time_s": "wall time, compilation included [s]",
    "created": "created (UTC)",
}
_ELSEWHERE = ("title", "scenario", "mount", "status", "stop_reason")


def report_page(run: xr.Dataset, checks: "Sequence[Check] | None" = None) -> str:
    """A run as one HTML page that needs no other file and no network.

    Args:
        run: of ``qb.simulate`` or ``qb.load_run``.
        checks: of ``quietbus.validate.validate`` on the run's scenario; without them the page says
            that they were not run.

    Raises:
        ScenarioError: the run's scenario is not valid.
    """
    scenario = scenario_of(run)
    shown, buckets = pictures(run)
    time = run["time"].to_numpy()
    several = len(time) > 1
    name = f"{scenario.name}, {run.attrs['mount']}"
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    folder = importlib.resources.files("quietbus.report")
    template = environment.from_string((folder / "page.html.jinja").read_text(encoding="utf-8"))
    return template.render(
        name=scenario.name,
        mount=run.attrs["mount"],
        status=run.attrs.get("status", "unknown"),
        reason=visible_lines(run.attrs.get("stop_reason", "")),
        reached=f"{time[-1]:.6g}",
        duration=f"{scenario.simulation.duration:.6g}",
        facts=_facts(run),
        harmonic=is_harmonic(run),
        aliasing="" if is_harmonic(run) else aliasing(scenario),
        numbers=_cells(summary_table({run.attrs["mount"]: summarize(run)})) if several else None,
        pictures=[_embedded(picture) for picture in shown],
        instants=len(time),
        buckets=buckets,
        checks=_cells(checks_table(name, checks)) if checks else None,
        failed=[check.name for check in checks or () if not check.passed],
        scenario=visible_lines(run.attrs["scenario"]),
        provenance=_provenance(run),
        makers=_makers(),
        made=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        plotlyjs=plotly.offline.get_plotlyjs(),
    )


def write_report(
    run: xr.Dataset, path: str | os.PathLike[str], checks: "Sequence[Check] | None" = None
) -> None:
    """Write ``report_page``; an older page of that name is replaced once the new one is whole.

    Raises:
        OutputError: (an OSError) the page cannot be written, or is no page and so not replaced.
    """
    check_target(path, "page (HTML)")
    write_text(path, report_page(run, checks), "page (HTML)")


def _embedded(picture: Picture) -> dict[str, str]:
    """A picture for the template: its figure as JSON, or the reason why there is none."""
    words = {"name": picture.name, "title": picture.title, "caption": picture.caption}
    if isinstance(picture.content, str):
        return words | {"json": "", "reason": picture.content}
    return words | {
        # no "<" inside a script, where it could end it
        "json": picture.content.to_json().replace("<", "\\u003c"),
        "height": f"{picture.content.layout.height}",
    }


def _cells(table: Table) -> dict[str, Any]:
    """A terminal table's title, headings and rows, with the columns that hold numbers."""
    return {
        "title": str(table.title),
        "columns": [str(column.header) for column in table.columns],
        "numeric": [column.justify == "right" for column in table.columns],
        "rows": list(zip(*(list(column.cells) for column in table.columns), strict=True)),
    }


def _facts(run: xr.Dataset) -> dict[str, str]:
    """What one wants to know first of a run."""
    time = run["time"].to_numpy()
    rate = f", {(len(time) - 1) / (time[-1] - time[0]):.6g} Hz" if len(time) > 1 else ""
    facts = {
        "Mount": run.attrs["mount"],
        "Method": run.attrs.get("method", "unknown"),
        "Time flown": f"{time[-1]:.6g} s",
        "Output": f"{len(time)} instant{'s' if len(time) > 1 else ''}{rate}",
        "CMGs" if has_gimbals(run) else "Wheels": f"{run.sizes['cmg']}",
        "Legs": f"{run.sizes['leg']}",
    }
    if "wall_time_s" in run.attrs:
        facts["Wall time"] = f"{run.attrs['wall_time_s']:.3g} s"
    return facts


def _provenance(run: xr.Dataset) -> dict[str, str]:
    """The run's attributes by their names for people."""
    known = {words: run.attrs[name] for name, words in _ATTRIBUTES.items() if name in run.attrs}
    others = run.attrs.keys() - _ATTRIBUTES.keys() - set(_ELSEWHERE)
    values = known | {name: run.attrs[name] for name in sorted(others)}
    return {
        name: f"{value:.4g}"
        if isinstance(value, float | np.floating)
        else visible_lines(str(value))
        for name, value in values.items()
    }


def _makers() -> dict[str, str]:
    """Versions of what made the page."""
    versions = {name: importlib.metadata.version(name) for name in MAKERS}
    return versions | {"python": platform.python_version(), "system": platform.platform()}
