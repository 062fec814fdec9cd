"""The scenario's satellite, controlled and loaded, by MuJoCo's equations of motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp

from quietbus.reference import loads
from quietbus.reference.control import Control, Decisions
from quietbus.reference.disturbance import GimbalLines, RotorLines
from quietbus.reference.mechanism import Mechanism, apply, balanced, read_mechanism, turn
from quietbus.reference.motion import Motion, beside_bus, matrix, placed, quaternion
from quietbus.reference.multibody import Accelerations, JointForces, Multibody
from quietbus.reference.platforms import Data


@dataclass(frozen=True)
class Instant:
    """All that the reference knows of one instant."""

    decisions: Decisions
    accelerations: Accelerations
    rates: Motion  # time derivatives of the motion
    stroke: np.ndarray  # (leg,) [m]
    strut_force: np.ndarray  # (leg,) [N]
    rotor_torque: np.ndarray  # (unit,) [N m]
    joints: JointForces | None  # None: on rigid mounts the legs' forces are not determined


class ReferenceSatellite:
    """The satellite of a scenario; needs MuJoCo."""

    def __init__(self, data: Data) -> None:
        """``data``: as of ``Scenario.to_dict``."""
        self._data = data
        self.mechanism = read_mechanism(data)
        self.body = Multibody(self.mechanism, _as_one(self.mechanism))
        self.control = Control(data, self.mechanism, _inertia_B(self.mechanism))
        self.rotor_lines = RotorLines(data, self.mechanism)
        self.gimbal_lines = GimbalLines(data, self.mechanism)

    @property
    def corners(self) -> list[float]:
        """Instants [s] at which loads or commands are not smooth, ascending."""
        found = [t for load in self._data["loads"] for t in loads.corners(load["profile"])]
        return sorted({*found, *self.control.corners})

    def initial(self) -> Motion:
        """The motion at t = 0: all bodies moving as one, bus mass centre at rest at 0."""
        start = self._data["initial"]
        speed = self.control.prescribed(0.0)[1]
        return _as_one(self.mechanism, start["attitude"], start["rate"], speed)

    def at(self, t: float, motion: Motion, with_joints: bool = True) -> Instant:
        """Everything at time t [s]."""
        motion = self._riding(motion)
        decisions = self.control.decide(t, motion)
        gimbals = decisions.gimbal_acceleration + self.gimbal_lines.acceleration(motion)
        R_NX = matrix(motion.q_NX)
        wrenches = loads.wrenches(self._data["loads"], t, self.mechanism.names, R_NX)
        if self.rotor_lines.any:
            wrenches = wrenches + self.rotor_lines.wrenches(motion, R_NX)
        self.body.set(motion)
        found = self.body.accelerations(gimbals, decisions.rotor_acceleration, wrenches)
        isolated = not np.any(self.mechanism.welded)
        return Instant(
            decisions,
            found,
            Motion(
                p_NX_N=motion.v_NX_N,
                q_NX=_quaternion_rate(motion.q_NX, motion.w_NX_X),
                v_NX_N=found.v,
                w_NX_X=apply(np.swapaxes(R_NX, 1, 2), found.w),
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
        """The motion with unit quaternions, and with welded bodies in their places."""
        q_NX = motion.q_NX / np.linalg.norm(motion.q_NX, axis=1, keepdims=True)
        return placed(self.mechanism, replace(motion, q_NX=q_NX), self.mechanism.welded)


def _as_one(
    mechanism: Mechanism,
    attitude: Sequence[float] = (0.0, 0.0, 0.0),
    rate: Sequence[float] = (0.0, 0.0, 0.0),
    speed: np.ndarray | float = 0.0,
) -> Motion:
    """All bodies moving as one, gimbals and rotors at their angles of the start.

    Args:
        attitude: [roll, pitch, yaw] of the bus [rad].
        rate: (3,) of the bus [rad/s], bus frame.
        speed: of the rotors [rad/s].
    """
    units, zero = mechanism.units, np.zeros((len(mechanism.names), 3))
    bus = Motion(
        p_NX_N=zero,
        q_NX=quaternion(turn(attitude)) * np.ones((len(zero), 1)),
        v_NX_N=zero,
        w_NX_X=zero + np.array(rate, dtype=float),
        gimbal_angle=units.gimbal_angle,
        gimbal_rate=np.zeros_like(units.phase),
        rotor_angle=units.phase,
        rotor_speed=speed * np.ones_like(units.phase),
        error_integral=np.zeros(3),
    )
    return placed(mechanism, bus, beside_bus(mechanism))


def _inertia_B(mechanism: Mechanism) -> np.ndarray:
    """Inertia [kg m^2] of the whole satellite at its start about its mass centre, bus axes.

    With balanced rotors, as the control's designer knows it.
    """
    start = _as_one(mechanism)
    body = Multibody(balanced(mechanism), start)
    body.set(start)
    return body.inertia()


def _quaternion_rate(q: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Of attitudes (body, 4) whose bodies turn at w (body, 3) [rad/s] about their own axes."""
    scalar, vector = q[:, :1], q[:, 1:]
    along = -np.sum(vector * w, axis=1, keepdims=True)
    return 0.5 * np.concatenate([along, scalar * w + np.cross(vector, w)], axis=1)
