"""The attitude that the control is to follow (docs/theory.md, section 10)."""

import numpy as np
from scipy.interpolate import PPoly
from scipy.spatial.transform import Rotation

from quietbus.reference.mechanism import turn
from quietbus.reference.platforms import Data


class Guidance:
    """The target at once, or a turn to it about one axis with bounded rate, acceleration, jerk."""

    def __init__(self, data: Data) -> None:
        target, said = turn(data["target"]["attitude"]), data["target"]["guidance"]
        self._start, self.turn = target, None
        if said == "step":
            return
        self._start = turn(data["initial"]["attitude"])
        whole = (self._start.inv() * target).as_rotvec()
        angle = float(np.linalg.norm(whole))
        if angle == 0.0:
            return
        limits = (said["max_rate"], said["max_acceleration"], said["max_jerk"])
        self._axis = whole / angle
        self.turn = turn_profile(angle, *limits, said["start"])

    def reference(self, t: float) -> tuple[Rotation, np.ndarray, np.ndarray]:
        """Attitude, its rate and acceleration in its own axes, at time t [s]."""
        if self.turn is None:
            return self._start, np.zeros(3), np.zeros(3)
        inside = np.clip(t, self.turn.x[0], self.turn.x[-1])
        angle, rate, acceleration = (float(self.turn(inside, nu)) for nu in range(3))
        if inside != t:
            rate = acceleration = 0.0
        axis = self._axis
        return self._start * Rotation.from_rotvec(angle * axis), rate * axis, acceleration * axis


def turn_profile(
    angle: float, rate: float, acceleration: float, jerk: float, start: float
) -> PPoly:
    """Angle [rad] over time of the quickest turn from rest to rest within the limits.

    A ramp of the rate is ``jerk, constant acceleration, -jerk``; the way back mirrors it. The peak
    rate is the largest that the limit and the angle allow.
    """

    def ramp(peak: float) -> tuple[float, float]:
        """Times of jerk and of constant acceleration that lead to a rate."""
        if peak * jerk <= acceleration**2:
            return np.sqrt(peak / jerk), 0.0
        return acceleration / jerk, peak / acceleration - acceleration / jerk

    def turned(peak: float) -> float:
        """Angle of both ramps without a cruise between them."""
        with_jerk, steady = ramp(peak)
        return peak * (2.0 * with_jerk + steady)

    peak = rate
    if turned(rate) > angle:  # by bisection: it grows with the rate
        low, high = 0.0, rate
        while high - low > 4e-16 * high:
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            low, high = (middle, high) if turned(middle) < angle else (low, middle)
        peak = high
    with_jerk, steady = ramp(peak)
    cruise = max((angle - turned(peak)) / peak, 0.0)
    times = np.array([with_jerk, steady, with_jerk, cruise, with_jerk, steady, with_jerk])
    jerks = jerk * np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])
    knots, coefficients = [start], []
    at = np.zeros(3)  # angle, rate, acceleration
    for lasting, j in zip(times, jerks, strict=True):
        if lasting <= 0.0:
            continue
        coefficients.append([j / 6.0, at[2] / 2.0, at[1], at[0]])
        knots.append(knots[-1] + lasting)
        s = lasting
        at = np.array(
            [
                at[0] + at[1] * s + at[2] * s**2 / 2.0 + j * s**3 / 6.0,
                at[1] + at[2] * s + j * s**2 / 2.0,
                at[2] + j * s,
            ]
        )
    return PPoly(np.array(coefficients).T, np.array(knots))
