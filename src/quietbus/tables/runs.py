"""Tables of a scenario as read, and of runs side by side."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from quietbus.plain import RPM
from quietbus.results.motion import NOISE
from quietbus.scenario.as_read import as_read
from quietbus.tables.parts import AXES, titled

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import numpy as np

    from quietbus.results import Summary
    from quietbus.scenario import Scenario


def as_read_table(scenario: Scenario) -> Table:
    """The main values of a scenario in usual units."""
    table = Table(box=None, show_header=False, title_justify="left")
    table.title = Text(f"{scenario.name}, as read")
    table.add_column()
    table.add_column(overflow="fold")
    for part, values in as_read(scenario):
        table.add_row(part, Text(values))
    return table


def summary_table(summaries: Mapping[str, Summary]) -> Table:
    """The numbers of one run, or of two side by side with their ratio."""
    both = len(summaries) == 2
    first = next(iter(summaries.values()))
    table = titled(f"Residual motion {first.residual_note}")
    table.add_column("")
    table.add_column("unit")
    for mount in summaries:
        table.add_column(mount, justify="right")
    if both:
        table.add_column("isolated / rigid", justify="right")

    def row(name: str, unit: str, value: Callable[[Summary], float], ratio: bool = False) -> None:
        values = [value(summary) for summary in summaries.values()]
        cells = ["n/a" if math.isnan(v) else f"{v:.4g}" for v in values]
        if both:
            known = ratio and not math.isnan(sum(values)) and values[1] > NOISE
            cells.append(f"{100 * values[0] / values[1]:.3g} %" if known else "")
        table.add_row(name, unit, *cells)

    rates = [
        ("rate jitter {}, peak", "residual_rate"),
        ("rate jitter {}, RMS", "residual_rate_rms"),
        ("rate jitter {}, any phases", "worst_phases_rate"),
        ("slow rate {}, peak", "slow_rate"),
    ]
    if all(summary.worst_phases_rate is None for summary in summaries.values()):
        del rates[2]
    for name, field in rates:
        for i, axis in enumerate(AXES):
            value = lambda s, i=i, field=field: _degrees(getattr(s, field), i)  # noqa: E731
            row(name.format(axis), "deg/s", value, ratio=field != "slow_rate")
    row("pointing error at the end", "deg", lambda s: math.degrees(s.pointing_error))
    if first.rotor_speeds is None or first.peak_gimbal_rate > 0.0:
        row("peak gimbal rate", "deg/s", lambda s: math.degrees(s.peak_gimbal_rate))
    if first.rotor_speeds is not None:
        row("least rotor speed", "rpm", lambda s: _rpm(s.rotor_speeds, 0))
        row("largest rotor speed", "rpm", lambda s: _rpm(s.rotor_speeds, 1))
        row("peak rotor torque", "N m", lambda s: _known(s.peak_rotor_torque))
    row("largest strut stroke", "mm", lambda s: 1e3 * s.peak_stroke)
    row("largest strut force", "N", lambda s: s.peak_strut_force)
    row("least singularity measure", "-", lambda s: s.minimum_singularity)
    row("peak control torque", "N m", lambda s: s.peak_control_torque)
    if first.minimum_torque_share is not None:
        row("least torque share", "%", lambda s: 100.0 * _known(s.minimum_torque_share))
    return table


def _degrees(vector: Sequence[float] | None, i: int) -> float:
    return math.nan if vector is None else math.degrees(vector[i])


def _rpm(speeds: np.ndarray | None, i: int) -> float:
    return math.nan if speeds is None else RPM * speeds[i]


def _known(value: float | None) -> float:
    return math.nan if value is None else value
