"""YAML text to plain data and back, with the line of every field.

A scenario is data that a person wrote: what YAML can do beyond that (types of its own, aliases that
unfold into millions of entries, nesting without end) is refused before anything is made of it.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from quietbus.scenario.errors import Path, Problem, ScenarioError
from quietbus.scenario.limits import MOST_DEPTH, MOST_ENTRIES, MOST_LETTERS
from quietbus.words import shown

_CORE = "tag:yaml.org,2002:"
# a date is a text here: no field is one, and whatever reads it says what it expected instead
_SCALARS = {_CORE + name for name in ("str", "int", "float", "bool", "null", "value", "timestamp")}
_CONTAINERS = {_CORE + "seq", _CORE + "map"}


def read_yaml(text: str, source: str) -> tuple[Any, Callable[[Path], int | None]]:
    """Plain data, and a function from a field's path to its line.

    Raises ScenarioError on text that is not YAML, has a key twice, a tag that is not a plain
    type's, or more than ``quietbus.scenario.limits`` allows.
    """
    try:
        if len(text) > MOST_LETTERS:
            raise _Refused(f"expected at most {MOST_LETTERS:,} letters, got {len(text):,}")
        reader = _Reader()
        data = reader.data(reader.composed(text))
    except _Refused as error:
        raise ScenarioError(source, [Problem(str(error), error.path, error.line)]) from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        why = ", ".join(part.strip() for part in (error.context, error.problem) if part)
        raise ScenarioError(
            source, [Problem(f"not valid YAML: {why}", (), mark.line + 1 if mark else None)]
        ) from None
    except YAMLError as error:
        why = " ".join(str(error).split())
        raise ScenarioError(source, [Problem(f"not valid YAML: {why}")]) from None
    return data, lambda path: reader.line(data, path)


def write_yaml(data: Any) -> str:
    """Text of plain data, innermost lists and mappings on one line."""
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 200  # no leaf is broken
    buffer = io.StringIO()
    yaml.dump(data, buffer)
    return buffer.getvalue()


class _Refused(Exception):
    """Text that YAML allows and a scenario does not."""

    def __init__(self, message: str, node: Node | None = None, path: Path = ()) -> None:
        super().__init__(message)
        self.path = path
        self.line = None if node is None else node.start_mark.line + 1


class _LimitedComposer(Composer):
    """Stops at once where the text is deeper or longer than a scenario can be."""

    entries = 0
    levels = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        self.entries += 1
        self.levels += 1
        line = self.parser.peek_event().start_mark.line + 1
        if self.levels > MOST_DEPTH:
            refused = _Refused(f"expected at most {MOST_DEPTH} lists and mappings in each other")
        elif self.entries > MOST_ENTRIES:
            refused = _Refused(f"expected at most {MOST_ENTRIES:,} entries, got more")
        else:
            node = super().compose_node(parent, index)
            self.levels -= 1
            return node
        refused.line = line
        raise refused


class _Reader:
    """Makes plain data of YAML's nodes, and remembers the lines."""

    def __init__(self) -> None:
        self.yaml = YAML(typ="safe", pure=True)
        self.yaml.Composer = _LimitedComposer
        self.done: dict[int, tuple[Any, int]] = {}  # by node: its data, the entries it unfolds to
        self.open: set[int] = set()
        self.lines: dict[int, dict[str | int, int]] = {}  # by list or mapping

    def composed(self, text: str) -> Node | None:
        return self.yaml.compose(text)

    def data(self, node: Node | None) -> Any:
        """Dict, list and scalars; aliases stay shared."""
        return None if node is None else self._made(node, ())[0]

    def line(self, data: Any, path: Path) -> int | None:
        """Line of the deepest part of ``path`` that the document has."""
        found = None
        for key in path:
            lines = self.lines.get(id(data), {})
            if key not in lines:
                break
            found = lines[key]
            data = data[int(key)] if isinstance(data, list) else _by_text(data, key)
        return found

    def _made(self, node: Node, path: Path) -> tuple[Any, int]:
        if id(node) in self.done:
            return self.done[id(node)]
        if id(node) in self.open:
            raise _Refused("expected a value, got an alias of what it is a part of", node, path)
        self._check_tag(node, path)
        self.open.add(id(node))
        if isinstance(node, ScalarNode):
            made: tuple[Any, int] = self._scalar(node, path), 1
        elif isinstance(node, SequenceNode):
            made = self._sequence(node, path)
        else:
            assert isinstance(node, MappingNode)
            made = self._mapping(node, path)
        if made[1] > MOST_ENTRIES:
            raise _Refused(
                f"expected at most {MOST_ENTRIES:,} entries, got aliases that unfold into more",
                node,
                path,
            )
        self.open.remove(id(node))
        self.done[id(node)] = made
        return made

    def _check_tag(self, node: Node, path: Path) -> None:
        known = _SCALARS if isinstance(node, ScalarNode) else _CONTAINERS
        if str(node.tag) not in known:
            tag = str(node.tag).replace(_CORE, "!!")
            raise _Refused(f"expected a value without a tag, got {shown(tag)}", node, path)

    def _scalar(self, node: ScalarNode, path: Path) -> Any:
        kind = str(node.tag).removeprefix(_CORE)
        if kind in ("str", "value", "timestamp"):
            return node.value
        try:
            return self.yaml.constructor.construct_object(node)
        except (ValueError, KeyError, IndexError, AssertionError):  # each type has its own way
            what = {"int": "a whole number", "float": "a number", "bool": "true or false"}
            why = f" ({len(node.value):,} digits)" if len(node.value) > 100 else ""
            raise _Refused(
                f"expected {what.get(kind, 'nothing')}, got {shown(node.value)}{why}", node, path
            ) from None

    def _sequence(self, node: SequenceNode, path: Path) -> tuple[list[Any], int]:
        made = [self._made(item, (*path, i)) for i, item in enumerate(node.value)]
        items = [item for item, _ in made]
        self.lines[id(items)] = {i: _line(item) for i, item in enumerate(node.value)}
        return items, 1 + sum(size for _, size in made)

    def _mapping(self, node: MappingNode, path: Path) -> tuple[dict[Any, Any], int]:
        own: dict[Any, Any] = {}
        lines: dict[str | int, int] = {}
        merged: dict[Any, Any] = {}
        merged_lines: dict[str | int, int] = {}
        size = 1
        for key_node, value_node in node.value:
            if str(key_node.tag) == _CORE + "merge":
                for mapping, mapping_size in reversed(list(self._merged(value_node, path))):
                    merged |= mapping
                    merged_lines |= self.lines[id(mapping)]
                    size += mapping_size
                continue
            if not isinstance(key_node, ScalarNode):
                raise _Refused("expected a text as key, got a list or a mapping", key_node, path)
            key = self._made(key_node, path)[0]
            if str(key) in lines:
                raise _Refused("this key appears twice in its mapping", key_node, (*path, str(key)))
            own[key], below = self._made(value_node, (*path, str(key)))
            lines[str(key)] = _line(key_node)
            size += below
        data = merged | own
        self.lines[id(data)] = merged_lines | lines
        return data, size

    def _merged(self, node: Node, path: Path) -> Iterator[tuple[dict[Any, Any], int]]:
        """The mappings that ``<<`` names, the strongest first."""
        for each in node.value if isinstance(node, SequenceNode) else [node]:
            if not isinstance(each, MappingNode):
                raise _Refused("expected mappings to merge by <<", each, (*path, "<<"))
            yield self._made(each, path)


def _line(node: Node) -> int:
    return int(node.start_mark.line) + 1


def _by_text(mapping: dict[Any, Any], text: str | int) -> Any:
    """The value whose key reads so: keys of a scenario are texts, YAML's may be numbers."""
    return next(value for key, value in mapping.items() if str(key) == text)
