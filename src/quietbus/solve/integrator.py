"""Diffrax's ``diffeqsolve`` as programs that JAX can keep on the disk.

Diffrax checks its arguments (instants in order and within the flight) by calls back into Python,
and JAX keeps no program that has such calls. Here a failed check gives numbers that are not finite,
which every run looks for. ``EQX_ON_ERROR=nan`` would do the same, but for everything in the
process, and the process is the user's; where the user has set it, it counts here too.
"""

import functools
import inspect
import os
from types import FunctionType, SimpleNamespace
from typing import Any

import diffrax
import equinox as eqx
import equinox.internal as eqxi


def _with_quiet_checks(solve: Any) -> Any:
    """The function of Diffrax with another ``error_if``, and Diffrax left as it is."""
    inner = inspect.unwrap(solve)
    if "EQX_ON_ERROR" in os.environ or inner.__globals__.get("eqxi") is not eqxi:
        return solve
    quiet = {"error_if": functools.partial(eqxi.error_if, on_error="nan")}
    made = FunctionType(
        inner.__code__,
        inner.__globals__ | {"eqxi": SimpleNamespace(**vars(eqxi) | quiet)},
        inner.__name__,
        inner.__defaults__,
        inner.__closure__,
    )
    made.__kwdefaults__ = inner.__kwdefaults__
    return eqx.filter_jit(made)


diffeqsolve = _with_quiet_checks(diffrax.diffeqsolve)
