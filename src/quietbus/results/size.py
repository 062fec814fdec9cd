"""How large a run will be, so that a disk with too little room is told before anything is flown."""

import math
import os
import pathlib
import shutil

from quietbus.results.schema import (
    COMBINED,
    CONTROL_VARIABLES,
    JITTER_VARIABLES,
    JOINT_VARIABLES,
    ROTOR_VARIABLES,
    VARIABLES,
)
from quietbus.results.task import Task
from quietbus.scenario.wheels import WheelCluster
from quietbus.writing import OutputError

DOUBLE = 8  # [bytes]


def expected_size(task: Task) -> int:
    """Of a run in memory and in its file [bytes], but for its attributes and spectra."""
    scenario, cluster = task.scenario, task.scenario.cluster
    sizes = {
        "axis": 3,
        "quaternion": 4,
        "cmg": cluster.count,
        "leg": scenario.isolator.legs.count,
        "order": len(cluster.orders),
        "point": len(task.points),
        "line": len(task.lines_of_sight),
    }
    tables = [VARIABLES, CONTROL_VARIABLES]
    if isinstance(cluster, WheelCluster) or cluster.run_up is not None:
        tables.append(ROTOR_VARIABLES)
    if task.joint_forces:
        tables.append(JOINT_VARIABLES)
    dimensions = [inner for table in tables for inner, _, _ in table.values()]
    if task.method.jitter_apart:
        for inner, _, _ in JITTER_VARIABLES.values():
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
