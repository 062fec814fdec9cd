"""The reference reads a scenario for itself; quietbus's own satellite has the same numbers."""

from dataclasses import fields, is_dataclass

import numpy as np
import pytest

from oracles.scenarios import awkward_rigid, awkward_scenario, awkward_wheels
from quietbus.build import build_satellite
from quietbus.reference.mechanism import read_mechanism
from quietbus.reference.units import rotor_inertia
from quietbus.scenario import load_scenario
from quietbus.validate.translate import mechanism_of


def _assert_alike(a, b, path=""):
    for field in fields(a):
        if field.name == "gimbal_angle":  # of the state in quietbus
            continue
        one, other = getattr(a, field.name), getattr(b, field.name)
        if is_dataclass(one):
            _assert_alike(one, other, f"{path}.{field.name}")
        elif field.name == "names":
            assert one == other, path
        else:
            np.testing.assert_allclose(one, other, rtol=1e-14, atol=1e-16, err_msg=path)


@pytest.mark.parametrize(
    "scenario",
    [
        awkward_scenario(),
        awkward_rigid(),
        awkward_wheels(),
        load_scenario("zhang2012"),
        load_scenario("wheels-demo"),
        load_scenario("zhang2012").with_overrides(
            {
                "cluster.pyramid": None,
                "cluster.units": [
                    {
                        "position": [0.3, 0.1, 0.0],
                        "gimbal_axis": [0.0, 0.6, 0.8],
                        "spin_axis": [1.0, 0.0, 5e-4],
                        "rotor": {"spin_inertia": 0.02, "speed": 500.0},
                    },
                    {
                        "position": [-0.3, 0.1, 0.0],
                        "gimbal_axis": [0.0, 0.0, 1.0],
                        "spin_axis": [0.0, 1.0, 0.0],
                        "gimbal_body": {"mass": 7.0},
                    },
                ],
                "cluster.rotor_phases": [0.3, 0.4],
                "cluster.gimbal_angles": [0.0, 1.0],
            }
        ),
    ],
    ids=lambda scenario: scenario.name,
)
def test_both_read_the_same_numbers(scenario):
    _assert_alike(read_mechanism(scenario.to_dict()), mechanism_of(build_satellite(scenario)))


def test_dynamic_imbalance_is_the_product_of_inertia_of_two_points():
    """Masses m at (a, r) and (-a, -r) in the plane of spin and a direction at 0.4 rad."""
    m, a, r, phase = 0.01, 0.03, 0.1, 0.4
    across = np.array([0.0, r * np.cos(phase), r * np.sin(phase)])
    points = [across + np.array([a, 0.0, 0.0]), -across - np.array([a, 0.0, 0.0])]
    added = sum(m * ((p @ p) * np.eye(3) - np.outer(p, p)) for p in points)
    rotor = {"spin_inertia": 1.0, "transverse_inertia": 1.0, "dynamic_imbalance": 2 * m * a * r}
    inertia = rotor_inertia(rotor | {"dynamic_imbalance_phase": phase})
    np.testing.assert_allclose(inertia[0, 1:], added[0, 1:], rtol=1e-14)
