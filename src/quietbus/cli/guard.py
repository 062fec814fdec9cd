"""What is refused before anything is computed, and how a command ends that cannot go on."""

from __future__ import annotations

import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import typer

from quietbus.words import visible_lines
from quietbus.writing import OutputError, check_target

BAD_INPUT, FAILED = 2, 1


class BadInput(Exception):
    """Something that the user asked for and that cannot be; the message says what."""


def fail(message: str) -> NoReturn:
    print(f"quietbus: {visible_lines(message)}", file=sys.stderr)
    raise typer.Exit(FAILED)


def check_file(file: Path, kind: str) -> None:
    """Refuse a file that cannot be written, before anything is computed for it.

    Args:
        kind: of ``quietbus.writing.BEGINNINGS``.
    """
    try:
        check_target(file, kind)
    except OutputError as error:
        raise BadInput(str(error)) from None


_made: list[Path] = []  # folders that this command made, deepest first


def remove_empty_folders() -> None:
    """Take away the folders that were made and into which nothing came."""
    for folder in _made:
        with suppress(OSError):  # it has something in it, which is as it should be
            folder.rmdir()
    _made.clear()


def make_folder(folder: Path, *numbers: str) -> None:
    """Make a folder for results, and refuse it where the files of their numbers have no place.

    A command that ends without results takes it away again (``remove_empty_folders``).

    Args:
        numbers: names of files that are to be written there, JSON.
    """
    _made.extend(each for each in (folder, *folder.parents) if not each.exists())
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise BadInput(f"{folder}: is a file; expected the name of a folder") from None
    except OSError as error:
        raise BadInput(f"{folder}: cannot be made: {error.strerror}") from None
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written: {error.strerror or error}") from None
    for name in numbers:
        check_file(folder / name, "JSON file")
