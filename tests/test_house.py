"""The rules of the house that import-linter cannot state (docs/architecture.md)."""

import ast
import pathlib
import re
import subprocess
import sys
import tomllib

import pytest

import kinds

ROOT = pathlib.Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "quietbus"
PAGE = ROOT / "docs" / "architecture.md"
SOURCES = sorted([*PACKAGE.rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py")])


def private_imports(text: str) -> list[str]:
    """Private names that a module takes from another one of the package."""
    tree = ast.parse(text)
    modules, found = set(), []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules |= {each.asname or each.name for each in node.names if "quietbus" in each.name}
        if isinstance(node, ast.ImportFrom) and (node.level or str(node.module) >= "quietbus"):
            modules |= {each.asname or each.name for each in node.names}
            found += [each.name for each in node.names if _private(each.name)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and _private(node.attr):
            owner = ast.unparse(node.value)
            found += [f"{owner}.{node.attr}"] if owner in modules else []
    return found


def _private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__")


def test_no_module_takes_a_private_name_from_another():
    for source in SOURCES:
        assert not private_imports(source.read_text(encoding="utf-8")), source


@pytest.mark.parametrize(
    "text",
    [
        "from quietbus.words import _LETTERS",
        "from .words import _LETTERS",
        "from quietbus import words\nwords._LETTERS",
        "import quietbus.words\nquietbus.words._LETTERS",
    ],
)
def test_a_private_name_of_another_module_is_seen(text):
    assert private_imports(text)


def test_own_private_names_are_not_others():
    assert not private_imports("import os\n\n_A = 1\nself._b\nos._exit(_A)")


def test_every_room_stands_in_the_drawing():
    """import-linter demands that all stand in its layers; the page is for people."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = project["tool"]["importlinter"]["contracts"][0]["layers"]
    drawing = PAGE.read_text(encoding="utf-8").split("```")[1].splitlines()
    drawn = [re.split(r"\s{2,}", line[15:].strip()) for line in drawing]  # after what a floor is
    known = {room for layer in layers for room in layer.split(" | ")}
    rooms = [sorted(known.intersection(line)) for line in drawn]
    assert [own for own in rooms if own] == [sorted(layer.split(" | ")) for layer in layers]


def test_kinds_are_counted():
    text = """
if a is None or b is not None or isinstance(c, int):
    pass
if d.mount == e or f == "rigid" or g != "isolated" or h == "other" or i is True:
    pass
"""
    assert kinds.counted(text) == {"is None": 1, "is not None": 1, "isinstance": 1, "mount": 3}


def test_the_count_of_kinds_is_printed():
    printed = subprocess.run(
        [sys.executable, kinds.__file__], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    total = sum(count.total() for count in kinds.by_file().values())
    assert printed[-1].split()[0] == str(total)
