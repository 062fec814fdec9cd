"""Make a paper's figures and numbers again, each once: what is made is kept and not made twice."""

import hashlib
import importlib.util
import inspect
import json
import math
import os
import pathlib
import traceback
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import quietbus
from quietbus.plots.style import save_figures, style
from quietbus.reproduce.pages import report_page, table_page
from quietbus.reproduce.parts import Findings, Paper, Part
from quietbus.reproduce.sources import sources_of
from quietbus.writing import UNFINISHED, write_json, write_text

Tell = Callable[[str, float], None]  # what is being done, and how far it is, 0 to 1


class MissingExtra(ImportError):
    """A library that a part needs is not installed; the message says how to get it."""


@dataclass
class Made:
    """One part as it is kept in the folder."""

    key: str
    file: str
    picture: str  # hash of the file
    caption: str
    text: str
    numbers: dict[str, float]


@dataclass(frozen=True)
class Outcome:
    """How a reproduction went."""

    table: dict[str, Any]
    made: tuple[str, ...]  # parts made now
    kept: tuple[str, ...]  # parts found made
    failed: Mapping[str, str]  # part: reason
    interrupted: bool


class Workshop:
    """The output folder, the hashes that what is kept must carry, and how to tell progress."""

    def __init__(self, folder: pathlib.Path, tell: Tell):
        self.folder, self.tell = folder, tell
        self.store = folder / ".made"
        self.store.mkdir(parents=True, exist_ok=True)
        for left in (*folder.glob(UNFINISHED), *self.store.glob(UNFINISHED)):
            left.unlink()

    def key(self, maker: Callable[..., Any] | type) -> str:
        """Hash of all that a function or class depends on: sources, scenarios, libraries."""
        return sources_of(inspect.getfile(maker)).digest()

    def kept(self, part: Part) -> Made | None:
        """What is kept of a part, if it is whole and of the same inputs and sources."""
        try:
            made = Made(**json.loads((self.store / f"{part.name}.json").read_text("utf-8")))
            whole = _hash((self.folder / made.file).read_bytes()) == made.picture
        except (OSError, ValueError, TypeError):
            return None
        return made if whole and made.key == self.key(part.make) else None

    def keep(self, part: Part, found: Findings) -> Made:
        """Write a part's picture and numbers, each whole or not at all.

        Raises:
            ValueError: a number is not finite, which has no place in JSON.
        """
        numbers = {name: float(value) for name, value in found.numbers.items()}
        odd = [name for name, value in numbers.items() if not math.isfinite(value)]
        if odd:
            raise ValueError(f"expected finite numbers, got others for {', '.join(odd)}")
        file = f"{part.name}.png"
        with style():
            save_figures({part.name: found.figure}, self.folder)
        picture = (self.folder / file).read_bytes()
        made = Made(self.key(part.make), file, _hash(picture), found.caption, found.text, numbers)
        write_json(self.store / f"{part.name}.json", asdict(made))
        return made


def reproduce(
    paper: Paper,
    folder: str | os.PathLike[str],
    tell: Tell | None = None,
    fresh: bool = False,
    partial: bool = False,
) -> Outcome:
    """Make all figures, ``table.json``, ``table.md`` and ``report.md`` of a paper.

    A part that fails is named in the table and leaves the others alone. After Ctrl-C (a
    KeyboardInterrupt, also one that ``tell`` raises) what was made is kept.

    Args:
        paper: what to reproduce.
        folder: for the results; made if it is not there.
        tell: called with what is being done and how far it is (0 to 1).
        fresh: make everything again.
        partial: make what can be made where a part needs a library that is not installed.

    Raises:
        MissingExtra: such a library, unless ``partial``; nothing has been computed then.
        OSError: the folder cannot be written.
    """
    tell = tell or (lambda _what, _fraction: None)
    shop = Workshop(pathlib.Path(folder), tell)
    bench = paper.bench(shop)
    if fresh:
        for path in shop.store.iterdir():
            path.unlink()
    lacking = {part.name: said for part in paper.parts if (said := _lacking(part))}
    wanted = [part.name for part in paper.parts if part.name in lacking and not shop.kept(part)]
    if wanted and not partial:
        raise MissingExtra(f"{wanted[0]} {lacking[wanted[0]]}")
    done: dict[str, Made] = {}
    new: list[str] = []
    failed: dict[str, str] = {}
    interrupted = False
    try:
        for part in paper.parts:
            tell(part.title, 0.0)
            kept = shop.kept(part)
            if kept is not None:
                done[part.name] = kept
                continue
            if part.name in lacking:
                failed[part.name] = lacking[part.name]
                continue
            try:
                with style():
                    found = part.make(bench)
                done[part.name] = shop.keep(part, found)
                new.append(part.name)
            except Exception as error:  # any failure of one part must leave the others alone
                failed[part.name] = f"{type(error).__name__}: {error}"
                write_text(shop.store / f"{part.name}.log", traceback.format_exc(), "log")
    except KeyboardInterrupt:
        interrupted = True
    key = _hash("".join(shop.key(part.make) for part in paper.parts).encode())
    table = _table(paper, done, failed, key)
    write_json(shop.folder / "table.json", table)
    write_text(shop.folder / "table.md", table_page(table), "Markdown file")
    chapters = {
        heading: [(part.title, done.get(part.name), part.name) for part in parts]
        for heading, parts in paper.chapters.items()
    }
    write_text(shop.folder / "report.md", report_page(table, chapters), "Markdown file")
    kept_names = tuple(name for name in done if name not in new)
    return Outcome(table, tuple(new), kept_names, failed, interrupted)


def _lacking(part: Part) -> str:
    """What a part needs and does not find, in words, or nothing."""
    missing = [name for name in part.needs if importlib.util.find_spec(name) is None]
    extras = sorted({part.needs[name] for name in missing})
    if not missing:
        return ""
    return f"needs {', '.join(missing)}: pip install 'quietbus[{','.join(extras)}]'"


def _table(
    paper: Paper, done: Mapping[str, Made], failed: Mapping[str, str], key: str
) -> dict[str, Any]:
    findings = {name: value for made in done.values() for name, value in made.numbers.items()}
    return {
        "paper": paper.name,
        "reference": paper.reference,
        "quietbus_version": quietbus.__version__,
        "fingerprint": key,
        "rows": [claim.row(findings) for claim in paper.claims],
        "figures": [
            {
                "name": part.name,
                "title": part.title,
                "chapter": heading,
                "file": done[part.name].file if part.name in done else None,
                "caption": done[part.name].caption if part.name in done else None,
            }
            for heading, parts in paper.chapters.items()
            for part in parts
        ],
        "findings": findings,
        "failed": [{"name": name, "reason": reason} for name, reason in failed.items()],
    }


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
