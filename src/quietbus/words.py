"""How what came from outside is told in a message: short, on one line, harmless to a terminal."""

from __future__ import annotations

import re
import reprlib
from typing import Any

_LETTERS = 60  # of a value in a message


def visible(text: str) -> str:
    r"""Text with every letter that has no glyph written as its escape, as ``\x1b``.

    Control letters move a terminal's cursor or name its window, letters that turn the direction of
    writing make one text look like another.
    """
    return "".join(
        letter
        if letter.isprintable()
        else letter.encode("unicode_escape", "surrogatepass").decode("ascii")
        for letter in text
    )


def file_name(text: str) -> str:
    """A name as a part of a file's name: no separator, space or letter that a shell reads."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", text) or "-"


def visible_lines(text: str) -> str:
    """``visible``, for a text of our own with line ends of its own."""
    return "\n".join(visible(line) for line in text.split("\n"))


def shown(value: Any) -> str:
    """A value as the user wrote it, cut to a readable length."""
    if _of_numpy(value):
        if value.size > _LETTERS:
            return f"an array of shape {value.shape}"
        value = value.tolist()
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a mapping"
    text = _Short().repr(list(value) if isinstance(value, tuple) else value)
    if isinstance(value, list | tuple) and len(text) > _LETTERS:
        return f"a list of {len(value)}"
    return text if len(text) <= _LETTERS else text[: _LETTERS - 3] + "..."


def _of_numpy(value: Any) -> bool:
    """Whether it is an array or a number of NumPy, which is not loaded for this question."""
    return type(value).__module__ == "numpy" and hasattr(value, "tolist")


class _Short(reprlib.Repr):
    """Looks at no more of a value than is shown, however large or nested it is."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 4
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = self.maxother = _LETTERS

    def repr_str(self, x: str, level: int) -> str:  # noqa: ARG002
        return repr(x[: _LETTERS + 1])

    def repr_int(self, x: int, level: int) -> str:  # noqa: ARG002
        if x.bit_length() > 200:  # Python refuses to write out more than some thousand digits
            return f"a whole number of some {int(x.bit_length() * 0.30103):,} digits"
        return repr(x)

    def repr_instance(self, x: Any, level: int) -> str:
        if _of_numpy(x):
            return self.repr1(x.tolist(), level) if x.size <= _LETTERS else "an array"
        text = super().repr_instance(x, level)
        return f"an object of type {type(x).__name__}" if text.startswith("<") else text
