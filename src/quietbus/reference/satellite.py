"""The scenario's satellite, controlled and loaded, by MuJoCo's equations of motion."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp

from quietbus.reference import loads
from quietbus.reference.control import Control, Decisions
from quietbus.reference.disturbance import GimbalLines, RotorLines
from quietbus.reference.mechanism import Data, Mechanism, read_mechanism, turn
from quietbus.reference.motion import Motion, matrix, quaternion, with_plate
from quietbus.reference.multibody import Accelerations, JointForces, Multibody, Wrench


@dataclass(frozen=True)
class Instant:
    """All that the reference knows of one instant."""

    decisions: Decisions
    accelerations: Accelerations
    rates: Motion  # time derivatives of the motion
    stroke: np.ndarray  # (leg,) [m]
    strut_force: np.ndarray  # (leg,) [N]
    rotor_torque: np.ndarray  # (unit,) [N m]
    joints: JointForces | None  # None: on a rigid mount the legs' forces are not determined


class ReferenceSatellite:
    """The satellite of a scenario; needs MuJoCo."""

    def __init__(self, data: Data) -> None:
        """``data``: as of ``Scenario.to_dict``."""
        self._data = data
        self.mechanism = read_mechanism(data)
        self.body = Multibody(self.mechanism, _as_one(self.mechanism))
        self.control = Control(data, self.mechanism, _inertia_B(data))
        self.rotor_lines = RotorLines(data, self.mechanism)
        self.gimbal_lines = GimbalLines(data, self.mechanism)

    @property
    def corners(self) -> list[float]:
        """Instants [s] at which loads or commands are not smooth, ascending."""
        found = [t for load in self._data["loads"] for t in loads.corners(load["profile"])]
        return sorted({*found, *self.control.corners})

    def initial(self) -> Motion:
        """The motion at t = 0: plate and bus moving as one, bus mass centre at rest at 0."""
        run_up = self.control.run_up
        speed = self.mechanism.units.speed if run_up is None else run_up.initial_speed
        start = self._data["initial"]
        return _as_one(self.mechanism, start["attitude"], start["rate"], speed)

    def at(self, t: float, motion: Motion, with_joints: bool = True) -> Instant:
        """Everything at time t [s]."""
        motion = self._riding(motion)
        decisions = self.control.decide(t, motion)
        gimbals = decisions.gimbal_acceleration + self.gimbal_lines.acceleration(motion)
        R_NB, R_NP = matrix(motion.q_NB), matrix(motion.q_NP)
        wrench = loads.wrench(self._data["loads"], t, R_NB, R_NP)
        if self.rotor_lines.any:
            force, torque = (R_NP @ each for each in self.rotor_lines.wrench(motion))
            on_P = (wrench.force_P + force, wrench.torque_P + torque)
            wrench = Wrench(*on_P, wrench.force_B, wrench.torque_B)
        self.body.set(motion)
        found = self.body.accelerations(gimbals, decisions.rotor_acceleration, wrench)
        isolated = self.mechanism.mount == "isolated"
        return Instant(
            decisions,
            found,
            Motion(
                p_NB_N=motion.v_NB_N,
                q_NB=_quaternion_rate(motion.q_NB, motion.w_NB_B),
                p_NP_N=motion.v_NP_N,
                q_NP=_quaternion_rate(motion.q_NP, motion.w_NP_P),
                v_NB_N=found.v_B,
                w_NB_B=R_NB.T @ found.w_B,
                v_NP_N=found.v_P,
                w_NP_P=R_NP.T @ found.w_P,
                gimbal_angle=motion.gimbal_rate,
                gimbal_rate=gimbals,
                rotor_angle=motion.rotor_speed,
                rotor_speed=decisions.rotor_acceleration,
                error_integral=decisions.integral_rate,
            ),
            self.body.strokes(),
            self.body.strut_forces(),
            self.body.rotor_torques(found),
            self.body.joint_forces(found) if isolated and with_joints else None,
        )

    def fly(
        self, start: Motion, times: np.ndarray, relative: float = 1e-11, absolute: float = 1e-13
    ) -> list[Motion]:
        """Motions at ascending times [s], the first that of ``start``.

        SciPy's DOP853, stopped where loads or commands are not smooth.
        """
        ends = [t for t in self.corners if times[0] < t < times[-1]]
        motions, y = [start], start.as_vector()

        def rate(t: float, y: np.ndarray) -> np.ndarray:
            return self.at(t, start.from_vector(y), with_joints=False).rates.as_vector()

        last = times[0]
        for end in [*ends, times[-1]]:
            due = times[(times > last) & (times <= end)]
            asked = due if len(due) and due[-1] == end else np.append(due, end)
            # a hair inside the corner, so that each stretch sees its own side of it
            inside = lambda t, last=last, end=end: min(  # noqa: E731
                max(t, np.nextafter(last, np.inf)), np.nextafter(end, -np.inf)
            )
            flight = solve_ivp(
                lambda t, y, inside=inside: rate(inside(t), y),
                (last, end),
                y,
                "DOP853",
                asked,
                rtol=relative,
                atol=absolute,
            )
            if not flight.success:
                raise RuntimeError(f"the reference's flight ended at {flight.t[-1]:g} s")
            motions += [self._riding(start.from_vector(y)) for y in flight.y.T[: len(due)]]
            y, last = flight.y[:, -1], end
        return motions

    def _riding(self, motion: Motion) -> Motion:
        """The motion with unit quaternions, and on a rigid mount with the plate on the bus."""
        q_NB, q_NP = (q / np.linalg.norm(q) for q in (motion.q_NB, motion.q_NP))
        motion = replace(motion, q_NB=q_NB, q_NP=q_NP)
        return with_plate(self.mechanism, motion) if self.mechanism.mount == "rigid" else motion


def _as_one(
    mechanism: Mechanism,
    attitude: Sequence[float] = (0.0, 0.0, 0.0),
    rate: Sequence[float] = (0.0, 0.0, 0.0),
    speed: np.ndarray | float = 0.0,
) -> Motion:
    """Plate and bus moving as one, gimbals and rotors at their angles of the start.

    Args:
        attitude: [roll, pitch, yaw] of the bus [rad].
        rate: (3,) of the bus [rad/s], bus frame.
        speed: of the rotors [rad/s].
    """
    units, zero = mechanism.units, np.zeros(3)
    alone = Motion(
        p_NB_N=zero,
        q_NB=quaternion(turn(attitude)),
        p_NP_N=zero,
        q_NP=np.zeros(4),
        v_NB_N=zero,
        w_NB_B=np.array(rate, dtype=float),
        v_NP_N=zero,
        w_NP_P=zero,
        gimbal_angle=units.gimbal_angle,
        gimbal_rate=np.zeros_like(units.phase),
        rotor_angle=units.phase,
        rotor_speed=speed * np.ones_like(units.phase),
        error_integral=zero,
    )
    return with_plate(mechanism, alone)


def _inertia_B(data: Data) -> np.ndarray:
    """Inertia [kg m^2] of the whole satellite at its start about its mass centre, bus axes.

    With balanced rotors, as the control's designer knows it.
    """
    cluster = copy.deepcopy(data["cluster"])
    for rotor in [cluster["rotor"], *(unit.get("rotor", {}) for unit in cluster.get("units", []))]:
        rotor.update(static_imbalance=0.0, dynamic_imbalance=0.0)
    balanced = read_mechanism({**data, "cluster": cluster})
    body = Multibody(balanced, _as_one(balanced))
    body.set(_as_one(balanced))
    return body.inertia()


def _quaternion_rate(q: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Of an attitude whose body turns at w [rad/s] about its own axes."""
    scalar, vector = q[0], q[1:]
    return 0.5 * np.concatenate([[-vector @ w], scalar * w + np.cross(vector, w)])
