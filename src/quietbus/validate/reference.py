"""Accelerations by MuJoCo of a satellite without a scenario."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from quietbus.dynamics.state import State
from quietbus.model.element import Rates
from quietbus.model.satellite import Satellite
from quietbus.reference import multibody
from quietbus.validate.translate import driven_by, mechanism_of, motion_of


class Reference:
    """Accelerations of one satellite by MuJoCo (``quietbus.reference.multibody``)."""

    def __init__(self, satellite: Satellite, state: State) -> None:
        """Build the model; ``state`` only has to be a valid one."""
        self._satellite = satellite
        self._body = multibody.Multibody(mechanism_of(satellite), motion_of(satellite, 0.0, state))

    def accelerations(
        self, t: float, state: State, rates: dict[str, Rates], wrenches: np.ndarray
    ) -> np.ndarray:
        """Of the origins of all bodies, and angular: (body, 2, 3), inertial components.

        As ``quietbus.dynamics.equations.accelerations``, whose ``extra`` are the wrenches in a row.

        Args:
            t: time [s], which turns rotors of prescribed speed.
            state: motion of the satellite.
            rates: of clusters that have any: what their drives do.
            wrenches: (body, 2, 3) forces [N] and torques [N m] about the bodies' origins, inertial.
        """
        self._body.set(motion_of(self._satellite, t, state))
        gimbals, rotors = _driven_by(self._satellite, jnp.asarray(t, float), state, rates)
        found = self._body.accelerations(np.asarray(gimbals), np.asarray(rotors), wrenches)
        return np.stack([found.v, found.w], axis=1)


_driven_by = eqx.filter_jit(driven_by)
