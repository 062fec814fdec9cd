"""Disturbances in the scenario: what is read, and what is refused with its path."""

import numpy as np
import pytest

import quietbus as qb
from quietbus.build import build_satellite
from quietbus.model.disturbance import QuietRotors
from quietbus.model.gimbal_motor import SmoothMotor

TABLE = {
    "orders": [
        {"order": 1, "radial_force": "7.5e-8 kg*m", "phase": "random"},
        {"order": 1, "radial_force": "1e-9 N/rpm^2", "whirl": "backward"},
        {
            "order": 2.83,
            "radial_torque": 1e-9,
            "axial_force": 2e-9,
            "phase": {"radial_torque": "90 deg", "axial_force": "random"},
        },
    ],
    "resonances": {"rocking": {"frequency": "60 Hz", "damping": 0.02}},
    "broadband": {"axial_force": {"frequency": [1, "0.1 kHz"], "psd": ["1e-6 N^2/Hz", 1e-6]}},
    "seed": 5,
}


def with_table(table):
    return qb.load_scenario("zhang2012").with_overrides({"cluster.rotor.disturbance": table})


def test_a_table_becomes_channels_of_the_model():
    scenario = with_table(TABLE)
    assert qb.Scenario.from_yaml(scenario.to_yaml()) == scenario
    assert scenario.cluster.orders == (1.0, 2.0, 2.83)
    built = build_satellite(scenario).clusters[0].disturbance
    coefficient, phase = np.asarray(built.coefficient), np.asarray(built.phase)
    expected = np.zeros((3, 6))
    expected[0, :2] = 7.5e-8, 1e-9 * (30 / np.pi) ** 2  # rpm^-2 to s^2/rad^2
    expected[2, 2:4] = 2e-9, 1e-9
    assert coefficient[1] == pytest.approx(expected)
    assert phase[:, 2, 3] == pytest.approx(np.pi / 2)
    random = phase[:, [0, 2], [0, 2]]
    assert np.unique(random).size == 8  # every rotor and line its own
    again = build_satellite(scenario).clusters[0].disturbance
    assert np.array_equal(again.phase, built.phase)
    other = build_satellite(with_table(TABLE | {"seed": 6})).clusters[0].disturbance
    assert not np.any(np.asarray(other.phase)[:, [0, 2], [0, 2]] == random)
    assert np.asarray(built.period)[0] == pytest.approx([0, 0, 1 / (120 * np.pi)])


def test_a_unit_may_have_another_table_or_none():
    pyramid = qb.load_scenario("zhang2012")
    units = [
        {"position": u.position, "gimbal_axis": u.gimbal_axis, "spin_axis": u.spin_axis}
        for u in pyramid.cluster.placed()
    ]
    units[1]["rotor"] = {"disturbance": {}}
    units[2]["rotor"] = {"disturbance": {"orders": [{"order": 3.5, "axial_torque": 1e-9}]}}
    data = pyramid.to_dict()
    data["cluster"] |= {"units": units}
    del data["cluster"]["pyramid"]
    data["cluster"]["rotor"]["disturbance"] = TABLE
    scenario = qb.Scenario.from_dict(data)
    assert qb.Scenario.from_yaml(scenario.to_yaml()) == scenario
    built = build_satellite(scenario).clusters[0].disturbance
    assert list(np.asarray(built.order)) == [1.0, 2.0, 2.83, 3.5]
    there = np.any(np.asarray(built.coefficient) > 0, axis=2)
    assert there.tolist() == [
        [True, False, True, False],
        [False, False, False, False],
        [False, False, False, True],
        [True, False, True, False],
    ]
    assert [any(spectra) for spectra in built.broadband] == [True, False, False, True]


def test_no_table_builds_no_disturbance():
    (cluster,) = build_satellite(qb.load_scenario("zhang2012")).clusters
    assert type(cluster.disturbance) is QuietRotors
    assert type(cluster.motor) is SmoothMotor
    assert qb.load_scenario("zhang2012").cluster.orders == (1, 2)


def spectrum(**changes):
    table = {"frequency": [1.0, 10.0], "psd": [1e-6, 1e-6]} | changes
    return {"broadband": {"radial_torque": table}}


TORQUE = "broadband.radial_torque."


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"orders": []}, "orders: expected a list of one or more orders, got []"),
        ({"orders": [{"order": 0}]}, "orders[0].order: expected a plain number, got 0 (must be ab"),
        ({"orders": [{"order": 2}, {"order": 1}]}, "orders[1].order: expected an order above 2"),
        ({"orders": [{"order": 2}, {"order": 2}]}, "orders[1].order: expected an order above 2"),
        (
            {"orders": [{"order": 1, "radial_force": -1}]},
            "orders[0].radial_force: expected a force coefficient, force over speed squared, in "
            "kg*m, got -1 (must be at least 0)",
        ),
        (
            {"orders": [{"order": 1, "radial_force": "1 kg*m^2"}]},
            "orders[0].radial_force: expected a force coefficient, force over speed squared, in "
            "kg*m, got '1 kg*m^2' (a moment of inertia?)",
        ),
        (
            {"orders": [{"order": 1, "phase": "any"}]},
            "orders[0].phase: expected random, or an angle in rad, got 'any'",
        ),
        (
            {"orders": [{"order": 1, "phase": {"radial_force": "1 m"}}]},
            "orders[0].phase.radial_force: expected random, or an angle in rad, got '1 m'",
        ),
        ({"orders": [{"order": 1, "wirl": "forward"}]}, "did you mean 'whirl'?"),
        (
            {"orders": [{"order": 1}], "resonances": {"radial": {"frequency": 9, "damping": 0}}},
            "resonances.radial.damping: expected a plain number, got 0 (must be above 0)",
        ),
        (
            {
                "orders": [{"order": 1}],
                "resonances": {"rocking": {"frequency": "60 rad/s", "damping": 0.1}},
            },
            "resonances.rocking.frequency: expected a frequency in Hz, got '60 rad/s'",
        ),
        (
            {"resonances": {"radial": {"frequency": 9, "damping": 0.1}}},
            "resonances: expected orders or broadband beside them",
        ),
        (spectrum(frequency=[10.0, 1.0]), TORQUE + "frequency[1]: expected a frequency above 10"),
        (spectrum(frequency=[], psd=[]), TORQUE + "frequency: expected a list of one or more"),
        (spectrum(frequency=[1.0], psd=[1.0]), TORQUE + "frequency: expected at least two freq"),
        (spectrum(psd=[1.0]), TORQUE + "psd: expected 2 numbers, one for each frequency, got 1"),
        (spectrum(psd=[1.0, -1.0]), TORQUE + "psd[1]: expected a one-sided torque spectrum"),
        (spectrum(psd=[1.0, 0.0]), TORQUE + "psd[1]: expected a number above 0 for interpolation"),
        (
            spectrum(psd=["1 N^2*m^2*s/rad", 1.0]),
            TORQUE + "psd[0]: expected a one-sided torque spectrum in N^2*m^2/Hz, got '1 N^2*m^2*s",
        ),
        (
            spectrum(sample_rate=18.0),
            TORQUE + "frequency[1]: expected at most 9 Hz, the Nyquist frequency of the table's",
        ),
        (
            {"table": 3},
            "table: expected the name of a file, or a list of names, got 3",
        ),
        ({"seed": -1}, "seed: expected a whole number from 0 to 2^63 - 1, got -1"),
    ],
)
def test_bad_tables_are_named_with_their_path(table, message):
    with pytest.raises(qb.ScenarioError) as refused:
        with_table(table)
    said = str(refused.value)
    assert message in said
    assert "cluster.rotor.disturbance." in said


@pytest.mark.parametrize(
    ("motor", "message"),
    [
        ({}, "gimbal_motor: expected ripple, stepping or both, got neither"),
        ({"ripple": []}, "gimbal_motor.ripple: expected a list of one or more ripples"),
        (
            {"ripple": [{"per_turn": 2.5, "torque": 1}]},
            "gimbal_motor.ripple[0].per_turn: expected a count of at least 1, got 2.5",
        ),
        (
            {"ripple": [{"per_turn": 2, "torque": "1 N"}]},
            "gimbal_motor.ripple[0].torque: expected a torque in N*m, got '1 N' (a force?)",
        ),
        (
            {"stepping": {"steps_per_turn": 200, "frequency": 0, "damping": 0.1}},
            "gimbal_motor.stepping.frequency: expected a frequency in Hz, got 0",
        ),
    ],
)
def test_bad_motors_are_named_with_their_path(motor, message):
    with pytest.raises(qb.ScenarioError) as refused:
        qb.load_scenario("zhang2012").with_overrides({"cluster.gimbal_motor": motor})
    assert message in str(refused.value)
