"""Make the mistakes of ``mutations.py`` one by one in a copy of the package, and validate.

    python tests/mutations/run.py [--only 3..7] [--results FILE] [--again]

Mutants are checked on the scenarios of ``oracles/scenarios.py``, and stop at the first check that
fails. Each needs its own programs, a minute or several, so results are kept in a file and those
that it holds are not computed again. Mutant 0 is the package as it is, which has to pass. Exit
status 0: no more than SURVIVORS of all mutants survive.
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
import quietbus.api
from oracles import scenarios
from quietbus.validate.checks import run_checks
for name in sys.argv[1:]:
    for check in run_checks(getattr(scenarios, name)()):
        if not check.passed:
            print(json.dumps([name, check.name, check.error]))
            sys.exit(0)
"""


def main() -> int:
    """Run the mutants that are asked for, and tell what is known of all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", help="numbers from 0, 3..7 or 5")
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path("mutations.json"))
    parser.add_argument("--again", action="store_true", help="also those that are known")
    given = parser.parse_args()
    numbers = range(len(MUTATIONS) + 1)
    if given.only:
        first, _, last = given.only.partition("..")
        numbers = range(int(first), int(last or first) + 1)
    known = json.loads(given.results.read_text()) if given.results.exists() else {}
    for number in numbers:
        mutation = MUTATIONS[number - 1] if number else None
        key = _key(mutation)
        if key not in known or given.again:
            known[key] = {"number": number, **judge(mutation)}
            given.results.write_text(json.dumps(known, indent=1))
        print(f"{number:3d} {_said(mutation, known[key])}", flush=True)
    results = [known.get(_key(mutation), {"verdict": "not run"}) for mutation in MUTATIONS]
    caught = sum(result["verdict"] == "caught" for result in results)
    missing = sum(result["verdict"] == "not run" for result in results)
    print(f"{caught} of {len(MUTATIONS)} caught, {missing} not run")
    return int(len(MUTATIONS) - caught > SURVIVORS)


def judge(mutation: Mutation | None) -> dict:
    """What becomes of a mutant."""
    scenarios = (CMG, RIGID, WHEELS) if mutation is None else mutation.scenarios
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / "quietbus"
        shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
        if mutation is not None:
            mutate(copy / mutation.file, mutation)
        paths = os.pathsep.join([folder, str(TESTS)])
        # programs run once: the compiler's optimisation would take longer than it saves
        quick = {
            "XLA_FLAGS": "--xla_backend_optimization_level=0",
            "JAX_ENABLE_COMPILATION_CACHE": "false",
        }
        try:
            done = subprocess.run(
                [sys.executable, "-c", CHECK, *scenarios],
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
