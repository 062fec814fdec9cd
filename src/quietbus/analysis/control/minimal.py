"""The exact, minimal equations from a torque on the platform to one on its base.

Coordinates that the torque cannot move or the base torque does not feel are projected out: K and
C are symmetric once the masses are scaled to one, so the orthogonal complement of a space that is
invariant under both is invariant too, and leaving it out changes nothing.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from quietbus.analysis.control.hexapod import HexapodIsolator
from quietbus.analysis.control.rational import Array, Coefficients
from quietbus.analysis.control.symbolic import SymbolicChannel

NEGLIGIBLE = 1e-7
"""[-] A coupling this small, relative to the largest stiffness per mass, is rounding."""


@dataclass(frozen=True)
class Pole:
    """A real pole, or a pair of conjugate poles by the one with positive imaginary part."""

    real: float  # [rad/s]
    imag: float  # [rad/s]

    @property
    def natural_frequency_hz(self) -> float:
        """Distance from the origin [Hz]; the undamped frequency where legs share one c/k."""
        return abs(complex(self.real, self.imag)) / (2.0 * math.pi)

    @property
    def damped_frequency_hz(self) -> float:
        """Frequency of the free oscillation [Hz]; zero for a real pole."""
        return self.imag / (2.0 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Damping relative to critical [-]."""
        return -self.real / abs(complex(self.real, self.imag))

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return dataclasses.asdict(self) | {
            "natural_frequency_hz": self.natural_frequency_hz,
            "damped_frequency_hz": self.damped_frequency_hz,
            "damping_ratio": self.damping_ratio,
        }


@dataclass(frozen=True, eq=False)
class Minimal:
    """q'' + C q' + K q = b f, y = o_k q + o_c q': a minimal channel in unit-mass coordinates."""

    K: Array  # (n, n) [1/s^2] symmetric
    C: Array  # (n, n) [1/s] symmetric
    b: Array  # (n,)
    o_k: Array  # (n,)
    o_c: Array  # (n,)

    def symbolic(self, k: float) -> SymbolicChannel:
        """G = sum_j r_j / (sigma + lambda_j) with sigma = s^2/u, for C proportional to K."""
        stiffness, shapes = np.linalg.eigh(self.K)
        values, residues = stiffness / k, (self.o_k @ shapes) * (shapes.T @ self.b) / k
        denominator = np.poly(-values)
        numerator = np.zeros(values.size)
        for j, residue in enumerate(residues):
            numerator += residue * np.poly(-np.delete(values, j))
        numerator[np.abs(numerator) < 1e-12 * np.abs(residues).sum()] = 0.0
        numerator = np.trim_zeros(numerator, "f")
        lead = numerator[0]
        return SymbolicChannel(
            tuple((numerator / lead).tolist()), tuple((denominator / lead).tolist())
        )

    def polynomials(self) -> tuple[Coefficients, Coefficients]:
        """Numerator and monic denominator in s, for any damping.

        Both are known at points on a circle (determinant, and response times determinant), and
        a Fourier transform turns values on a circle into coefficients.
        """
        n = self.b.size
        radius = math.exp(np.linalg.slogdet(self.K)[1] / (2 * n))
        points = 2 * n + 1  # odd: none on the negative real axis, where poles lie
        s = radius * np.exp(2j * math.pi * np.arange(points) / points)
        matrices = s[:, None, None] ** 2 * np.eye(n) + s[:, None, None] * self.C + self.K
        determinants = np.linalg.det(matrices)
        motion = np.linalg.solve(matrices, np.broadcast_to(self.b[:, None], (points, n, 1)))[..., 0]
        outputs = motion @ self.o_k + s * (motion @ self.o_c)
        powers = radius ** np.arange(points)

        def coefficients(values: NDArray[np.complex128]) -> Coefficients:
            scaled = np.fft.fft(values).real / points
            scaled[np.abs(scaled) < 1e-13 * np.abs(scaled).max()] = 0.0
            return tuple(np.trim_zeros((scaled / powers)[::-1], "f").tolist())

        return coefficients(outputs * determinants), coefficients(determinants)

    def poles(self) -> tuple[Pole, ...]:
        """Poles by rising distance from the origin."""
        n = self.b.size
        system = np.block([[np.zeros((n, n)), np.eye(n)], [-self.K, -self.C]])
        values = np.linalg.eigvals(system)
        upper = sorted(values[values.imag >= 0], key=abs)
        return tuple(Pole(float(value.real), float(value.imag)) for value in upper)


def minimal(isolator: HexapodIsolator, i: int, j: int) -> Minimal | None:
    """Torque j to base torque i on the coordinates that take part; None if nothing passes."""
    to_unit_mass = np.linalg.inv(np.linalg.cholesky(isolator.mass_matrix))
    legs = isolator.legs_P @ to_unit_mass.T
    K = legs.T @ (isolator.stiffness[:, None] * legs)
    C = legs.T @ (isolator.damping[:, None] * legs)
    b = to_unit_mass[:, 3 + j]
    o_k = (isolator.legs_D[:, 3 + i] * isolator.stiffness) @ legs
    o_c = (isolator.legs_D[:, 3 + i] * isolator.damping) @ legs

    directions = [_unit(o_k), _unit(o_c)]  # sized before the projection, so that none is inflated
    for vectors in ([_unit(b)], directions):
        basis = _invariant_subspace(vectors, (K, C))
        if basis.shape[1] == 0:
            return None
        K, C = basis.T @ K @ basis, basis.T @ C @ basis
        b, o_k, o_c = basis.T @ b, basis.T @ o_k, basis.T @ o_c
        directions[:] = [basis.T @ direction for direction in directions]
    return Minimal(K, C, b, o_k, o_c)


def _unit(vector: Array) -> Array:
    size = np.linalg.norm(vector)
    return vector / size if size else vector


def _invariant_subspace(vectors: Sequence[Array], operators: Sequence[Array]) -> Array:
    """Orthonormal basis of the smallest space that holds `vectors` and that `operators` keep."""
    scaled = [A / norm for A in operators if (norm := np.linalg.norm(A, 2)) > 0]
    basis = np.empty((len(vectors[0]), 0))
    new = np.column_stack(vectors)
    while basis.shape[1] < len(basis):
        new = new - basis @ (basis.T @ new)
        left, sizes, _ = np.linalg.svd(new, full_matrices=False)
        left = left[:, sizes > NEGLIGIBLE]
        if left.shape[1] == 0:
            break
        basis = np.linalg.qr(np.hstack([basis, left]))[0]
        new = np.hstack([A @ basis for A in scaled])
    return basis
