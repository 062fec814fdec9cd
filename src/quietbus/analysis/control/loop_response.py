"""Bode, Nyquist and root locus data of a loop, for pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from quietbus.analysis.control.crossings import frequency_grid, gain_crossings, phase_crossings
from quietbus.analysis.control.loop import Loop
from quietbus.analysis.control.nyquist import stable_gain_range
from quietbus.analysis.control.rational import Array


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Bode and Nyquist data of a loop."""

    omega: Array  # (n,) [rad/s]
    response: NDArray[np.complex128]  # (n,) [-] L(j omega)
    phase_deg: Array  # (n,) [deg] continuous, from -90 degrees per integrator

    @property
    def frequency_hz(self) -> Array:
        """[Hz]."""
        return self.omega / (2.0 * math.pi)

    @property
    def magnitude_db(self) -> Array:
        """[dB]; infinite on a pole."""
        with np.errstate(divide="ignore"):
            return 20.0 * np.log10(np.abs(self.response))


def frequency_response(loop: Loop, omega: ArrayLike | None = None) -> FrequencyResponse:
    """Response of a loop that is not zero, by default on a grid with all crossings in it.

    Args:
        loop: the loop.
        omega: (n,) angular frequencies [rad/s].
    """
    if omega is None:
        marks = [
            c.omega for c in phase_crossings(loop) if c.omega > 0 and math.isfinite(c.log_gain)
        ]
        marks += [crossover for crossover, _ in gain_crossings(loop)]
        grid = np.unique(np.append(frequency_grid(loop), marks))
    else:
        grid = np.asarray(omega, float)
    return FrequencyResponse(grid, loop.response(grid), np.degrees(loop.phase(grid)))


@dataclass(frozen=True, eq=False)
class RootLocus:
    """Closed-loop poles over the gain, one column per branch."""

    gains: Array  # (m,) K
    poles: NDArray[np.complex128]  # (m, n) [rad/s] each column continuous in K


def root_locus(loop: Loop, gains: ArrayLike | None = None) -> RootLocus:
    """Closed-loop poles for many gains, matched into continuous branches.

    Args:
        loop: the loop; a delay is left out, having no finite locus.
        gains: (m,) rising K; by default dense over six decades around the chosen gain and the
            ends of the stable range.
    """
    if gains is None:
        ends = [end for pair in stable_gain_range(loop) for end in pair if end]
        marks = np.array([*ends, loop.gain or 1.0])
        gains = np.unique(
            np.append(np.geomspace(marks.min() * 1e-3, marks.max() * 1e3, 1200), marks)
        )
    gains = np.asarray(gains, float)
    scales = gains / loop.gain if loop.gain else np.zeros_like(gains)
    poles = np.array([np.roots(loop.closed_loop_polynomial(scale)) for scale in scales], complex)
    for i in range(1, len(poles)):
        before, now = poles[i - 1][:, None], poles[i][None, :]
        size = np.abs(before) + np.abs(now)
        distance = np.abs(before - now) / np.where(size > 0, size, 1.0)
        poles[i] = poles[i][linear_sum_assignment(distance)[1]]
    return RootLocus(gains, poles)
