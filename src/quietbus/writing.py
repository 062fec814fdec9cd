"""Files written whole or not at all: under a new name beside the target, then moved into its place.

What is written becomes visible only when all of it is on the disk, so neither a full disk nor a
killed program leaves half a file under a name that promises a whole one. A target is a regular file
or no file yet. Links, pipes and devices are refused, write-protected files too, and so is what is
no older output of the same kind: a run does not replace a scenario.
"""

import contextlib
import errno
import io
import json
import os
import secrets
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

# how files of a kind begin; an older one of that kind may be replaced
BEGINNINGS: Mapping[str, tuple[bytes, ...]] = {
    "run (NetCDF-4)": (b"\x89HDF\r\n\x1a\n",),
    "checkpoint": (b"quietbus checkpoint 1\n",),
    "kept program": (b"",),  # a damaged one is replaced
    "page (HTML)": (b"<!DOCTYPE html>", b"<!doctype html>"),
    "disturbance block (YAML)": (b"disturbance:",),
    "new scenario (YAML)": (),  # never replaced
    "MuJoCo model (XML)": (b"<mujoco",),
    "JSON file": (b"{",),
    "Markdown file": (b"",),
    "log": (b"",),
    ".png picture": (b"\x89PNG\r\n\x1a\n",),
    ".svg picture": (b"<?xml", b"<svg"),
    ".pdf picture": (b"%PDF",),
}
UNFINISHED = ".quietbus-*.part"  # names of new files until they are whole
LONGEST_NAME = 255  # bytes, of the usual file systems


class OutputError(OSError):
    """A file that cannot be written, or must not; the message names it and says why."""


def check_target(path: str | os.PathLike[str], kind: str) -> None:
    """Refuse what is no place for a file of this kind (a key of ``BEGINNINGS``).

    Nothing is written but an unnamed trial file in the target's folder.

    Raises:
        OutputError: no such folder, a name that cannot be, no regular file, a write-protected one,
            an existing one of another kind, or a folder that takes no file.
    """
    path = Path(path)
    _status(path, kind)
    with _told(path):
        handle, trial = _new_file(path)
        handle.close()
        trial.unlink()


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str], kind: str) -> Iterator[io.BufferedRandom]:
    """A new file, open to write and read, that takes the target's place once it is whole.

    Raises:
        OutputError: as of ``check_target``, or what the disk says.
    """
    path = Path(path)
    old = _status(path, kind)
    with _told(path):
        handle, partial = _new_file(path)
        try:
            with handle:
                yield handle
                handle.flush()
                os.fsync(handle.fileno())  # some file systems tell only here that they are full
            if old is not None:
                partial.chmod(stat.S_IMODE(old.st_mode))
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


def write_text(path: str | os.PathLike[str], text: str, kind: str) -> None:
    """Write a text in UTF-8, as ``replacing`` does."""
    with replacing(path, kind) as file:
        file.write(text.encode("utf-8"))


def write_json(path: str | os.PathLike[str], numbers: Mapping[str, Any]) -> None:
    """Write numbers as JSON, as ``replacing`` does.

    Raises:
        ValueError: a number is not finite, which has no place in JSON.
    """
    write_text(path, json.dumps(numbers, indent=2, allow_nan=False) + "\n", "JSON file")


def _status(path: Path, kind: str) -> os.stat_result | None:
    """What is there, None if nothing; OutputError where nothing may be written."""
    name = str(path) if str(path).isprintable() else ascii(str(path))
    if "\0" in str(path) or len(os.fsencode(path.name)) > LONGEST_NAME:
        raise OutputError(
            f"{name[:80]}: cannot be the name of a file: expected at most {LONGEST_NAME} bytes, "
            "none of them zero"
        )
    if not path.parent.is_dir():
        raise OutputError(f"{path.parent}: no such folder")
    try:
        status = path.lstat()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OutputError(f"{name}: cannot be written: {error.strerror}") from None
    if stat.S_ISDIR(status.st_mode):
        raise OutputError(f"{name}: is a folder; expected the name of a file")
    if stat.S_ISLNK(status.st_mode):
        raise OutputError(
            f"{name}: is a link to {os.readlink(path)}; expected the name of a regular file"
        )
    if not stat.S_ISREG(status.st_mode):
        raise OutputError(f"{name}: is a pipe, socket or device; expected a regular file")
    if not status.st_mode & 0o222 or not os.access(path, os.W_OK):
        raise OutputError(f"{name}: is write-protected; choose another name")
    begins = BEGINNINGS[kind]
    with _told(path), path.open("rb") as old:
        found = old.read(max(map(len, begins), default=1))
    if status.st_size and not found.startswith(begins):
        raise OutputError(
            f"{name}: exists and is no {kind}, so it is not replaced; choose another name"
        )
    return status


def _new_file(beside: Path) -> tuple[io.BufferedRandom, Path]:
    """A file that was not there, under a name that nobody can foresee."""
    partial = beside.with_name(UNFINISHED.replace("*", secrets.token_hex(8)))
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    return os.fdopen(os.open(partial, flags, 0o666), "r+b"), partial


@contextlib.contextmanager
def _told(path: Path) -> Iterator[None]:
    """What the system refuses, told of the target and not of the name beside it."""
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        if error.errno == errno.EFBIG:
            reason = "the size that files may have here is reached"
        raise OutputError(f"{path}: cannot be written: {reason}") from error
