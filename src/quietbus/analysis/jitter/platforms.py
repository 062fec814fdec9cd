"""Several isolation platforms on one bus, each with its own legs and CMGs, at rest.

They are one satellite (``model.together``); here is what is asked of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np

from quietbus.analysis.control.controlled import ControlledSatellite, controlled
from quietbus.analysis.control.modes import RIGID_BODY
from quietbus.analysis.control.pid import PID
from quietbus.analysis.jitter.lines import at_rest, rest_error, steady_jitter_once
from quietbus.dynamics.linearize import (
    Actuation,
    LinearModel,
    OperatingPoint,
    linearize,
    steering_commands,
)
from quietbus.dynamics.rotor_response import orders_of
from quietbus.dynamics.vibration import Vibration, actuator_reactions
from quietbus.model.satellite import BUS, Satellite
from quietbus.model.together import together
from quietbus.model.variants import with_base_fixed, with_mount
from quietbus.programs import compiled_for_few_runs

MOUNTS = ("isolated", "rigid")


@dataclass(frozen=True)
class Platforms:
    """The small vibration at rest of a bus with n platforms, units steered as one cluster."""

    satellite: Satellite  # isolated
    gimbal_angle: np.ndarray  # (cmg,) [rad] of all units

    @classmethod
    def assemble(
        cls, satellites: Sequence[Satellite], gimbal_angles: Sequence[np.ndarray]
    ) -> "Platforms":
        """Put the platforms of satellites that share a bus together.

        Args:
            satellites: at least one, each the same bus with one platform; control and steering
                law of the first hold for all.
            gimbal_angles: (cmg,) [rad] of each.
        """
        angles = np.concatenate([np.asarray(each, float) for each in gimbal_angles])
        return cls(with_mount(together(satellites), welded=False), angles)

    def mounted(self, mount: str) -> Satellite:
        """The satellite with its platforms on their struts, or welded to the bus."""
        return with_mount(self.satellite, welded=mount == "rigid")

    @property
    def orders(self) -> np.ndarray:
        """(order,) multiples of rotor speed at which rotors shake."""
        return np.array(orders_of(self.satellite))

    @property
    def frequency(self) -> np.ndarray:
        """(cmg, order) [rad/s]."""
        return np.outer(self.satellite.rotor_speed, self.orders)

    @cached_property
    def _at_rest(self) -> dict[str, tuple[dict[str, np.ndarray], Vibration]]:
        found = {}
        for mount in MOUNTS:
            outputs, small = steady_jitter_once(self.mounted(mount), jnp.asarray(self.gimbal_angle))
            found[mount] = jax.tree.map(np.asarray, (outputs, small))
        return found

    def outputs(self, mount: str) -> dict[str, np.ndarray]:
        """Complex amplitudes (cmg, order, ...) by output, to each order of each rotor."""
        return self._at_rest[mount][0]

    def small(self, mount: str) -> Vibration:
        """Equations of small vibration."""
        return self._at_rest[mount][1]

    @property
    def rest_error(self) -> float:
        """Largest acceleration [m/s^2, rad/s^2]: 0 at an equilibrium."""
        return rest_error(self.small("isolated"))

    def strokes_by(self, torque: np.ndarray) -> np.ndarray:
        """Strokes (leg,) [m] of all legs under a steady control torque [N m] on the bus.

        Units move as steering asks for, the satellite gathers speed, the plates have come to rest
        in the bus: at the start of a manoeuvre, before rates matter.
        """
        commands = steering_commands(self.satellite, self.gimbal_angle) @ torque
        small, reaction = self.small("isolated"), self._reaction
        force = reaction[1] @ commands
        T = np.asarray(self.small("rigid").projection)  # all freedoms by those of the bus
        M, K = np.asarray(small.M), np.asarray(small.K)
        gathering = T @ np.linalg.solve(T.T @ M @ T, T.T @ force)
        plates = np.ones(len(M), bool)
        plates[small.free.rows(BUS)] = False
        xi = np.zeros(len(M))
        missing = (force - M @ gathering)[plates]
        xi[plates] = np.linalg.solve(K[np.ix_(plates, plates)], missing)
        return np.asarray(small.seen["leg_stroke"].by_pose) @ xi

    @cached_property
    def _reaction(self) -> np.ndarray:
        """(3, n, command) forces by driven coordinates, their rates and second derivatives."""
        return np.asarray(_compiled_reaction(self.satellite, jnp.asarray(self.gimbal_angle)))

    def modes(self, held: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies [Hz] and damping of critical [-], ascending; gimbals held, bus free or held.

        Modes that do not swing count twice, one pole each.
        """
        satellite = with_base_fixed(self.satellite) if held else self.satellite
        model = linearize(satellite, self._point, "ideal").internal()
        poles = np.linalg.eigvals(model.A)
        poles = poles[(poles.imag >= 0.0) & (np.abs(poles) > RIGID_BODY)]
        size = np.abs(poles)
        order = np.argsort(size)
        return size[order] / (2.0 * np.pi), -poles.real[order] / size[order]

    @property
    def _point(self) -> OperatingPoint:
        return OperatingPoint(np.zeros(3), self.gimbal_angle)

    def linear(self, actuator: Actuation = "servo") -> LinearModel:
        """The uncontrolled satellite as a state-space model; see ``dynamics.linearize``."""
        return linearize(self.satellite, self._point, actuator)

    def controlled(self, pid: PID, actuator: Actuation = "servo") -> ControlledSatellite:
        """The attitude loop around the satellite; gains as of ``analysis.coupled``."""
        return controlled(self.linear(actuator), pid)

    @cached_property
    def torque_peaks(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) frequencies [Hz] and gains [-] of the largest answer of the bus to control torque.

        The gain is angular acceleration about an axis by the torque asked for about it, over what
        it is at low frequency; gimbals follow at once.
        """
        model = self.linear("ideal").internal().select(["control_torque"], ["bus_rate"])

        def gain(hz: np.ndarray) -> np.ndarray:
            return np.abs(np.einsum("fii->fi", model.response(hz))) * hz[:, None]

        hz = np.geomspace(0.05, 100.0, 500)
        coarse = gain(hz)
        peaks = []
        for axis, k in enumerate(np.argmax(coarse, axis=0)):
            near = np.linspace(hz[max(k - 1, 0)], hz[min(k + 1, len(hz) - 1)], 200)
            fine = gain(near)[:, axis]
            best = int(np.argmax(fine))
            peaks.append((near[best], fine[best] / coarse[0, axis]))
        found = np.array(peaks)
        return found[:, 0], found[:, 1]


@compiled_for_few_runs
def _compiled_reaction(satellite, gimbal_angle):
    _, averaged, slow = at_rest(satellite, gimbal_angle)
    return actuator_reactions(averaged, slow)
