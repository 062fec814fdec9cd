"""What a user waits for in a fresh process: seconds, ratios to other imports, and where they go.

``python benchmarks/startup.py [runs]``: medians of 5 runs, everything kept that a run before could
keep, and one run with nothing kept. The bound is 3 times what it takes to import MuJoCo, xarray and
scipy.signal, plus one second.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import quietbus as qb

PEER = [sys.executable, "-c", "import mujoco, xarray, scipy.signal"]
HELP = [sys.executable, "-m", "quietbus", "--help"]
IMPORT = [sys.executable, "-c", "import quietbus as qb; qb.simulate"]
COMMANDS = {
    "jitter --json": ["jitter", "zhang2012", "--json"],
    "analyze --json": ["analyze", "zhang2012", "--json"],
    "verify --json": ["verify", "VERIFIED", "--json"],
    "harmonic, 100 s": ["simulate", "zhang2012", "--method", "harmonic", "--duration", "100 s"],
    "direct, 10 s": ["simulate", "zhang2012", "--duration", "10 s"],
    "jitter, pictures": ["jitter", "zhang2012"],
    "analyze, pictures": ["analyze", "zhang2012"],
    "verify, pictures": ["verify", "VERIFIED"],
}
# the built-in's own, which stand there as a comment
WANTED = {
    "lines_of_sight": {"camera": {"direction": [0, 0, -1]}},
    "requirements": [
        "jitter(camera, window = 20 ms, confidence = 0.997) <= 0.001 arcsec",
        "RPE(camera, window = 20 ms, confidence = 0.997) <= 0.04 arcsec",
        "MTF_loss(camera, window = 20 ms, spatial_frequency = 5 1/arcsec) <= 1 %",
    ],
}
PARTS = ("import", "load", "trace", "lower", "compile", "rest")
WATCHED = """
import json, sys, time
begun = time.perf_counter()
spent = dict.fromkeys(("import", "load", "trace", "lower", "compile"), 0.0)
import jax
import quietbus.api
from quietbus import programs
spent["import"] = time.perf_counter() - begun
EVENTS = {"jaxpr_trace": "trace", "jaxpr_to_mlir": "lower", "backend_compile": "compile"}
def heard(event, seconds, **_):
    for word, part in EVENTS.items():
        if word in event:
            spent[part] += seconds
jax.monitoring.register_event_duration_secs_listener(heard)
read = programs._read_program
def timed(file):
    at = time.perf_counter()
    try:
        return read(file)
    finally:
        spent["load"] += time.perf_counter() - at
programs._read_program = timed
sys.argv = ["quietbus", *sys.argv[1:]]
from quietbus.cli import main
try:
    main()
except SystemExit as stopped:
    if stopped.code not in (0, 1, None):
        raise
spent["rest"] = time.perf_counter() - begun - sum(spent.values())
print(json.dumps(spent), file=sys.__stderr__)
"""


def seconds(command: list[str], environment: dict[str, str]) -> float:
    """By the clock, of a process that must succeed (status 1 of verify: a requirement failed)."""
    begun = time.perf_counter()
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    spent = time.perf_counter() - begun
    if done.returncode not in (0, 1):
        raise SystemExit(f"{' '.join(command)}: {done.stderr}")
    return spent


def main() -> None:
    """Print the table; compare rows of one run only, machines differ."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    with tempfile.TemporaryDirectory() as folder:
        scenario = Path(folder) / "verified.yaml"
        scenario.write_text(qb.Scenario.from_dict(_zhang() | WANTED).to_yaml(), encoding="utf-8")
        environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": f"{folder}/kept"}
        for command in (PEER, HELP, IMPORT):
            seconds(command, environment)  # reads the files from the disk
        peer = statistics.median(seconds(PEER, environment) for _ in range(runs))
        bound = 3.0 * peer + 1.0
        print(f"import mujoco, xarray, scipy.signal: {peer:.2f} s; bound {bound:.2f} s")
        told = statistics.median(seconds(HELP, environment) for _ in range(runs))
        print(f"quietbus --help: {told:.2f} s (bound 0.5)")
        own = statistics.median(seconds(IMPORT, environment) for _ in range(runs))
        print(f"import quietbus, ready to simulate: {own:.2f} s, {own / peer:.2f} of it\n")
        head = f"{'command':<18}{'nothing kept':>13}{'all kept':>10}{'of bound':>10}   of which"
        print(head + "".join(f"{part:>9}" for part in PARTS))
        for name, words in COMMANDS.items():
            arguments = [str(scenario) if word == "VERIFIED" else word for word in words]
            if "--json" not in words:
                out = "run.nc" if words[0] == "simulate" else "pictures"
                arguments += ["--output", f"{folder}/{out}"]
            command = [sys.executable, "-m", "quietbus", *arguments]
            empty = environment | {"JAX_COMPILATION_CACHE_DIR": f"{folder}/{name}"}
            cold = seconds(command, empty)
            seconds(command, environment)
            warm = statistics.median(seconds(command, environment) for _ in range(runs))
            watched = subprocess.run(
                [sys.executable, "-c", WATCHED, *arguments],
                env=environment,
                capture_output=True,
                text=True,
                check=True,
            )
            spent = json.loads(watched.stderr.strip().splitlines()[-1])
            parts = "".join(f"{spent[part]:9.2f}" for part in PARTS)
            print(f"{name:<18}{cold:>13.1f}{warm:>10.2f}{warm / bound:>10.2f}           {parts}")


def _zhang() -> dict:
    return qb.load_scenario("zhang2012").to_dict()


if __name__ == "__main__":
    main()
