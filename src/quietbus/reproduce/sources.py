"""What a figure is made of: the modules that its maker imports, near and far, and libraries.

Read from the sources, not by importing them, so that a library that is missing does not matter.
Imports within functions count, those for type checkers alone do not; nor does a package's
``__init__`` that is only passed through on the way to one of its modules.
"""

import ast
import functools
import hashlib
import importlib.metadata
import pathlib
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import quietbus

ROOT = pathlib.Path(quietbus.__file__).parent


@dataclass(frozen=True)
class Sources:
    """All that code depends on."""

    modules: Mapping[str, pathlib.Path]  # files by their names in the package
    libraries: frozenset[str]  # top-level modules of other packages, without Python's own

    def digest(self) -> str:
        """Hash of the sources, of the built-in scenarios, and of the libraries' versions."""
        digest = hashlib.sha256()
        scenarios = {str(path.relative_to(ROOT)): path for path in ROOT.rglob("*.yaml")}
        for name, path in sorted({**self.modules, **scenarios}.items()):
            digest.update(f"{name}\0".encode() + path.read_bytes())
        for library in sorted(self.libraries):
            digest.update(f"{library} {version_of(library)}\0".encode())
        return digest.hexdigest()


def sources_of(file: str | pathlib.Path) -> Sources:
    """What a module depends on.

    Args:
        file: of the module, in the package or outside.
    """
    start = pathlib.Path(file)
    modules, libraries = {_name(start): start}, set[str]()
    waiting = [start]
    while waiting:
        for name in imports(waiting.pop()):
            path = _file(name)
            if path is not None and _name(path) not in modules:
                modules[_name(path)] = path
                waiting.append(path)
            top = name.partition(".")[0]
            if top not in ("quietbus", *sys.stdlib_module_names):
                libraries.add(top)
    return Sources(modules, frozenset(libraries))


@functools.cache
def imports(path: pathlib.Path) -> tuple[str, ...]:
    """Names of the modules that a file imports, and of what it takes from them."""
    return tuple(_imported(ast.parse(path.read_bytes())))


def _imported(node: ast.AST) -> Iterator[str]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            for other in child.orelse:
                yield from _imported(other)
        elif isinstance(child, ast.Import):
            yield from (alias.name for alias in child.names)
        elif isinstance(child, ast.ImportFrom) and child.module and not child.level:
            within = [f"{child.module}.{alias.name}" for alias in child.names]
            found = [name for name in within if _file(name) is not None]
            yield from found
            if len(found) < len(within):  # names of the module itself
                yield child.module
        else:
            yield from _imported(child)


def _file(name: str) -> pathlib.Path | None:
    """The file of a module of the package; None of others and of what is no module."""
    top, *rest = name.split(".")
    if top != "quietbus":
        return None
    path = ROOT.joinpath(*rest)
    for found in (path.with_suffix(".py") if rest else path, path / "__init__.py"):
        if found.is_file():
            return found
    return None


def _name(path: pathlib.Path) -> str:
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else path.name


@functools.cache
def version_of(library: str) -> str:
    for distribution in importlib.metadata.packages_distributions().get(library, [library]):
        try:
            return importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:
            continue
    return "missing"
