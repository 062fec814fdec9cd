"""Attitude control, steering and motors of a scenario (docs/theory.md, sections 8 and 9)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.guidance import Guidance
from quietbus.reference.mechanism import Mechanism, apply
from quietbus.reference.motion import Motion
from quietbus.reference.platforms import Data, blocks
from quietbus.reference.units import read_drives


@dataclass(frozen=True)
class Decisions:
    """What control and motors do at one instant."""

    attitude_error: np.ndarray  # (3,) [rad] bus frame
    torque: np.ndarray  # (3,) [N m] on the bus, within its limit
    integral_rate: np.ndarray  # (3,) [rad]
    gimbal_acceleration: np.ndarray  # (unit,) [rad/s^2]
    rotor_acceleration: np.ndarray  # (unit,) [rad/s^2]
    singularity: float  # [-] of the units' torque directions
    torque_share: float  # [-] of the torque that is delivered, along its own direction


class Control:
    """Controller, steering and motors."""

    def __init__(self, data: Data, mechanism: Mechanism, inertia_B: np.ndarray) -> None:
        """``inertia_B``: (3, 3) of the whole satellite [kg m^2], for the slew's feedforward."""
        self._mechanism, self._drives = mechanism, read_drives(data)
        self.guidance = Guidance(data)
        said = data["control"]
        self._pid, self._law, self._limit = None, None, np.inf
        if said != "none":
            self._pid = gains(said["pid"])
            self._limit = said.get("torque_limit", np.inf)
            self._law = said["steering"] if said["steering"]["law"] != "none" else None
            self._feedforward = inertia_B if said["feedforward"] else np.zeros((3, 3))
        self._limited = np.isfinite(self._drives.limit)
        self._full = np.where(self._limited, self._drives.limit, 1.0)  # rad/s, or N m of wheels
        self._spin_inertia = mechanism.units.rotor.inertia[:, 0, 0]
        self._run_ups = [
            (block.units, RunUp(block.data["run_up"], mechanism.units.speed[block.units]))
            for block in blocks(data)
            if "run_up" in block.data
        ]

    @property
    def corners(self) -> list[float]:
        """Instants [s] at which what is asked for is not smooth."""
        turn = [] if self.guidance.turn is None else list(self.guidance.turn.x)
        return turn + [t for _, run_up in self._run_ups for t in run_up.corners]

    @property
    def speed_limit(self) -> np.ndarray:
        """(unit,) [rad/s] of wheels; infinite: none."""
        return self._drives.speed_limit

    @property
    def runs_up(self) -> np.ndarray:
        """(unit,) whether the rotor's speed is prescribed."""
        found = np.zeros(len(self._spin_inertia), dtype=bool)
        for units, _ in self._run_ups:
            found[units] = True
        return found

    def prescribed(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Turn since t = 0 [rad], speed and acceleration of all rotors that are left alone."""
        speed = self._mechanism.units.speed
        course = np.array([speed * t, speed, np.zeros_like(speed)])
        for units, run_up in self._run_ups:
            course[:, units] = run_up.turn(t), run_up.speed(t), run_up.acceleration(t)
        turn, speed, acceleration = course
        return turn, speed, acceleration

    def decide(self, t: float, motion: Motion) -> Decisions:
        """At time t [s]."""
        reference, w_R, dw_R = self.guidance.reference(t)
        turned = reference.inv() * Rotation.from_quat(motion.q_NX[0], scalar_first=True)
        error = 2.0 * turned.as_quat(canonical=True)[:3]  # scalar last and not negative
        R_BR = turned.as_matrix().T
        asked = torque = integral_rate = np.zeros(3)
        units, axes_B = self._mechanism.units, self._axes_B(motion)
        most = self._full[:, None] * axes_B
        scale = float(np.sqrt(np.sum(most**2) / len(most))) if np.any(most) else 1.0
        A = most.T / scale
        command, share = np.zeros(len(axes_B)), 1.0
        if self._pid is not None:
            kp, ki, kd = self._pid
            rate_error = motion.w_NX_X[0] - R_BR @ w_R
            asked = -(kp * error + ki * motion.error_integral + kd * rate_error)
            asked = asked + self._feedforward @ R_BR @ dw_R
            size = np.linalg.norm(asked)
            torque = asked * min(1.0, self._limit / size) if size > 0.0 else asked
            delivered = torque
            if self._law is not None:
                # the units' momentum takes up what the bus is to feel
                effort = steer(self._law, A, -torque / scale, t, self._mechanism.R_BX[1])
                cut = 1.0 / max(1.0, np.max(np.abs(effort[self._limited]), initial=0.0))
                wanted = cut * effort * self._full
                command = np.where(self._stuck(wanted, motion), 0.0, wanted)
                delivered = cut * torque + (wanted - command) @ axes_B
                if size > 0.0:
                    share = float(-(command @ axes_B) @ torque / (torque @ torque))
            integral_rate = error
            if ki * kd > 0.0:
                integral_rate = error + (asked - delivered) / (ki * np.sqrt(kd / ki))
        drives, most_by = self._drives, self._drives.acceleration_limit
        rate = np.where(units.wheel, 0.0, command)
        acceleration = drives.bandwidth * (rate - motion.gimbal_rate)
        acceleration = np.clip(acceleration, -most_by, most_by)
        spin_up = np.where(units.wheel, command, 0.0) / self._spin_inertia
        spin_up = spin_up + self.prescribed(t)[2]
        singularity = float(np.prod(np.linalg.svd(A)[1])) if len(axes_B) >= 3 else 0.0
        return Decisions(error, torque, integral_rate, acceleration, spin_up, singularity, share)

    def _stuck(self, torque: np.ndarray, motion: Motion) -> np.ndarray:
        """Which units are wheels at the end of their speed that a torque would take further."""
        at_its_end = np.abs(motion.rotor_speed) >= self._drives.speed_limit
        outward = np.sign(torque) == np.sign(motion.rotor_speed)
        return self._mechanism.units.wheel & at_its_end & outward

    def _axes_B(self, motion: Motion) -> np.ndarray:
        """Momentum rate (unit, 3) by each gimbal's rate or wheel's torque, bodies in their places.

        Bus axes; of gimbals [N m s], of torques [-].
        """
        units = self._mechanism.units
        s, t, _ = np.moveaxis(units.axes_X, 2, 0)
        gamma = motion.gimbal_angle[:, None]
        momentum = (self._spin_inertia * motion.rotor_speed)[:, None]
        across = momentum * (np.cos(gamma) * t - np.sin(gamma) * s)
        axes_X = np.where(units.wheel[:, None], s, across)
        return apply(self._mechanism.R_BX[units.host], axes_X)


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


def steer(law: Data, A: np.ndarray, wanted: np.ndarray, t: float, R: np.ndarray) -> np.ndarray:
    """Efforts (unit,) by a steering law for a momentum rate (3,).

    Args:
        A: (3, unit) momentum rates at full effort, over the same scale as ``wanted``.
        R: (3, 3) turns the law's own axes to those of A.
    """
    if law["law"] == "pseudo_inverse":
        return np.linalg.pinv(A, rcond=0.0) @ wanted
    AAt = A @ A.T
    weight = law["lambda0"] * np.exp(-law["mu"] * np.linalg.det(AAt))
    E = np.eye(3)
    if law["law"] == "generalized_singularity_robust":
        e1, e2, e3 = (
            law["epsilon0"] * np.sin(law["frequency"] * t + phase) for phase in law["phases"]
        )
        E = E + R @ np.array([[0.0, e3, e2], [e3, 0.0, e1], [e2, e1, 0.0]]) @ R.T
    return A.T @ np.linalg.solve(AAt + weight * E, wanted)


class RunUp:
    """A prescribed change of the rotors' speeds."""

    def __init__(self, said: Data, nominal: np.ndarray) -> None:
        def each(value: float | list[float]) -> np.ndarray:
            return np.array(value) if isinstance(value, list) else np.full(len(nominal), value)

        self._initial = each(said["initial_speed"])
        final = said.get("final_speed")
        self._change = (nominal if final is None else each(final)) - self._initial
        self._start, self._duration = said["start"], said["duration"]
        self._smooth = said["shape"] == "smooth"

    @property
    def corners(self) -> list[float]:
        """Beginning and end [s]."""
        return [self._start, self._start + self._duration]

    @property
    def _course(self) -> np.ndarray:
        """Polynomial of the speed's change at the share x of the duration: of 1 in all."""
        return np.array([-2.0, 3.0, 0.0, 0.0] if self._smooth else [1.0, 0.0])

    def acceleration(self, t: float) -> np.ndarray:
        """Of each rotor [rad/s^2] at time t [s]."""
        x = (t - self._start) / self._duration
        if not 0.0 <= x < 1.0:
            return np.zeros_like(self._change)
        return np.polyval(np.polyder(self._course), x) * self._change / self._duration

    def speed(self, t: float) -> np.ndarray:
        """Of each rotor [rad/s] at time t [s]."""
        x = np.clip((t - self._start) / self._duration, 0.0, 1.0)
        return self._initial + np.polyval(self._course, x) * self._change

    def turn(self, t: float) -> np.ndarray:
        """Of each rotor [rad] from t = 0 until t [s]."""
        x = np.clip((t - self._start) / self._duration, 0.0, 1.0)
        after = max(t - self._start - self._duration, 0.0)
        gained = self._duration * np.polyval(np.polyint(self._course), x) + after
        return self._initial * t + gained * self._change
