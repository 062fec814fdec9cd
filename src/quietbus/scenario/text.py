"""YAML text to plain data and back, with the line of every field."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq, TaggedScalar
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, SequenceNode

from quietbus.scenario.errors import Path, Problem, ScenarioError


def read_yaml(text: str, source: str) -> tuple[Any, Callable[[Path], int | None]]:
    """Plain data, and a function from a field's path to its line.

    Raises ScenarioError on text that is not YAML or has a key twice.
    """
    try:
        document = YAML().load(text)
    except DuplicateKeyError as error:
        line = error.problem_mark.line
        path = _path_at(YAML().compose(text), line, error.problem_mark.column) or ()
        raise ScenarioError(
            source, [Problem("this key appears twice in its mapping", path, line + 1)]
        ) from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        why = ", ".join(part.strip() for part in (error.context, error.problem) if part)
        raise ScenarioError(
            source, [Problem(f"not valid YAML: {why}", (), mark.line + 1 if mark else None)]
        ) from None
    except YAMLError as error:
        why = " ".join(str(error).split())
        raise ScenarioError(source, [Problem(f"not valid YAML: {why}")]) from None
    return _plain(document, {}), lambda path: _line(document, path)


def write_yaml(data: Any) -> str:
    """Text of plain data, innermost lists and mappings on one line."""
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 200  # no leaf is broken
    buffer = io.StringIO()
    yaml.dump(data, buffer)
    return buffer.getvalue()


def _plain(node: Any, done: dict[int, Any]) -> Any:
    """The loader's commented nodes as dict, list and scalars; aliases stay shared."""
    if id(node) in done:
        return done[id(node)]
    if isinstance(node, CommentedMap):
        mapping = done[id(node)] = {}
        mapping.update({key: _plain(value, done) for key, value in node.items()})
        return mapping
    if isinstance(node, CommentedSeq):
        sequence = done[id(node)] = []
        sequence.extend(_plain(value, done) for value in node)
        return sequence
    if isinstance(node, TaggedScalar):
        return f"{node.tag.value} {node.value}"
    for kind in (str, int, float):  # the loader's own scalars remember how they were written
        if isinstance(node, kind) and type(node) is not bool:
            return bool(node) if type(node).__name__ == "ScalarBoolean" else kind(node)
    return node


def _line(node: Any, path: Path) -> int | None:
    """Line of the deepest part of ``path`` that the document has."""
    line = None
    for key in path:
        try:
            if isinstance(node, CommentedMap):
                line = node.lc.key(key)[0] + 1
            elif isinstance(node, CommentedSeq):
                line = node.lc.item(key)[0] + 1
            node = node[key]
        except (KeyError, IndexError, TypeError):
            break
    return line


def _path_at(node: Node, line: int, column: int) -> Path | None:
    """Path of the key that starts at a place in the text."""
    if isinstance(node, MappingNode):
        children = [(key.value, key, value) for key, value in node.value]
    elif isinstance(node, SequenceNode):
        children = [(index, item, item) for index, item in enumerate(node.value)]
    else:
        return None
    for name, place, child in children:
        if isinstance(node, MappingNode) and (
            place.start_mark.line == line and place.start_mark.column == column
        ):
            return (name,)
        below = _path_at(child, line, column)
        if below is not None:
            return (name, *below)
    return None
