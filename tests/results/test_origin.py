"""A run knows its scenario: it is parsed where it comes in, and nowhere on the way."""

import copy
import pickle
import threading
from collections import OrderedDict

import pytest

import quietbus as qb
from quietbus.plots import compare_figures, run_figures
from quietbus.report import write_report
from quietbus.results import origin, with_worst_phases
from quietbus.scenario import schema

CAMERA = {"camera": {"direction": [0, 0, 1]}}
ZHANG = qb.load_scenario("zhang2012").with_overrides({"simulation.duration": 0.1}).to_dict()
REQUIREMENT = "RPE(camera, window = 2 ms) <= 1 deg"


def scenario(name="camera"):
    """A flight of a moment, with something to verify."""
    added = {"name": name, "lines_of_sight": CAMERA, "requirements": [REQUIREMENT]}
    return qb.Scenario.from_dict(ZHANG | added)


@pytest.fixture
def parses(monkeypatch):
    """The texts that the YAML reader is given, of scenarios that nobody has met before."""
    texts = []
    read = schema.read_yaml
    monkeypatch.setattr(schema, "read_yaml", lambda text, *a: texts.append(text) or read(text, *a))
    monkeypatch.setattr(origin, "_kept", OrderedDict())
    return texts


def all_that_reads_a_run(run, tmp_path):
    qb.summarize(run)
    qb.worst_over_phases(run)
    run_figures(run)
    qb.Verification(run).to_dict()
    write_report(run, tmp_path / "run.html")
    qb.summarize(with_worst_phases(run, None).isel(time=slice(0, 50)))


@pytest.mark.parametrize("method", ["direct", "harmonic"])
def test_a_scenario_given_as_an_object_is_never_parsed(method, parses, tmp_path):
    all_that_reads_a_run(qb.simulate(scenario(), method), tmp_path)
    qb.verify(scenario(), method)
    assert len(parses) == 0


def test_a_scenario_given_as_a_file_is_parsed_once(parses, tmp_path):
    (tmp_path / "s.yaml").write_text(scenario().to_yaml())
    runs = qb.compare(str(tmp_path / "s.yaml"))
    for run in runs.values():
        all_that_reads_a_run(run, tmp_path)
    compare_figures(runs)
    assert len(parses) == 1


def test_a_run_from_a_file_is_parsed_once(parses, tmp_path):
    qb.save_run(qb.simulate(scenario()), tmp_path / "run.nc")
    origin._kept.clear()
    all_that_reads_a_run(qb.load_run(tmp_path / "run.nc"), tmp_path)
    assert len(parses) == 1


def test_slices_and_copies_have_the_very_scenario_of_the_run(parses):
    given = scenario()
    run = qb.simulate(given)
    made_of_it = {
        "isel": run.isel(time=slice(0, 10)),
        "instant": run.isel(time=-1),
        "sel": run.sel(axis="x"),
        "copy": run.copy(),
        "deep copy": copy.deepcopy(run),
        "some variables": run[["bus_rate"]],
        "another variable": run.assign(twice=2.0 * run["bus_rate"]),
        "pickle": pickle.loads(pickle.dumps(run)),
    }
    for how, other in made_of_it.items():
        assert qb.scenario_of(other) is qb.scenario_of(run), how
    assert qb.scenario_of(run) == given
    assert not parses


def test_a_run_with_another_text_has_another_scenario(parses):
    run = qb.simulate(scenario())
    other = run.assign_attrs(scenario=scenario("another").to_yaml())
    assert qb.scenario_of(other).name == "another"
    assert len(parses) == 1
    run.attrs["scenario"] = run.attrs["scenario"].replace("name: camera", "name: edited")
    assert qb.scenario_of(run).name == "edited"
    run.attrs["scenario"] = "name: nothing else\n"
    for _ in range(2):  # what cannot be read is told each time
        with pytest.raises(qb.ScenarioError, match=r"the run's scenario.*\n? *bus"):
            qb.scenario_of(run)


def test_what_is_kept_is_bounded_and_the_last_used_stays(parses, monkeypatch):
    texts = [origin.text_of(scenario(f"number{i}")) for i in range(6)]
    monkeypatch.setattr(origin, "MOST_LETTERS", 3 * len(texts[0]))
    origin.scenario_from(texts[0], "first")  # used again, and so the last to go
    origin.text_of(scenario("number6"))
    assert [text.partition("\n")[0] for text in origin._kept] == [
        f"name: number{i}" for i in (5, 0, 6)
    ]
    monkeypatch.setattr(origin, "MOST_LETTERS", 1)
    origin.text_of(scenario("number7"))
    assert len(origin._kept) == 1  # however long it is
    assert not parses
    assert origin.scenario_from(texts[1], "gone").name == "number1"
    assert len(parses) == 1


def test_many_threads_find_their_own(parses, monkeypatch):
    texts = [origin.text_of(scenario(f"number{i}")) for i in range(4)]
    monkeypatch.setattr(origin, "MOST_LETTERS", 2 * len(texts[0]))  # so that all are always in need
    wrong = []

    def work(start):
        for i in range(start, start + 12):
            found = origin.scenario_from(texts[i % 4], "thread").name
            wrong.extend([found] if found != f"number{i % 4}" else [])

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert len(origin._kept) == 2
