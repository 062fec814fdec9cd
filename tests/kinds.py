"""Counts tests of kind in the package: ``python tests/kinds.py`` prints them by file.

A test of kind asks which of several things a value is, where the thing itself could answer:
``x is None``, ``x is not None``, ``isinstance(x, ...)``, and comparison with the word of a mount
(``"rigid"``, ``"isolated"``) or of anything called ``mount``. Each comparison counts once.
"""

import ast
import collections
import pathlib

PACKAGE = pathlib.Path(__file__).parents[1] / "src" / "quietbus"
MOUNTS = ("rigid", "isolated")


def kind_of_test(node: ast.AST) -> str | None:
    """What kind of test of kind a node of a syntax tree is, if any."""
    if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance":
        return "isinstance"
    if not isinstance(node, ast.Compare):
        return None
    sides = [node.left, *node.comparators]
    for operator in node.ops:
        if isinstance(operator, ast.Is | ast.IsNot) and any(
            isinstance(side, ast.Constant) and side.value is None for side in sides
        ):
            return "is None" if isinstance(operator, ast.Is) else "is not None"
        if isinstance(operator, ast.Eq | ast.NotEq):
            if any(isinstance(side, ast.Constant) and side.value in MOUNTS for side in sides):
                return "mount"
            if any(isinstance(side, ast.Attribute) and side.attr == "mount" for side in sides):
                return "mount"
    return None


def counted(text: str) -> collections.Counter[str]:
    """Tests of kind in Python text."""
    found = map(kind_of_test, ast.walk(ast.parse(text)))
    return collections.Counter(kind for kind in found if kind)


def by_file() -> dict[str, collections.Counter[str]]:
    """Those of every file of the package that has some."""
    found = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        if count := counted(file.read_text(encoding="utf-8")):
            found[file.relative_to(PACKAGE).as_posix()] = count
    return found


def main() -> None:
    """Print them by file, by room and in all."""
    rooms: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    files = by_file()
    for name, count in sorted(files.items(), key=lambda each: -each[1].total()):
        rooms[name.partition("/")[0]] += count
        print(_row(name, count))
    print()
    for room, count in sorted(rooms.items(), key=lambda each: -each[1].total()):
        print(_row(room, count))
    total = sum(rooms.values(), collections.Counter[str]())
    print(_row(f"in {len(files)} files", total))


def _row(name: str, count: collections.Counter[str]) -> str:
    kinds = ", ".join(f"{kind} {number}" for kind, number in count.most_common())
    return f"{count.total():4d}  {name}: {kinds}"


if __name__ == "__main__":
    main()
