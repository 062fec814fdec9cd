"""Actuators beside the blocks of CMGs and wheels, by their types; all are users' own."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator

from quietbus.scenario.base import FrozenDict, bad_name, name_defect
from quietbus.scenario.kinds import Kinds
from quietbus.scenario.units import expected

ACTUATORS = Kinds("actuator")
AnyActuator = Annotated[Any, ACTUATORS]


def _by_name(value: Any) -> Any:
    if not isinstance(value, dict):
        raise expected("a mapping of names to actuators", value)
    for name in value:
        defect = name_defect(name)
        if defect is not None:
            raise bad_name(name, defect)
    return FrozenDict(value)


Actuators = Annotated[dict[str, AnyActuator], BeforeValidator(_by_name)]
