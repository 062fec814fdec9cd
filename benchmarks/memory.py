"""Peak memory of a long run: 600 s of the built-in satellite at 1 kHz output, both parts of it.

The bound is 1 GiB for the whole process. The run itself is shortened in nothing.
"""

import resource
import tempfile
import time
from pathlib import Path

import quietbus as qb


def peak_mib() -> float:
    """Largest resident size of this process so far [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> None:
    """Print the memory after import, after the run and after writing it."""
    scenario = qb.load_scenario("zhang2012").with_overrides({"simulation.duration": "600 s"})
    qb.simulate(scenario, duration=0.1)
    print(f"imports, compilation and 0.1 s: {peak_mib():.0f} MiB")
    started = time.perf_counter()
    run = qb.simulate(scenario)
    spent = time.perf_counter() - started
    print(f"600 s at 1 kHz: {peak_mib():.0f} MiB, {run.nbytes / 2**20:.0f} MiB of it results")
    print(f"{600.0 / spent:.1f} x real time")
    with tempfile.TemporaryDirectory() as folder:
        qb.save_run(run, Path(folder) / "run.nc")
    print(f"and written to a file: {peak_mib():.0f} MiB (bound: 1024 MiB)")


if __name__ == "__main__":
    main()
