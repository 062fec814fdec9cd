"""What a part tells of itself: each quantity is declared once, with its unit and meaning.

The results' variables, the outputs of linear models and of jitter, and the documentation's table
all read these declarations.
"""

from dataclasses import dataclass
from typing import NamedTuple

from jaxtyping import Array

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
