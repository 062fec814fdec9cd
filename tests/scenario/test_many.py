"""Several groups of units, several platforms, a payload: what is read, and what is refused."""

import copy
import re
import warnings
from typing import Literal

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import quietbus as qb
from oracles.scenarios import BODY, CMGS, PLATFORM, WHEELS, ZHANG, mixed, payload, two
from quietbus.asked import scenario_asked
from quietbus.build import build_initial_state, build_satellite
from quietbus.model.gimbals import GimbalServos, HeldGimbals
from quietbus.model.rotors import ConstantSpeed, RunUp, WheelMotors
from quietbus.model.steering import PseudoInverse
from quietbus.report import report_page
from quietbus.scenario import Scenario, ScenarioError, load_scenario
from quietbus.scenario.actuators import ACTUATORS
from quietbus.scenario.as_read import as_read
from quietbus.scenario.base import Part
from quietbus.scenario.plausibility import implausible
from quietbus.scenario.text import write_yaml
from quietbus.spatial.rotation import quaternion_to_matrix

KINDS = {"mixed": mixed, "two": two, "payload": payload}


def refusal(data: dict) -> list[str]:
    """What is told of a file with these data, line by line."""
    with pytest.raises(ScenarioError) as error:
        Scenario.from_yaml(write_yaml(data), "s.yaml")
    return str(error.value).splitlines()


def line_of(data: dict, *path: str | int) -> int:
    """Line of a key in the file, found by a mark in its place."""
    marked = copy.deepcopy(data)
    within = marked
    for key in path[:-1]:
        within = within[key]
    within[path[-1]] = "here it is"
    return 1 + write_yaml(marked).split("here it is")[0].count("\n")


# ---- what is read


@pytest.mark.parametrize("kind", KINDS)
def test_written_and_read_again_it_is_the_same_without_a_warning(kind):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scenario = Scenario.from_dict(KINDS[kind]())
        again = Scenario.from_yaml(scenario.to_yaml())
        assert again == scenario
        assert hash(again) == hash(scenario)
        assert Scenario.from_dict(scenario.to_dict()) == scenario
        assert scenario.with_mount("rigid").with_mount("isolated") == scenario


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_as_likely_as_what_it_is_made_of(kind):
    assert list(implausible(Scenario.from_dict(KINDS[kind]()))) == []


def test_blocks_of_one_plate_become_clusters_of_their_own_numbered_through():
    scenario = Scenario.from_dict(mixed())
    cmgs, wheels = build_satellite(scenario).clusters
    assert [type(c.gimbals) for c in (cmgs, wheels)] == [GimbalServos, HeldGimbals]
    assert [type(c.rotors) for c in (cmgs, wheels)] == [ConstantSpeed, WheelMotors]
    assert (cmgs.hosts, wheels.hosts) == (("plate",), ("plate",))
    assert (cmgs.name, wheels.name) == ("cluster 0", "cluster 1")
    assert scenario.units.count == cmgs.count + wheels.count == len(scenario.units.placed())
    alone = load_scenario("wheels-demo").cluster
    assert wheels.rotors.torque_limit == pytest.approx([alone.motor.torque_limit] * wheels.count)
    assert wheels.units.rotor_speed == pytest.approx([u.rotor.speed for u in alone.placed()])


def test_random_phases_go_by_the_number_through_all_blocks():
    """A second block of the same wheels has other phases than the first."""
    wheels = {key: value for key, value in WHEELS.items() if key != "rotor_phases"}
    scenario = Scenario.from_dict(ZHANG | {"cluster": [wheels, wheels], "control": "none"})
    first, second = (c.units.rotor_phase for c in build_satellite(scenario).clusters)
    drawn = scenario.units.phases()
    assert np.concatenate([first, second]) == pytest.approx(drawn)
    assert len(set(drawn)) == len(drawn)


def test_random_phases_are_shown_as_they_are_on_every_platform():
    data = two()
    for platform in data["platforms"]:
        platform["cluster"] = platform["cluster"] | {"rotor_phases": "random"}
    scenario = Scenario.from_dict(data)
    shown = [text for name, text in as_read(scenario) if name == "rotor phases"]
    told = [float(x) for text in shown for x in re.findall(r"-?\d+\.?\d*", text)]
    np.testing.assert_allclose(told, np.degrees(scenario.units.phases()), rtol=1e-3)


def test_a_block_may_run_up_while_others_are_steered():
    data = mixed()
    data["cluster"][1]["run_up"] = {"duration": "3 s"}
    satellite = build_satellite(Scenario.from_dict(data))
    assert type(satellite.clusters[1].rotors) is RunUp
    assert satellite.control.actuators == ("cluster 0",)


def test_an_entry_of_a_block_may_be_overridden():
    changed = Scenario.from_dict(mixed()).with_overrides({"cluster[1].motor.torque_limit": "3 N*m"})
    assert changed.cluster[1].motor.torque_limit == 3.0
    assert Scenario.from_dict(two()).number("platforms[1].isolator.offset[0]") == 0.8


def test_wheels_alone_take_the_pseudo_inverse_on_several_platforms_too():
    data = two()
    data["platforms"][0]["cluster"] = [WHEELS, WHEELS]
    del data["control"]["steering"]
    satellite = build_satellite(Scenario.from_dict(data))
    assert type(satellite.control.steering) is PseudoInverse
    assert len(satellite.control.actuators) == 3


def test_platforms_stand_where_their_isolators_say():
    """Oracle: offset and orientation written out; the run starts with all bodies as one."""
    scenario = Scenario.from_dict(two() | {"initial": {"attitude": [0.1, -0.2, 0.3]}})
    satellite = build_satellite(scenario)
    assert [body.name for body in satellite.bodies] == ["bus", "north", "south"]
    assert [legs.hosts for legs in satellite.hexapods] == [("north", "bus"), ("south", "bus")]
    turn = Rotation.from_euler("ZYX", [0.2, 0.3, 0.0])
    up = np.array([0.0, 0.0, scenario.platforms[1].isolator.separation])
    origin = np.array([0.8, 0.0, 0.6]) + turn.apply(up)
    mount = satellite.mount("south")
    assert mount.p_BX_B == pytest.approx(origin)
    assert np.asarray(quaternion_to_matrix(mount.q_BX)) == pytest.approx(turn.as_matrix())
    south = build_initial_state(scenario, satellite).bodies["south"]
    R_NB = Rotation.from_euler("ZYX", [0.3, -0.2, 0.1])
    assert south.p_NX_N == pytest.approx(R_NB.apply(origin))
    place, attitude = scenario.place("south")
    assert place == pytest.approx(origin)
    assert attitude.as_matrix() == pytest.approx(turn.as_matrix())


def test_a_platform_may_stand_on_another():
    """Listed before what it stands on; its place is that of both, one after the other."""
    data = two()
    data["platforms"][0]["on"] = "south"
    scenario = Scenario.from_dict(data)
    satellite = build_satellite(scenario)
    assert [(mount.body, mount.base) for mount in satellite.mounts] == [
        ("south", "bus"),
        ("north", "south"),
    ]
    up = np.array([0.0, 0.0, scenario.platforms[0].isolator.separation])
    turn = Rotation.from_euler("ZYX", [0.2, 0.3, 0.0])
    on_south = up + np.array(ZHANG["isolator"]["offset"])
    place = np.array([0.8, 0.0, 0.6]) + turn.apply(up + on_south)
    assert satellite.nominal()["north"].p == pytest.approx(place)
    assert scenario.place("north")[0] == pytest.approx(place)


def test_mounts_may_differ():
    data = two()
    data["platforms"][1]["isolator"]["mount"] = "rigid"
    scenario = Scenario.from_dict(data)
    assert scenario.mount == "mixed"
    assert build_satellite(scenario).free == ("bus", "north")


@pytest.mark.parametrize("kind", [two, payload])
@pytest.mark.parametrize("mount", ["isolated", "rigid"])
def test_a_mount_that_is_asked_for_is_that_of_all_bodies(kind, mount):
    asked = scenario_asked(Scenario.from_dict(kind()), mount)
    assert asked.mount == mount
    assert {m.welded for m in build_satellite(asked).mounts} == {mount == "rigid"}


@pytest.mark.slow
def test_a_payload_is_compared_on_both_mounts():
    runs = qb.compare(Scenario.from_dict(payload() | {"simulation": {"duration": 0.05}}))
    assert {mount: run.attrs["mount"] for mount, run in runs.items()} == {
        "isolated": "isolated",
        "rigid": "rigid",
    }
    assert all(np.all(qb.worst_over_phases(run) > 0.0) for run in runs.values())


def test_what_an_analysis_leaves_out_of_several_bodies_is_said():
    study = qb.analyze(Scenario.from_dict(two()))
    assert any("are of" in note and "alone" in note for note in study.notes)
    bodies = {mode.name.partition(":")[0] for mode in study.modes["fixed_base"]}
    assert bodies == {site.name for site in study.scenario.sites}
    assert len(study.modes["fixed_base"]) == 12


def test_a_payload_is_a_body_with_legs_and_without_units():
    scenario = Scenario.from_dict(payload())
    satellite = build_satellite(scenario)
    bench = satellite.body("payload")
    assert bench.mass_X == 30.0
    assert bench.p_XXcm_X == pytest.approx([0.0, 0.0, 0.1])
    assert satellite.mount("payload").p_BX_B[2] == pytest.approx(
        -1.2 + scenario.isolator.separation
    )
    assert [cluster.hosts for cluster in satellite.clusters] == [("plate",)]
    assert scenario.legs == 12


def test_lines_of_sight_are_on_the_payload_unless_they_say_otherwise():
    scenario = Scenario.from_dict(payload())
    assert scenario.seen_from("camera") == "payload"
    assert scenario.seen_from("tracker") == "bus"
    on_plate = Scenario.from_dict(ZHANG | {"lines_of_sight": {"c": {"direction": [1, 0, 0]}}})
    assert on_plate.seen_from("c") == "bus"
    there = on_plate.with_overrides({"lines_of_sight.c.on": "plate"})
    assert there.seen_from("c") == "plate"


def test_a_direction_is_in_the_frame_of_its_body():
    data = two()
    data["lines_of_sight"] = {"c": {"direction": [1, 0, 0], "on": "south"}}
    turned = Rotation.from_euler("ZYX", [0.2, 0.3, 0.0]).apply([1.0, 0.0, 0.0])
    assert Scenario.from_dict(data).sight("c").direction == pytest.approx(turned)


def test_loads_act_on_any_body():
    data = two() | {"loads": [{"body": "south", "force": ["1 N", 0, 0]}]}
    (load,) = build_satellite(Scenario.from_dict(data)).others
    assert load.hosts == ("south",)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_run_has_its_bodies_in_its_file_and_on_its_page(kind, tmp_path):
    scenario = Scenario.from_dict(KINDS[kind]())
    run = qb.simulate(scenario, "harmonic", duration=0.5)
    assert run.sizes["cmg"] == scenario.units.count
    assert run.sizes["leg"] == scenario.legs
    named = ["platform" if body == "plate" else body for body in scenario.bodies]
    assert {f"{name}_rate_jitter_rms" for name in named} <= set(run.data_vars)
    qb.save_run(run, tmp_path / "run.nc")
    assert qb.load_run(tmp_path / "run.nc").identical(run)
    page = report_page(run)
    assert all(name in page for name in named)
    qb.save_run(run.drop_vars(f"{named[-1]}_rate"), tmp_path / "less.nc")
    with pytest.raises(ValueError, match=f"it has no {named[-1]}_rate$"):
        qb.load_run(tmp_path / "less.nc")


# ---- what is refused: data, place of the mistake, what is told


def _named(name):
    data = two()
    data["platforms"][1]["name"] = name
    return data, ("platforms", 1, "name")


def _on(name):
    data = two()
    data["platforms"][1]["on"] = name
    return data, ("platforms", 1, "on")


def _loop():
    data = two()
    data["platforms"][0]["on"], data["platforms"][1]["on"] = "south", "north"
    return data, ("platforms", 0, "on")


def _bench(**changes):
    data = payload()
    data["payload"] |= changes
    return data, ("payload", *changes)


def _unseen(lines):
    data = payload()
    if lines is None:
        del data["lines_of_sight"]
    else:
        data["lines_of_sight"] = lines
    return data, ("payload",)


def _load(body):
    return two() | {"loads": [{"body": body, "force": [1, 0, 0]}]}, ("loads", 0, "body")


def _line(body):
    data = payload()
    data["lines_of_sight"]["camera"]["on"] = body
    return data, ("lines_of_sight", "camera", "on")


def _five_legs():
    data = two()
    legs = data["platforms"][1]["isolator"]["legs"]
    for key in ("upper_joints", "lower_joints", "universal_axes"):
        legs[key] = legs[key][:5]
    return data, ("platforms", 1, "isolator", "legs")


def _both(key):
    return two() | {key: ZHANG[key]}, (key,)


def _blocks(*blocks, at):
    return ZHANG | {"cluster": list(blocks)}, ("cluster", *at)


def _without(key, of):
    return {name: value for name, value in of.items() if name != key}


def _wheel_table():
    data = mixed()
    data["cluster"][1]["motor"]["speed_limit"] = "10 rpm"
    data["cluster"][1]["units"][0]["rotor"] = {"speed": "900 rpm"}
    return data, ("cluster", 1, "units", 0, "rotor", "speed")


def _run_up(data, *path):
    within = data
    for key in path:
        within = within[key]
    within["run_up"] = {"duration": 3}
    return data, (*path, "run_up")


def _platforms(value):
    return two() | {"platforms": value}, ("platforms",)


def _strut(value):
    data = two()
    legs = data["platforms"][0]["isolator"]["legs"]
    del legs["stiffness"], legs["damping"]
    legs["strut"] = value
    return data, ("platforms", 0, "isolator", "legs", "strut")


MANY = _without("units", WHEELS) | {"pyramid": {"skew": 1, "radius": 1, "units": 600}}
REFUSED = {
    "two platforms of one name": (
        *_named("north"),
        "expected a name of its own, got 'north', which another body has already",
    ),
    "a platform named as the bus": (
        *_named("bus"),
        "expected a name of its own, got 'bus', which is the satellite's own",
    ),
    "a platform named as a result": (
        *_named("gimbal"),
        "expected a name of its own, got 'gimbal', which results and models call something else",
    ),
    "a name that no variable can have": (
        *_named("a/b"),
        "expected a name of its own, got 'a/b', whose '/' cannot be in the name of a result",
    ),
    "a payload named as the plate": (
        *_bench(name="plate"),
        "expected a name of its own, got 'plate', which another body has already",
    ),
    "a body that nothing holds": (
        *_five_legs(),
        "expected legs that hold the plate in all six directions; these 5 leave free: ",
    ),
    "a payload without legs": (
        _without("payload", payload()) | {"payload": {"body": BODY}},
        ("payload",),
        ".isolator: expected a mapping with keys among mount, offset, orientation, separation, "
        "legs, got nothing",
    ),
    "a platform on an unknown body": (
        *_on("bush"),
        "expected a body, one of bus, north; got 'bush'",
    ),
    "a platform on itself": (*_on("south"), "expected a body, one of bus, north; got 'south'"),
    "a loop of bodies": (
        *_loop(),
        "expected bodies that stand on the bus in the end; got a loop: north on south on north",
    ),
    "a load on an unknown body": (
        *_load("plate"),
        "expected a body, one of bus, north, south; got 'plate'",
    ),
    "a line of sight on an unknown body": (
        *_line("paylod"),
        "expected a body, one of bus, plate, payload; got 'paylod'",
    ),
    "a payload without line of sight": (
        *_unseen(None),
        "expected lines_of_sight on it, since it carries the optics; got none",
    ),
    "a payload that no line of sight is on": (
        *_unseen({"c": {"direction": [1, 0, 0], "on": "bus"}}),
        "expected lines_of_sight on it, since it carries the optics; got those on bus alone",
    ),
    "units on a payload": (
        *_bench(cluster=CMGS),
        "unknown key 'cluster'; known here: name, on, body, isolator",
    ),
    "isolator beside platforms": (
        *_both("isolator"),
        "expected it within platforms, since several platforms are given; got both",
    ),
    "cluster beside platforms": (
        *_both("cluster"),
        "expected it within platforms, since several platforms are given; got both",
    ),
    "platforms by name": (
        *_platforms({"north": PLATFORM}),
        "expected a list of one or more platforms, or isolator and cluster instead, got a mapping",
    ),
    **{
        f"platforms: {got}": (
            *_platforms(value),
            "expected a list of one or more platforms, or isolator and cluster instead, "
            f"got {got}",
        )
        for value, got in ((2, "2"), (None, "nothing"), ([], "nothing"), ({}, "a mapping"))
    },
    "a payload that is forgotten": (
        ZHANG | {"payload": None},
        ("payload",),
        "expected a mapping with keys among name, on, body, isolator, got nothing",
    ),
    "wheels without a type": (
        *_blocks(CMGS, _without("type", WHEELS), at=(1,)),
        ".type: expected wheel, as a block with housing has it (left out, it is cmg), got nothing",
    ),
    "a type that is forgotten": (
        *_blocks(CMGS | {"type": None}, WHEELS, at=(0, "type")),
        "expected one of cmg, wheel, got nothing",
    ),
    "a strut without type": (
        *_strut({"stiffness": "20 kN/m"}),
        ".type: expected spring_damper, or a type that --parts FILE.py registers, got nothing",
    ),
    "a strut that is a word": (
        *_strut("spring_damper"),
        "expected a mapping with the key type, got 'spring_damper'",
    ),
    "no block": (
        *_blocks(at=()),
        "expected a list of one or more blocks of CMGs or wheels, got [] (0 of them)",
    ),
    "both kinds in one block": (
        *_blocks(CMGS, WHEELS | {"units": [{"type": "cmg"}]}, at=(1, "units", 0, "type")),
        "expected wheel as before, since one block cannot mix CMGs and reaction wheels (a list of "
        "blocks can), got 'cmg'",
    ),
    "a weight": (
        *_blocks(CMGS, WHEELS | {"weight": 2}, at=(1, "weight")),
        "unknown key 'weight'; known here: pyramid, rotor, rotor_phases, run_up, type, units, ",
    ),
    "wheels with a limit beside wheels without": (
        *_blocks(WHEELS | {"motor": {}}, WHEELS, CMGS, at=(0, "motor")),
        ".torque_limit: expected a limit, since cluster[1] has one and blocks share a torque by "
        "their limits; got none",
    ),
    "gimbals with a limit beside gimbals without": (
        *_blocks(CMGS | {"gimbal_rate_limit": 1}, CMGS, at=(1,)),
        ".gimbal_rate_limit: expected a limit, since cluster[0] has one and blocks share a torque "
        "by their limits; got none",
    ),
    "wheels that start beyond their limit": (
        *_wheel_table(),
        "expected at most the motor's speed limit (1.0472 rad/s), got 94.2478 rad/s for wheel 0",
    ),
    "steered gimbals of a block that runs up from rest": (
        *_run_up(mixed(), "cluster", 0),
        "expected control: none or steering: {law: none} for rotors that run up from, down to or "
        "through rest: without momentum gimbals give no torque",
    ),
    "steered gimbals of a platform that runs up from rest": (
        *_run_up(two(), "platforms", 0, "cluster"),
        "expected control: none or steering: {law: none} for rotors that run up from, down to or ",
    ),
    "more units than there may be": (
        *_blocks(MANY, MANY, at=()),
        "expected at most 1,000 units in all blocks, got 1,200",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_refused_in_one_message_with_file_line_and_path(kind):
    data, path, message = REFUSED[kind]
    (told,) = refusal(data)
    where = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path)[1:]
    below, _, rest = message.partition(": ")
    if below.startswith("."):  # of a key that is missing: told at what it is missing in
        where, message = where + below, rest
    assert told.startswith(f"s.yaml: {where} (line {line_of(data, *path)}): {message}"), told


def test_rotors_that_a_plate_turns_are_judged_by_their_axes_in_the_bus():
    """Wheels on two platforms whose axes span all directions together, and alone do not."""
    flat = {"spin_axis": [0, 0, 1], "position": [0, 0, 0]}
    wheels = _without("pyramid", WHEELS) | {"units": [flat, flat | {"spin_axis": [1, 0, 0]}]}
    data = two()
    for platform in data["platforms"]:
        platform["cluster"] = {k: v for k, v in wheels.items() if k != "rotor_phases"}
    del data["control"]["steering"]
    data["platforms"][1]["isolator"]["orientation"] = [0, 0, "90 deg"]
    assert Scenario.from_dict(data).units.count == 4
    data["platforms"][1]["isolator"]["orientation"] = [0, "90 deg", 0]
    (told,) = refusal(data)
    assert "these 4 give no torque about [0, " in told


class Idle(Part):
    """An actuator of a user's own."""

    type: Literal["idle"]


OWN_NAMES = ["legs", "cluster", "cluster 0", "north cluster", "bus", "north", "load 1", "cmg2"]


@pytest.mark.parametrize("name", OWN_NAMES)
def test_an_actuator_has_a_name_of_its_own(name, monkeypatch):
    monkeypatch.setitem(ACTUATORS.known, "idle", Idle)
    data = two() | {"actuators": {name: {"type": "idle"}}}
    (told,) = refusal(data)
    line = write_yaml(data).split(f"\n  {name}: {{type: idle}}")[0].count("\n") + 2
    assert told.startswith(f"s.yaml: actuators.{name} (line {line}): expected a name of its own")
    assert Scenario.from_dict(two() | {"actuators": {"rods": {"type": "idle"}}}).actuators


def test_unknown_type_of_a_strut_names_those_that_are_known():
    data = copy.deepcopy(ZHANG)
    legs = data["isolator"]["legs"]
    legs["strut"] = {"type": "spring_dampr", "stiffness": legs.pop("stiffness"), "damping": 1}
    del legs["damping"]
    line = line_of(data, "isolator", "legs", "strut", "type")
    assert refusal(data) == [
        f"s.yaml: isolator.legs.strut.type (line {line}): expected spring_damper, or a type that "
        "--parts FILE.py registers, got 'spring_dampr'"
    ]


def test_an_actuator_without_type_is_told():
    (told,) = refusal(ZHANG | {"actuators": {"rods": {"torque": "1 N*m"}}})
    said = r"expected a type that --parts FILE\.py registers, got nothing"
    assert re.fullmatch(rf"s\.yaml: actuators\.rods\.type \(line \d+\): {said}", told)
