"""Arguments of the public functions: a wrong one is told by name, before anything is computed.

TypeError: the wrong kind of thing. ValueError: the right kind, a wrong value or shape.
"""

from __future__ import annotations

import math
import numbers
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from quietbus.words import shown


def positive(name: str, value: Any, most: float = math.inf) -> float:
    """A finite number above zero; texts with units are the scenario's business."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError(f"{name}: expected a number above 0, got {shown(value)}")
    if not 0.0 < float(value) <= most or not math.isfinite(value):
        upper = f" and at most {most:g}" if most < math.inf else ""
        raise ValueError(f"{name}: expected a finite number above 0{upper}, got {shown(value)}")
    return float(value)


def at_least_zero(name: str, value: Any) -> float:
    """A finite number that is not negative."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError(f"{name}: expected a number of at least 0, got {shown(value)}")
    if not (float(value) >= 0.0 and math.isfinite(value)):
        raise ValueError(f"{name}: expected a finite number of at least 0, got {shown(value)}")
    return float(value)


def count(name: str, value: Any, least: int = 1) -> int:
    """A whole number."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise TypeError(f"{name}: expected a whole number, got {shown(value)}")
    if value < least:
        raise ValueError(f"{name}: expected a whole number of at least {least}, got {value}")
    return int(value)


def array(name: str, value: Any, what: str) -> np.ndarray:
    """Finite numbers of any shape; ``what`` was expected, in words."""
    try:
        found = np.asarray(value)
    except (TypeError, ValueError):  # ragged, or what does not become an array
        raise ValueError(f"{name}: expected {what}, got {shown(value)}") from None
    if found.dtype.kind not in "iuf" or found.dtype == bool:
        raise ValueError(f"{name}: expected {what}, got {shown(value)}")
    if not np.all(np.isfinite(found)):
        raise ValueError(f"{name}: expected {what}, all finite, got {shown(value)}")
    return found.astype(float)


def vector(name: str, value: Any, size: int) -> np.ndarray:
    """(size,) finite numbers."""
    found = array(name, value, f"{size} finite numbers")
    if found.shape != (size,):
        raise ValueError(f"{name}: expected {size} finite numbers, got {shown(value)}")
    return found


def choice(name: str, value: Any, options: Sequence[str]) -> str:
    """One of a few words."""
    if not isinstance(value, str) or value not in options:
        listed = ", ".join(repr(option) for option in options)
        raise ValueError(f"{name}: expected one of {listed}, got {shown(value)}")
    return str(value)


def flag(name: str, value: Any) -> bool:
    """True or false, and nothing that merely counts as that."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name}: expected True or False, got {shown(value)}")
    return bool(value)


def mapping(name: str, value: Any, what: str) -> Mapping[str, Any]:
    """A mapping from names to ``what``; None is an empty one."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise TypeError(f"{name}: expected a mapping from names to {what}, got {shown(value)}")
    for key in value:
        if not isinstance(key, str):
            raise TypeError(f"{name}: expected names as keys, got {shown(key)}")
        if not key or not key.isprintable():
            raise ValueError(f"{name}: expected names of printable letters, got {shown(key)}")
    return value


def function(name: str, value: Any) -> Callable[..., Any] | None:
    """Something to call, or None."""
    if value is not None and not callable(value):
        raise TypeError(f"{name}: expected a function to call, got {shown(value)}")
    return value


def listing(name: str, value: Any, what: str) -> list[Any]:
    """Several things, and not a text, whose letters would be taken for them."""
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Sequence | np.ndarray):
        raise TypeError(f"{name}: expected a list of {what}, got {shown(value)}")
    return list(value)


def path(name: str, value: Any) -> str:
    """The name of a file."""
    if not isinstance(value, str | os.PathLike):
        raise TypeError(f"{name}: expected the path of a file, got {shown(value)}")
    return os.fsdecode(value)
