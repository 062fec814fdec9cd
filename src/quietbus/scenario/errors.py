"""What is wrong with a scenario, told in the user's terms: file, field, line, what was expected."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from quietbus.words import shown, visible, visible_lines

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a scenario.

    Attributes:
        message: what was expected and what came.
        path: the field, from the top of the scenario; empty for the whole.
        line: line in the file, counted from 1, if there is one.
    """

    message: str
    path: Path = ()
    line: int | None = None

    def __str__(self) -> str:
        where = visible(dotted(self.path))
        if self.line is not None:
            where = f"{where} (line {self.line})" if where else f"line {self.line}"
        message = visible_lines(self.message)
        return f"{where}: {message}" if where else message


class ScenarioError(ValueError):
    """A scenario that cannot be used; its text has one line for each problem.

    Attributes:
        source: file or name of the scenario.
        problems: everything found wrong.
    """

    def __init__(self, source: str, problems: Iterable[Problem]) -> None:
        self.source = source
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{visible(source)}: {problem}" for problem in self.problems))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.source, self.problems)  # an exception's own way keeps one text


class Findings:
    """Problems that a check of several fields together has found."""

    def __init__(self) -> None:
        self._errors: list[InitErrorDetails] = []

    def add(self, path: Path | str, message: str) -> None:
        """Note a problem of the field at ``path`` below the checked model."""
        loc = (path,) if isinstance(path, str) else path
        kind = PydanticCustomError("scenario", "{text}", {"text": message})
        self._errors.append(InitErrorDetails(type=kind, loc=loc, input=None))

    def raise_any(self) -> None:
        """Report what was noted to pydantic, which merges it with all else."""
        if self._errors:
            raise ValidationError.from_exception_data("scenario", self._errors)


class UnknownKey:
    """Stands in for the value of a key that a model does not have, until it is reported."""

    def __init__(self, key: str, known: Iterable[str]) -> None:
        known = list(known)
        close = difflib.get_close_matches(key[:60], known, n=1)
        if not close:  # BUS for bus
            close = [name for name in known if name.lower() == key.lower()]
        self.meant = close[0] if close else None
        hint = f"did you mean '{self.meant}'?" if close else f"known here: {', '.join(known)}"
        self.message = f"unknown key {shown(key)}; {hint}"


def found(
    error: ValidationError, line_of: Callable[[Path], int | None] | None = None
) -> list[Problem]:
    """Pydantic's findings as problems, in the order of the file.

    A key that is missing because it is misspelt is told once, as the misspelt one.
    """
    problems: dict[Problem, None] = {}  # an ordered set
    all_details = error.errors(include_url=False)
    misspelt = {
        _field((*details["loc"][:-1], details["input"].meant))
        for details in all_details
        if isinstance(details["input"], UnknownKey) and details["input"].meant
    }
    for details in all_details:
        path = _field(details["loc"])
        if path in misspelt and details["input"] is None:
            continue
        problems[Problem(_message(details), path, line_of(path) if line_of else None)] = None
    return sorted(problems, key=lambda problem: problem.line or 0)


def _field(loc: Path) -> Path:
    """Elements like "<each>" name the branch of a union, not a field."""
    return tuple(key for key in loc if not str(key).startswith("<"))


def _message(details: ErrorDetails) -> str:
    value = details["input"]
    match details["type"]:
        case "scenario":
            return details["msg"]
        case "extra_forbidden" if isinstance(value, UnknownKey):
            return value.message
        case "literal_error":
            return f"expected {details['ctx']['expected']}, got {shown(value)}"
        case "bool_type":
            return f"expected true or false, got {shown(value)}"
        case "float_type" | "float_parsing":  # of users' own parts: others' numbers are quantities
            return (
                f"expected a number without a unit, as its type has no Measure, got {shown(value)}"
            )
        case "value_error" | "assertion_error":  # of users' own checks
            return str(details["ctx"]["error"])
        case _:
            return f"is not valid, got {shown(value)}"


def dotted(path: Path) -> str:
    """A path as text: ``cluster.units[2].position``."""
    text = "".join(f"[{key}]" if isinstance(key, int) else f".{str(key)[:60]}" for key in path)
    return text.removeprefix(".")
