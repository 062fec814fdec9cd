"""Text of the files that a user or a scenario names: of regular files only, and not without end."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from pathlib import Path

MOST_BYTES = 16_000_000  # of a scenario or a table
TABLE_FOLDERS = "QUIETBUS_TABLE_FOLDERS"  # environment: further folders that scenarios may name
NO_SUCH_FILE = "no such file"


class UnreadableError(ValueError):
    """Why a file's text cannot be had, without a word of what is in it."""


def read_text(path: str | os.PathLike[str], most: int = MOST_BYTES) -> str:
    """The UTF-8 text of a regular file, its line ends as Python has them.

    Raises:
        UnreadableError: no such file, not a regular one (a pipe could block for ever, a device
            never end), larger than ``most`` bytes, or no text.
    """
    try:
        _refuse_special(os.stat(path))
        # should another have taken its place since, then a pipe does not block the opening either
        with open(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as opened:
            _refuse_special(os.fstat(opened.fileno()))
            data = opened.read(most + 1)
    except UnreadableError:
        raise
    except FileNotFoundError:
        raise UnreadableError(NO_SUCH_FILE) from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise UnreadableError(
            f"cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from None
    if len(data) > most:
        raise UnreadableError(f"expected at most {most:,} bytes, got more")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UnreadableError(f"not a UTF-8 text file (byte {error.start:,})") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _refuse_special(about: os.stat_result) -> None:
    if stat.S_ISDIR(about.st_mode):
        raise UnreadableError("is a folder; expected a file")
    if not stat.S_ISREG(about.st_mode):
        raise UnreadableError("expected a regular file, got a pipe or a device")


def within(path: Path, folder: Path) -> bool:
    """Whether a scenario in ``folder`` may name a file: one below it, or below a folder that the
    environment names in QUIETBUS_TABLE_FOLDERS. Links count as what they lead to.
    """
    named = os.environ.get(TABLE_FOLDERS, "").split(os.pathsep)
    allowed: Iterable[Path] = (folder, *(Path(name) for name in named if name))
    return any(path.resolve().is_relative_to(each.resolve()) for each in allowed)
