"""Actuators of users' own kinds, beside the blocks of CMGs and wheels."""

from functools import singledispatch
from typing import Any

from quietbus.model.element import AbstractActuator


@singledispatch
def actuator_of(said: Any, name: str) -> AbstractActuator:
    """An actuator by the type of what the scenario says of it.

    A type is registered: ``@actuator_of.register`` (docs/extending.md).
    """
    raise TypeError(f"no actuator is registered for {type(said).__name__}")
