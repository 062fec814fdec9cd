"""How large a scenario may be: far above what one needs, far below what stops a computer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

MOST_LETTERS = 4_000_000  # of a scenario's text
MOST_ENTRIES = 100_000  # values, lists and mappings, aliases unfolded
MOST_DEPTH = 40  # lists and mappings in each other
MOST_UNITS = 1_000  # CMGs or wheels
MOST_LEGS = 200
MOST_HARMONICS = 1_000  # of a motor's stepping frequency
MOST_LINES_A_TURN = 1_000_000  # of ripple or steps
MOST_SAMPLES = 2e7  # of a run, of some 400 bytes each


class Oversize(ValueError):
    """Data that are more than a scenario can be."""


def plain(data: Any) -> Any:
    """Nested mappings, sequences, and arrays of NumPy as dicts, lists and Python's own numbers.

    Raises Oversize for more than the limits allow, such as a list that holds itself.
    """
    entries = 0

    def made(value: Any, depth: int) -> Any:
        nonlocal entries
        entries += 1
        if entries > MOST_ENTRIES:
            raise Oversize(f"expected at most {MOST_ENTRIES:,} entries, got more")
        if isinstance(value, np.ndarray | np.generic):
            if value.size > MOST_ENTRIES:
                raise Oversize(f"expected at most {MOST_ENTRIES:,} entries, got {value.size:,}")
            value = value.tolist()
        if isinstance(value, Mapping | list | tuple) and depth > MOST_DEPTH:
            raise Oversize(
                f"expected at most {MOST_DEPTH} lists and mappings in each other, got more"
            )
        if isinstance(value, Mapping):
            return {key: made(item, depth + 1) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return [made(item, depth + 1) for item in value]
        return value

    return made(data, 1)
