"""A linear model with names for every row and column."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

EVERY = ("*",)  # stands for all names


class LinearModel(NamedTuple):
    """``dx/dt = A x + B u``, ``y = C x + D u`` with names for every row and column."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def select(
        self, inputs: Sequence[str] = EVERY, outputs: Sequence[str] = EVERY
    ) -> "LinearModel":
        """The model with some inputs and outputs only; a name without axis takes all three.

        Raises:
            KeyError: a name that the model does not have, with the ones it has.
        """
        columns = _indices(self.inputs, inputs, "input")
        rows = _indices(self.outputs, outputs, "output")
        return self._replace(
            B=self.B[:, columns],
            C=self.C[rows],
            D=self.D[np.ix_(rows, columns)],
            inputs=tuple(self.inputs[i] for i in columns),
            outputs=tuple(self.outputs[i] for i in rows),
        )

    def internal(self) -> "LinearModel":
        """The model without the satellite's position and velocity as a whole.

        Nothing depends on them; outputs that are them are dropped.
        """
        kept = [i for i, name in enumerate(self.states) if not name.startswith(_AS_A_WHOLE)]
        gone = [i for i, name in enumerate(self.states) if name.startswith(_AS_A_WHOLE)]
        rows = [i for i in range(len(self.outputs)) if not np.any(self.C[i, gone])]
        return self._replace(
            A=self.A[np.ix_(kept, kept)],
            B=self.B[kept],
            C=self.C[np.ix_(rows, kept)],
            D=self.D[rows],
            states=tuple(self.states[i] for i in kept),
            outputs=tuple(self.outputs[i] for i in rows),
        )

    def response(self, frequency_hz: np.ndarray) -> np.ndarray:
        """Frequency response (frequency, output, input) at frequencies [Hz]."""
        s = 2j * np.pi * np.atleast_1d(frequency_hz)[:, None, None]
        resolvent = np.linalg.solve(s * np.eye(len(self.A)) - self.A, self.B.astype(complex))
        return self.C @ resolvent + self.D

    def to_control(self):
        """A ``control.StateSpace`` with these names."""
        import control  # slow to load, and not needed to integrate

        return control.StateSpace(
            self.A,
            self.B,
            self.C,
            self.D,
            states=list(self.states),
            inputs=list(self.inputs),
            outputs=list(self.outputs),
            remove_useless_states=False,
        )


_AS_A_WHOLE = ("bus_velocity", "bus_position")


def _indices(names: tuple[str, ...], wanted: Sequence[str], kind: str) -> list[int]:
    found: list[int] = []
    for name in wanted:
        match = [i for i, known in enumerate(names) if name in (known, known[:-2], *EVERY)]
        if not match:
            raise KeyError(f"no {kind} '{name}'; the model has {', '.join(names)}")
        found += match
    return found
