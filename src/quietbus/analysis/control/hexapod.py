"""A platform on n massless legs over a fixed base, for small motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quietbus.analysis.control.rational import Array


@dataclass(frozen=True, eq=False)
class StrutMemory:
    """What n struts with elongations e remember: tension F z more, with z' = E e + R e' + Z z."""

    force: Array  # (n, m) F [N]
    elongation: Array  # (m, n) E [1/m/s]
    rate: Array  # (m, n) R [1/m]
    decay: Array  # (m, m) Z [1/s]

    @classmethod
    def none(cls, n: int) -> StrutMemory:
        """Of n struts that remember nothing."""
        return cls(np.zeros((n, 0)), np.zeros((0, n)), np.zeros((0, n)), np.zeros((0, 0)))

    @property
    def size(self) -> int:
        """Count m of what is remembered."""
        return len(self.decay)

    def per_elongation(self, s: NDArray[np.complex128]) -> NDArray:
        """z per elongation of each strut (..., m, n) at s (...) [rad/s]."""
        s = s[..., None, None]
        return np.linalg.solve(s * np.eye(self.size) - self.decay, self.elongation + s * self.rate)

    @property
    def stiffness(self) -> Array:
        """What it adds (n, n) [N/m] to the stiffness at rest, as far as it comes to rest."""
        return -self.force @ np.linalg.pinv(self.decay) @ self.elongation


@dataclass(frozen=True, eq=False)
class HexapodIsolator:
    """An upper platform on n massless legs over a fixed base, for small motion.

    Wrenches are (force, torque): about the platform's mass centre on the platform, about the
    base plate's centre D on the base. All in the base plate's axes. Build with
    `hexapod_isolator`.
    """

    mass_matrix: Array  # (6, 6) [kg], [kg m^2] about the platform's mass centre
    legs_P: Array  # (n, 6) [-], [m] J: elongation per platform motion
    legs_D: Array  # (n, 6) [-], [m] J_D: base wrench about D per tension
    stiffness: Array  # (n,) [N/m], memory held
    damping: Array  # (n,) [N s/m], memory held
    memory: StrutMemory

    @property
    def stiffness_matrix(self) -> Array:
        """K (6, 6) [N/m], [N], [N m/rad] about the platform's mass centre, at rest."""
        return self.legs_P.T @ (np.diag(self.stiffness) + self.memory.stiffness) @ self.legs_P

    @property
    def damping_matrix(self) -> Array:
        """C (6, 6) [N s/m], [N s], [N m s/rad] about the platform's mass centre, memory held."""
        return self.legs_P.T @ (self.damping[:, None] * self.legs_P)

    @property
    def is_proportional(self) -> bool:
        """Whether every leg has the same damping per stiffness, and none a memory."""
        k, c = self.stiffness, self.damping
        return self.memory.size == 0 and bool(
            np.allclose(c * k.mean(), k * c.mean(), rtol=1e-12, atol=0.0)
        )

    def transmissibility(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Wrench on the platform to wrench on the base, (..., 6, 6).

        Args:
            omega: angular frequencies [rad/s], any shape.
        """
        s = 1j * np.asarray(omega, float)
        struts = self.strut_stiffness(s) @ self.legs_P
        dynamic = s[..., None, None] ** 2 * self.mass_matrix + self.legs_P.T @ struts
        return self.legs_D.T @ struts @ np.linalg.inv(dynamic)

    def strut_stiffness(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Dynamic stiffness Z (..., n, n) [N/m], tension per elongation at s (...) [rad/s]."""
        own = self.stiffness + s[..., None] * self.damping
        return own[..., None] * np.eye(len(self.stiffness)) + self.memory.force @ (
            self.memory.per_elongation(s)
        )

    def torque_response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Torque on the platform to torque on the base about D, (..., 3, 3)."""
        return self.transmissibility(omega)[..., 3:, 3:]


@dataclass(frozen=True, eq=False)
class SingleAxisPlatform:
    """A platform that moves along one line only: one mass on all its struts."""

    isolator: HexapodIsolator
    along: Array  # (n,) [-] elongation of each strut per displacement

    @property
    def natural_frequency(self) -> float:
        """Of the stiffness at rest [rad/s]."""
        own = np.diag(self.isolator.stiffness) + self.isolator.memory.stiffness
        return float(np.sqrt(self.along @ own @ self.along / self.isolator.mass_matrix[0, 0]))

    def transmissibility(self, omega: ArrayLike) -> Array:
        """Force on the base per force on the mass, abs [-] at `omega` [rad/s], any shape."""
        s = 1j * np.asarray(omega, float)
        struts = self.isolator.strut_stiffness(s) @ self.along @ self.along
        return np.abs(struts / (struts + s**2 * self.isolator.mass_matrix[0, 0]))


def hexapod_isolator(
    upper_joints: ArrayLike,
    lower_joints: ArrayLike,
    separation: float,
    mass: float,
    inertia: ArrayLike,
    center_of_mass: ArrayLike,
    stiffness: ArrayLike,
    damping: ArrayLike,
    memory: StrutMemory | None = None,
) -> HexapodIsolator:
    """The small-motion model of a platform on its legs, in the nominal pose.

    Args:
        upper_joints: (n, 3) spherical joints in the upper plate's frame [m].
        lower_joints: (n, 3) universal joints in the base plate's frame [m].
        separation: height of the upper plate's origin over the base plate's, along z [m].
        mass: upper platform with all it carries [kg].
        inertia: (3, 3) or its diagonal (3,), of the same about its mass centre [kg m^2].
        center_of_mass: (3,) of the same in the upper plate's frame [m].
        stiffness: (n,) or one number for all legs [N/m].
        damping: (n,) or one number for all legs [N s/m].
        memory: of the struts, if they have any; stiffness and damping are those with it held.

    Raises:
        ValueError: a value of the wrong shape or sign, or legs that leave a motion free.
    """
    upper = _array("upper_joints", upper_joints, (None, 3))
    n = len(upper)
    lower = _array("lower_joints", lower_joints, (n, 3))
    com = _array("center_of_mass", center_of_mass, (3,))
    inertia = np.asarray(inertia, float)
    inertia = _array("inertia", np.diag(inertia) if inertia.ndim == 1 else inertia, (3, 3))
    k = _array("stiffness", np.full(n, stiffness) if np.ndim(stiffness) == 0 else stiffness, (n,))
    c = _array("damping", np.full(n, damping) if np.ndim(damping) == 0 else damping, (n,))
    if not mass > 0:
        raise ValueError(f"mass: expected a positive mass, got {mass} kg")
    if not np.allclose(inertia, inertia.T) or np.min(np.linalg.eigvalsh(inertia)) <= 0:
        raise ValueError(
            f"inertia: expected a symmetric, positive definite matrix, got {inertia.tolist()}"
        )
    if np.any(k < 0) or np.any(c < 0):
        raise ValueError("stiffness and damping: expected no negative values")

    p_DU = upper + np.array([0.0, 0.0, separation])
    legs = p_DU - lower
    lengths = np.linalg.norm(legs, axis=1, keepdims=True)
    if np.min(lengths) <= 0:
        raise ValueError("joints: a leg has no length; expected its two joints apart")
    s = legs / lengths
    isolator = HexapodIsolator(
        mass_matrix=np.block([[mass * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), inertia]]),
        legs_P=np.hstack([s, np.cross(upper - com, s)]),
        legs_D=np.hstack([s, np.cross(lower, s)]),
        stiffness=k,
        damping=c,
        memory=memory or StrutMemory.none(n),
    )
    _check_held(isolator)
    return isolator


def _array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    array = np.asarray(value, float)
    fits = array.ndim == len(shape) and all(
        want in (None, got) for want, got in zip(shape, array.shape, strict=True)
    )
    if not fits or not np.all(np.isfinite(array)):
        wanted = " x ".join("n" if want is None else str(want) for want in shape)
        raise ValueError(f"{name}: expected {wanted} finite numbers, got shape {array.shape}")
    return array


def _check_held(isolator: HexapodIsolator) -> None:
    """Raise if some motion of the platform meets no stiffness, and name that motion."""
    scale = np.concatenate([np.ones(3), np.full(3, 1.0 / np.abs(isolator.legs_P[:, 3:]).max())])
    values, vectors = np.linalg.eigh(scale[:, None] * isolator.stiffness_matrix * scale)
    if values[0] > 1e-12 * max(values[-1], np.finfo(float).tiny):
        return
    motion = vectors[:, 0] * scale
    motion = motion / np.abs(motion).max()
    words = [
        f"{value:+.2g} {name}"
        for value, name in zip(
            motion, ("along x", "along y", "along z", "about x", "about y", "about z"), strict=True
        )
        if abs(value) > 1e-6
    ]
    raise ValueError(
        f"legs: {len(isolator.stiffness)} legs leave the platform free to move "
        f"({', '.join(words)} [m, rad]); add legs, stiffness or another geometry"
    )
