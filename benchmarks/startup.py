"""What a user waits for before anything moves: help, import, compilation (cold, from the cache)."""

import os
import subprocess
import sys
import tempfile
import time

RUN = """
import time
start = time.perf_counter()
import quietbus as qb
qb.simulate
imported = time.perf_counter()
qb.simulate("zhang2012", duration=0.01)
first = time.perf_counter()
qb.simulate("zhang2012", duration=0.01)
again = time.perf_counter()
print(imported - start, (first - imported) - (again - first))
"""


def main() -> None:
    """Print seconds; compare them in one run only, machines differ."""
    for _ in range(2):
        started = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "quietbus", "--help"], check=True, stdout=subprocess.DEVNULL
        )
        spent = time.perf_counter() - started
    print(f"quietbus --help: {spent:.2f} s (bound 0.5)")
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": cache}
        environment |= {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.3"}
        for name, bound in (("cold", 10.0), ("from the cache", 2.0)):
            found = subprocess.run(
                [sys.executable, "-c", RUN],
                env=environment,
                check=True,
                capture_output=True,
                text=True,
            ).stdout.split()
            imports, warm_up = map(float, found)
            print(f"import {imports:.1f} s, warm-up {name}: {warm_up:.1f} s (bound {bound:g})")


if __name__ == "__main__":
    main()
