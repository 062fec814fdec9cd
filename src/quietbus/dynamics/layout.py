"""Which rows of the equations belong to whom, and how shares are summed into them.

The generalised speeds are (v, w) of every body, along common axes, then the speeds of the elements'
own coordinates.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.state import State
from quietbus.model.element import AbstractElement
from quietbus.model.satellite import Satellite
from quietbus.spatial.vector import rotate

BODY = 6  # speeds of a body


@dataclass(frozen=True)
class Layout:
    """Names and sizes of the parts that have rows, in their order."""

    parts: tuple[tuple[str, int], ...]
    bodies: int  # how many of them, from the first, are bodies

    @classmethod
    def of(cls, satellite: Satellite, state: State) -> "Layout":
        """Of all bodies, welded ones too."""
        bodies = [(body.name, BODY) for body in satellite.bodies]
        own = [
            (e.name, len(state.own[e.name].u)) for e in satellite.elements if e.name in state.own
        ]
        return cls((*bodies, *((_own(name), n) for name, n in own if n)), len(bodies))

    def free(self, satellite: Satellite) -> "Layout":
        """Without the bodies that are welded to others."""
        free = [part for part in self.parts[: self.bodies] if part[0] in satellite.free]
        return Layout((*free, *self.parts[self.bodies :]), len(free))

    @property
    def size(self) -> int:
        """Number of speeds."""
        return sum(size for _, size in self.parts)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return tuple(name for name, _ in self.parts[: self.bodies])

    def rows(self, name: str) -> slice:
        """Rows of a body."""
        first = 0
        for part, size in self.parts:
            if part == name:
                return slice(first, first + size)
            first += size
        raise KeyError(name)

    def own(self, element: str) -> slice:
        """Rows of an element's own speeds."""
        return self.rows(_own(element)) if _own(element) in dict(self.parts) else slice(0)

    def of_element(self, element: AbstractElement) -> list[tuple[str, int]]:
        """The parts that an element gives to, in its own order."""
        own = [part for part in self.parts if part[0] == _own(element.name)]
        return [*((host, BODY) for host in element.hosts), *own]

    def gathered(self, element: AbstractElement, u: Float[Array, " n"]) -> Float[Array, " m"]:
        """The rows of a vector that an element is concerned with, in its own order."""
        return jnp.concatenate([u[self.rows(name)] for name, _ in self.of_element(element)])

    def matrix(
        self, shares: Iterable[tuple[AbstractElement, Float[Array, "m m"]]]
    ) -> Float[Array, "n n"]:
        """Sum of the elements' shares, by rows and columns."""
        sums: dict[tuple[str, str], Any] = {}
        for element, share in shares:
            for row, rows in self._cut(element, share):
                for column, block in self._cut(element, rows.T):
                    sums[row, column] = sums.get((row, column), 0.0) + block.T
        return jnp.block(
            [
                [sums.get((row, column), jnp.zeros((n, m))) for column, m in self.parts]
                for row, n in self.parts
            ]
        )

    def vector(
        self, shares: Iterable[tuple[AbstractElement, Float[Array, "m ..."]]]
    ) -> Float[Array, "n ..."]:
        """Sum of the elements' shares, at least one: vectors, or each of the same columns."""
        sums: dict[str, Any] = {}
        width: tuple[int, ...] = ()
        for element, share in shares:
            width = share.shape[1:]
            for name, part in self._cut(element, share):
                sums[name] = sums.get(name, 0.0) + part
        rows = [sums.get(name, jnp.zeros((size, *width))) for name, size in self.parts]
        return jnp.concatenate(rows)

    def turned(self, R: Float[Array, "3 3"], u: Float[Array, " n"]) -> Float[Array, " n"]:
        """A vector of all speeds with those of the bodies along other axes."""
        end = BODY * self.bodies
        return jnp.concatenate([rotate(R, u[:end].reshape(-1, 3)).reshape(end), u[end:]])

    def spread(self, element: AbstractElement, rows: Float[Array, "*k m"]) -> Float[Array, "*k n"]:
        """What depends on the speeds of an element, by those of all; along the last axis."""
        flat = rows.reshape(-1, rows.shape[-1])
        return self.vector([(element, flat.T)]).T.reshape(*rows.shape[:-1], self.size)

    def _cut(self, element: AbstractElement, share: Array) -> Iterator[tuple[str, Array]]:
        first = 0
        for name, size in self.of_element(element):
            yield name, share[first : first + size]
            first += size


def _own(element: str) -> str:
    return f"{element}'s own"
