"""Modes of the satellite on its platform: frequency, damping, shape."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from quietbus.dynamics.linear_model import LinearModel

RIGID_BODY = (
    1e-4  # [rad/s] slower is a rigid-body motion: a double pole at zero, spread by rounding
)


@dataclass(frozen=True)
class Mode:
    """One oscillating or decaying mode."""

    frequency_hz: float  # undamped: abs(pole) / 2 pi
    damped_frequency_hz: float
    damping: float  # [-] of critical
    pole: complex  # [rad/s], the one with non-negative imaginary part
    shape: np.ndarray  # (12,) complex: the body's position, rotation, the bus's; largest 1
    name: str  # what moves most, and along or about what

    def to_dict(self) -> dict[str, object]:
        """For JSON; the shape as real and imaginary parts."""
        return {
            "name": self.name,
            "frequency_hz": self.frequency_hz,
            "damped_frequency_hz": self.damped_frequency_hz,
            "damping": self.damping,
            "pole": [self.pole.real, self.pole.imag],
            "shape": {"real": self.shape.real.tolist(), "imag": self.shape.imag.tolist()},
        }


def _pose(body: str) -> list[str]:
    return [f"{body}_{kind}_{axis}" for kind in ("position", "attitude") for axis in "xyz"]


def free_modes(model: LinearModel) -> list[Mode]:
    """Elastic modes of the free satellite, gimbals held, by rising frequency.

    Args:
        model: linearised with ``actuator="ideal"``, so that gimbals take no part.
    """
    return _modes(model.A, list(model.states))


def fixed_base_modes(model: LinearModel) -> list[Mode]:
    """Modes of the other bodies, with what struts remember, the bus held."""
    kept = [i for i, name in enumerate(model.states) if not name.startswith("bus_")]
    states = [model.states[i] for i in kept]
    return _modes(model.A[np.ix_(kept, kept)], states)


def _modes(A: np.ndarray, states: list[str]) -> list[Mode]:
    bus = _rows(_pose("bus"), states)
    first = "_position_x"
    bodies = [name.removesuffix(first) for name in states if name.endswith(first)]
    rows = {}
    for body in bodies:
        if body != "bus":
            rows[body] = np.concatenate([_rows(_pose(body), states), bus])
            rows[body][:3] += bus[:3]  # its position is relative to the bus's; shapes are in space
    poles, vectors = np.linalg.eig(A)
    found = []
    for pole, vector in zip(poles, vectors.T, strict=True):
        if pole.imag < 0.0 or abs(pole) < RIGID_BODY:
            continue
        shapes = {body: each @ vector for body, each in rows.items()}
        if any(np.any(shape) for shape in shapes.values()):
            found.append(mode_of(pole, shapes))
    return sorted(found, key=lambda mode: mode.frequency_hz)


def _rows(names: list[str], states: list[str]) -> np.ndarray:
    """(name, state) what picks states by name; those that there are not stand still."""
    return np.array([[float(name == state) for state in states] for name in names])


def mode_of(pole: complex, shapes: Mapping[str, np.ndarray]) -> Mode:
    """The mode of a pole [rad/s]; of several bodies it is named after the one that moves most.

    Args:
        shapes: by body, (12,) its motion and the bus's, in space and of any size but zero.
    """
    most = max(shapes, key=lambda body: np.max(np.abs(shapes[body][:6] - shapes[body][6:])))
    body = "" if len(shapes) == 1 else f"{most}: "
    shape = shapes[most] / shapes[most][np.argmax(np.abs(shapes[most]))]
    return Mode(
        frequency_hz=float(abs(pole) / (2.0 * np.pi)),
        damped_frequency_hz=float(pole.imag / (2.0 * np.pi)),
        damping=float(-pole.real / abs(pole)),
        pole=complex(pole),
        shape=shape,
        name=body + _name(shape),
    )


def _name(shape: np.ndarray) -> str:
    """The plate's motion relative to the bus, in words."""
    moved = np.abs(shape[:6] - shape[6:])
    kinds = [*(f"translation {a}" for a in "xyz"), *(f"rotation {a}" for a in "xyz")]
    parts = [kind for kind, size in zip(kinds, moved / moved.max(), strict=True) if size > 0.3]
    return " + ".join(parts)
