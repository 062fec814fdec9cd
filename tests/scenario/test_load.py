"""Scenarios from files, built-ins and text; what they round-trip to."""

import pickle
import re
import time

import pytest

from quietbus.scenario import (
    Scenario,
    ScenarioError,
    builtin_names,
    builtin_text,
    load_scenario,
    template_text,
)

TEXT = builtin_text("zhang2012")
ZHANG = load_scenario("zhang2012")


def refusal(text: str) -> str:
    with pytest.raises(ScenarioError) as error:
        Scenario.from_yaml(text, "s.yaml")
    return str(error.value)


@pytest.mark.parametrize("name", ["wheels-demo", "zhang2012", "zhang2012-slew"])
def test_builtin_comes_back_from_its_own_yaml(name):
    scenario = load_scenario(name)
    text = scenario.to_yaml()
    assert Scenario.from_yaml(text) == scenario
    assert scenario.name == name
    assert max(map(len, text.splitlines())) < 140
    assert hash(scenario) == hash(load_scenario(name))


def test_builtins_are_listed():
    assert builtin_names() == ["wheels-demo", "zhang2012", "zhang2012-slew"]


def test_slew_flies_the_same_satellite():
    slew = load_scenario("zhang2012-slew")
    for part in ("bus", "isolator", "cluster", "control"):
        assert getattr(slew, part) == getattr(ZHANG, part)


def test_template_is_the_paper_satellite_under_another_name():
    template = Scenario.from_yaml(template_text())
    assert template == ZHANG.with_overrides({"name": "my-satellite"})
    assert template.name == "my-satellite"


def test_paper_values_of_section_6():
    legs, cluster = ZHANG.isolator.legs, ZHANG.cluster
    assert ZHANG.bus.mass == 1000.0
    assert ZHANG.bus.inertia == ((1100, -20, -10), (-20, 900, -15), (-10, -15, 800))
    assert (legs.stiffness, legs.damping) == (20e3, 500.0)
    assert legs.spherical_friction == legs.universal_friction == 1e-4
    assert cluster.count == 4
    assert cluster.rotor.static_imbalance == pytest.approx(1.36e-5)
    assert cluster.rotor.dynamic_imbalance == pytest.approx(1.7e-6)
    assert ZHANG.control is not None
    assert (ZHANG.control.pid.kp, ZHANG.control.pid.ki, ZHANG.control.pid.kd) == (200, 0.1, 2500)


ASSUMED = [  # what the paper does not state
    *("offset", "separation", "center_of_mass", "upper_part", "lower_part"),
    *("pyramid", "gimbal_body", "momentum", "speed", "transverse_inertia"),
    *("rotor_phases", "gimbal_angles", "gimbal_bandwidth", "steering"),
    *("rate", "guidance", "duration", "output_rate"),
]


@pytest.mark.parametrize("name", ["zhang2012", "zhang2012-slew"])
@pytest.mark.parametrize("key", ASSUMED)
def test_values_the_paper_does_not_state_are_marked(name, key):
    """'assumption' stands on the key's line, the one below or in the comment above."""
    lines = builtin_text(name).splitlines()
    at = next(i for i, line in enumerate(lines) if re.match(rf"\s*{key}:", line))
    first = at
    while lines[first - 1].strip().startswith("#"):
        first -= 1
    assert any("assumption" in line for line in lines[first : at + 2])


def test_loading_a_builtin_is_quick():
    load_scenario("zhang2012")
    start = time.perf_counter()
    load_scenario("zhang2012")
    assert time.perf_counter() - start < 0.3


def test_file_is_read(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT, encoding="utf-8")
    assert load_scenario(path) == load_scenario(str(path)) == ZHANG


def test_all_problems_at_once_with_file_line_field_and_expectation(tmp_path):
    path = tmp_path / "bad.yaml"
    text = (
        TEXT.replace("damping: 500 N*s/m", "damping: 500 N/m")
        .replace("mount: isolated", "mount: ridgid")
        .replace("6000 rpm ", "100 Hz")
    )
    path.write_text(text, encoding="utf-8")
    lines = text.splitlines()

    def line(start):
        return 1 + next(i for i, each in enumerate(lines) if each.strip().startswith(start))

    with pytest.raises(ScenarioError) as error:
        load_scenario(path)
    assert str(error.value).splitlines() == [
        f"{path}: isolator.mount (line {line('mount')}): "
        "expected 'isolated' or 'rigid', got 'ridgid'",
        f"{path}: isolator.legs.damping (line {line('damping')}): "
        "expected a damping in N*s/m, got '500 N/m' (a stiffness?)",
        f"{path}: cluster.rotor.speed (line {line('speed')}): expected an angular velocity in "
        "rad/s, got '100 Hz' (turns or radians? write rpm, rev/s, deg/s or rad/s)",
    ]
    assert [problem.path[-1] for problem in error.value.problems] == ["mount", "damping", "speed"]
    assert error.value.source == str(path)


def test_line_in_flow_and_block_lists():
    text = TEXT.replace("    - [-20, 900, -15]", "    - [-20,\n       nonsense, -15]")
    row = text.splitlines().index("    - [-20,") + 1
    assert f"bus.inertia[1][1] (line {row + 1}): expected a moment of inertia" in refusal(text)


def test_line_of_a_merged_key_is_where_it_is_written():
    text = "extra: &m {mass: 5 s}\nbus:\n  <<: *m\n  inertia: [[1,0,0],[0,1,0],[0,0,1]]\n"
    assert "bus.mass (line 1): expected a mass in kg, got '5 s' (a time?)" in refusal(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("bus: {mass: 1, mass: 2}", "s.yaml: bus.mass (line 1): this key appears twice"),
        ("loads:\n- body: bus\n  body: bus", "loads[0].body (line 3): this key appears twice"),
        ("name: x\nbus: [1", "s.yaml: line 2: not valid YAML: while parsing a flow sequence"),
        ("name: x\n\tbus: 1", "s.yaml: line 2: not valid YAML"),
        ("a: *b", "s.yaml: line 1: not valid YAML: found undefined alias 'b'"),
        ("a: 1\n---\nb: 2", "s.yaml: line 2: not valid YAML: expected a single document"),
        ("name: \0", "s.yaml: not valid YAML: unacceptable character"),
        ("", "s.yaml: expected a mapping with keys among name, bus, "),
        ("- 1", "s.yaml: expected a mapping with keys among name, bus, "),
        ("a: &a [*a]", "s.yaml: a[0] (line 1): expected a value, got an alias of what it is"),
        ("loads: &a {b: *a}", "s.yaml: loads.b (line 1): expected a value, got an alias of what"),
        ("1: 2", "unknown key '1'"),
        ("bus: !!python/object:os.system x", "bus (line 1): expected a value without a tag"),
        ("name: &a true\nbus: {mass: *a}", "bus.mass (line 2): expected a mass in kg, got true"),
    ],
)
def test_broken_text(text, message):
    assert message in refusal(text)
    assert "Traceback" not in refusal(text)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "zhang2021",
            "zhang2021: no such file, and no built-in scenario of that name "
            "(did you mean zhang2012?); built in: wheels-demo, zhang2012, zhang2012-slew",
        ),
        ("folder/none.yaml", "folder/none.yaml: no such file"),
        (".", ".: is a folder; expected a file"),
        ("a\0b", "cannot be read"),
    ],
)
def test_file_that_cannot_be_read(name, message):
    with pytest.raises(ScenarioError) as error:
        load_scenario(name)
    assert message in str(error.value)


def test_file_that_is_not_text(tmp_path):
    path = tmp_path / "run.nc"
    path.write_bytes(b"\x89HDF\r\n\x1a\n\xff")
    with pytest.raises(ScenarioError, match="not a UTF-8 text file"):
        load_scenario(path)


def test_overrides_are_checked_and_leave_the_original():
    changed = ZHANG.with_overrides(
        {
            "isolator.mount": "rigid",
            "simulation.duration": "1 min",
            "bus.inertia[0][0]": 1200,
            "cluster.gimbal_angles.2": "90 deg",
            "control": "none",
        }
    )
    assert changed.isolator.mount == "rigid"
    assert changed.simulation.duration == 60.0
    assert changed.bus.inertia[0] == (1200.0, -20.0, -10.0)
    assert changed.cluster.gimbal_angles == pytest.approx((0, 0, 1.5707963267948966, 0))
    assert changed.control is None
    assert changed.isolator.legs == ZHANG.isolator.legs
    assert ZHANG == load_scenario("zhang2012") != changed


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("isolator.mount", "x", "isolator.mount: expected 'isolated' or 'rigid', got 'x'"),
        ("simulation.durations", 1, "unknown key 'durations'; did you mean 'duration'?"),
        ("isolator.legs.stiffness.x", 1, "isolator.legs.stiffness has no such entry"),
        ("bus.inertia[3]", 1, "bus.inertia[3]: cannot be set, because bus.inertia has no such"),
        ("", 1, "unknown key ''"),
    ],
)
def test_wrong_override_is_refused(path, value, message):
    with pytest.raises(ScenarioError) as error:
        ZHANG.with_overrides({path: value})
    assert str(error.value).startswith("zhang2012 with overrides: ")
    assert message in str(error.value)


def test_error_survives_pickling():
    with pytest.raises(ScenarioError) as error:
        Scenario.from_yaml("name: [", "s.yaml")
    again = pickle.loads(pickle.dumps(error.value))
    assert str(again) == str(error.value)
    assert again.problems == error.value.problems
