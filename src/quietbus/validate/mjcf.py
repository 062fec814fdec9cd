"""A satellite without a scenario as a MuJoCo model."""

import numpy as np

from quietbus.dynamics.state import State
from quietbus.model.satellite import Satellite
from quietbus.reference import mjcf
from quietbus.validate.translate import mechanism_of, motion_of


def write_mjcf(
    satellite: Satellite,
    state: State,
    legs: mjcf.LegModel = "tendons",
    timestep: float = 1e-4,
    rotor_angle: np.ndarray | None = None,
) -> str:
    """MuJoCo XML of the satellite as of ``quietbus.reference.mjcf``.

    Args:
        state: motion at the keyframe.
        legs: massless springs and dampers, or bodies.
        timestep: [s] of MuJoCo's integrator.
        rotor_angle: (cmg,) rotor angles at the keyframe [rad]; those at the start by default.
    """
    motion = motion_of(satellite, state, rotor_angle)
    return mjcf.write_mjcf(mechanism_of(satellite), motion, legs, timestep)
