"""The attitude controller of linear analysis.

K is the size of its leading gain: kd, or kp without kd, or ki without both. The others scale with
it, so the zeros stay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PID:
    """Attitude controller, torque = -(kp e + ki int e + kd de/dt)."""

    kp: float  # [N m/rad]
    ki: float  # [N m/(rad s)]
    kd: float  # [N m s/rad]

    @classmethod
    def from_gain_and_zeros(cls, gain: float, zeros: tuple[float, float]) -> PID:
        """PID(s) = K (s + tp)(s + tq)/s (eq. 34).

        Args:
            gain: K [N m s/rad].
            zeros: tp, tq [rad/s].
        """
        tp, tq = zeros
        return cls(kp=gain * (tp + tq), ki=gain * tp * tq, kd=gain)

    @property
    def zeros(self) -> tuple[complex, ...]:
        """Zeros of PID(s) [rad/s] away from the origin."""
        return tuple(root for root in np.roots([self.kd, self.kp, self.ki]).tolist() if root)

    @property
    def gain(self) -> float:
        """K: size of the leading gain kd, kp or ki, whichever is the first that is not zero."""
        return next((abs(g) for g in (self.kd, self.kp, self.ki) if g), 0.0)
