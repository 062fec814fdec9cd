"""What is refused before anything is computed, and how a command ends that cannot go on."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import NoReturn

import typer

BAD_INPUT, FAILED = 2, 1


class BadInput(Exception):
    """Something that the user asked for and that cannot be; the message says what."""


def fail(message: str) -> NoReturn:
    print(f"quietbus: {message}", file=sys.stderr)
    raise typer.Exit(FAILED)


def check_folder(folder: Path) -> None:
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder")


def check_file(file: Path) -> None:
    """Refuse a file that cannot be written, before anything is computed for it."""
    check_folder(file.parent)
    if file.is_dir():
        raise BadInput(f"{file}: is a folder; expected the name of a file")
    _check_writable(file.parent, file)


def make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise BadInput(f"{folder}: is a file; expected the name of a folder") from None
    except OSError as error:
        raise BadInput(f"{folder}: cannot be made: {error.strerror}") from None
    _check_writable(folder, folder)


def _check_writable(folder: Path, wanted: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise BadInput(f"{wanted}: cannot be written: {error.strerror or error}") from None
