"""Direct solver against MuJoCo's RK4 at equal error of the rotors' jitter, in one run.

The built-in satellite on its isolator, no control, 1 s of flight, output at 1 kHz. quietbus has
legs with mass; MuJoCo gets the cheaper problem, massless legs as tendons. The error is that of the
100 Hz amplitude of the bus rate over the last 0.2 s, each engine against its own converged run.
"""

import time
from collections.abc import Callable

import mujoco
import numpy as np

from quietbus.build import build_initial_state, build_satellite
from quietbus.scenario import load_scenario
from quietbus.solve.direct import Tolerances, integrate
from quietbus.validate import write_mjcf
from quietbus.validate.trajectory import massless_legs

DURATION, RATE, LINE = 1.0, 1000.0, 100.0  # [s], [Hz], [Hz]
TOLERANCES = (1e-7, 1e-8, 1e-9, 1e-10)
TIMESTEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4)
REPEATS = 5


def line_amplitude(time: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Complex amplitude of the rotors' line per axis, slow motion removed by a quintic."""
    last = time > DURATION - 0.2
    x = (time[last] - DURATION) / 0.2
    turn = 2.0 * np.pi * LINE * time[last]
    basis = np.column_stack([np.vander(x, 6), np.cos(turn), np.sin(turn)])
    fit = np.linalg.lstsq(basis, rate[last], rcond=None)[0]
    return fit[-2] - 1j * fit[-1]


def best_time(run: Callable[[], np.ndarray]) -> tuple[float, np.ndarray]:
    """Shortest of several times, and the result."""
    times = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        result = run()
        times.append(time.perf_counter() - started)
    return min(times), result


def main() -> None:
    """Print the work-precision table and the ratio at an error of 1e-6."""
    scenario = load_scenario("zhang2012").with_overrides(
        {"control": "none", "initial.attitude": [0, 0, 0]}
    )
    satellite = build_satellite(scenario)
    state = build_initial_state(scenario, satellite)
    times = np.arange(int(DURATION * RATE) + 1) / RATE

    def quietbus(tolerance: float) -> np.ndarray:
        tolerances = Tolerances(tolerance, 0.01 * tolerance)
        run = integrate(satellite, state, DURATION, RATE, tolerances)
        return line_amplitude(run.time, run.outputs.bus_rate)

    light = massless_legs(satellite)
    models: dict[float, mujoco.MjModel] = {}

    def mujoco_run(timestep: float) -> np.ndarray:
        if timestep not in models:
            xml = write_mjcf(light, state, timestep=timestep)
            models[timestep] = mujoco.MjModel.from_xml_string(xml)
        model = models[timestep]
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
        address = model.joint("bus").dofadr[0] + 3
        rate = np.empty((len(times), 3))
        rate[0] = data.qvel[address : address + 3]
        for i in range(1, len(times)):
            mujoco.mj_step(model, data, round(1.0 / RATE / timestep))
            rate[i] = data.qvel[address : address + 3]
        return line_amplitude(times, rate)

    rows: dict[str, list[tuple[float, float]]] = {}
    for name, run, settings, finest in (
        ("quietbus direct, tolerance", quietbus, TOLERANCES, 1e-13),
        ("MuJoCo RK4, timestep", mujoco_run, TIMESTEPS, 1.5625e-5),
    ):
        exact = run(finest)
        rows[name] = []
        for setting in settings:
            run(setting)  # warm
            spent, amplitude = best_time(lambda run=run, setting=setting: run(setting))
            error = float(np.max(np.abs(amplitude - exact)) / np.max(np.abs(exact)))
            rows[name].append((error, spent))
            print(f"{name} {setting:8.2e}: error {error:8.1e}, {DURATION / spent:6.1f} x real time")
    at = {}
    for name, points in rows.items():
        error, spent = np.log(np.array(sorted(points))).T
        at[name] = float(np.exp(np.interp(np.log(1e-6), error, spent)))
        print(f"{name}: {at[name] / DURATION:.4f} s per second of flight at an error of 1e-6")
    ours, theirs = at.values()
    print(f"quietbus is {theirs / ours:.2f} times as fast as MuJoCo at an error of 1e-6")


if __name__ == "__main__":
    main()
