"""The single-axis isolator (Zhang & Xu 2012, eq. 1-2): a mass on a spring and a damper.

Force on the mass in, force on the base out,

    G(s) = (c s + k) / (M s^2 + c s + k),
    mu_F = sqrt((1 + 4 xi^2 gamma^2) / ((1 - gamma^2)^2 + 4 xi^2 gamma^2)),

with gamma = omega/omega_n the frequency ratio and xi = c / (2 sqrt(k M)) the damping ratio.
Every curve passes through 1 at gamma = sqrt(2), whatever the damping: below it the strut
amplifies and damping helps, above it the strut isolates and damping spoils the roll-off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quietbus.arguments import array, at_least_zero, positive

CROSSING = math.sqrt(2.0)
"""[-] Frequency ratio above which the isolator isolates, for every damping ratio."""


@dataclass(frozen=True)
class SingleAxisIsolator:
    """A mass on one linear strut over a fixed base.

    Raises:
        ValueError: mass or stiffness not positive, or damping negative.
    """

    mass: float  # [kg]
    stiffness: float  # [N/m]
    damping: float  # [N s/m]

    def __post_init__(self) -> None:
        for name in ("mass", "stiffness"):
            positive(name, getattr(self, name))
        at_least_zero("damping", self.damping)

    @property
    def natural_frequency(self) -> float:
        """Undamped natural frequency omega_n [rad/s]."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio xi [-]."""
        return self.damping / (2.0 * math.sqrt(self.stiffness * self.mass))

    @property
    def numerator(self) -> tuple[float, ...]:
        """Coefficients of eq. 1 in descending powers of s."""
        return (self.damping, self.stiffness) if self.damping else (self.stiffness,)

    @property
    def denominator(self) -> tuple[float, ...]:
        """Coefficients of eq. 1 in descending powers of s."""
        return (self.mass, self.damping, self.stiffness)

    @property
    def peak(self) -> tuple[float, float]:
        """Frequency [rad/s] and height [-] of the resonance."""
        gamma, gain = transmissibility_peak(self.damping_ratio)
        return float(gamma) * self.natural_frequency, float(gain)

    def transmissibility(self, omega: ArrayLike) -> NDArray[np.float64]:
        """abs(G(j omega)) [-] at angular frequencies `omega` [rad/s], any shape."""
        omega = array("omega", omega, "angular frequencies in rad/s")
        return transmissibility(omega / self.natural_frequency, self.damping_ratio)

    def to_control(self) -> Any:
        """The same as a ``control.TransferFunction``."""
        import control

        return control.tf(self.numerator, self.denominator)


def transmissibility(gamma: ArrayLike, xi: ArrayLike) -> NDArray[np.float64]:
    """Force transmissibility mu_F [-] (eq. 2).

    Args:
        gamma: frequency ratio omega/omega_n [-].
        xi: damping ratio [-]; broadcasts against `gamma`. An undamped isolator at
            resonance gives inf.
    """
    gamma, xi = np.asarray(gamma, float), np.asarray(xi, float)
    damper = (2.0 * xi * gamma) ** 2
    with np.errstate(divide="ignore"):
        return np.sqrt((1.0 + damper) / ((1.0 - gamma**2) ** 2 + damper))


def transmissibility_peak(xi: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequency ratio [-] and height [-] of the peak of `transmissibility`, in closed form.

    With r = sqrt(1 + 8 xi^2), d(mu_F^2)/d(gamma^2) = 0 gives

        gamma_peak = sqrt(2 / (1 + r)),    mu_peak = (r + 1) / sqrt((r - 1)(r + 3)).

    Args:
        xi: damping ratio [-], any shape; zero gives (1, inf).
    """
    xi = np.asarray(xi, float)
    r = np.sqrt(1.0 + 8.0 * xi**2)
    r_less_1 = 8.0 * xi**2 / (r + 1.0)  # r - 1 without cancellation at small xi
    with np.errstate(divide="ignore"):
        return np.sqrt(2.0 / (1.0 + r)), (r + 1.0) / np.sqrt(r_less_1 * (r + 3.0))
