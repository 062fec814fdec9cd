"""Error against time: the direct and the harmonic solver, MuJoCo, and Basilisk on a rigid mount.

The satellite is the built-in one with massless legs, without control, its gimbals held, shaken by
its rotors alone and in steady vibration from the start. The error is that of the 100 Hz amplitude
of the bus rate in the last second, relative, against the direct solver at its tightest tolerance.
The time is the processor's, so that other work on the machine matters little.
The dynamic imbalance lies where Basilisk has it, a quarter turn behind the static one.

    python benchmarks/work_precision.py [PICTURE.png]

Basilisk (the package ``bsk``) asks for versions of other packages of its own: install it in
another environment and name its interpreter in QUIETBUS_BASILISK_PYTHON.
"""

import importlib.util
import json
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

# before anything starts threads
os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
os.environ["XLA_FLAGS"] = os.environ.get("XLA_FLAGS", "") + " --xla_cpu_multi_thread_eigen=false"

import mujoco  # noqa: E402
import numpy as np  # noqa: E402
from harmonic import in_turns  # noqa: E402

from quietbus.build import build_initial_state, build_satellite  # noqa: E402
from quietbus.dynamics.state import State  # noqa: E402
from quietbus.model.satellite import Satellite  # noqa: E402
from quietbus.plots.style import COLOURS, DASHES, new_figure, share_legend, style  # noqa: E402
from quietbus.scenario import load_scenario  # noqa: E402
from quietbus.solve.direct import Tolerances, integrate  # noqa: E402
from quietbus.solve.harmonic import integrate_harmonic, on_periodic_solution  # noqa: E402
from quietbus.spatial.inertia import point_inertia  # noqa: E402
from quietbus.validate import write_mjcf  # noqa: E402
from quietbus.validate.trajectory import massless_legs  # noqa: E402

MOUNTS = ("isolated", "rigid")
DURATION, RATE, LINE = 5.0, 1000.0, 100.0  # [s], [Hz] of the outputs, [Hz]
LONG, SLOW_RATE = 100.0, 10.0  # [s], [Hz] of harmonic runs
TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
TIMESTEPS = (2e-3, 1e-3, 5e-4, 2.5e-4, 1e-4)
BASILISK_TIMESTEPS = (1e-3, 5e-4, 2.5e-4, 1e-4)
FINEST_TOLERANCE, FINEST_TIMESTEP = 1e-13, 2.5e-5
AGREEMENT = 1e-3  # within which engines have to agree at their finest to be compared
REPEATS = 5  # of Basilisk's flights


@dataclass(frozen=True)
class Point:
    """What one engine needed at one setting, and how far off it was."""

    setting: str
    seconds: float  # of the processor per second of flight, the least of several
    error: float

    def show(self, mount: str, engine: str) -> None:
        """Print as a row of the table."""
        print(
            f"{mount:8} {engine:18} {self.setting:16} {self.error:9.1e} "
            f"{1e3 * self.seconds:10.3f} {1.0 / self.seconds:10.0f}",
            flush=True,
        )


def relative_error(amplitude: np.ndarray, exact: np.ndarray) -> float:
    """Of complex amplitudes (axis): the largest axis, relative to the largest amplitude."""
    return float(np.max(np.abs(amplitude - exact)) / np.max(np.abs(exact)))


def line_amplitude(time: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Complex amplitude of the rotors' line in the last second, slow motion removed by a cubic."""
    last = time > time[-1] - 1.0 + 1e-9
    x, turn = time[last] - time[-1], 2.0 * np.pi * LINE * time[last]
    lines = [wave(h * turn) for h in (1, 2) for wave in (np.cos, np.sin)]
    fit = np.linalg.lstsq(np.column_stack([*lines, np.vander(x, 4)]), rate[last], rcond=None)[0]
    return fit[0] - 1j * fit[1]


def fly_direct(satellite: Satellite, state: State, tolerance: float) -> Callable[[], np.ndarray]:
    """A flight by the direct solver."""

    def run() -> np.ndarray:
        solution = integrate(
            satellite, state, DURATION, RATE, Tolerances(tolerance, 0.01 * tolerance)
        )
        return line_amplitude(solution.time, np.asarray(solution.outputs.bus_rate))

    return run


def fly_harmonic(satellite: Satellite, slow: State, duration: float) -> Callable[[], np.ndarray]:
    """A flight by the harmonic solver."""
    phase = np.exp(1j * np.asarray(satellite.cluster.rotor_phase))

    def run() -> np.ndarray:
        solution = integrate_harmonic(satellite, slow, duration, SLOW_RATE, steady=True)
        return phase @ solution.jitter.amplitudes["bus_rate"][-1, :, 0]

    return run


def fly_mujoco(
    satellite: Satellite, state: State, timestep: float, *, free_rotors: bool = False
) -> Callable[[], np.ndarray]:
    """A flight by MuJoCo's RK4, rotors at constant speed or free of any motor torque."""
    xml = write_mjcf(satellite, state, timestep=timestep)
    if free_rotors:
        xml = re.sub(r'(name="rotor\d+" [^>]*)armature="[^"]*"', r'\1armature="0"', xml)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    address = model.joint("bus").dofadr[0] + 3
    every = max(round(1.0 / RATE / timestep), 1)
    count = round(DURATION / (every * timestep))

    def run() -> np.ndarray:
        mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
        rate = np.empty((count + 1, 3))
        rate[0] = data.qvel[address : address + 3]
        for i in range(count):
            mujoco.mj_step(model, data, every)
            rate[i + 1] = data.qvel[address : address + 3]
        return line_amplitude(np.arange(count + 1) * every * timestep, rate)

    return run


def basilisk_python() -> str | None:
    """An interpreter that has Basilisk."""
    if "QUIETBUS_BASILISK_PYTHON" in os.environ:
        return os.environ["QUIETBUS_BASILISK_PYTHON"]
    return sys.executable if importlib.util.find_spec("Basilisk") else None


def basilisk_points(
    python: str, satellite: Satellite, state: State, exact: np.ndarray
) -> list[Point]:
    """Points of Basilisk, or none if it disagrees with ``exact``; ``satellite`` is rigid.

    Its rotors turn freely and so change speed a little. Its error is that against MuJoCo with
    rotors as free.
    """
    given = basilisk_satellite(satellite) | {
        "attitude": np.asarray(state.q_NB).tolist(),
        "bus_rate": np.asarray(state.w_NB_B).tolist(),
        "duration": DURATION,
        "rate": RATE,
        "timesteps": BASILISK_TIMESTEPS * REPEATS,
    }
    script = Path(__file__).parent / "engines" / "basilisk_rigid.py"
    done = subprocess.run(
        [python, str(script)],
        input=json.dumps(given),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout.splitlines()[-1])
    free = fly_mujoco(satellite, state, FINEST_TIMESTEP, free_rotors=True)()
    points = []
    for i, timestep in enumerate(BASILISK_TIMESTEPS):
        flights = found["flights"][i :: len(BASILISK_TIMESTEPS)]
        amplitude = line_amplitude(*(np.array(flights[0][k]) for k in ("time", "bus_rate")))
        seconds = min(flight["seconds"] for flight in flights) / DURATION
        error = relative_error(amplitude, free)
        points.append(Point(f"step {1e3 * timestep:g} ms", seconds, error))
        points[-1].show("rigid", "Basilisk RK4")
    difference = relative_error(amplitude, exact)
    print(f"rigid    bsk {found['version']}; with rotors at constant speed: {difference:.1e} off")
    if difference < AGREEMENT:
        return points
    print(f"That is more than {AGREEMENT:g}: not in the picture")
    return []


def basilisk_satellite(satellite: Satellite) -> dict[str, Any]:
    """Hub and wheels: bus, plate and gimbal bodies make the hub; origin at the bus's centre."""
    cluster = satellite.cluster
    R_BP = _matrix(satellite.q_BP)
    p_BP = np.asarray(satellite.p_BP_B)
    bodies = [
        (satellite.bus.mass, np.zeros(3), np.asarray(satellite.bus.I_BBcm_B)),
        (
            satellite.plate.mass,
            p_BP + R_BP @ np.asarray(satellite.plate.p_PPcm_P),
            R_BP @ np.asarray(satellite.plate.I_PPcm_P) @ R_BP.T,
        ),
    ]
    wheels = []
    for j, phase in enumerate(np.asarray(cluster.rotor_phase)):
        R_BG = R_BP @ np.asarray(cluster.R_PG0[j])  # gimbals held at zero
        place = p_BP + R_BP @ np.asarray(cluster.p_PC_P[j])
        bodies.append(
            (
                cluster.gimbal_mass[j],
                place + R_BG @ np.asarray(cluster.p_CGcm_G[j]),
                R_BG @ np.asarray(cluster.I_GGcm_G[j]) @ R_BG.T,
            )
        )
        s, y, z = (R_BG @ np.asarray(cluster.R_GF[j])).T
        I = np.asarray(cluster.I_RRcm_R[j])
        wheels.append(
            {
                "mass": float(cluster.rotor_mass[j]),
                "rWB_B": (place + R_BG @ np.asarray(cluster.p_CR_G[j])).tolist(),
                "gsHat_B": s.tolist(),
                "w2Hat0_B": (np.cos(phase) * y + np.sin(phase) * z).tolist(),
                "w3Hat0_B": (np.cos(phase) * z - np.sin(phase) * y).tolist(),
                "Js": I[0, 0],
                "Jt": I[1, 1],
                "Jg": I[2, 2],
                "U_s": float(cluster.rotor_mass[j] * cluster.eccentricity[j]),
                "U_d": I[0, 2],
                "Omega": float(cluster.rotor_speed[j]),
            }
        )
    mass = sum(float(m) for m, _, _ in bodies)
    centre = sum(float(m) * r for m, r, _ in bodies) / mass
    inertia = sum(I + np.asarray(point_inertia(m, r - centre)) for m, r, I in bodies)
    hub = {"mass": mass, "centre": centre.tolist(), "inertia": np.asarray(inertia).tolist()}
    return {"hub": hub, "wheels": wheels}


def _matrix(quaternion: Any) -> np.ndarray:
    w, *v = np.asarray(quaternion)
    K = np.cross(np.eye(3), v).T
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K


def measure(mount: str) -> dict[str, list[Point]]:
    """Points by engine."""
    scenario = load_scenario("zhang2012").with_overrides(
        {
            "control": "none",
            "cluster.rotor.dynamic_imbalance_phase": "-90 deg",
            "initial.attitude": [0, 0, 0],
            "isolator.mount": mount,
        }
    )
    satellite = massless_legs(build_satellite(scenario))
    slow = build_initial_state(scenario, satellite)
    state = on_periodic_solution(satellite, slow)
    exact = fly_direct(satellite, state, FINEST_TOLERANCE)()
    runs: dict[tuple[str, str], tuple[float, Callable[[], np.ndarray]]] = {}
    for tolerance in TOLERANCES:
        run = fly_direct(satellite, state, tolerance)
        runs["quietbus direct", f"tolerance {tolerance:.0e}"] = DURATION, run
    for flown in (DURATION, LONG):
        run = fly_harmonic(satellite, slow, flown)
        runs["quietbus harmonic", f"flight of {flown:g} s"] = flown, run
    for timestep in TIMESTEPS:
        run = fly_mujoco(satellite, state, timestep)
        runs["MuJoCo RK4", f"step {1e3 * timestep:g} ms"] = DURATION, run
    spent = in_turns({name: run for name, (_, run) in runs.items()}, clock=time.process_time)
    points: dict[str, list[Point]] = {}
    for (engine, setting), (flown, run) in runs.items():
        error = relative_error(run(), exact)
        points.setdefault(engine, []).append(Point(setting, spent[engine, setting] / flown, error))
        points[engine][-1].show(mount, engine)
    step = 1e6 * min(p.seconds * t for p, t in zip(points["MuJoCo RK4"], TIMESTEPS, strict=True))
    finest = relative_error(fly_mujoco(satellite, state, FINEST_TIMESTEP)(), exact)
    print(
        f"{mount:8} MuJoCo: {step:.1f} µs a step; at {1e3 * FINEST_TIMESTEP:g} ms {finest:.1e} off"
    )
    if mount == "rigid":
        python = basilisk_python()
        if python is None:
            print(
                "Basilisk is skipped: install bsk in an environment of its own and set "
                "QUIETBUS_BASILISK_PYTHON to its interpreter"
            )
        else:
            points |= {"Basilisk RK4": basilisk_points(python, satellite, state, exact)}
    return points


def picture(path: Path, found: dict[str, dict[str, list[Point]]]) -> None:
    """Error against time, one panel for each mount."""
    with style():
        figure = new_figure(3.6, "Error of the 100 Hz jitter against time, on one core")
        panels = figure.subplots(1, len(found), sharex=True, sharey=True)
        for axes, (mount, points) in zip(panels, found.items(), strict=True):
            axes.margins(0.05)
            for i, (engine, own) in enumerate(points.items()):
                axes.plot(
                    [point.seconds for point in own],
                    [point.error for point in own],
                    color=COLOURS[i],
                    linestyle=DASHES[i],
                    marker="o*s^"[i],
                    markersize=8 if "o*s^"[i] == "*" else 4,
                    label=engine,
                )
            axes.set(xscale="log", yscale="log", title=mount, xlabel="time per second of flight, s")
        panels[0].set_ylabel("relative error of the amplitude")
        share_legend(figure, panels[-1])
        figure.savefig(path)


def main() -> None:
    """Print the table, and draw the picture if a file is named."""
    packages = [f"{name} {version(name)}" for name in ("quietbus", "jax", "diffrax", "mujoco")]
    print(f"{', '.join(packages)}; {platform.machine()}, one core")
    print(f"{'mount':8} {'engine':18} {'setting':16} {'error':>9} {'ms/s':>10} {'x real':>10}")
    found = {mount: measure(mount) for mount in MOUNTS}
    for path in map(Path, sys.argv[1:2]):
        picture(path, found)
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
