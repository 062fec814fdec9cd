"""Parts of users' own kinds are asked what they give as they are built; what is wrong is told.

Shapes first: ``jax.eval_shape`` runs each method on tracers and compiles nothing. Then the values
at the start of a run. Parts of the package's own kinds are not looked at; tests have done so.
"""

import inspect
import pathlib
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from quietbus.scenario import Problem, Scenario, ScenarioError
from quietbus.scenario.errors import Path
from quietbus.words import shown

Shape = tuple[int | None, ...]  # None: any length


class LawError(ValueError):
    """What is wrong with a part of a user's own kind, by class and method."""


@contextmanager
def told_at(scenario: Scenario, path: Path) -> Iterator[None]:
    """What is wrong with the part that the scenario has there, as an error of the scenario."""
    try:
        yield
    except LawError as error:
        raise ScenarioError(scenario.name, [Problem(str(error), path)]) from error


def is_own(said: object) -> bool:
    """Whether what a scenario says of a part is of a user's own kind."""
    return not type(said).__module__.startswith("quietbus.")


def built(build: Any, kind: type, said: Any, *given: Any) -> Any:
    """The law of a part, made by the function that is registered for what the scenario says of it.

    Args:
        build: ``strut_of`` or ``actuator_of``.
        kind: what the law has to be.
        given: further arguments of the function.
    """
    if not is_own(said):
        return build(said, *given)
    name = type(said).__name__
    if build.dispatch(type(said)) is build.dispatch(object):
        raise LawError(f"{name}: expected a function with @{build.__name__}.register, got none")
    where = f"{build.__name__}({name})"
    try:
        law = build(said, *given)
    except Exception as error:
        raise LawError(f"{where}: {_words(error, type(said))}") from error
    if not isinstance(law, kind):
        raise LawError(f"{where}: expected one of {kind.__name__}, got {_kind(law)}")
    return law


def number(*shape: int) -> Any:
    """Stands for numbers of a shape, whatever their values."""
    return jax.ShapeDtypeStruct(shape, jnp.float64)


@dataclass(frozen=True)
class Asked:
    """A law that is asked what it gives; a LawError where that is not what has to come."""

    law: Any

    def wrong(self, method: str, expected: str, got: str) -> LawError:
        """The error of a method or field."""
        return LawError(f"{type(self.law).__name__}.{method}: expected {expected}, got {got}")

    @contextmanager
    def _asking(self, method: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            if type(error) is NotImplementedError and not str(error):  # as the base class has it
                raise self.wrong(method, "the law to have this method", "none") from error
            words = _words(error, type(self.law))
            raise LawError(f"{type(self.law).__name__}.{method}: {words}") from error

    def fields(self) -> None:
        """Refuse fields that are neither numbers nor static."""
        for path, leaf in jax.tree_util.tree_leaves_with_path(self.law):
            if not eqx.is_array_like(leaf):
                wanted = "numbers and arrays, or eqx.field(static=True)"
                raise self.wrong(jax.tree_util.keystr(path)[1:], wanted, shown(leaf))
        with self._asking("fields that are static"):
            hash(jax.tree.structure(self.law))

    def call(self, method: str, *given: Any) -> Any:
        """What a method gives."""
        with self._asking(method):
            return getattr(self.law, method)(*given)

    def names(self, method: str, kind: type, count: int | None = None) -> list[Any]:
        """A list of names that a method gives, all unlike."""
        given = self.call(method, 0)
        if not isinstance(given, list | tuple) or not all(isinstance(n, kind) for n in given):
            raise self.wrong(method, f"a list of {kind.__name__}", shown(given))
        if len(set(given)) < len(given):
            raise self.wrong(method, "names that are all unlike", shown(given))
        if count is not None and len(given) != count:
            raise self.wrong(method, f"{count} names, as start has y", shown(given))
        return list(given)

    def shapes(self, method: str, *at: Any, of: Callable[[Any], Any] = lambda x: x) -> Any:
        """Shapes of what a method gives, or of a part of that."""
        with self._asking(method):
            return jax.eval_shape(lambda law, *at: of(getattr(law, method)(*at)), self.law, *at)

    def fits(self, what: str, value: Any, shape: Shape, why: str = "") -> None:
        """Refuse what is no numbers of a shape."""
        found: Any = getattr(value, "shape", None)  # Python's lists have none
        right = isinstance(found, tuple) and len(found) == len(shape)
        right = right and all(want in (n, None) for n, want in zip(found, shape, strict=True))
        of_python = getattr(value, "weak_type", False) and found == ()
        if not right or not (of_python or value.dtype == jnp.float64):
            told = f"float64 of shape {str(shape).replace('None', 'n')}"
            raise self.wrong(what, f"{told}, {why}" if why else told, _kind(value))

    def gives(self, method: str, at: tuple[Any, ...], shape: Shape, why: str = "") -> Any:
        """Shape of what a method gives, which has to be this."""
        given = self.shapes(method, *at)
        self.fits(method, given, shape, why)
        return given

    def gives_fields(
        self, method: str, at: tuple[Any, ...], kind: type, why: str = "", **shapes: Shape
    ) -> Any:
        """Shapes of what a method gives, which has to be of a kind with fields of these."""
        given = self.shapes(method, *at)
        if not isinstance(given, kind):
            raise self.wrong(method, kind.__name__, _kind(given))
        for key, shape in shapes.items():
            self.fits(f"{method}().{key}", getattr(given, key), shape, why)
        return given

    def slopes(self, method: str, *at: Any) -> None:
        """Refuse a method that has no derivatives, by which linear models and vibration follow."""

        def slopes(law: Any, *at: Any) -> Any:
            return jax.jacfwd(getattr(law, method), argnums=tuple(range(len(at))))(*at)

        with self._asking(f"{method}, its derivatives"):
            jax.eval_shape(slopes, self.law, *at)

    def finite(self, method: str, value: Any, what: str = "numbers") -> None:
        """Refuse what is not finite, at rest at the start of a run."""
        for leaf in map(np.asarray, jax.tree.leaves(value)):
            bad = leaf[~np.isfinite(leaf)]
            if bad.size:
                wanted = f"finite {what} at rest at the start of a run"
                raise self.wrong(method, wanted, shown(bad[0]))


def _kind(value: Any) -> str:
    """What came in place of numbers of some shape."""
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"{value.dtype} of shape {value.shape}"
    return "nothing" if value is None else f"an object of type {type(value).__name__}"


def _words(error: Exception, kind: type) -> str:
    """An exception in its own words, with its line in the file that has the class."""
    try:
        file = inspect.getfile(kind)
    except (TypeError, OSError):
        file = ""
    frames = traceback.walk_tb(error.__traceback__)
    lines = [line for frame, line in frames if frame.f_code.co_filename == file]
    at = f" in {pathlib.Path(file).name}, line {lines[-1]}" if lines else ""
    said = str(error).strip().partition("\n")[0]
    return f"raised {type(error).__name__}{at}" + (f": {said}" if said else "")
