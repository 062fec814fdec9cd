"""Attitude control, steering and motors of a scenario (docs/theory.md, sections 8 and 9)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.guidance import Guidance
from quietbus.reference.mechanism import Data, Mechanism, unit_data
from quietbus.reference.motion import Motion


@dataclass(frozen=True)
class Decisions:
    """What control and motors do at one instant."""

    attitude_error: np.ndarray  # (3,) [rad] bus frame
    torque: np.ndarray  # (3,) [N m] on the bus, within its limit
    integral_rate: np.ndarray  # (3,) [rad]
    gimbal_acceleration: np.ndarray  # (unit,) [rad/s^2]
    rotor_acceleration: np.ndarray  # (unit,) [rad/s^2]
    singularity: float  # [-] of the units' torque directions


class Control:
    """Controller, steering and motors; what has no limit in the scenario has an infinite one."""

    def __init__(self, data: Data, mechanism: Mechanism, inertia_B: np.ndarray) -> None:
        """``inertia_B``: (3, 3) of the whole satellite [kg m^2], for the slew's feedforward."""
        self._mechanism, self._cluster = mechanism, data["cluster"]
        self.guidance = Guidance(data)
        said = data["control"]
        self._pid, self._law, self._limit = None, None, np.inf
        if said != "none":
            self._pid = gains(said["pid"])
            self._limit = said.get("torque_limit", np.inf)
            self._law = said["steering"] if said["steering"]["law"] != "none" else None
            self._feedforward = inertia_B if said["feedforward"] else np.zeros((3, 3))
        units, cluster = unit_data(data["cluster"]), data["cluster"]
        self._spin_inertia = mechanism.units.rotor.inertia[:, 0, 0]
        self.run_up = (
            RunUp(cluster["run_up"], mechanism.units.speed) if "run_up" in cluster else None
        )
        if mechanism.units.wheels:
            own = data["cluster"].get("units") or [{}] * len(units)
            motors = [cluster["motor"] | unit.get("motor", {}) for unit in own]
            each = lambda key: np.array([motor.get(key, np.inf) for motor in motors])  # noqa: E731
            self._torque_limit, self._speed_limit = each("torque_limit"), each("speed_limit")
            self._weight = np.ones(len(units))
            if np.all(np.isfinite(self._torque_limit)):
                limit = self._torque_limit
                self._weight = limit / np.sqrt(np.mean(limit**2))

    @property
    def corners(self) -> list[float]:
        """Instants [s] at which what is asked for is not smooth."""
        turn = [] if self.guidance.turn is None else list(self.guidance.turn.x)
        return turn + ([] if self.run_up is None else self.run_up.corners)

    @property
    def speed_limit(self) -> np.ndarray | None:
        """(unit,) [rad/s] of wheels."""
        return self._speed_limit if self._mechanism.units.wheels else None

    def decide(self, t: float, motion: Motion) -> Decisions:
        """At time t [s]."""
        reference, w_R, dw_R = self.guidance.reference(t)
        turned = reference.inv() * Rotation.from_quat(motion.q_NB, scalar_first=True)
        error = 2.0 * turned.as_quat(canonical=True)[:3]  # scalar last and not negative
        R_BR = turned.as_matrix().T
        units = len(motion.rotor_angle)
        asked = torque = integral_rate = np.zeros(3)
        rate, spin_up = np.zeros(units), np.zeros(units)
        if self.run_up is not None:
            spin_up = self.run_up.acceleration(t)
        A, scale = self._axes(motion)
        if self._pid is not None:
            kp, ki, kd = self._pid
            rate_error = motion.w_NB_B - R_BR @ w_R
            asked = -(kp * error + ki * motion.error_integral + kd * rate_error)
            asked = asked + self._feedforward @ R_BR @ dw_R
            size = np.linalg.norm(asked)
            torque = asked * min(1.0, self._limit / size) if size > 0.0 else asked
            delivered = torque
            if self._law is not None:
                # the units' momentum takes up what the bus is to feel, the plate in its place
                wanted = -self._mechanism.R_BP.T @ torque / scale
                command = steer(self._law, A, wanted, t)
                if self._mechanism.units.wheels:
                    spin_up, delivered = self._drive(command, motion.rotor_speed)
                else:
                    most = self._cluster.get("gimbal_rate_limit", np.inf)
                    cut = min(1.0, most / max(np.max(np.abs(command)), 1e-300))
                    rate, delivered = cut * command, cut * torque
            integral_rate = error
            if ki * kd > 0.0:
                integral_rate = error + (asked - delivered) / (ki * np.sqrt(kd / ki))
        acceleration = np.zeros(units)
        if not self._mechanism.units.wheels:
            most = self._cluster.get("gimbal_acceleration_limit", np.inf)
            acceleration = self._cluster["gimbal_bandwidth"] * (rate - motion.gimbal_rate)
            acceleration = np.clip(acceleration, -most, most)
        singularity = float(np.prod(np.linalg.svd(A)[1])) if units >= 3 else 0.0
        return Decisions(error, torque, integral_rate, acceleration, spin_up, singularity)

    def _axes(self, motion: Motion) -> tuple[np.ndarray, float]:
        """What each unit's motion does to the momentum (3, unit), plate axes, and its scale."""
        s, t, _ = np.moveaxis(self._mechanism.units.axes_P, 2, 0)
        if self._mechanism.units.wheels:
            return s.T * self._weight, 1.0
        momentum = self._spin_inertia * motion.rotor_speed
        scale = float(np.sqrt(np.mean(momentum**2))) or 1.0
        gamma = motion.gimbal_angle[:, None]
        return (momentum[:, None] * (np.cos(gamma) * t - np.sin(gamma) * s)).T / scale, scale

    def _drive(self, command: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations of the wheels [rad/s^2], and the torque that the bus gets [N m]."""
        torque = self._weight * command
        torque = torque / max(1.0, np.max(np.abs(torque) / self._torque_limit))
        at_its_end = (np.abs(speed) >= self._speed_limit) & (np.sign(torque) == np.sign(speed))
        torque = np.where(at_its_end, 0.0, torque)
        axes = self._mechanism.units.axes_P[:, :, 0]
        return torque / self._spin_inertia, -self._mechanism.R_BP @ (torque @ axes)


def gains(pid: Data) -> tuple[float, float, float]:
    """Kp, Ki, Kd of the torque -(Kp e + Ki int e + Kd w), also from K (s + tp)(s + tq) / s."""
    if "gain" in pid:
        kd, ki_share, kp_share = np.array(pid["gain"]), *_expanded(pid["zeros"])
        return float(kd * kp_share), float(kd * ki_share), float(kd)
    return pid["kp"], pid["ki"], pid["kd"]


def _expanded(zeros: list[float]) -> tuple[float, float]:
    """Last and middle coefficient of (s + tp)(s + tq)."""
    _, middle, last = np.polymul([1.0, zeros[0]], [1.0, zeros[1]])
    return last, middle


def steer(law: Data, A: np.ndarray, wanted: np.ndarray, t: float) -> np.ndarray:
    """Rates (unit,) by a steering law for a momentum rate (3,), both over the scale of A."""
    if law["law"] == "pseudo_inverse":
        return np.linalg.pinv(A, rcond=0.0) @ wanted
    AAt = A @ A.T
    weight = law["lambda0"] * np.exp(-law["mu"] * np.linalg.det(AAt))
    E = np.eye(3)
    if law["law"] == "generalized_singularity_robust":
        e1, e2, e3 = (
            law["epsilon0"] * np.sin(law["frequency"] * t + phase) for phase in law["phases"]
        )
        E = E + np.array([[0.0, e3, e2], [e3, 0.0, e1], [e2, e1, 0.0]])
    return A.T @ np.linalg.solve(AAt + weight * E, wanted)


class RunUp:
    """A prescribed change of the rotors' speeds."""

    def __init__(self, said: Data, nominal: np.ndarray) -> None:
        def each(value: float | list[float]) -> np.ndarray:
            return np.array(value) if isinstance(value, list) else np.full(len(nominal), value)

        self.initial_speed = each(said["initial_speed"])
        final = said.get("final_speed")
        self._change = (nominal if final is None else each(final)) - self.initial_speed
        self._start, self._duration = said["start"], said["duration"]
        self._smooth = said["shape"] == "smooth"

    @property
    def corners(self) -> list[float]:
        """Beginning and end [s]."""
        return [self._start, self._start + self._duration]

    def acceleration(self, t: float) -> np.ndarray:
        """Of each rotor [rad/s^2] at time t [s]; smooth: the speed goes as 3 x^2 - 2 x^3."""
        x = (t - self._start) / self._duration
        if not 0.0 <= x < 1.0:
            return np.zeros_like(self._change)
        slope = np.polyval(np.polyder([-2.0, 3.0, 0.0, 0.0]), x) if self._smooth else 1.0
        return slope * self._change / self._duration
