"""Scenarios that use as much of the file format as they can, for checks between programs."""

import copy

import numpy as np

import quietbus as qb
from quietbus.scenario import load_scenario

ZHANG = load_scenario("zhang2012").to_dict()
CMGS, WHEELS = ZHANG["cluster"], load_scenario("wheels-demo").to_dict()["cluster"]
PLATFORM = {"isolator": ZHANG["isolator"], "cluster": CMGS}
BENCH = {key: value for key, value in ZHANG["isolator"].items() if key != "plate"}
BODY = {"mass": 30, "inertia": [[2, 0, 0], [0, 2, 0], [0, 0, 3]], "center_of_mass": [0, 0, 0.1]}


def mixed() -> dict:
    """CMGs and reaction wheels on one plate."""
    return copy.deepcopy(ZHANG | {"cluster": [CMGS, WHEELS]})


def two() -> dict:
    """CMGs on one platform, wheels on another."""
    rest = {key: value for key, value in ZHANG.items() if key not in PLATFORM}
    south = {"offset": [0.8, 0.0, 0.6], "orientation": [0.0, 0.3, 0.2]}
    platforms = [
        {"name": "north", **PLATFORM},
        {"name": "south", "isolator": ZHANG["isolator"] | south, "cluster": WHEELS},
    ]
    # nothing in common, so that a change of one is none of the other
    return copy.deepcopy(rest) | {"platforms": [copy.deepcopy(each) for each in platforms]}


def payload() -> dict:
    """The paper's satellite with a camera on a bench of its own."""
    bench = {"body": BODY, "isolator": BENCH | {"offset": [0, 0, -1.2]}}
    lines = {"camera": {"direction": [1, 0, 0]}, "tracker": {"direction": [0, 1, 0], "on": "bus"}}
    return copy.deepcopy(ZHANG | {"payload": bench, "lines_of_sight": lines})


def awkward_scenario() -> qb.Scenario:
    """CMGs: nothing aligned, centred or alike; slew, limits, loads, order tables; it can rest."""
    rng = np.random.default_rng(2012)

    def each(low: float, high: float) -> list[float]:
        return rng.uniform(low, high, 6).tolist()

    def parts(mass: float) -> list[dict[str, float]]:
        keys = ("mass", "distance", "transverse_inertia", "axial_inertia")
        low, high = (mass, 0.1, 0.01, 0.001), (2.0 * mass, 0.2, 0.02, 0.004)
        return [dict(zip(keys, rng.uniform(low, high).tolist(), strict=True)) for _ in range(6)]

    data = qb.load_scenario("zhang2012").to_dict()
    data["name"] = "awkward"
    isolator, cluster = data["isolator"], data["cluster"]
    isolator["offset"] = [0.05, -0.1, 0.6]
    isolator["orientation"] = [0.1, -0.15, 0.4]
    isolator["plate"] |= {"center_of_mass": [0.01, -0.02, 0.03]}
    axes = np.array(isolator["legs"]["universal_axes"]) + rng.normal(size=(6, 3), scale=0.3)
    isolator["legs"] |= {
        "universal_axes": (axes / np.linalg.norm(axes, axis=1, keepdims=True)).tolist(),
        "stiffness": each(1e4, 3e4),
        "damping": each(200.0, 800.0),
        "upper_part": parts(1.0),
        "lower_part": parts(2.0),
        "spherical_friction": each(0.5, 3.0),
        "universal_friction": each(0.5, 3.0),
    }
    cluster["gimbal_body"] |= {
        "inertia": [0.06, 0.05, 0.07],
        "center_of_mass": [0.01, 0.02, -0.015],
    }
    cluster["rotor"] |= {
        "dynamic_imbalance_phase": 0.7,
        "installation_error": {"alpha": 0.03, "beta": -0.02, "chi": 0.05},
        "offset": [-0.012, 0.008, 0.01],
        "disturbance": {
            "orders": [
                {"order": 0.6, "radial_force": 2e-7, "axial_force": 1e-7, "phase": 0.4},
                {"order": 2.0, "radial_torque": 3e-8, "whirl": "backward", "phase": "random"},
                {
                    "order": 5.2,
                    "axial_torque": 2e-8,
                    "radial_torque": 2e-8,
                    "phase": {"axial_torque": 0.3},
                },
            ],
            "resonances": {
                "radial": {"frequency": 150.0, "damping": 0.1},
                "rocking": {"frequency": 90.0, "damping": 0.05},
            },
        },
    }
    cluster |= {
        "gimbal_angles": [0.1, -0.5, 1.0, 2.0],
        "gimbal_rate_limit": 0.8,
        "gimbal_acceleration_limit": 30.0,
    }
    data["control"] = {
        "pid": {"kp": 200.0, "ki": 4.0, "kd": 2500.0},
        "torque_limit": 40.0,
        "steering": {"law": "singularity_robust", "lambda0": 0.05, "mu": 8.0},
    }
    data["initial"] = {"attitude": [0.3, -0.2, 0.5], "rate": [0.001, -0.002, 0.0015]}
    limits = {"max_rate": 0.05, "max_acceleration": 0.05, "max_jerk": 0.2}
    data["target"] = {"attitude": [0.5, 0.1, -0.1], "guidance": limits}
    data["loads"] = [
        {
            "body": "bus",
            "force": [1.0, -2.0, 0.5],
            "torque": [0.1, 0.2, -0.3],
            "point": [0.3, 0.2, -0.5],
        },
        {
            "body": "plate",
            "frame": "inertial",
            "force": [0.5, 1.0, 1.5],
            "point": [0.1, -0.2, 0.05],
            "profile": {"half_sine": {"start": 0.05, "duration": 0.1}},
        },
        {
            "body": "plate",
            "torque": [0.3, -0.1, 0.2],
            "profile": {"table": {"times": [1.0, 2.0, 5.0], "values": [0.0, 1.0, -0.5]}},
        },
        {"body": "bus", "force": [0.0, 3.0, 0.0], "profile": {"step": {"start": 0.1, "end": 9.0}}},
    ]
    data["simulation"]["duration"] = 30.0
    return qb.Scenario.from_dict(data, "awkward")


def awkward_wheels() -> qb.Scenario:
    """Reaction wheels with unlike motors on the awkward platform, its struts preloaded."""
    awkward, data = awkward_scenario().to_dict(), qb.load_scenario("wheels-demo").to_dict()
    data["name"], data["isolator"] = "awkward-wheels", awkward["isolator"]
    data["isolator"]["legs"]["free_length"] = 0.6
    cluster = data["cluster"]
    cluster["housing"] |= {"center_of_mass": [0.01, 0.02, -0.015]}
    cluster["rotor"] |= {"static_imbalance": 7e-4, "dynamic_imbalance": 2e-4}
    for unit, limit in zip(cluster["units"], (0.2, 0.15, 0.25, 0.1), strict=True):
        unit["motor"] = {"torque_limit": limit}
    data["control"] |= {"pid": {"gain": 350.0, "zeros": [0.1, 0.003]}}
    return qb.Scenario.from_dict(data, "awkward-wheels")


def awkward_rigid() -> qb.Scenario:
    """CMGs on a rigid mount that ripple and step, by another law, running from a steady start."""
    data = awkward_scenario().to_dict()
    data["name"], data["isolator"]["mount"] = "awkward-rigid", "rigid"
    data["cluster"]["gimbal_motor"] = {
        "ripple": [
            {"per_turn": 24, "torque": 0.01, "phase": 0.5},
            {"per_turn": 36, "torque": 0.02},
        ],
        "stepping": {"steps_per_turn": 200, "frequency": 60.0, "damping": 0.2, "harmonics": 2},
    }
    data["control"]["steering"] = {"law": "generalized_singularity_robust", "epsilon0": 0.2}
    data["initial"]["steady"] = True
    data["cluster"]["rotor_phases"] = "random"
    data["loads"] = data["loads"][:2]
    return qb.Scenario.from_dict(data, "awkward-rigid")
