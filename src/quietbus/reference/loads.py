"""External forces and torques of a scenario (docs/scenario.md, `loads`)."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from quietbus.reference.platforms import Data


def share(profile: Any, t: float) -> float:
    """What a load's profile leaves of it at time t [s]."""
    if profile == "constant":
        return 1.0
    if "step" in profile:
        step = profile["step"]
        return float(step["start"] <= t < step.get("end", np.inf))
    if "half_sine" in profile:
        sine = profile["half_sine"]
        past = (t - sine["start"]) / sine["duration"]
        return float(np.sin(np.pi * past)) if 0.0 < past < 1.0 else 0.0
    return float(np.interp(t, profile["table"]["times"], profile["table"]["values"]))


def corners(profile: Any) -> list[float]:
    """Instants [s] at which a profile is not smooth."""
    if profile == "constant":
        return []
    if "step" in profile:
        step = profile["step"]
        return [step["start"], *([step["end"]] if "end" in step else [])]
    if "half_sine" in profile:
        sine = profile["half_sine"]
        return [sine["start"], sine["start"] + sine["duration"]]
    return list(profile["table"]["times"])


def wrenches(loads: list[Data], t: float, names: Sequence[str], R_NX: np.ndarray) -> np.ndarray:
    """Sum of all loads at time t [s].

    Args:
        names: of the bodies.
        R_NX: (body, 3, 3) their attitudes.

    Returns:
        (body, 2, 3) forces [N] and torques [N m] about each body's origin, inertial.
    """
    total = np.zeros((len(names), 2, 3))
    for load in loads:
        body = names.index(load["body"])
        towards = R_NX[body] if load["frame"] == "body" else np.eye(3)
        now = share(load["profile"], t)
        force = now * (towards @ np.array(load["force"]))
        torque = now * (towards @ np.array(load["torque"]))
        lever = R_NX[body] @ np.array(load["point"])
        total[body] += np.stack([force, torque + np.cross(lever, force)])
    return total
