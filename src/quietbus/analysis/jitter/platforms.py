"""Several isolation platforms on one bus, each with its own legs and CMGs.

Every platform with the bus is a satellite, whose equations of small vibration are derivatives of
the nonlinear ones (``dynamics.vibration``). On the freedoms ``(r_P1, theta_P1, ..., r_B, theta_B)``
they add up, the bus counted once: platforms touch each other through the bus only
(docs/theory.md, section 14.10). At rest in the nominal pose; all vectors along bus axes.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.analysis.control.controlled import ControlledSatellite, controlled
from quietbus.analysis.control.modes import RIGID_BODY
from quietbus.analysis.control.pid import PID
from quietbus.analysis.jitter.lines import at_rest
from quietbus.dynamics.linearize import AXES, Actuator, LinearModel, steering_commands
from quietbus.dynamics.vibration import (
    Control,
    SlowMotion,
    Vibration,
    control_path,
    gimbal_reaction,
    leg_coefficients,
    rotor_forces,
    vibration,
)
from quietbus.model.cmg import ControlMomentGyro
from quietbus.model.controller import GimbalServo
from quietbus.model.disturbance import on_plate, orders_of
from quietbus.model.guidance import StepGuidance
from quietbus.model.satellite import Satellite
from quietbus.spatial.rotation import quaternion_to_matrix
from quietbus.spatial.vector import rotate

CHUNK = 256  # frequencies of noise that programs share


@dataclass(frozen=True)
class Platforms:
    """The small vibration at rest of a bus with n platforms, gimbals steered as one cluster."""

    satellites: tuple[Satellite, ...]  # the bus with one platform each, isolated, same control
    gimbal_angles: tuple[np.ndarray, ...]  # (cmg,) [rad] of each platform
    small: Vibration  # on (r_P1, theta_P1, ..., r_B, theta_B)
    force: np.ndarray  # (order, cmg, 6 n + 6) of the rotors
    reaction: np.ndarray  # (3, 6 n + 6, cmg) of gimbal angle, rate and acceleration
    rigid: np.ndarray  # (6 n + 6, 6) the freedoms by (r_B, theta_B) where nothing moves in the bus
    rest_error: float  # [m/s^2, rad/s^2] largest acceleration: 0 at an equilibrium

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
        satellites = tuple(replace(s, mount="isolated", loads=()) for s in satellites)
        angles = tuple(np.asarray(each, float) for each in gimbal_angles)
        n = len(satellites)
        size, bus = 6 * n + 6, np.arange(6 * n, 6 * n + 6)
        M, C, K = np.zeros((3, size, size))
        M[bus[:3], bus[:3]] = float(satellites[0].bus.mass)
        M[np.ix_(bus[3:], bus[3:])] = satellites[0].bus.I_BBcm_B
        parts = [
            jax.tree.map(np.asarray, _platform(_uncontrolled(satellite), jnp.asarray(own)))
            for satellite, own in zip(satellites, angles, strict=True)
        ]
        forces, reactions = [], []
        rigid = np.zeros((size, 6))
        rigid[bus] = np.eye(6)
        for i, (satellite, part) in enumerate(zip(satellites, parts, strict=True)):
            rows = np.concatenate([np.arange(6 * i, 6 * i + 6), bus])
            for whole, added in ((M, part.M), (C, part.C), (K, part.K)):
                whole[np.ix_(rows, rows)] += added
            forces.append(_spread(part.force, rows, size, axis=-1))
            reactions.append(_spread(part.reaction, rows, size, axis=1))
            rigid[rows[:6]] = np.eye(6)
            rigid[rows[:3], 3:] = -np.cross(satellite.p_BP_B, np.eye(3)).T
        error = max(float(np.max(np.abs(part.slow.u_rate))) for part in parts)
        reaction = np.concatenate(reactions, axis=2)
        control = None
        if satellites[0].controller is not None and satellites[0].steering is not None:
            control = _decisions(as_one_cluster(satellites), jnp.concatenate(angles))
            control = eqx.tree_at(lambda c: c.reaction, control, reaction)
        matrices = (jnp.asarray(matrix) for matrix in (M, C, K))
        small = _equations(parts[0].slow, matrices, control, None)
        force = np.concatenate(forces, axis=1)
        return cls(satellites, angles, small, force, reaction, rigid, error)

    @property
    def orders(self) -> np.ndarray:
        """(order,) multiples of rotor speed at which rotors shake, the same on all platforms."""
        return np.asarray(orders_of(self.satellites[0].disturbance))

    @property
    def frequency(self) -> np.ndarray:
        """(cmg, order) [rad/s]."""
        speeds = np.concatenate([s.cluster.rotor_speed for s in self.satellites])
        return np.outer(speeds, self.orders)

    @property
    def bolted(self) -> Vibration:
        """The equations with all plates fixed to the bus, on (r_B, theta_B)."""
        T, small = self.rigid, self.small
        control = small.control
        if control is not None:
            control = eqx.tree_at(lambda c: c.reaction, control, T.T @ control.reaction)
        matrices = (jnp.asarray(T.T @ matrix @ T) for matrix in self._matrices)
        return _equations(small.slow, matrices, control, T)

    def response(self, mount: str = "isolated") -> np.ndarray:
        """(cmg, order, 6 n + 6) complex freedoms, steady response to each order of each rotor."""
        small = self.small if mount == "isolated" else self.bolted
        s = 1j * self.frequency
        standing = s == 0.0  # a rotor that stands still shakes nothing
        Z = np.asarray(_dynamic_stiffness(small, jnp.asarray(np.where(standing, 1j, s).ravel())))
        force = np.swapaxes(self.force, 0, 1).reshape(len(Z), -1)
        if mount == "isolated":
            xi = np.linalg.solve(Z, force[..., None])[..., 0]
        else:
            xi = np.linalg.solve(Z, (force @ self.rigid)[..., None])[..., 0] @ self.rigid.T
        return np.where(standing[..., None], 0.0, xi.reshape(*s.shape, -1))

    def noise_psd(self, frequency: np.ndarray, mount: str = "isolated") -> np.ndarray:
        """(f, cmg, axis) one-sided PSD [(rad/s)^2/Hz] of the bus rate by each rotor's noise.

        Args:
            frequency: (f,) [Hz].
        """
        frequency = np.asarray(frequency, float)
        parts = []
        for start in range(0, len(frequency), CHUNK):
            these = frequency[start : start + CHUNK]
            padded = np.pad(these, (0, CHUNK - len(these)), mode="edge")
            parts.append(self._noise_psd(padded, mount)[: len(these)])
        return np.concatenate(parts)

    def _noise_psd(self, frequency: np.ndarray, mount: str) -> np.ndarray:
        small = self.small if mount == "isolated" else self.bolted
        omega, size = 2.0 * np.pi * frequency, len(self.rigid)
        Z = np.asarray(_dynamic_stiffness(small, jnp.asarray(1j * omega)))
        bus = np.arange(size - 6, size)
        found = []
        for i, (own, gamma) in enumerate(zip(self.satellites, self.gimbal_angles, strict=True)):
            if own.disturbance is None or not own.disturbance.noisy:
                found.append(np.zeros((len(omega), len(gamma), 3)))
                continue
            wrench, density = map(np.asarray, _noise(own, gamma, jnp.asarray(frequency)))
            rows = np.concatenate([np.arange(6 * i, 6 * i + 6), bus])
            force = np.pad(wrench.reshape(len(omega), -1, 6), ((0, 0), (0, 0), (0, 6)))
            force = np.swapaxes(_spread(force, rows, size, axis=-1), 1, 2)
            if mount != "isolated":
                force = self.rigid.T @ force
            rate = omega[:, None, None] * np.abs(np.linalg.solve(Z, force)[:, -3:])
            rate = rate.reshape(len(omega), 3, *density.shape[1:])
            found.append(np.einsum("fjc,fajc->fja", density, rate**2))
        return np.concatenate(found, axis=1)

    def strokes(self, xi: np.ndarray) -> tuple[np.ndarray, ...]:
        """Strokes (..., leg) [m] of each platform's legs for freedoms (..., 6 n + 6)."""
        found = []
        for i, satellite in enumerate(self.satellites):
            own = np.concatenate([xi[..., 6 * i : 6 * i + 6], xi[..., -6:]], axis=-1)
            found.append(own @ _stroke_rows(satellite).T)
        return tuple(found)

    def turned(self, torque: np.ndarray) -> np.ndarray:
        """(6 n + 6,) freedoms under a steady control torque [N m] on the bus; the bus at zero.

        Gimbals turn at the rate that steering asks for, the satellite gathers speed, the plates
        have come to rest in the bus: at the start of a manoeuvre, before rates matter.
        """
        rates = steering_commands(as_one_cluster(self.satellites), self._all_angles) @ torque
        force = self.reaction[1] @ rates
        T, (M, _, K) = self.rigid, self._matrices
        gathering = T @ np.linalg.solve(T.T @ M @ T, T.T @ force)
        plates = slice(0, -6)
        at = np.linalg.solve(K[plates, plates], (force - M @ gathering)[plates])
        return np.append(at, np.zeros(6))

    @property
    def _matrices(self) -> tuple[np.ndarray, ...]:
        """M, C and K."""
        return tuple(np.asarray(m) for m in (self.small.M, self.small.C, self.small.K))

    @property
    def _all_angles(self) -> np.ndarray:
        return np.concatenate(self.gimbal_angles)

    def modes(self, held: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies [Hz] and damping of critical [-], ascending; gimbals held, bus free or held.

        Modes that do not swing count twice, one pole each.
        """
        poles = np.linalg.eigvals(self._plates_in_bus(held))
        poles = poles[(poles.imag >= 0.0) & (np.abs(poles) > RIGID_BODY)]
        size = np.abs(poles)
        order = np.argsort(size)
        return size[order] / (2.0 * np.pi), -poles.real[order] / size[order]

    def _plates_in_bus(self, held: bool) -> np.ndarray:
        if held:
            M, C, K = (matrix[:-6, :-6] for matrix in self._matrices)
            n, unit = len(M), np.eye(len(M))
            pull, damp = np.linalg.solve(M, -K), np.linalg.solve(M, -C)
            return np.block([[np.zeros((n, n)), unit], [pull, damp]])
        _, pull, damp = self._in_bus()
        n = len(pull)
        unit = np.eye(n)
        A = np.block([[np.zeros((n, n)), unit], [pull, damp]])
        return A[3:, 3:]  # nothing depends on the attitude

    def _in_bus(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Inverse mass on the forces of all freedoms, and accelerations by pose and by rate.

        Of (theta_B, plates relative to the bus); the satellite's place as a whole is left out.
        """
        n = len(self.rigid) - 6
        # xi = basis (r_B, theta_B, plates in the bus); the legs resist only the latter
        basis = np.hstack([self.rigid, np.eye(n + 6)[:, :n]])
        M, C, K = (basis.T @ matrix @ basis for matrix in self._matrices)
        K[:, :6] = 0.0  # at rest nothing depends on where the satellite is as a whole
        inverse = np.linalg.inv(M)
        return (inverse @ basis.T)[3:], -(inverse @ K)[3:, 3:], -(inverse @ C)[3:, 3:]

    def linear(self, actuator: Actuator = "servo") -> LinearModel:
        """The uncontrolled satellite as a state-space model.

        States: attitude of the bus, pose of each plate relative to the bus, their rates, the rate
        of the bus, and gimbal rates (servo). Inputs: ``control_torque``. Outputs:
        ``bus_attitude``, ``bus_rate``.

        Args:
            actuator: "servo": gimbals follow their rate commands through the servo. "ideal": at
                once.
        """
        by_force, pull, damp = self._in_bus()
        command = steering_commands(as_one_cluster(self.satellites), self._all_angles)
        cmg = command.shape[0]
        by_rate, by_acceleration = (by_force @ r for r in self.reaction[1:])
        m = len(pull)
        zero = np.zeros((m, m))
        if actuator == "ideal":
            A = np.block([[zero, np.eye(m)], [pull, damp]])
            B = np.vstack([np.zeros((m, 3)), by_rate @ command])
        else:
            bandwidth = np.asarray(_servos(self.satellites).bandwidth)
            driven = by_rate - by_acceleration * bandwidth
            A = np.block(
                [
                    [zero, np.eye(m), np.zeros((m, cmg))],
                    [pull, damp, driven],
                    [np.zeros((cmg, 2 * m)), -np.diag(bandwidth)],
                ]
            )
            lag = bandwidth[:, None] * command
            B = np.vstack([np.zeros((m, 3)), by_acceleration @ lag, lag])
        unit = np.eye(len(A))
        return LinearModel(
            A,
            B,
            unit[[0, 1, 2, m, m + 1, m + 2]],
            np.zeros((6, 3)),
            self._state_names(actuator, cmg),
            tuple(f"control_torque_{axis}" for axis in AXES),
            tuple(f"{name}_{axis}" for name in ("bus_attitude", "bus_rate") for axis in AXES),
        )

    def _state_names(self, actuator: Actuator, cmg: int) -> tuple[str, ...]:
        plates = range(len(self.satellites))
        names = []
        for bus, kinds in (("attitude", ("position", "attitude")), ("rate", ("velocity", "rate"))):
            whole = [f"bus_{bus}", *(f"plate{i}_{kind}" for i in plates for kind in kinds)]
            names += [f"{name}_{axis}" for name in whole for axis in AXES]
        if actuator == "servo":
            names += [f"gimbal_rate_{j}" for j in range(cmg)]
        return tuple(names)

    def controlled(self, pid: PID, actuator: Actuator = "servo") -> ControlledSatellite:
        """The attitude loop around the satellite; gains as of ``analysis.coupled``."""
        return controlled(self.linear(actuator), pid)

    @cached_property
    def torque_peaks(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) frequencies [Hz] and gains [-] of the largest answer of the bus to control torque.

        The gain is angular acceleration about an axis by the torque asked for about it, over what
        it is at low frequency; gimbals follow at once.
        """
        model = self.linear("ideal").select(None, ["bus_rate"])

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


def as_one_cluster(satellites: Sequence[Satellite]) -> Satellite:
    """The CMGs of all, each with its servo, on one plate along bus axes, as steering sees them.

    Control and steering law are those of all; legs and plate mean nothing, since what control and
    steering decide depends on neither.
    """
    turned = []
    for satellite in satellites:
        R_BP = np.asarray(quaternion_to_matrix(satellite.q_BP))
        cluster: ControlMomentGyro = satellite.cluster
        places = np.asarray(satellite.p_BP_B) + np.asarray(cluster.p_PC_P) @ R_BP.T
        axes = R_BP @ np.asarray(cluster.R_PG0)
        # at rest a run-up has its end speeds, and nothing drives the rotors
        turned.append(replace(cluster, p_PC_P=places, R_PG0=axes, drive=None))
    whole = jax.tree.map(lambda *each: jnp.concatenate(each), *turned)
    unit = jnp.array([1.0, 0.0, 0.0, 0.0])
    return replace(
        satellites[0],
        cluster=whole,
        q_BP=unit,
        servo=_servos(satellites),
        disturbance=None,
        motor=None,
    )


def _servos(satellites: Sequence[Satellite]) -> GimbalServo:
    """Each CMG's own; limits, which do not act at rest, are left out."""
    each = [np.full(len(s.cluster.rotor_speed), float(s.servo.bandwidth)) for s in satellites]
    return GimbalServo(jnp.asarray(np.concatenate(each)), None, None)


def _equations(
    slow: SlowMotion,
    matrices: Iterable[Array],
    control: Control | None,
    projection: np.ndarray | None,
) -> Vibration:
    M, C, K = matrices
    return Vibration(
        slow, M, C, K, control, None if projection is None else jnp.asarray(projection)
    )


class _Part(eqx.Module):
    """What one platform adds to the equations, without the bus."""

    M: Float[Array, "12 12"]
    C: Float[Array, "12 12"]
    K: Float[Array, "12 12"]
    force: Float[Array, "order cmg 12"]
    reaction: Float[Array, "3 12 cmg"]
    slow: SlowMotion


def _uncontrolled(satellite: Satellite) -> Satellite:
    """What matters to a platform alone, so that one program serves all controls and guidances."""
    guidance = StepGuidance(jnp.array([1.0, 0.0, 0.0, 0.0]))
    return replace(satellite, controller=None, steering=None, guidance=guidance)


@eqx.filter_jit
def _platform(satellite: Satellite, gimbal_angle: Float[Array, " cmg"]) -> _Part:
    satellite, slow, moments = at_rest(satellite, jnp.asarray(gimbal_angle))
    bus = (jnp.zeros(()), jnp.zeros((3, 3)))
    alone = eqx.tree_at(lambda s: (s.bus.mass, s.bus.I_BBcm_B), satellite, bus)
    small = vibration(alone, slow, moments, leg_coefficients(alone, slow))
    return _Part(
        small.M,
        small.C,
        small.K,
        rotor_forces(satellite, slow, moments),
        gimbal_reaction(slow, moments),
        slow,
    )


@eqx.filter_jit
def _decisions(satellite: Satellite, gimbal_angle: Float[Array, " cmg"]) -> Control | None:
    return control_path(*at_rest(satellite, jnp.asarray(gimbal_angle)))


@eqx.filter_jit
def _noise(satellite, gimbal_angle, frequency):
    """Wrench on the plate by each channel of each rotor (f, cmg, channel, 6), and PSD of these."""
    disturbance, cluster = satellite.disturbance, satellite.cluster
    R_BP = quaternion_to_matrix(satellite.q_BP)

    def wrench(frequency):
        each = disturbance.unit_inputs(cluster, 2.0 * jnp.pi * frequency)
        each = on_plate(cluster, gimbal_angle, each)
        return rotate(R_BP, each.reshape(*each.shape[:-1], 2, 3)).reshape(each.shape)

    return jax.vmap(wrench)(frequency), disturbance.density(frequency)


@eqx.filter_jit
def _dynamic_stiffness(small, s):
    return jax.vmap(small.stiffness)(s)


def _spread(values: np.ndarray, rows: np.ndarray, size: int, axis: int) -> np.ndarray:
    """Values on twelve freedoms as values on all of them."""
    moved = np.moveaxis(values, axis, -1)
    whole = np.zeros((*moved.shape[:-1], size), moved.dtype)
    whole[..., rows] = moved
    return np.moveaxis(whole, -1, axis)


def _stroke_rows(satellite: Satellite) -> np.ndarray:
    """(leg, 12) strokes by (r_P, theta_P, r_B, theta_B)."""
    R_BP, legs = np.asarray(quaternion_to_matrix(satellite.q_BP)), satellite.legs
    r_U, r_A = np.asarray(legs.p_PU_P) @ R_BP.T, np.asarray(legs.p_BA_B)
    s = np.asarray(satellite.p_BP_B) + r_U - r_A
    s = s / np.linalg.norm(s, axis=1, keepdims=True)
    return np.hstack([s, np.cross(r_U, s), -s, -np.cross(r_A, s)])
