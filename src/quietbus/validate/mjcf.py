"""A satellite without a scenario as a MuJoCo model."""

from quietbus.dynamics.state import State
from quietbus.model.satellite import Satellite
from quietbus.reference import mjcf
from quietbus.validate.translate import mechanism_of, motion_of


def write_mjcf(
    satellite: Satellite,
    state: State,
    legs: mjcf.LegModel = "tendons",
    timestep: float = 1e-4,
    t: float = 0.0,
) -> str:
    """MuJoCo XML of the satellite as of ``quietbus.reference.mjcf``.

    Args:
        state: motion at the keyframe.
        legs: massless springs and dampers, or bodies.
        timestep: [s] of MuJoCo's integrator.
        t: [s] of the keyframe, which turns rotors of prescribed speed.
    """
    motion = motion_of(satellite, t, state)
    return mjcf.write_mjcf(mechanism_of(satellite), motion, legs, timestep)
