"""Methods as objects: what a word means, which tolerances hold, and what they change."""

import subprocess
import sys

import numpy as np
import pytest

import quietbus as qb
from quietbus.results.checkpoint import CheckpointError
from quietbus.solve import direct, harmonic

SHORT = qb.load_scenario("zhang2012").with_overrides({"simulation.duration": 0.2})
LEFT_OUT = ("wall_time_s", "created")  # of a run, which no two have in common


def with_tolerances(**given):
    return SHORT.with_overrides({f"simulation.tolerances.{k}": v for k, v in given.items()})


@pytest.mark.parametrize(("word", "method"), [("direct", qb.Direct()), ("harmonic", qb.Harmonic())])
def test_a_word_and_its_object_make_the_same_run(word, method):
    by_word, by_object = qb.simulate(SHORT, word), qb.simulate(SHORT, method)
    for run in (by_word, by_object):
        run.attrs = {k: v for k, v in run.attrs.items() if k not in LEFT_OUT}
    assert by_word.identical(by_object)
    assert by_object.attrs["method"] == word


RULE = [  # of docs/api.md: method, scenario, relative and absolute tolerance
    (qb.Direct(), {}, (1e-8, 1e-10)),
    (qb.Harmonic(), {}, (1e-7, 1e-9)),
    (qb.Direct(), {"relative": 1e-6}, (1e-6, 1e-10)),
    (qb.Harmonic(), {"relative": 1e-6}, (1e-6, 1e-10)),
    (qb.Harmonic(), {"absolute": 1e-12}, (1e-8, 1e-12)),
    (qb.Direct(1e-5), {}, (1e-5, 1e-10)),
    (qb.Harmonic(1e-5), {}, (1e-5, 1e-9)),
    (qb.Harmonic(absolute_tolerance=1e-5), {"relative": 1e-6}, (1e-6, 1e-5)),
    (qb.Direct(1e-5, 1e-6), {"relative": 1e-6, "absolute": 1e-12}, (1e-5, 1e-6)),
    (qb.Harmonic(1e-8, 1e-10), {}, (1e-8, 1e-10)),  # the scenario's defaults, asked for
]


@pytest.mark.parametrize(("method", "given", "expected"), RULE)
def test_tolerances_follow_the_rule(method, given, expected):
    chosen = method.tolerances(with_tolerances(**given))
    assert (chosen.relative, chosen.absolute) == expected


def test_the_solvers_themselves_have_the_same_defaults():
    for method, own in ((qb.Direct(), direct.Tolerances()), (qb.Harmonic(), harmonic.TOLERANCES)):
        chosen = method.tolerances(SHORT)
        assert (chosen.relative, chosen.absolute) == (own.relative, own.absolute)


@pytest.mark.parametrize(
    ("kind", "tolerances"), [(qb.Direct, (1e-8, 1e-10, 1e-13)), (qb.Harmonic, (1e-5, 1e-8, 1e-12))]
)
def test_a_finer_tolerance_makes_a_truer_run(kind, tolerances):
    """Of the slow motion of a step, against the finest; coarser ones are bound by stability."""
    scenario = SHORT.with_overrides({"simulation.duration": 2.0})
    runs = [qb.simulate(scenario, kind(r, 0.01 * r)) for r in tolerances]
    coarse, fine, true = (run["bus_rate"].isel(time=-1).to_numpy() for run in runs)
    assert np.abs(fine - true).max() < 0.05 * np.abs(coarse - true).max()
    assert [run.attrs["relative_tolerance"] for run in runs] == list(tolerances)
    assert [run.attrs["absolute_tolerance"] for run in runs] == [0.01 * r for r in tolerances]
    assert runs[0].attrs["steps"] < runs[1].attrs["steps"] < runs[2].attrs["steps"]


WRONG = [
    (lambda kind: kind("x"), TypeError, "relative_tolerance: expected a number above 0, got 'x'"),
    (lambda kind: kind(0.0), ValueError, "relative_tolerance: expected a finite number above 0"),
    (lambda kind: kind(1.0), ValueError, r"relative_tolerance: .* from 1e-13 to 0\.01"),
    (lambda kind: kind(absolute_tolerance=1e-30), ValueError, "absolute_tolerance: .* from 1e-16"),
    (lambda kind: kind(absolute_tolerance=True), TypeError, "absolute_tolerance: .*got true"),
    (lambda kind: qb.simulate(SHORT, kind), ValueError, r"method: .* Direct\(\.\.\.\) or"),
    (lambda kind: qb.verify(SHORT, kind), ValueError, r"method: .* Harmonic\(\.\.\.\)"),
]  # fmt: skip


@pytest.mark.parametrize("kind", [qb.Direct, qb.Harmonic])
@pytest.mark.parametrize(("call", "error", "message"), WRONG)
def test_wrong_tolerances_and_methods_are_told_by_name(kind, call, error, message):
    with pytest.raises(error, match=message):
        call(kind)


def test_a_run_with_other_tolerances_is_not_continued(tmp_path):
    def stop(t):
        raise KeyboardInterrupt

    scenario = SHORT.with_overrides({"simulation.duration": 1.5})
    checkpoint = tmp_path / "run.checkpoint"
    with pytest.warns(qb.QuietbusWarning, match="interrupted"):
        qb.simulate(scenario, "direct", progress=stop, checkpoint=checkpoint)
    with pytest.raises(CheckpointError, match="differs in relative_tolerance"):
        qb.simulate(scenario, qb.Direct(1e-9), checkpoint=checkpoint, resume=True)
    run = qb.simulate(scenario, qb.Direct(1e-8), checkpoint=checkpoint, resume=True)
    assert run.attrs["status"] == "complete"  # the same, said in another way


def test_a_method_is_made_without_loading_jax():
    script = "import sys, quietbus as qb; qb.Harmonic(1e-9); raise SystemExit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], timeout=60).returncode == 0
