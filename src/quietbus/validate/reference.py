"""Accelerations by MuJoCo of a satellite without a scenario."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.dynamics.equations import Accelerations, Wrench
from quietbus.dynamics.state import State
from quietbus.model.satellite import Satellite
from quietbus.reference import multibody
from quietbus.validate.translate import BUS, PLATE, mechanism_of, motion_of


class Reference:
    """Accelerations of one satellite by MuJoCo (``quietbus.reference.multibody``)."""

    def __init__(self, satellite: Satellite, state: State) -> None:
        """Build the model; ``state`` only has to be a valid one."""
        self._satellite = satellite
        self._body = multibody.Multibody(mechanism_of(satellite), motion_of(satellite, state))

    def accelerations(
        self,
        state: State,
        rotor_angle: Float[Array, " cmg"],
        gimbal_acceleration: Float[Array, " cmg"],
        wrench: Wrench,
        rotor_acceleration: Float[Array, " cmg"] | None = None,
    ) -> Accelerations:
        """As ``quietbus.dynamics.equations.accelerations``; wheels have no gimbal accelerations."""
        self._body.set(motion_of(self._satellite, state, rotor_angle))
        still = np.zeros(len(rotor_angle))
        spin_up = still if rotor_acceleration is None else np.asarray(rotor_acceleration)
        on_P, on_B = (wrench.force_P, wrench.torque_P), (wrench.force_B, wrench.torque_B)
        found = self._body.accelerations(
            np.asarray(gimbal_acceleration), spin_up, np.array([on_B, on_P])
        )
        each = (found.v[PLATE], found.w[PLATE], found.v[BUS], found.w[BUS])
        return Accelerations(*(jnp.asarray(vector) for vector in each))
