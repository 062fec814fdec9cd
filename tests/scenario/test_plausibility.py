"""Values that no satellite has are told, in usual units; those of a satellite are not."""

import warnings

import numpy as np
import pytest

import quietbus as qb
from quietbus.scenario import Scenario, builtin_names, load_scenario
from quietbus.scenario.as_read import as_read
from quietbus.scenario.plausibility import implausible, quantities
from quietbus.scenario.units import Quantity

ZHANG = load_scenario("zhang2012")
LEGS = ZHANG.to_dict()["isolator"]["legs"]
LINES = {"lines_of_sight": {"camera": {"direction": [0, 0, 1]}}}
# changes, the field that is named, what is said of it
ODD = [
    ({"cluster.rotor.speed": 6000}, "cluster.rotor.speed", "6000 rad/s, 57300 rpm"),
    (
        {"cluster.rotor.speed": -6000, "cluster.rotor.momentum": -15},
        "cluster.rotor.speed",
        "-57300",
    ),
    ({"initial.attitude": [1.5, 1.5, 1.5]}, "initial.attitude", "[85.94, 85.94, 85.94] deg"),
    (
        {"isolator.offset": [0, 0, 600]},
        "isolator.offset[2]",
        "600 m: more than 20 times the radius",
    ),
    ({"cluster.gimbal_angles": [30] * 4}, "cluster.gimbal_angles[0]", "30 rad, 1719 deg"),
    ({"cluster.rotor.static_imbalance": 1.36}, "cluster.rotor.static_imbalance", "227 mm off"),
    ({"cluster.rotor.dynamic_imbalance": 1e-3}, "cluster.rotor.dynamic_imbalance", "10000 g cm^2"),
    ({"cluster.pyramid.skew": 53.13}, "cluster.pyramid.skew", "3044 deg"),
    ({"isolator.legs.stiffness": 0.02}, "isolator.legs.stiffness", "swing at some 0.0035"),
    ({"isolator.legs.damping": "500 kN*s/m"}, "isolator.legs.damping", "times critical damping"),
    ({"initial.rate": [0, 1, 0]}, "initial.rate[1]", "57.3 deg/s"),
    ({"cluster.gimbal_rate_limit": 60}, "cluster.gimbal_rate_limit", "3438 deg/s"),
    ({"cluster.rotor.installation_error.beta": 1}, "cluster.rotor.installation_error.beta", "57.3"),
    ({"control.pid.kd": 2.5e6}, "control.pid", "beyond the 10 Hz that attitude control reaches"),
    ({"bus.inertia": (1e9 * np.eye(3)).tolist()}, "bus.inertia", "a radius of gyration of 1e+03 m"),
    (
        {"isolator.legs.upper_joints": [[500 * x for x in row] for row in LEGS["upper_joints"]]},
        "isolator.legs.upper_joints[0][0]",
        "250 m",
    ),
    (
        LINES | {"requirements": ["RPE(camera, window = 20 ms) <= 0.1"]},
        "requirements[0].at_most",
        "0.1 rad, 5.73 deg",
    ),
    (
        {"cluster.rotor.disturbance": {"orders": [{"order": 2, "radial_force": 0.1}]}},
        "cluster.rotor.disturbance.orders[0]",
        "10000 g cm",
    ),
    (
        {"cluster.rotor.static_imbalance": 0, "cluster.rotor.dynamic_imbalance": 0},
        "cluster.rotor",
        "all jitter is zero",
    ),
    (
        {
            "target.attitude": [1, 0, 0],
            "target.guidance": {"max_rate": 0.01, "max_acceleration": 0.01, "max_jerk": 0.01},
        },
        "target.attitude",
        "[57.3, 0, 0] deg: a bare number is in rad; were degrees meant?",
    ),
]


@pytest.mark.parametrize("name", builtin_names())
def test_nothing_is_odd_about_a_built_in(name):
    assert implausible(load_scenario(name)) == []


@pytest.mark.parametrize(("changes", "field", "said"), ODD, ids=[f"{f}" for _, f, _ in ODD])
def test_what_no_satellite_has_is_told_once_by_its_field_and_in_usual_units(changes, field, said):
    notes = [note for note in implausible(ZHANG.with_overrides(changes)) if note.startswith(field)]
    assert len(notes) == 1, notes
    assert notes[0].startswith(f"{field}: read as ")
    assert said in notes[0]


@pytest.mark.parametrize("named", [f for _, f, _ in ODD[:6]])
def test_one_slip_is_one_note(named):
    changes = next(changes for changes, field, _ in ODD if field == named)
    assert len(implausible(ZHANG.with_overrides(changes))) == 1


@pytest.mark.parametrize(
    "changes",
    [
        {"target.attitude": ["90 deg", "45 deg", "0 deg"], "target.guidance": {
            "max_rate": "3 deg/s", "max_acceleration": "0.5 deg/s^2", "max_jerk": 1}},
        {"cluster.gimbal_angles": ["-90 deg", 0, "90 deg", "180 deg"]},
        {"cluster.rotor.static_imbalance": "5 g*cm"},
        {"cluster.rotor_phases": [0, 1, 2, 3]},
        {"isolator.legs.stiffness": "2 kN/m", "isolator.legs.damping": 0},
        {"cluster.rotor.speed": "12000 rpm", "isolator.offset": [0, 2.5, -2]},
    ],
)  # fmt: skip
def test_what_satellites_have_is_not_told(changes):
    assert implausible(ZHANG.with_overrides(changes)) == []


def test_what_units_have_in_common_is_told_once_and_what_is_a_units_own_by_its_number():
    data = ZHANG.to_dict()
    del data["cluster"]["pyramid"]
    data["cluster"]["units"] = [
        {"position": unit.position, "gimbal_axis": unit.gimbal_axis, "spin_axis": unit.spin_axis}
        for unit in ZHANG.cluster.placed()
    ]
    data["cluster"]["units"][2]["rotor"] = {"static_imbalance": 0.5}
    (note,) = implausible(Scenario.from_dict(data))
    assert note.startswith("cluster.units[2].rotor.static_imbalance: read as")
    data["cluster"]["units"][2] = data["cluster"]["units"][2] | {"rotor": {}}
    data["cluster"]["rotor"]["speed"] = 6000
    (note,) = implausible(Scenario.from_dict(data))
    assert note.startswith("cluster.rotor.speed: read as")


def test_all_numbers_with_a_unit_are_looked_at():
    found = {path: quantity for path, _, quantity in quantities(ZHANG)}
    assert all(isinstance(quantity, Quantity) for quantity in found.values())
    for path, unit in (
        (("bus", "inertia", 1, 2), "kg*m^2"),
        (("isolator", "legs", "upper_joints", 5, 2), "m"),
        (("cluster", "rotor", "speed"), "rad/s"),
        (("cluster", "rotor_phases", 3), "rad"),
        (("target", "attitude", 0), "rad"),
        (("simulation", "output_rate"), "Hz"),
    ):
        assert found[path].unit == unit, path


def platforms(**isolator):
    """Two platforms, the second with something else in its isolator."""
    data = ZHANG.to_dict()
    first = {"name": "east", "isolator": data.pop("isolator"), "cluster": data.pop("cluster")}
    second = first | {"name": "west", "isolator": first["isolator"] | isolator}
    return Scenario.from_dict(data | {"platforms": [first, second]})


def test_platforms_at_one_place_are_told():
    """To a millimetre, whatever their attitudes; the built-in's stands at 0.6 m."""
    said = "m on the bus, where east stands too"
    path = "platforms[1].isolator.offset: read as"
    assert implausible(platforms()) == [f"{path} [0, 0, 0.6] {said}"]
    near = platforms(offset=[0, 9e-4, 0.6], orientation=[0, 0, 0.3])
    assert implausible(near) == [f"{path} [0, 0.0009, 0.6] {said}"]
    assert not implausible(platforms(offset=[0, 2e-3, 0.6]))


def test_platforms_that_stand_on_each_other_are_not_at_one_place():
    data = platforms().to_dict()
    data["platforms"][1]["on"] = "east"
    assert not implausible(Scenario.from_dict(data))


def test_python_is_warned_too():
    with pytest.warns(qb.ImplausibleValue, match="offset\\[2\\]: read as 600 m"):
        qb.analyze(ZHANG.with_overrides({"isolator.offset": [0, 0, 600]}))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        qb.analyze(ZHANG)


def test_values_as_read_are_in_usual_units():
    rows = dict(as_read(ZHANG))
    assert rows["4 CMGs"].startswith("15 N m s at 6000 rpm, rotor 6 kg, skew 53.13 deg")
    assert rows["imbalance"] == "static 1.36 g cm, dynamic 17 g cm^2"
    assert rows["struts"] == "6 of 20 kN/m and 500 N s/m"
    assert rows["start"].startswith("[1.5, 1.5, 1.5] deg")
    changed = {
        "cluster.rotor_phases": "random",
        "control": "none",
        "cluster.gimbal_angles": [30] * 4,
    }
    rows = dict(as_read(ZHANG.with_overrides(changed)))
    assert rows["control"] == "none"
    assert rows["gimbals"].startswith("at 1719 deg")
    assert rows["rotor phases"].startswith("random, ")
    wheels = dict(as_read(load_scenario("wheels-demo")))
    assert wheels["4 wheels"].startswith("4 N m s at -2000 to 2000 rpm")
    assert wheels["motors"] == "limits 0.2 N m, 6000 rpm"
