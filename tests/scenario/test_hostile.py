"""Scenario files that hang, overflow or fool a reader: each is refused at once, in one message."""

import os
import time

import pytest

from quietbus.scenario import Scenario, ScenarioError, builtin_text, load_scenario
from quietbus.scenario.limits import MOST_ENTRIES, MOST_LETTERS
from quietbus.scenario.text import read_yaml

TEXT = builtin_text("zhang2012")
BOMB = "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}' if k else 'x'] * 10)}]\n" for k in range(9))
MASS = "mass: 1000 kg"
LOADS = "loads: []"
BOMB_IN_LOADS = "loads:\n" + "".join(
    f"  - &b{k} [{', '.join([f'*b{k - 1}' if k else 'x'] * 10)}]\n" for k in range(9)
)
MERGES = "".join(
    f"m{k}: &m{k} {{<<: [{', '.join([f'*m{k - 1}'] * 10 if k else [])}], k{k}: 1}}\n"
    for k in range(9)
)
LINES = "lines_of_sight: {c: {direction: [0, 0, 1]}}\n"
HOSTILE = {
    "alias bomb as a value": (BOMB + TEXT.replace(MASS, "mass: *a8"), "aliases that unfold"),
    "alias bomb in a list": (TEXT.replace(LOADS, BOMB_IN_LOADS), "aliases that unfold"),
    "alias bomb of merges": (MERGES + TEXT, "aliases that unfold"),
    "deep flow lists": ("name: " + 300 * "[" + 300 * "]", "at most 40 lists and mappings"),
    "deep block lists": (2000 * "- ", "at most 40 lists and mappings"),
    "deep mappings": ("a: {" * 200 + "}" * 200, "at most 40 lists and mappings"),
    "too long": ("x" * (MOST_LETTERS + 1), "at most 4,000,000 letters"),
    "many digits": (TEXT.replace(MASS, "mass: " + 5000 * "9"), "bus.mass (line 12): expected a"),
    "many digits in hex": (TEXT.replace(MASS, "mass: 0x" + 5000 * "f"), "bus.mass (line 12)"),
    "bad bool": (TEXT.replace(MASS, "mass: !!bool abc"), "line 12): expected true or false, got"),
    "bad float": (TEXT.replace(MASS, "mass: !!float abc"), "(line 12): expected a number, got"),
    "bad int": (TEXT.replace(MASS, "mass: !!int abc"), "(line 12): expected a whole number, got"),
    "bad date": (TEXT.replace(MASS, "mass: 2001-99-99"), "bus.mass (line 12): expected a mass"),
    "tag of a scalar": (TEXT.replace(MASS, "mass: !kg 1000"), "a value without a tag, got '!kg'"),
    "tag of a mapping": (TEXT.replace("target:", "target: !goal"), "without a tag, got '!goal'"),
    "binary": (TEXT.replace(MASS, "mass: !!binary aGk="), "without a tag, got '!!binary'"),
    "set": (TEXT.replace("bus:  ", "bus: !!set "), "without a tag, got '!!set'"),
    "list as a key": (TEXT + "? [a, b]\n: 1\n", "expected a text as key"),
    "many units": (TEXT.replace("height: 0 m", "units: 1000000000"), "count of at most 1,000"),
    "many harmonics": (
        TEXT.replace(
            "  rotor_phases",
            "  gimbal_motor: {stepping: {steps_per_turn: 200, frequency: 20, damping: 0.3, "
            "harmonics: 1000000000}}\n  rotor_phases",
        ),
        "harmonics (line 82): expected a count of at most 1,000",
    ),
    "list as a metric": (
        TEXT + LINES + "requirements: [{metric: [1], line_of_sight: c, at_most: 1}]\n",
        "requirements[0].metric (line 120): expected one of",
    ),
    "mapping as a metric": (
        TEXT + LINES + "requirements: [{metric: {a: 1}, line_of_sight: c, at_most: 1}]\n",
        "requirements[0].metric (line 120): expected one of",
    ),
    "escape letters": (TEXT.replace(": zhang2012", ': "\\e]0;x\\a"'), r"got '\x1b]0;x\x07'"),
    "null letter": (TEXT.replace(": zhang2012", ': "a\\0b"'), r"got 'a\x00b' (control"),
    "turned writing": (TEXT.replace(": zhang2012", ': "a\u202eb"'), r"got 'a\u202eb' (control"),
    "lone surrogate": (TEXT.replace(": zhang2012", ': "\\ud800"'), "name"),
    "long name": (TEXT.replace(": zhang2012", ": " + 240 * "x"), "(240 letters)"),
    "name of a line": (TEXT + 'lines_of_sight: {"a\\eb": {direction: [0, 0, 1]}}\n', r"a\x1bb"),
    "escape in a key": (TEXT + '"\\e[31m": 1\n', r"unknown key '\x1b[31m'"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_text_is_refused_at_once_in_one_short_message(kind):
    text, message = HOSTILE[kind]
    start = time.process_time()
    with pytest.raises(ScenarioError) as refused:
        Scenario.from_yaml(text, "s.yaml")
    assert time.process_time() - start < 1.0
    told = str(refused.value)
    assert message in told
    assert len(told) < 600
    assert all(line.isprintable() for line in told.split("\n"))


@pytest.mark.parametrize("depth", [3, 100_000])
def test_nested_python_data_are_refused_too(depth):
    inner = []
    for _ in range(depth if depth > 3 else 0):
        inner = [inner]
    if depth == 3:
        inner.append(inner)
    with pytest.raises(ScenarioError, match="at most 40 lists and mappings in each other"):
        Scenario.from_dict({"name": inner})


@pytest.mark.parametrize(
    "value",
    [10**5000, [[10**5000]], {"a": 1}, 1j, object(), b"x", set()],
    ids=lambda v: type(v).__name__,
)
def test_any_value_is_told_shortly(value):
    with pytest.raises(ScenarioError, match=r"bus\.mass: expected a mass in kg, got") as refused:
        load_scenario("zhang2012").with_overrides({"bus.mass": value})
    assert len(str(refused.value)) < 300


def test_a_scenario_at_the_limit_is_read():
    data, line_of = read_yaml("a:\n" + "- 1\n" * 5000, "s")
    assert (len(data["a"]), line_of(("a", 4999))) == (5000, 5001)
    with pytest.raises(ScenarioError, match="at most 100,000 entries, got more"):
        read_yaml("[" + "1," * MOST_ENTRIES + "1]", "s")


def test_aliases_and_merges_that_end_are_read_with_the_lines_of_their_text():
    text = "a: &a {x: 1, y: 2}\nb: &b {y: 3}\nc:\n  <<: [*b, *a]\n  z: *a\n  w: 1\n"
    text += "d: {<<: *a, x: 9}\n"
    data, line_of = read_yaml(text, "s")
    assert data["c"] == {"x": 1, "y": 3, "z": {"x": 1, "y": 2}, "w": 1}
    assert data["d"] == {"x": 9, "y": 2}  # what is written there is stronger than what is merged
    lines = [line_of(path) for path in (("c", "x"), ("c", "y"), ("c", "z"), ("c", "none"))]
    assert lines == [1, 2, 5, 3]


@pytest.mark.parametrize("name", ["[/red]", r"$\frac{1$", "卫星 §1", "<b>&amp;", "100 % _x^2"])
def test_printable_names_are_legal(name):
    changed = load_scenario("zhang2012").with_overrides({"name": name})
    assert Scenario.from_yaml(changed.to_yaml()).name == name


# ---- files


def naming(table):
    return TEXT.replace(
        "    # installation_error", f"    disturbance: {{table: {table}}}\n    #", 1
    )


def refused_table(folder, table):
    (folder / "s.yaml").write_text(naming(table))
    with pytest.raises(ScenarioError) as refused:
        load_scenario(folder / "s.yaml")
    return str(refused.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes of that kind")
def test_pipes_and_devices_are_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name in (tmp_path / "pipe", "/dev/zero", "/dev/null"):
        with pytest.raises(ScenarioError, match="expected a regular file, got a pipe or a device"):
            load_scenario(name)
    assert "a pipe or a device" in refused_table(tmp_path, "pipe")


def test_a_scenario_names_tables_of_its_own_folder_or_of_those_that_the_user_names(
    tmp_path, monkeypatch
):
    home, wheels = tmp_path / "home", tmp_path / "wheels"
    home.mkdir()
    wheels.mkdir()
    secret = wheels / "radial_force.csv"
    secret.write_text("order,kind,coefficient,unit\n1,radial_force,1e-8,kg*m\n")
    (home / "link.csv").symlink_to(secret)
    (home / "diary.txt").write_text("dear diary: nobody shall read this\n1, 2, 3\n")
    (home / "keys.txt").write_text("-----: s3cret\n")
    for name in ("../wheels/radial_force.csv", str(secret), "link.csv"):
        told = refused_table(home, name)
        assert "expected a file in the scenario's folder or in those that QUIETBUS_TABLE_" in told
    for name in ("diary.txt", "keys.txt"):
        told = refused_table(home, name)
        assert "expected a table: rows of numbers, or a header" in told
        assert "dear" not in told
        assert "s3cret" not in told
    monkeypatch.setenv("QUIETBUS_TABLE_FOLDERS", str(wheels))
    scenario = Scenario.from_yaml(naming("../wheels/radial_force.csv"), "s.yaml", str(home))
    assert scenario.cluster.rotor.disturbance.orders[0].radial_force == 1e-8
