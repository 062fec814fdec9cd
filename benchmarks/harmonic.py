"""The harmonic solver against real time and MuJoCo; jitter of a thousand designs; on one core.

The flight is that of the built-in satellite, 100 s in closed loop with jitter ten times a second.
MuJoCo flies the same satellite by RK4 at a step of 1 ms, made cheaper for it: legs without mass, no
controller, no output. All competitors take turns; each one's time, the processor's for flights, is
the shortest of several.
"""

import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import replace
from importlib.metadata import version
from typing import Any, TypeVar

# before anything starts threads
os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
os.environ["XLA_FLAGS"] = os.environ.get("XLA_FLAGS", "") + " --xla_cpu_multi_thread_eigen=false"

import mujoco  # noqa: E402
import numpy as np  # noqa: E402

import quietbus as qb  # noqa: E402
from quietbus.build import build_initial_state, build_satellite  # noqa: E402
from quietbus.studies.jitter import jitter_of_designs  # noqa: E402
from quietbus.validate import write_mjcf  # noqa: E402
from quietbus.validate.trajectory import massless_legs  # noqa: E402

DURATION, RATE, TIMESTEP = 100.0, 10.0, 1e-3  # [s], [Hz], [s] of MuJoCo
MOUNTS = ("isolated", "rigid")
DESIGNS = 1000
REPEATS = 5
K = TypeVar("K", bound=Hashable)

COLD = f"""
import time
start = time.perf_counter()
import quietbus as qb
qb.simulate
imported = time.perf_counter()
run = lambda: qb.simulate("zhang2012", "harmonic", duration={DURATION})
run()
first = time.perf_counter()
run()
again = time.perf_counter()
print(imported - start, first - imported, again - first)
"""


def in_turns(
    works: Mapping[K, Callable[[], Any]],
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[K, float]:
    """Shortest time [s] of each, after a run of each to warm up, all taking turns."""
    best: dict[K, float] = dict.fromkeys(works, np.inf)
    for work in works.values():
        work()
    for _ in range(repeats):
        for name, work in works.items():
            started = clock()
            work()
            best[name] = min(best[name], clock() - started)
    return best


def mujoco_flight(scenario: qb.Scenario, mount: str) -> Callable[[], None]:
    """A flight of DURATION in MuJoCo, gimbals held."""
    satellite = massless_legs(build_satellite(scenario, mount))
    xml = write_mjcf(satellite, build_initial_state(scenario, satellite), timestep=TIMESTEP)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)

    def fly() -> None:
        mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
        mujoco.mj_step(model, data, round(DURATION / TIMESTEP))

    return fly


def cold(cache: str) -> list[float]:
    """Import, first and second run [s] in a process of its own."""
    environment = os.environ | {
        "JAX_COMPILATION_CACHE_DIR": cache,
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.3",
    }
    done = subprocess.run(
        [sys.executable, "-c", COLD], env=environment, check=True, capture_output=True, text=True
    )
    return [float(seconds) for seconds in done.stdout.split()]


def main() -> None:
    """Print times and ratios."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("quietbus", "jax", "mujoco"))
    print(f"{packages}; {platform.machine()}, one core")
    scenario = qb.load_scenario("zhang2012")

    def ours(mount: str) -> Callable[[], Any]:
        return lambda: qb.simulate(scenario, "harmonic", mount, duration=DURATION, output_rate=RATE)

    flights = {f"quietbus, {mount}": ours(mount) for mount in MOUNTS}
    flights |= {f"MuJoCo, {mount}": mujoco_flight(scenario, mount) for mount in MOUNTS}
    spent = in_turns(flights, clock=time.process_time)  # other work matters little
    print(f"\n{DURATION:g} s of flight, everything compiled; bounds 500 x real time, 10 x MuJoCo")
    for mount in MOUNTS:
        own, other = spent[f"quietbus, {mount}"], spent[f"MuJoCo, {mount}"]
        step = 1e6 * other * TIMESTEP / DURATION
        print(
            f"{mount:8}: quietbus {1e3 * own:5.0f} ms, {DURATION / own:6.0f} x real time; MuJoCo "
            f"{1e3 * other:5.0f} ms ({step:.1f} µs a step); quietbus {other / own:.1f} x as fast"
        )

    print("\nThe same flight in a fresh process, isolated")
    with tempfile.TemporaryDirectory() as cache:
        for name in ("nothing compiled yet", "compiled before"):
            imports, first, second = cold(cache)
            print(
                f"{name:20}: import {imports:.1f} s, compilation {first - second:.1f} s, "
                f"run {second:.2f} s"
            )

    print(f"\nJitter of {DESIGNS} designs at one operating point; bound 1 ms a design")
    angle = np.array(scenario.cluster.gimbal_angles)
    rng = np.random.default_rng(0)
    k, c = rng.uniform(5e3, 5e4, DESIGNS), rng.uniform(100.0, 2000.0, DESIGNS)
    works: dict[str, Callable[[], Any]] = {}
    for mount in MOUNTS:
        satellite = build_satellite(scenario, mount)
        ones, legs = np.ones(len(satellite.legs.stiffness)), satellite.legs
        designs = [
            replace(satellite, legs=replace(legs, stiffness=ki * ones, damping=ci * ones))
            for ki, ci in zip(k, c, strict=True)
        ]
        works[mount] = lambda designs=designs: jitter_of_designs(designs, angle)
    for mount, seconds in in_turns(works).items():
        print(f"{mount:8}: {1e3 * seconds / DESIGNS:.3f} ms a design")


if __name__ == "__main__":
    main()
