"""Scenarios: what to simulate, read from YAML, checked and in SI units. No JAX in here."""

from quietbus.scenario.errors import Problem, ScenarioError
from quietbus.scenario.load import (
    builtin_names,
    builtin_text,
    load_scenario,
    located,
    template_text,
)
from quietbus.scenario.per_cmg import per_cmg_scenarios
from quietbus.scenario.pointing import LineOfSight
from quietbus.scenario.schema import Scenario
from quietbus.scenario.sites import Site
from quietbus.scenario.wheel_files import WheelTable, read_wheel_table

__all__ = [
    "LineOfSight",
    "Problem",
    "Scenario",
    "ScenarioError",
    "Site",
    "WheelTable",
    "builtin_names",
    "builtin_text",
    "load_scenario",
    "located",
    "per_cmg_scenarios",
    "read_wheel_table",
    "template_text",
]
