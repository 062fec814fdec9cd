"""Make the mistakes of ``mutations.py`` one by one in a copy of the package, and validate.

    python tests/mutations/run.py [--only 3..7,9] [--results FILE] [--again]

Mutants are checked on the scenarios of ``oracles/scenarios.py`` and the paper's, and stop at the
first check that fails. Each needs its own programs, up to a minute or several, so results are kept
in a file and those that it holds are not computed again; beside it are the compiled programs.
Mutant 0 is the package as it is, which has to pass. Exit status 0: no more than SURVIVORS of all
mutants survive.
"""

import argparse
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

from mutations import CMG, MUTATIONS, RIGID, WHEELS, Mutation

SURVIVORS = 2
TIMEOUT = 1800.0  # [s]
TESTS = pathlib.Path(__file__).resolve().parents[1]
PACKAGE = TESTS.parent / "src" / "quietbus"

CHECK = """
import sys, json
import numpy as np
import quietbus.api
from oracles import scenarios
from quietbus.scenario import load_scenario
from quietbus.validate.checks import flight_duration
from quietbus.validate.flight import check_energy, check_flight, check_momentum, fly_both
from quietbus.validate.harmonic import check_harmonic
from quietbus.validate.instants import check_instants, check_start
from quietbus.validate.motions import kicked
from quietbus.validate.subject import Subject

def instants(subject):
    yield check_start(subject)
    yield from check_instants(subject, 20, np.random.default_rng(0))

def flights(subject):
    start = kicked(subject.reference, subject.reference.initial(), np.random.default_rng(0))
    flight = fly_both(subject, start, flight_duration(subject))
    yield check_flight(subject, flight)
    yield from check_harmonic(subject, flight)
    yield from check_momentum(subject, flight)
    yield check_energy(subject, flight)

def made(name):
    return getattr(scenarios, name)() if hasattr(scenarios, name) else load_scenario(name)

for stage in sys.argv[1:]:
    name, kind = stage.split(":")
    for check in globals()[kind](Subject(made(name), made(name))):
        print(name, check.name, check.error, file=sys.stderr, flush=True)
        if not check.passed:
            print(json.dumps([name, check.name, check.error]))
            sys.exit(0)
"""


def stages(mutation: Mutation | None) -> list[str]:
    """What to look at, scenario and kind of check: first what most likely sees the mistake.

    All mistakes but the solvers' show at instants, which are quick; the solvers' show on the
    platform of the paper, whose programs are small.
    """
    names = (CMG, RIGID, WHEELS) if mutation is None else mutation.scenarios
    instants = [f"{name}:instants" for name in names]
    flights = [f"{name}:flights" for name in ("zhang2012", *names)]
    solver = mutation is not None and mutation.file.startswith("solve/")
    return flights + instants if solver else instants + flights


def main() -> int:
    """Run the mutants that are asked for, and tell what is known of all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", help="numbers from 0, 3..7 or 5, several with commas")
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path("mutations.json"))
    parser.add_argument("--again", action="store_true", help="also those that are known")
    given = parser.parse_args()
    numbers = list(range(len(MUTATIONS) + 1))
    if given.only:
        parts = [part.partition("..") for part in given.only.split(",")]
        numbers = [n for a, _, b in parts for n in range(int(a), int(b or a) + 1)]
    cache = given.results.with_suffix(".programs")
    known = json.loads(given.results.read_text()) if given.results.exists() else {}
    for number in numbers:
        mutation = MUTATIONS[number - 1] if number else None
        key = _key(mutation)
        if key not in known or given.again:
            known[key] = {"number": number, **judge(mutation, cache)}
            given.results.write_text(json.dumps(known, indent=1))
        print(f"{number:3d} {_said(mutation, known[key])}", flush=True)
    results = [known.get(_key(mutation), {"verdict": "not run"}) for mutation in MUTATIONS]
    caught = sum(result["verdict"] == "caught" for result in results)
    missing = sum(result["verdict"] == "not run" for result in results)
    print(f"{caught} of {len(MUTATIONS)} caught, {missing} not run")
    return int(len(MUTATIONS) - caught > SURVIVORS)


def judge(mutation: Mutation | None, cache: pathlib.Path) -> dict:
    """What becomes of a mutant; compiled programs are kept in the folder ``cache``."""
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / "quietbus"
        shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
        if mutation is not None:
            mutate(copy / mutation.file, mutation)
        paths = os.pathsep.join([folder, str(TESTS)])
        # programs run once: the compiler's optimisation would take longer than it saves; those
        # that a mistake leaves as they are come from the mutants before
        quick = {
            "XLA_FLAGS": "--xla_backend_optimization_level=0",
            "JAX_COMPILATION_CACHE_DIR": str(cache.resolve()),
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.3",
        }
        try:
            done = subprocess.run(
                [sys.executable, "-c", CHECK, *stages(mutation)],
                env=os.environ | quick | {"PYTHONPATH": paths},
                capture_output=True,
                text=True,
                timeout=TIMEOUT,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return {"verdict": "timed out"}
    seconds = round(time.monotonic() - started)
    if done.returncode:
        why = done.stderr.strip().splitlines()[-1:] or ["?"]
        return {"verdict": "broke", "by": why[0], "seconds": seconds}
    if not done.stdout.strip():
        return {"verdict": "survived", "seconds": seconds}
    scenario, check, error = json.loads(done.stdout)
    by = f"{check} of {scenario}"
    return {"verdict": "caught", "by": by, "error": error, "seconds": seconds}


def mutate(file: pathlib.Path, mutation: Mutation) -> None:
    """Put the mistake in; the text that it replaces has to be there once."""
    text = file.read_text(encoding="utf-8")
    if text.count(mutation.old) != 1:
        found = text.count(mutation.old)
        raise SystemExit(f"{mutation.file}: {mutation.old!r} is there {found} times, not once")
    file.write_text(text.replace(mutation.old, mutation.new), encoding="utf-8")


def _key(mutation: Mutation | None) -> str:
    """Of a mutation, whatever its number."""
    text = "" if mutation is None else "|".join([mutation.file, mutation.old, mutation.new])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _said(mutation: Mutation | None, result: dict) -> str:
    means = "the package as it is" if mutation is None else f"{mutation.file}: {mutation.means}"
    by = f" by {result['by']}" if "by" in result else ""
    error = f" (error {result['error']:.1e})" if "error" in result else ""
    seconds = f", {result['seconds']} s" if "seconds" in result else ""
    return f"{result['verdict']}{by}{error}: {means}{seconds}"


if __name__ == "__main__":
    sys.exit(main())
