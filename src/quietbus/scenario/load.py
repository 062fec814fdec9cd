"""Scenarios from files and the built-in ones."""

from __future__ import annotations

import difflib
import os
import pathlib
from dataclasses import replace
from importlib.resources import files
from typing import Any

from quietbus.scenario.errors import Problem, ScenarioError
from quietbus.scenario.files import NO_SUCH_FILE, UnreadableError, read_text
from quietbus.scenario.schema import Scenario
from quietbus.scenario.text import read_yaml
from quietbus.words import shown

_BUILTIN = files("quietbus.scenario") / "builtin"


def builtin_names() -> list[str]:
    """Names of the built-in scenarios."""
    names = (entry.name for entry in _BUILTIN.iterdir())
    return sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml"))


def builtin_text(name: str) -> str:
    """YAML text of a built-in scenario, with its comments."""
    return (_BUILTIN / f"{name}.yaml").read_text(encoding="utf-8")


def template_text() -> str:
    """A commented scenario to start from."""
    return builtin_text("zhang2012").replace("name: zhang2012", "name: my-satellite", 1)


def load_scenario(path_or_name: str | os.PathLike[str]) -> Scenario:
    """Scenario from a YAML file, or a built-in one by its name.

    A built-in's name wins over a file of that name; write ``./name`` for the file. Raises
    ScenarioError, also if the file cannot be read, and TypeError for what is no path.
    """
    source = _source(path_or_name)
    return Scenario.from_yaml(_text(source), source, str(pathlib.Path(source).parent))


def located(error: ScenarioError, path_or_name: str | os.PathLike[str]) -> ScenarioError:
    """What is wrong with a scenario that was read from here, with file and lines."""
    source = _source(path_or_name)
    line_of = read_yaml(_text(source), source)[1]
    problems = (replace(each, line=line_of(each.path)) for each in error.problems)
    return ScenarioError(source, problems)


def _source(path_or_name: Any) -> str:
    if not isinstance(path_or_name, str | os.PathLike):
        raise TypeError(
            "scenario: expected a Scenario, the path of a scenario file, or a built-in's name, "
            f"got {shown(path_or_name)}"
        )
    source = os.fspath(path_or_name)
    return source if isinstance(source, str) else os.fsdecode(source)


def _text(source: str) -> str:
    if source in builtin_names():
        return builtin_text(source)
    try:
        return read_text(source)
    except UnreadableError as error:
        missing = error.args[0] == NO_SUCH_FILE
        raise ScenarioError(
            source, [Problem(_not_found(source) if missing else str(error))]
        ) from None


def _not_found(source: str) -> str:
    names = builtin_names()
    close = difflib.get_close_matches(source, names, n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    return (
        f"no such file, and no built-in scenario of that name{hint}; built in: {', '.join(names)}"
    )
