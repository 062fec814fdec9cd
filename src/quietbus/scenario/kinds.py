"""Kinds of a part that the word at its key ``type`` tells apart; users register their own."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic_core import CoreSchema, core_schema

from quietbus.scenario.base import Part
from quietbus.scenario.errors import Findings
from quietbus.scenario.units import expected

Kind = TypeVar("Kind", bound=type)


class Kinds:
    """A type annotation: any of the kinds registered when a scenario is read."""

    def __init__(self, noun: str, base: type[Part] = Part) -> None:
        """Of a noun for messages, and of what all of them have to be."""
        self.noun, self.base = noun, base
        self.known: dict[str, type[Part]] = {}

    def register(self, kind: Kind) -> Kind:
        """Make a kind known, by its field ``type: Literal["word"]``; for use as a decorator.

        Raises:
            TypeError: not of the base, or without such a field.
            ValueError: another kind has the word.
        """
        fields: dict[str, Any] = getattr(kind, "model_fields", {})
        words: tuple[Any, ...] = ()
        if "type" in fields:
            words = getattr(fields["type"].annotation, "__args__", ())
        if len(words) != 1 or not issubclass(kind, self.base):
            what = f'a {self.base.__name__} with a field type: Literal["word"]'
            raise TypeError(f"{kind.__name__}: expected {what}")
        word = str(words[0])
        other = self.known.get(word)
        if other is not None and (other.__module__, other.__qualname__) != (
            kind.__module__,
            kind.__qualname__,
        ):
            raise ValueError(f"{self.noun} type {word!r}: {other.__qualname__} has it already")
        self.known[word] = kind
        return kind

    def _read(self, value: Any, info: ValidationInfo) -> Part:
        if isinstance(value, Part):
            return value
        if not isinstance(value, dict):
            raise expected("a mapping with the key type", value)
        word: Any = value.get("type")
        if not isinstance(word, str) or word not in self.known:
            findings = Findings()
            own = "a type that --parts FILE.py registers"
            wanted = f"{', '.join(self.known)}, or {own}" if self.known else own
            findings.add("type", expected(wanted, word).message())
            findings.raise_any()
        return self.known[word].model_validate(value, context=info.context)

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(
            self._read,
            serialization=core_schema.plain_serializer_function_ser_schema(
                lambda part, info: part.model_dump(mode=info.mode), info_arg=True
            ),
        )

    def __get_pydantic_json_schema__(
        self, _: CoreSchema, __: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {
            "type": "object",
            "required": ["type"],
            "properties": {"type": {"type": "string", "examples": list(self.known)}},
        }
