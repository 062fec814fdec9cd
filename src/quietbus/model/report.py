"""What a part tells of itself: each quantity is declared once, with its unit and meaning.

The results' variables, the outputs of linear models and of jitter, and the documentation's table
all read these declarations.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array

Value = TypeVar("Value")

AXIS, QUATERNION, UNIT, LEG = ("axis",), ("quaternion",), ("cmg",), ("leg",)


@dataclass(frozen=True)
class Quantity:
    """A quantity by its name in the results."""

    name: str
    dimensions: tuple[str, ...]  # after time; of like parts the first one runs through all parts
    unit: str
    meaning: str  # with the frame of its components
    when: str = ""  # in which runs; empty: in all
    vibrates: bool = False  # harmonic runs and linear models have its deviations too
    of_vibration: str = ""  # meaning of these, where it is another


class Output(NamedTuple):
    """A quantity and its value."""

    quantity: Quantity
    value: Array


Report = tuple[Output, ...]


def by_name(told: Iterable[tuple[str, Value]]) -> dict[str, Value]:
    """Arrays, or trees of them, by name, those of like parts one after the other."""
    parts: dict[str, list[Value]] = {}
    for name, value in told:
        parts.setdefault(name, []).append(value)
    return {
        name: each[0] if len(each) == 1 else jax.tree.map(lambda *r: jnp.concatenate(r), *each)
        for name, each in parts.items()
    }
