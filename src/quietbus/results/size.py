"""How large a run will be, so that a disk with too little room is told before anything is flown."""

import math
import os
import pathlib
import shutil

from quietbus.results.schema import (
    CHANGING_VARIABLES,
    COMBINED,
    CONTROL_VARIABLES,
    JOINT_VARIABLES,
    jitter_variables_of,
    variables_of,
)
from quietbus.results.task import Task
from quietbus.writing import OutputError

DOUBLE = 8  # [bytes]


def expected_size(task: Task) -> int:
    """Of a run in memory and in its file [bytes], but for its attributes and spectra."""
    scenario, units = task.scenario, task.scenario.units
    sizes = {
        "axis": 3,
        "quaternion": 4,
        "cmg": units.count,
        "leg": scenario.legs,
        "order": len(units.orders),
        "point": len(task.points),
        "line": len(task.lines_of_sight),
    }
    tables = [variables_of(scenario.bodies), CONTROL_VARIABLES]
    if units.speeds_change:
        tables.append(CHANGING_VARIABLES)
    if task.joint_forces:
        tables.append(JOINT_VARIABLES)
    dimensions = [inner for table in tables for inner, _, _ in table.values()]
    if task.method.jitter_apart:
        for inner, _, _ in jitter_variables_of(scenario.bodies).values():
            dimensions += [("cmg", "order", *inner)] * 2 + [inner] * len(COMBINED)
    row = 1 + sum(math.prod(sizes[name] for name in inner) for inner in dimensions)
    rows = scenario.simulation.duration * scenario.simulation.output_rate + 1.0
    return int(DOUBLE * row * rows)


def check_space(checkpoint: str | os.PathLike[str], task: Task) -> None:
    """Refuse to begin a run whose disk has no room for it and its checkpoint.

    Raises:
        OutputError: with what is needed and what is there.
    """
    path = pathlib.Path(checkpoint)
    needed, there = 2 * expected_size(task), path.stat().st_size if path.exists() else 0
    try:
        free = shutil.disk_usage(path.parent).free + there
    except OSError:
        return  # no disk that could tell
    if needed > free:
        raise OutputError(
            f"{path.parent}: too little room: the run and its checkpoint need about "
            f"{needed / 1e6:.4g} MB, {free / 1e6:.4g} MB are free; a shorter duration or a lower "
            "output rate needs less"
        )
