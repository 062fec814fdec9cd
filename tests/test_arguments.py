"""Wrong arguments of the public functions: told by name before anything is computed."""

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import quietbus as qb
from quietbus import arguments

ZHANG = qb.load_scenario("zhang2012")
STUDY = qb.jitter("zhang2012")  # computes when asked
JARGON = re.compile(r"pydantic|numpy|dtype|Input should|subscriptable|NoneType|float\(\)|int\(\)")
RUN = xr.Dataset()
ISOLATOR = qb.SingleAxisIsolator(1.0, 1.0, 0.1)
WRONG = [  # call, what the message names
    (lambda: qb.load_scenario(5), "scenario: expected a Scenario, the path"),
    (lambda: qb.load_scenario(None), "scenario: .* got nothing"),
    (lambda: qb.load_scenario(b"zhang2012"), "scenario"),
    (lambda: qb.Scenario.from_yaml(5), "text: expected the YAML text"),
    (lambda: qb.Scenario.from_dict(5), "expected a mapping with keys among name"),
    (lambda: qb.Scenario(name="x"), "bus: expected a mapping"),
    (lambda: qb.Scenario(nonsense=1), "unknown key 'nonsense'"),
    (lambda: ZHANG.with_overrides("bus.mass"), "overrides: expected a mapping"),
    (lambda: ZHANG.with_overrides({5: 1}), "path: expected a text such as 'bus.mass', got 5"),
    (lambda: ZHANG.number(5), "path: expected a text"),
    (lambda: ZHANG.number("bus"), "bus: is not one number"),
    (lambda: setattr(ZHANG, "name", "x"), "do not change"),
    *[
        (lambda verb=verb: verb(5), "scenario: expected a Scenario")
        for verb in (qb.simulate, qb.compare, qb.analyze, qb.jitter, qb.linearize, qb.verify)
    ],
    (lambda: qb.simulate(ZHANG, method="magic"), "method: expected one of 'direct', 'harmonic'"),
    (lambda: qb.simulate(ZHANG, method=5), "method: .* got 5"),
    (lambda: qb.simulate(ZHANG, mount="soft"), "mount: expected one of 'isolated', 'rigid'"),
    *[
        (lambda v=value, n=name, f=verb: f(ZHANG, **{n: v}), f"{name}: expected a .*number above 0")
        for name, verb in (("duration", qb.simulate), ("output_rate", qb.simulate),
                           ("duration", qb.compare), ("duration", qb.verify))
        for value in (0, -1.0, float("nan"), float("inf"), [1.0], True)
    ],
    (lambda: qb.simulate(ZHANG, "harmonic", output_rate=0), "output_rate: .* got 0"),
    (lambda: qb.simulate(ZHANG, duration="5 kg"), r"simulation\.duration: expected a time in s"),
    (lambda: qb.simulate(ZHANG, joint_forces=1), "joint_forces: expected True or False"),
    (lambda: qb.simulate(ZHANG, progress=5), "progress: expected a function"),
    (lambda: qb.simulate(ZHANG, resume="x"), "resume: expected True or False"),
    (lambda: qb.simulate(ZHANG, "harmonic", points=[1, 2, 3]), "points: expected a mapping"),
    (lambda: qb.simulate(ZHANG, "harmonic", points={"a": 1}), r"points\['a'\]: expected 3 finite"),
    (lambda: qb.simulate(ZHANG, "harmonic", points={"a": ["x"] * 3}), r"points\['a'\]: expected 3"),
    (lambda: qb.simulate(ZHANG, "harmonic", points={"a": [[1], [2, 3]]}), r"points\['a'\]"),
    (lambda: qb.simulate(ZHANG, "harmonic", points={"a": [1, 2, np.nan]}), r"points\['a'\]"),
    (lambda: qb.simulate(ZHANG, "harmonic", points={5: [1, 2, 3]}), "points: expected names"),
    (lambda: qb.simulate(ZHANG, "harmonic", points={"\x1b": [1, 2, 3]}), "points: expected names"),
    (lambda: qb.simulate(ZHANG, "harmonic", lines_of_sight=5), "lines_of_sight: expected a mapp"),
    (lambda: qb.simulate(ZHANG, "harmonic", lines_of_sight={"a": "z"}), r"lines_of_sight\['a'\]"),
    (lambda: qb.simulate(ZHANG, "harmonic", lines_of_sight={"a": [0, 0, 0]}), r"\['a'\].* zero"),
    (lambda: qb.simulate(ZHANG, "harmonic", lines_of_sight={"a": np.zeros((2, 12))}), "not zero"),
    (lambda: qb.simulate(ZHANG, "harmonic", lines_of_sight={"a": np.ones((2, 5))}), "rows of 12"),
    (lambda: qb.compare(ZHANG, progress="x"), "progress: expected a function"),
    (lambda: qb.analyze(ZHANG, 5), "gimbal angles: expected 4 finite numbers, got 5"),
    (lambda: qb.analyze(ZHANG, "zero"), "gimbal angles: expected 4 finite numbers"),
    (lambda: qb.analyze(ZHANG, [0, 0, 0, np.inf]), "gimbal angles"),
    (lambda: qb.jitter(ZHANG, [True] * 4), "gimbal angles"),
    (lambda: qb.linearize(ZHANG, rate=[1]), "rate: expected 3 finite numbers"),
    (lambda: qb.linearize(ZHANG, actuator=5), "actuator: expected one of 'servo', 'ideal'"),
    (lambda: qb.linearize(ZHANG, points=5), "points: expected a mapping"),
    (lambda: qb.platforms(ZHANG), "scenarios: expected a list of scenarios"),
    (lambda: qb.platforms("zhang2012"), "scenarios: expected a list of scenarios"),
    (lambda: qb.platforms([]), "scenarios: expected one or more"),
    (lambda: qb.platforms([ZHANG], 5), "gimbal_angles: expected a list"),
    (lambda: qb.verify(ZHANG, method=None), "method: .* got nothing"),
    (lambda: qb.Direct("1"), "relative_tolerance: expected a number above 0, got '1'"),
    (lambda: qb.Harmonic(absolute_tolerance=1), "absolute_tolerance: expected a number from"),
    (lambda: qb.per_cmg_scenarios("zhang2012"), "scenario: expected a Scenario"),
    (lambda: qb.per_cmg_scenarios(ZHANG, -1.0), "scale: expected a finite number above 0"),
    (lambda: qb.per_cmg_scenarios(ZHANG, "x"), "scale: expected a number above 0"),
    (lambda: qb.read_wheel_table(5), "path: expected a list of files, got 5"),
    (lambda: qb.read_wheel_table([]), "path: expected a file or several"),
    (lambda: qb.read_wheel_table("x.csv", kind="noise"), "kind: expected one of"),
    (lambda: qb.read_waterfall(5), "path: expected the path of a file, got 5"),
    (lambda: qb.fit_waterfall(5), "path: expected the path of a file, got 5"),
    (lambda: qb.fit_waterfall("x.csv", most=0), "most: expected a whole number of at least 1"),
    (lambda: qb.load_run(5), "path: expected the path of a file"),
    (lambda: qb.save_run(5, "x.nc"), "run: expected a run"),
    (lambda: qb.save_run(RUN, "x.nc"), "run: expected a run of quietbus, got a Dataset without"),
    (lambda: qb.summarize(5), "run: expected a run"),
    (lambda: qb.summarize(RUN), "run: expected a run of quietbus"),
    (lambda: qb.worst_over_phases(5), "run: expected a run"),
    (lambda: qb.scenario_of("x"), "run: expected a run"),
    (lambda: qb.reconstruct(5), "run: expected a run"),
    (lambda: qb.compare_run_up(RUN, STUDY, "soft"), "mount: expected one of"),
    (lambda: qb.compare_run_up(5, STUDY, "rigid"), "run: expected a run with a run-up"),
    (lambda: qb.SingleAxisIsolator("1", 1, 1), "mass: expected a number above 0, got '1'"),
    (lambda: qb.SingleAxisIsolator(1, 0, 1), "stiffness: expected a finite number above 0"),
    (lambda: qb.SingleAxisIsolator(1, 1, float("nan")), "damping: expected a finite number"),
    (lambda: ISOLATOR.transmissibility("x"), "omega: expected angular frequencies"),
    (lambda: STUDY.bus_rate("soft"), "mount: expected one of 'isolated', 'rigid', got 'soft'"),
    (lambda: STUDY.combined(5), "mount: .* got 5"),
    (lambda: STUDY.noise("x"), "mount"),
    (lambda: STUDY.worst(None), "mount"),
    (lambda: STUDY.sweep(max_speed=-1), "max_speed: expected a finite number above 0"),
    (lambda: STUDY.sweep(max_speed="fast"), "max_speed: expected a number above 0"),
    (lambda: STUDY.sweep(count=1), "count: expected a whole number of at least 2"),
    (lambda: STUDY.sweep(count=2.5), "count: expected a whole number, got 2.5"),
    (lambda: STUDY.derivative("bus.mass", "rigid"), "paths: expected a list"),
]  # fmt: skip


@pytest.mark.parametrize("case", range(len(WRONG)), ids=lambda i: WRONG[i][1][:40])
def test_a_wrong_argument_is_told_by_its_name(case):
    call, message = WRONG[case]
    with pytest.raises((TypeError, ValueError), match=message) as refused:
        call()
    assert not JARGON.search(str(refused.value)), refused.value
    assert len(str(refused.value)) < 1000


def test_every_public_function_is_tried():
    """The list above goes through all of them, and a new one is missed here."""
    text = inspect.getsource(sys.modules[__name__])
    functions = {n for n in qb.__all__ if inspect.isfunction(getattr(qb, n))}
    functions |= {"SingleAxisIsolator", "Scenario"}
    assert {name for name in functions if f"qb.{name}" not in text} == set()


def test_python_reference_lists_every_public_name():
    page = (Path(__file__).parents[1] / "docs" / "api.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^::: (\S+)$", page, re.MULTILINE))
    named = {each.rpartition(".")[2] for each in listed}
    assert {name for name in qb.__all__ if name not in named} == set()


def test_numbers_of_numpy_and_lists_are_taken():
    assert arguments.positive("x", np.float32(2.0)) == 2.0
    assert arguments.count("x", np.int64(3)) == 3
    assert arguments.vector("x", (1, 2, 3), 3).tolist() == [1.0, 2.0, 3.0]


# ---- processes


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_forked_process_is_refused_instead_of_hanging():
    script = (
        "import os, warnings; warnings.simplefilter('ignore'); import quietbus as qb\n"
        "qb.analyze('zhang2012')\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    try:\n"
        "        qb.analyze('zhang2012')\n"
        "    except RuntimeError as error:\n"
        "        os._exit(7 if 'spawn' in str(error) else 1)\n"
        "    os._exit(0)\n"
        "raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))\n"
    )
    assert subprocess.run([sys.executable, "-c", script], timeout=60).returncode == 7


def test_a_device_that_is_not_there_is_told_in_one_sentence():
    environment = os.environ | {"JAX_PLATFORMS": "nonsense"}
    ended = subprocess.run(
        [sys.executable, "-m", "quietbus", "analyze", "zhang2012", "--json"],
        env=environment, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert ended.returncode == 2
    assert ended.stderr.startswith("quietbus: JAX_PLATFORMS=nonsense asks for a device that JAX")
    assert ended.stderr.count("\n") == 1


def test_a_refused_scenario_does_not_load_jax(tmp_path):
    (tmp_path / "s.yaml").write_text("name: x\n")
    script = (
        "import sys; from quietbus.cli import main\n"
        "sys.argv = ['quietbus', sys.argv[1], 's.yaml']\n"
        "try:\n    main()\n"
        "except SystemExit as end:\n"
        "    raise SystemExit(end.code + 10 * ('jax' in sys.modules))\n"
    )
    for command in ("simulate", "analyze", "jitter", "compare", "verify", "validate"):
        ended = subprocess.run(
            [sys.executable, "-c", script, command], cwd=tmp_path, capture_output=True, timeout=60
        )
        assert ended.returncode == 2, command
