"""Scenarios: what to simulate, read from YAML, checked and in SI units. No JAX in here."""

from quietbus.scenario.errors import Problem, ScenarioError
from quietbus.scenario.load import builtin_names, builtin_text, load_scenario, template_text
from quietbus.scenario.pointing import LineOfSight
from quietbus.scenario.schema import Scenario

__all__ = [
    "LineOfSight",
    "Problem",
    "Scenario",
    "ScenarioError",
    "builtin_names",
    "builtin_text",
    "load_scenario",
    "template_text",
]
