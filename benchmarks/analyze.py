"""How long the linear analysis takes: warm, cold, and for a map of a thousand isolator designs.

Warm is linearisation, channels, all loops and the coupled loop with its disk margin. Cold is the
command `quietbus analyze zhang2012 --json`: once with an empty compilation cache, once with a full.
"""

import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version

import numpy as np

import quietbus as qb
from quietbus.analysis.control.controlled import controlled
from quietbus.analysis.control.coupled import analyze_coupled
from quietbus.analysis.control.designs import map_designs
from quietbus.analysis.control.margins import analyze_loop
from quietbus.studies.linear import Study

REPEATS = 20


def best(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """Shortest of several times [s], after one run to warm up."""
    work()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


def command(cache: str) -> float:
    """Time [s] of the command in a process of its own."""
    started = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "quietbus", "analyze", "zhang2012", "--json"],
        env=os.environ | {"JAX_COMPILATION_CACHE_DIR": cache},
        stdout=subprocess.DEVNULL,
        check=True,
    )
    return time.perf_counter() - started


def main() -> None:
    """Print the table."""
    study = qb.analyze("zhang2012")
    model, loops, channel = study.linear(), study.loops, study.channels.x.symbolic
    assert loops is not None
    assert study.pid is not None
    assert channel is not None
    pid = study.pid

    def everything() -> None:
        fresh = Study(study.scenario, study.gimbal_angle)
        fresh.__dict__["satellite"] = study.satellite  # built once; only numbers of it change
        _ = fresh.loop_analyses, fresh.coupled

    rng = np.random.default_rng(0)
    k, c = rng.uniform(5e3, 5e4, 1000), rng.uniform(100.0, 2000.0, 1000)
    rows = {
        "linearisation": best(study.linear),
        "three loops per axis": best(lambda: [analyze_loop(loop) for loop in loops.values()]),
        "coupled loop, disk margin": best(lambda: analyze_coupled(controlled(model, pid))),
        "all of it, warm": best(everything),
        "1000 designs (k, c)": best(lambda: map_designs(channel, k, c, 1100.0, pid), 2),
        "1000 designs with delay": best(
            lambda: map_designs(channel, k, c, 1100.0, pid, delay=0.02), 1
        ),
    }
    with tempfile.TemporaryDirectory() as cache:
        rows["command, nothing compiled yet"] = command(cache)
        rows["command, compiled before"] = command(cache)
    packages = ", ".join(f"{name} {version(name)}" for name in ("quietbus", "jax", "numpy"))
    print(f"{packages}; {platform.machine()}, {os.cpu_count()} cores")
    for name, seconds in rows.items():
        print(f"{name:32} {1e3 * seconds:9.1f} ms")


if __name__ == "__main__":
    main()
