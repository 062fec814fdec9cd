"""The exact, minimal equations from a torque on the platform to one on its base.

Coordinates that the torque cannot move or the base torque does not feel are projected out: K and
C are symmetric once the masses are scaled to one, so the orthogonal complement of a space that is
invariant under both is invariant too, and leaving it out changes nothing. What struts remember is
further coordinates; maps to and from them are not symmetric, so that what the torque moves is
invariant under the maps, what is felt under their transposes.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from quietbus.analysis.control.hexapod import HexapodIsolator, StrutMemory
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
    """A minimal channel in unit-mass coordinates q, with what the struts remember as z:

    q'' + C q' + K q + F z = b f,   z' = E q + R q' + Z z,   y = o_k q + o_c q' + o_z z.
    """

    K: Array  # (n, n) [1/s^2] symmetric
    C: Array  # (n, n) [1/s] symmetric
    F: Array  # (n, m)
    E: Array  # (m, n)
    R: Array  # (m, n)
    Z: Array  # (m, m) [1/s]
    b: Array  # (n,)
    o_k: Array  # (n,)
    o_c: Array  # (n,)
    o_z: Array  # (m,)

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
        n, m = self.F.shape
        poles = np.abs(np.linalg.eigvals(self.system))
        radius = math.exp(np.mean(np.log(poles[poles > 0.0])))
        points = 2 * (n + m) + 1  # odd: none on the negative real axis, where poles lie
        s = radius * np.exp(2j * math.pi * np.arange(points) / points)
        at = s[:, None, None]
        matrices = np.block(
            [
                [at**2 * np.eye(n) + at * self.C + self.K, self.F + 0.0 * at],
                [-self.E - at * self.R, at * np.eye(m) - self.Z],
            ]
        )
        force = np.concatenate([self.b, np.zeros(m)])[:, None]
        determinants = np.linalg.det(matrices)
        motion = np.linalg.solve(matrices, np.broadcast_to(force, (points, n + m, 1)))[..., 0]
        outputs = motion @ np.concatenate([self.o_k, self.o_z]) + s * (motion[:, :n] @ self.o_c)
        powers = radius ** np.arange(points)

        def coefficients(values: NDArray[np.complex128]) -> Coefficients:
            scaled = np.fft.fft(values).real / points
            scaled[np.abs(scaled) < 1e-13 * np.abs(scaled).max()] = 0.0
            return tuple(np.trim_zeros((scaled / powers)[::-1], "f").tolist())

        return coefficients(outputs * determinants), coefficients(determinants)

    @property
    def system(self) -> Array:
        """The free motion of (q, q', z) (2 n + m, 2 n + m) [1/s]."""
        n, m = self.F.shape
        return np.block(
            [
                [np.zeros((n, n)), np.eye(n), np.zeros((n, m))],
                [-self.K, -self.C, -self.F],
                [self.E, self.R, self.Z],
            ]
        )

    def poles(self) -> tuple[Pole, ...]:
        """Poles by rising distance from the origin."""
        values = np.linalg.eigvals(self.system)
        upper = sorted(values[values.imag >= 0], key=abs)
        return tuple(Pole(float(value.real), float(value.imag)) for value in upper)

    def undamped_frequencies(self) -> Array:
        """Of the stiffness at rest [rad/s]: with what dampers and memory hold taken out."""
        at_rest = self.K - self.F @ np.linalg.pinv(self.Z) @ self.E
        return np.sqrt(np.sort(np.linalg.eigvals(at_rest).real.clip(0.0)))


def minimal(isolator: HexapodIsolator, i: int, j: int) -> Minimal | None:
    """Torque j to base torque i on the coordinates that take part; None if nothing passes."""
    to_unit_mass = np.linalg.inv(np.linalg.cholesky(isolator.mass_matrix))
    legs, out = isolator.legs_P @ to_unit_mass.T, isolator.legs_D[:, 3 + i]
    memory = _scaled(isolator)
    found = Minimal(
        K=legs.T @ (isolator.stiffness[:, None] * legs),
        C=legs.T @ (isolator.damping[:, None] * legs),
        F=legs.T @ memory.force,
        E=memory.elongation @ legs,
        R=memory.rate @ legs,
        Z=memory.decay,
        b=to_unit_mass[:, 3 + j],
        o_k=(out * isolator.stiffness) @ legs,
        o_c=(out * isolator.damping) @ legs,
        o_z=out @ memory.force,
    )
    n, m = found.F.shape
    of_q, of_z = np.eye(n + m)[:n], np.eye(n + m)[n:]
    maps = [
        of_q.T @ found.K @ of_q,
        of_q.T @ found.C @ of_q,
        of_q.T @ found.F @ of_z,
        of_z.T @ found.E @ of_q,
        of_z.T @ found.R @ of_q,
        of_z.T @ found.Z @ of_z,
    ]
    moved = [_unit(found.b) @ of_q]  # all sized before the projection, so that none is inflated
    felt = [_unit(found.o_k) @ of_q, _unit(found.o_c) @ of_q, _unit(found.o_z) @ of_z]
    reached = _invariant_subspace(moved, maps)
    maps = [reached.T @ A.T @ reached for A in maps]
    seen = reached @ _invariant_subspace([reached.T @ vector for vector in felt], maps)
    q, z = _range(seen[:n]), _range(seen[n:])
    if q.shape[1] == 0:
        return None
    return Minimal(
        K=q.T @ found.K @ q,
        C=q.T @ found.C @ q,
        F=q.T @ found.F @ z,
        E=z.T @ found.E @ q,
        R=z.T @ found.R @ q,
        Z=z.T @ found.Z @ z,
        b=q.T @ found.b,
        o_k=q.T @ found.o_k,
        o_c=q.T @ found.o_c,
        o_z=z.T @ found.o_z,
    )


def _scaled(isolator: HexapodIsolator) -> StrutMemory:
    """The struts' memory in units of what an oscillation of one metre leaves in it."""
    memory = isolator.memory
    stiffness = isolator.stiffness.sum() + abs(memory.stiffness.sum())
    omega = math.sqrt(stiffness / isolator.mass_matrix[0, 0])
    size = np.abs(memory.per_elongation(np.array(1j * omega))).max(axis=1, initial=0.0)
    size[size == 0.0] = 1.0
    return StrutMemory(
        memory.force * size,
        memory.elongation / size[:, None],
        memory.rate / size[:, None],
        memory.decay * size / size[:, None],
    )


def _range(vectors: Array) -> Array:
    """Orthonormal basis of what columns span that are of length one or zero there."""
    left, sizes, _ = np.linalg.svd(vectors, full_matrices=False)
    return left[:, sizes > 0.5]


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
