"""Channel transfer functions of a hexapod isolator, derived from its geometry.

The setting is that of Zhang & Xu 2012, eq. 31-33: base fixed, legs without mass, small motion;
torque about the upper platform's mass centre in, torque on the base plate *about its centre*
out. With x = (displacement of the mass centre, rotation), J the legs' elongation per x and k, c
the struts' stiffness and damping,

    M x'' + C x' + K x = w,        K = J^T diag(k) J,   C = J^T diag(c) J,
    base wrench = J_D^T (diag(k) J x + diag(c) J x').

A channel is the exact, minimal rational function from the torque about one axis to the base
torque about the same axis. Coordinates that the torque cannot move or the base torque does not
feel are projected out first: K and C are symmetric once the masses are scaled to one, so the
orthogonal complement of a space invariant under both is invariant too, and leaving it out
changes nothing.

Where all legs have the same c/k, a channel depends on s through u = c s + k and s^2 only; it is
then also given with k and c as symbols, normalised as in the paper.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quietbus.analysis.control.rational import Array, Coefficients, minus_3db_frequency, peak

AXES = ("x", "y", "z")
NEGLIGIBLE = 1e-7
"""[-] A coupling this small, relative to the largest stiffness per mass, is rounding."""


# --- the platform on its legs --------------------------------------------------------------


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
    stiffness: Array  # (n,) [N/m]
    damping: Array  # (n,) [N s/m]

    @property
    def stiffness_matrix(self) -> Array:
        """K (6, 6) [N/m], [N], [N m/rad] about the platform's mass centre."""
        return self.legs_P.T @ (self.stiffness[:, None] * self.legs_P)

    @property
    def damping_matrix(self) -> Array:
        """C (6, 6) [N s/m], [N s], [N m s/rad] about the platform's mass centre."""
        return self.legs_P.T @ (self.damping[:, None] * self.legs_P)

    @property
    def is_proportional(self) -> bool:
        """Whether every leg has the same damping per stiffness."""
        k, c = self.stiffness, self.damping
        return bool(np.allclose(c * k.mean(), k * c.mean(), rtol=1e-12, atol=0.0))

    def transmissibility(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Wrench on the platform to wrench on the base, (..., 6, 6).

        Args:
            omega: angular frequencies [rad/s], any shape.
        """
        s = 1j * np.asarray(omega, float)[..., None, None]
        dynamic = s**2 * self.mass_matrix + s * self.damping_matrix + self.stiffness_matrix
        strut = s * self.damping[:, None] + self.stiffness[:, None]
        return self.legs_D.T @ (strut * self.legs_P) @ np.linalg.inv(dynamic)

    def torque_response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Torque on the platform to torque on the base about D, (..., 3, 3)."""
        return self.transmissibility(omega)[..., 3:, 3:]


def hexapod_isolator(
    upper_joints: ArrayLike,
    lower_joints: ArrayLike,
    separation: float,
    mass: float,
    inertia: ArrayLike,
    center_of_mass: ArrayLike,
    stiffness: ArrayLike,
    damping: ArrayLike,
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


# --- channels ------------------------------------------------------------------------------


@dataclass(frozen=True)
class SymbolicChannel:
    """A channel as a function of s, k and c, for legs that share one c/k.

    With u = c s + k and n the number of coordinates that take part,

        G = sum_m N_m s^(2m) u^(n-m) / sum_m D_m s^(2m) u^(n-m),

    normalised so that N's leading coefficient is 1: the paper divides by d' m. k and c are the
    legs' mean stiffness and damping.
    """

    numerator: Coefficients  # N_m [-], descending in s^2/u
    denominator: Coefficients  # D_m [-], [kg], ... descending in s^2/u

    def coefficients(self, stiffness: float, damping: float) -> tuple[Coefficients, Coefficients]:
        """Numerator and denominator in descending powers of s for numbers k and c."""
        order = len(self.denominator) - 1
        u = np.trim_zeros(np.array([damping, stiffness], float), "f")
        powers = [np.ones(1)]
        for _ in range(order):
            powers.append(np.convolve(powers[-1], u))

        def expand(terms: Coefficients) -> Coefficients:
            total = np.zeros(2 * order + 1)
            for m, value in enumerate(reversed(terms)):
                term = powers[order - m]  # times s^(2m): sits above 2m trailing zeros
                end = total.size - 2 * m
                total[end - term.size : end] += value * term
            return tuple(np.trim_zeros(total, "f").tolist())

        return expand(self.numerator), expand(self.denominator)

    def terms(self, which: str) -> dict[tuple[int, int, int], float]:
        """Coefficient of each s^i c^j k^l, keyed (i, j, l), of "numerator" or "denominator"."""
        order = len(self.denominator) - 1
        result: dict[tuple[int, int, int], float] = {}
        for m, value in enumerate(reversed(getattr(self, which))):
            for j in range(order - m + 1):
                if value:
                    key = (2 * m + j, j, order - m - j)
                    result[key] = value * math.comb(order - m, j)
        return dict(sorted(result.items(), reverse=True))

    def __str__(self) -> str:
        return f"({self._text('numerator')}) / ({self._text('denominator')})"

    def _text(self, which: str) -> str:
        factors = []
        for (i, j, l), value in self.terms(which).items():
            symbols = [
                name if power == 1 else f"{name}^{power}"
                for name, power in (("k", l), ("c", j), ("s", i))
                if power
            ]
            number = f"{value:.4g}"
            factors.append(" ".join(symbols if number == "1" and symbols else [number, *symbols]))
        return " + ".join(factors).replace("+ -", "- ")


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


@dataclass(frozen=True)
class Channel:
    """The transfer function of one axis and what is read from it, each under its own name.

    The paper's "corner frequency" is `peak_frequency_hz`.
    """

    axis: str
    numerator: Coefficients  # descending powers of s; leading coefficient c, or k if undamped
    denominator: Coefficients  # descending powers of s; same normalisation, see `SymbolicChannel`
    symbolic: SymbolicChannel | None  # None where legs differ in c/k; then D is monic
    peak_frequency_hz: float  # [Hz] of the largest gain; 0 if largest at rest
    peak_gain: float  # [-] inf for an undamped channel
    minus_3db_frequency_hz: float | None  # [Hz] gain first falls below 1/sqrt(2)
    undamped_frequencies_hz: tuple[float, ...]  # [Hz] with the dampers taken out
    poles: tuple[Pole, ...]  # damped frequencies and damping ratios
    coupling: float  # [-] largest gain to the base torque about another axis, any frequency
    coupling_axis: str | None  # that other axis; None without coupling

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """G(j omega) at angular frequencies `omega` [rad/s]."""
        s = 1j * np.asarray(omega, float)
        return np.polyval(self.numerator, s) / np.polyval(self.denominator, s)

    def to_control(self) -> Any:
        """The same as a ``control.TransferFunction``."""
        import control

        return control.tf(self.numerator, self.denominator)

    def to_dict(self) -> dict[str, Any]:
        """For JSON: plain numbers, None where infinite."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        values["symbolic"] = None if self.symbolic is None else str(self.symbolic)
        values["poles"] = [pole.to_dict() for pole in self.poles]
        return json_ready(values)


@dataclass(frozen=True)
class Channels:
    """The three rotational channels of a hexapod isolator."""

    x: Channel
    y: Channel
    z: Channel
    coupling: tuple[tuple[float, ...], ...]  # (3, 3) [-] peak gain, base torque i per torque j

    def __iter__(self) -> Any:
        return iter((self.x, self.y, self.z))

    @property
    def largest_coupling(self) -> float:
        """Largest gain [-] from a torque about one axis to the base torque about another."""
        return max(channel.coupling for channel in self)

    @property
    def verdict(self) -> str:
        """Whether one axis may be looked at without the others, in words."""
        if self.largest_coupling == 0.0:
            return "The three channels are independent of each other."
        worst = max(self, key=lambda channel: channel.coupling)
        return (
            f"The channels are coupled: torque about {worst.axis} reaches the base about "
            f"{worst.coupling_axis} with a gain of up to {worst.coupling:.3g}. "
            "Look at the coupled analysis."
        )

    def to_dict(self) -> dict[str, Any]:
        """For JSON, keyed by axis."""
        return {channel.axis: channel.to_dict() for channel in self}


def channels(isolator: HexapodIsolator) -> Channels:
    """Derive the three channels (eq. 31-33 for the paper's geometry)."""
    coupling = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            reduced = _reduce(isolator, i, j)
            if reduced is not None:
                coupling[i, j] = peak(*reduced.polynomials())[1]
    x, y, z = (_channel(isolator, i, coupling[:, i]) for i in range(3))
    return Channels(x, y, z, tuple(map(tuple, coupling.tolist())))


def _channel(isolator: HexapodIsolator, i: int, gains: Array) -> Channel:
    reduced = _reduce(isolator, i, i)
    if reduced is None:
        raise ValueError(
            f"no torque about {AXES[i]} reaches the base about its centre; check the joints"
        )
    symbolic = None
    if isolator.is_proportional:
        k, c = float(isolator.stiffness.mean()), float(isolator.damping.mean())
        symbolic = reduced.symbolic(k)
        numerator, denominator = symbolic.coefficients(k, c)
    else:
        numerator, denominator = reduced.polynomials()
    peak_frequency, peak_gain = peak(numerator, denominator)
    minus_3db = minus_3db_frequency(numerator, denominator)
    others = np.delete(np.arange(3), i)
    other = int(others[np.argmax(gains[others])])
    return Channel(
        axis=AXES[i],
        numerator=numerator,
        denominator=denominator,
        symbolic=symbolic,
        peak_frequency_hz=peak_frequency / (2.0 * math.pi),
        peak_gain=peak_gain,
        minus_3db_frequency_hz=None if minus_3db is None else minus_3db / (2.0 * math.pi),
        undamped_frequencies_hz=tuple(
            (np.sqrt(np.linalg.eigvalsh(reduced.K)) / (2.0 * math.pi)).tolist()
        ),
        poles=reduced.poles(),
        coupling=float(gains[other]),
        coupling_axis=AXES[other] if gains[other] > 0 else None,
    )


@dataclass(frozen=True, eq=False)
class _Reduced:
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


def _reduce(isolator: HexapodIsolator, i: int, j: int) -> _Reduced | None:
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
    return _Reduced(K, C, b, o_k, o_c)


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


def json_ready(value: Any) -> Any:
    """Plain lists, dicts and finite numbers: infinite or undefined ones become None."""
    if isinstance(value, dict):
        return {key: json_ready(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [json_ready(item) for item in value]
    if isinstance(value, (complex, np.complexfloating)):
        return [json_ready(value.real), json_ready(value.imag)]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value
