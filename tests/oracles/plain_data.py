"""Scenarios of several platforms, a bench and mixed clusters as plain data; nothing is aligned."""

from typing import Any

import numpy as np

STILL = {"alpha": 0.0, "beta": 0.0, "chi": 0.0}


def cmgs(count: int, **changes: Any) -> dict[str, Any]:
    """A block of unbalanced CMGs around an axis that leans."""
    units = []
    for j in range(count):
        a = 2.0 * np.pi * j / count + 0.3
        gimbal = np.array([0.7 * np.cos(a), 0.7 * np.sin(a), np.sqrt(0.51)])
        spin = np.cross([0.1, 0.2, 1.0], gimbal)
        units.append(
            {
                "position": [0.3 * np.cos(a), 0.3 * np.sin(a), 0.05],
                "gimbal_axis": gimbal.tolist(),
                "spin_axis": (spin / np.linalg.norm(spin)).tolist(),
            }
        )
    return {
        "type": "cmg",
        "units": units,
        "gimbal_body": {
            "mass": 5.0,
            "inertia": [0.03, 0.04, 0.05],
            "center_of_mass": [0.01, -0.02, 0.015],
        },
        "rotor": _rotor(3.0, {"momentum": 15.0, "speed": 500.0}),
        "rotor_phases": [0.4 + j for j in range(count)],
        "gimbal_angles": [0.5 - 0.3 * j for j in range(count)],
        "gimbal_bandwidth": 40.0,
    } | changes


def wheels(axes: list[list[float]], **changes: Any) -> dict[str, Any]:
    """A block of unbalanced reaction wheels with spin axes along these directions."""
    units = [
        {
            "position": [0.2, -0.1 * j, 0.1],
            "spin_axis": (np.array(axis) / np.linalg.norm(axis)).tolist(),
        }
        for j, axis in enumerate(axes)
    ]
    return {
        "type": "wheel",
        "units": units,
        "housing": {"mass": 1.5, "inertia": [0.01, 0.012, 0.014], "center_of_mass": [0.0] * 3},
        "rotor": _rotor(2.0, {"spin_inertia": 0.02, "speed": 200.0}),
        "motor": {},
        "rotor_phases": [1.0 + 0.5 * j for j in range(len(axes))],
    } | changes


def _rotor(mass: float, turning: dict[str, float]) -> dict[str, Any]:
    return turning | {
        "mass": mass,
        "transverse_inertia": 0.016,
        "static_imbalance": 2e-4,
        "dynamic_imbalance": 3e-5,
        "dynamic_imbalance_phase": 0.6,
        "installation_error": STILL,
        "offset": [0.0, 0.0, 0.0],
    }


def isolator(
    offset: list[float], orientation: list[float], heavy: bool, **changes: Any
) -> dict[str, Any]:
    """Six struts under a plate; ``heavy``: legs with mass and friction in their joints."""
    angles = np.pi / 3.0 * np.arange(6)
    ring = lambda radius, a: np.stack(  # noqa: E731
        [radius * np.cos(a), radius * np.sin(a), 0.02 * np.sin(3.0 * a + 1.0)], axis=1
    )
    across = ring(1.0, angles + np.pi / 2.0)
    mass = 0.3 if heavy else 0.0
    part = {
        "mass": mass,
        "distance": 0.12,
        "transverse_inertia": 0.01 * mass,
        "axial_inertia": 0.001 * mass,
    }
    return {
        "mount": "isolated",
        "offset": offset,
        "orientation": orientation,
        "separation": 0.35,
        "plate": {
            "mass": 9.0,
            "inertia": [[0.5, 0.02, 0.0], [0.02, 0.6, 0.03], [0.0, 0.03, 0.8]],
            "center_of_mass": [0.01, -0.02, 0.03],
        },
        "legs": {
            "lower_joints": ring(0.55, angles + 0.25 * (-1.0) ** np.arange(6)).tolist(),
            "upper_joints": ring(0.45, angles - 0.3 * (-1.0) ** np.arange(6)).tolist(),
            "universal_axes": (across / np.linalg.norm(across, axis=1)[:, None]).tolist(),
            "stiffness": 2e4,
            "damping": 300.0,
            "lower_part": part,
            "upper_part": part,
            "spherical_friction": 0.4 if heavy else 0.0,
            "universal_friction": 0.7 if heavy else 0.0,
        },
    } | changes


def satellite(heavy: bool = True) -> dict[str, Any]:
    """Platform ``north`` with CMGs and wheels, ``south`` with wheels, and a bench."""
    north = {
        "name": "north",
        "isolator": isolator([0.1, -0.9, 0.6], [0.1, -0.2, 0.4], heavy),
        "cluster": [cmgs(3), wheels([[1.0, 0.0, 0.2]], motor={"torque_limit": 0.3})],
    }
    south = {
        "name": "south",
        "isolator": isolator([-0.2, 1.1, 0.5], [-0.3, 0.1, 0.0], heavy),
        "cluster": wheels([[1.0, 0.3, 0.0], [0.0, 1.0, 0.2]], motor={"torque_limit": 0.5}),
    }
    payload = {
        "body": {
            "mass": 60.0,
            "inertia": [[5.0, 0.1, 0.0], [0.1, 6.0, 0.2], [0.0, 0.2, 7.0]],
            "center_of_mass": [0.02, 0.01, -0.05],
        },
        "isolator": isolator([0.0, 0.1, -0.7], [3.0, 0.1, 0.2], heavy),
    }
    return {
        "bus": {
            "mass": 600.0,
            "inertia": [[300.0, -5.0, 3.0], [-5.0, 250.0, 4.0], [3.0, 4.0, 200.0]],
        },
        "platforms": [north, south],
        "payload": payload,
        "control": {
            "pid": {"kp": 60.0, "ki": 1.0, "kd": 400.0},
            "steering": {"law": "pseudo_inverse"},
            "feedforward": False,
        },
        "initial": {"attitude": [0.1, -0.2, 0.3], "rate": [0.01, -0.02, 0.015]},
        "target": {"attitude": [0.12, -0.18, 0.29], "guidance": "step"},
        "loads": [],
    }
