"""Modes of the satellite on its platform: frequency, damping, shape."""

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
        most = max(shapes, key=lambda body: np.max(np.abs(shapes[body][:6] - shapes[body][6:])))
        if np.max(np.abs(shapes[most])) == 0.0:
            continue
        found.append(mode_of(pole, shapes[most], "" if len(rows) == 1 else f"{most}: "))
    return sorted(found, key=lambda mode: mode.frequency_hz)


def _rows(names: list[str], states: list[str]) -> np.ndarray:
    """(name, state) what picks states by name; those that there are not stand still."""
    return np.array([[float(name == state) for state in states] for name in names])


def mode_of(pole: complex, shape: np.ndarray, body: str = "") -> Mode:
    """The mode of a pole [rad/s] and its shape (12,), in space and of any size but zero.

    ``body`` stands before its name: which of several bodies moves.
    """
    shape = shape / shape[np.argmax(np.abs(shape))]
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
