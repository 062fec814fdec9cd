"""Compiled programs, kept from one process to the next: a program known needs no tracing.

`compiled` and `compiled_for_few_runs` take the place of ``equinox.filter_jit``. Beside JAX's
compilation cache lie two kinds of files. An *entry* is named by what a program is made of: the
package's source, the function, structure and shapes of its arguments. It tells the program, and
how its results are put together. A *program* is machine code, named by what it was compiled from
(StableHLO); where sources have changed but the program has not, it is found again by tracing.
Both are named by versions, settings and processor too, and checked for damage.

Arguments that hold something of a user's own are not kept, since only their author knows when
they change. A file that is damaged or cannot be written costs time, and one warning.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import os
import pickle
import platform
import sys
import warnings
import weakref
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import serialize_executable
from jax.experimental.compilation_cache import compilation_cache

from quietbus.jaxconfig import XLA_FLAGS
from quietbus.writing import replacing

ROOM = 1 << 30  # bytes, of all that is kept
NAMED = ("quietbus", "jax", "jaxlib", "numpy", "equinox", "diffrax", "builtins", "copyreg")
LIBRARIES = ("jax", "jaxlib", "numpy", "equinox", "diffrax", "lineax", "optimistix", "jaxtyping")


class KeptProgramWarning(UserWarning):
    """A kept program cannot be read or written: answers are the same, later."""


class Slot(NamedTuple):
    """Stands for an array."""

    shape: tuple[int, ...]
    dtype: np.dtype
    weak: bool


_all: weakref.WeakSet[Program] = weakref.WeakSet()


class Program:
    """A function of pytrees as compiled programs, one for each structure of its arguments."""

    def __init__(self, function: Callable, options: Callable[[], dict]):
        functools.update_wrapper(self, function)
        self._function, self._options = function, options
        self._loaded: dict[Any, Callable] = {}
        _all.add(self)

    def __call__(self, *args, **kwargs):
        leaves, structure = jax.tree.flatten((args, kwargs))
        which = tuple(eqx.is_array(leaf) for leaf in leaves)
        arrays = [leaf for leaf, array in zip(leaves, which, strict=True) if array]
        if jax.config.values["jax_disable_jit"] or any(
            isinstance(a, jax.core.Tracer) for a in arrays
        ):
            return self._within(*args, **kwargs)
        said = tuple(
            _slot(leaf) if array else leaf for leaf, array in zip(leaves, which, strict=True)
        )
        key = (structure, said)
        run = self._loaded.get(key)
        if run is None:
            run = self._loaded[key] = self._load(structure, said, arrays)
        return run(arrays)

    @functools.cached_property
    def _within(self) -> Callable:
        """For use within another program."""
        return eqx.filter_jit(self._function)

    def _load(self, structure, said, arrays) -> Callable:
        entry = _entry(self._function, self._options(), jax.tree.unflatten(structure, said))
        kept = entry and _read_entry(entry)
        if not kept:
            kept = self._compile(structure, said, arrays, entry)
        program, answer = kept
        answer_leaves, answer_structure = jax.tree.flatten(answer, is_leaf=_is_slot)
        places = [_is_slot(leaf) for leaf in answer_leaves]

        def run(arrays):
            given = iter(program(*arrays))
            filled = [
                next(given) if place else leaf
                for place, leaf in zip(places, answer_leaves, strict=True)
            ]
            return jax.tree.unflatten(answer_structure, filled)

        return run

    def _compile(self, structure, said, arrays, entry) -> tuple[Callable, Any]:
        answer = None

        def flat(*arrays):
            nonlocal answer
            given = iter(arrays)
            filled = [next(given) if isinstance(leaf, Slot) else leaf for leaf in said]
            args, kwargs = jax.tree.unflatten(structure, filled)
            out = self._function(*args, **kwargs)
            answer = jax.tree.map(lambda leaf: _slot(leaf) if eqx.is_array(leaf) else leaf, out)
            return [leaf for leaf in jax.tree.leaves(out) if eqx.is_array(leaf)]

        flat.__name__ = self._function.__name__
        # with what is not used too, so that what is compiled tells its arguments
        lowered = jax.jit(flat, keep_unused=True, **self._options()).lower(*arrays)
        if entry is None:
            return lowered.compile(), answer
        digest = hashlib.sha256(repr(sorted(self._options().items())).encode())
        digest.update(lowered.as_text().encode())
        file = entry.parents[1] / f"{entry.name.rsplit('-')[0]}-{digest.hexdigest()[:32]}.program"
        program = _read_program(file)
        if program is None:
            with _no_other_cache():
                program = lowered.compile()
            if not _write_program(file, program):
                return program, answer
        _write_entry(entry, file, answer)
        return program, answer


def forget() -> None:
    """Drop all programs of this process, as ``jax.clear_caches`` does; files stay."""
    for program in _all:
        program._loaded.clear()
    jax.clear_caches()


def compiled(function: Callable) -> Program:
    """``equinox.filter_jit``, with programs kept from one process to the next."""
    return Program(function, dict)


def compiled_for_few_runs(function: Callable) -> Program:
    """`compiled` with little optimisation, for programs that run once or a few times.

    Compilation takes a third of the time, a run twice as long. Values may differ by rounding.
    Within another program it is a part of that.
    """
    return Program(function, _few_runs)


@functools.cache
def _few_runs() -> dict:
    """What ``jit`` takes for it; nothing where XLA does not know these options."""
    options = {"xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 0}
    try:
        jax.jit(lambda: jnp.zeros(()), compiler_options=options)()
    except jax.errors.JaxRuntimeError:
        return {}
    return {"compiler_options": options}


def _slot(leaf: Any) -> Slot:
    return Slot(leaf.shape, leaf.dtype, getattr(leaf, "weak_type", False))


def _is_slot(leaf: Any) -> bool:
    return isinstance(leaf, Slot)


# --- files -------------------------------------------------------------------------------------


class _ForeignError(Exception):
    """Something of a user's own, whose changes cannot be seen."""


class _OfTheHouse(pickle.Pickler):
    """Takes classes and functions of the package and its libraries only."""

    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, type) or hasattr(value, "__code__"):
            home = str(getattr(value, "__module__", "")).split(".")[0]
            if home not in NAMED:
                raise _ForeignError(home)
        return NotImplemented


def _entry(function: Callable, options: dict, described: Any) -> Path | None:
    """The entry's file; None where the program is not to be kept."""
    folder = _folder()
    if folder is None or function.__module__.split(".")[0] != "quietbus":
        return None
    text = io.BytesIO()
    pickler = _OfTheHouse(text, protocol=5)
    pickler.fast = True  # what is equal reads equal, whether it is one object or two
    try:
        pickler.dump(described)
    except Exception:  # what cannot be told in a file cannot be found again
        return None
    name = f"{function.__module__}.{function.__qualname__} {sorted(options.items())}"
    digest = hashlib.sha256(name.encode() + text.getvalue()).hexdigest()
    return folder / _sources() / f"{function.__name__.strip('_')}-{digest[:32]}"


@functools.cache
def _folder() -> Path | None:
    """Of these versions, on this machine, with these settings; None to keep nothing."""
    cache = jax.config.values["jax_compilation_cache_dir"]
    if not cache or not jax.config.values["jax_enable_compilation_cache"]:
        return None
    if jax.default_backend() != "cpu":
        return None
    settings = [
        sys.version,
        *(version(library) for library in LIBRARIES),
        XLA_FLAGS,
        os.environ.get("EQX_ON_ERROR", ""),
        *(jax.config.values[each] for each in ("jax_enable_x64", "jax_debug_nans")),
        jax.config.values["jax_default_matmul_precision"],
        jax.device_count(),
        _processor(),
    ]
    digest = hashlib.sha256(repr(settings).encode()).hexdigest()
    return Path(cache) / "programs" / digest[:24]


@functools.cache
def _sources() -> str:
    """Stands for all lines of the package."""
    digest = hashlib.sha256()
    source = Path(__file__).parent
    for file in sorted(source.rglob("*.py")):
        digest.update(str(file.relative_to(source)).encode() + file.read_bytes())
    return digest.hexdigest()[:24]


def _processor() -> str:
    """What machine code depends on; where that is not told, the machine itself."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return repr(platform.uname())
    said = ("model name", "flags", "Features", "CPU part")
    return repr(sorted({line for line in lines if line.startswith(said)})) + platform.machine()


def _read_entry(entry: Path) -> tuple[Callable, Any] | None:
    found = _read(entry)
    if found is None:
        return None
    name, answer = found
    program = _read_program(entry.parents[1] / name)
    return None if program is None else (program, answer)


def _read_program(file: Path) -> Callable | None:
    found = _read(file)
    if found is None:
        return None
    payload, inputs, outputs = found
    _use_lapack()
    with contextlib.suppress(OSError):
        file.touch()  # used lately
    try:
        return serialize_executable.deserialize_and_load(
            payload,
            jax.tree.structure(((0,) * inputs, {})),
            jax.tree.structure([0] * outputs),
            execution_devices=jax.devices()[:1],
        )
    except Exception as error:  # whatever it is: the program is made anew
        _warn(f"{file}: a kept program cannot be loaded ({error}); it is made anew")
        return None


@functools.cache
def _use_lapack() -> None:
    """JAX points its programs to LAPACK when it lowers one that needs it, not when it loads one."""
    jax.jit(jnp.linalg.inv).lower(jnp.zeros((2, 2)))


@contextlib.contextmanager
def _no_other_cache() -> Iterator[None]:
    """Compile for real: machine code that JAX has read from its cache cannot be written again."""
    jax.config.update("jax_enable_compilation_cache", False)
    compilation_cache.reset_cache()
    try:
        yield
    finally:
        jax.config.update("jax_enable_compilation_cache", True)
        compilation_cache.reset_cache()


def _read(file: Path) -> Any:
    """What was written; None where there is nothing, or not what was written."""
    try:
        data = file.read_bytes()
    except OSError:
        return None
    digest, body = data[:32], data[32:]
    try:
        if hashlib.sha256(body).digest() != digest:
            raise ValueError("it is not as it was written")
        return pickle.loads(body)
    except Exception as error:  # whatever it is: the program is made anew
        _warn(f"{file}: a kept program cannot be read ({error}); it is made anew")
        return None


def _write_program(file: Path, program: jax.stages.Compiled) -> bool:
    try:
        payload, inputs, outputs = serialize_executable.serialize(program)
    except Exception:  # a program that calls back
        return False
    _make_room(file.parent)
    return _write(file, (payload, inputs.num_leaves, outputs.num_leaves))


def _write_entry(entry: Path, program: Path, answer: Any) -> None:
    with contextlib.suppress(pickle.PicklingError, AttributeError, TypeError):  # something local
        _write(entry, (program.name, answer))


def _write(file: Path, said: Any) -> bool:
    body = pickle.dumps(said)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file, "kept program") as stream:
            stream.write(hashlib.sha256(body).digest() + body)
    except OSError as error:
        _warn(f"compiled programs cannot be kept in {file.parent}: {error.strerror or error}")
        return False
    return True


def _make_room(folder: Path) -> None:
    """Remove what was not used for longest, of all versions and settings, beyond ROOM."""
    with contextlib.suppress(OSError):
        files = [(f.stat().st_mtime, f.stat().st_size, f) for f in folder.parent.rglob("*-*")]
        files = sorted(((t, s, f) for t, s, f in files if f.is_file()), reverse=True)
        total = 0
        for _, size, file in files:
            total += size
            if total > ROOM:
                file.unlink(missing_ok=True)


@functools.cache
def _warned() -> list[str]:
    return []


def _warn(text: str) -> None:
    """Once in a process."""
    if not _warned():
        _warned().append(text)
        warnings.warn(text, KeptProgramWarning, stacklevel=2)
