"""Checkpoints: what a run has computed, on the disk while it goes, and where it can go on.

A checkpoint is a file of records: what was asked for, then again and again the outputs since the
last record with the state reached. Each record carries its length and checksum, so that one cut
short, by a killed program or a full disk, is known and left out, and all before it count.
"""

import io
import json
import os
import pathlib
import stat
import struct
import time
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO, Self

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from quietbus.build import build_satellite
from quietbus.dynamics.state import BodyState, State
from quietbus.model.element import Own
from quietbus.results.dataset import to_dataset
from quietbus.results.task import Task, differences
from quietbus.scenario import ScenarioError
from quietbus.solve.direct import Reached, Solution
from quietbus.solve.harmonic import HarmonicSolution, respond
from quietbus.writing import BEGINNINGS, OutputError, check_target

KIND = "checkpoint"
MAGIC = BEGINNINGS[KIND][0]
EVERY = 5.0  # [s] of wall time between records, at the least
_FRAME = struct.Struct("<QI")  # length of a record [bytes] and its CRC


class CheckpointError(ValueError):
    """A checkpoint that cannot be read, or is of another run; the message names it."""


class Checkpoint:
    """A checkpoint in writing. ``keep`` is for ``integrate``; ``flush`` ends it."""

    def __init__(self, file: BinaryIO, rows: int, wall_time: float):
        self.file, self.rows = file, rows
        self.started = time.perf_counter() - wall_time
        self.written = time.perf_counter()
        self.reached: Reached | None = None
        self.trouble = ""  # why nothing more is written

    @classmethod
    def create(cls, path: str | os.PathLike[str], task: Task) -> Self:
        """A new checkpoint; an older one of another task is replaced.

        Raises:
            OutputError: the file cannot be written, or is no checkpoint and so not replaced.
            CheckpointError: it holds a part of this very task, which can be continued.
        """
        check_target(path, KIND)
        _refuse_to_lose(pathlib.Path(path), task)
        pathlib.Path(path).unlink(missing_ok=True)
        try:
            file = open(path, "xb")  # noqa: SIM115
            file.write(MAGIC)
            _append(file, json.dumps(task.to_dict()).encode())
        except OSError as error:
            raise OutputError(f"{path}: cannot be written: {error.strerror}") from error
        return cls(file, 0, 0.0)

    @classmethod
    def resume(cls, path: str | os.PathLike[str], task: Task) -> tuple[Self, Reached | None]:
        """Go on with a checkpoint of this very task: the file, and what it holds.

        Raises:
            FileNotFoundError: no such checkpoint.
            CheckpointError: it cannot be read, or is of another task; the message says what
                differs.
            OutputError: it cannot be written on.
        """
        check_target(path, KIND)
        found = read(path)
        other = differences(found.task, task)
        if other:
            raise CheckpointError(
                f"{path}: is of another run, which differs in {', '.join(other)}: it can be "
                "continued only as it was begun; delete it to start anew"
            )
        try:
            file = open(path, "r+b")  # noqa: SIM115
            file.truncate(found.length)
            file.seek(found.length)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written: {error.strerror}") from error
        rows = 0 if found.reached is None else len(jax.tree.leaves(found.reached.kept)[0])
        return cls(file, rows, found.wall_time), found.reached

    @property
    def wall_time(self) -> float:
        """[s] that the run has taken, before a resumption too."""
        return time.perf_counter() - self.started

    def keep(self, reached: Reached) -> None:
        """What the run has reached; it is written if the last record is old enough."""
        self.reached = reached
        if time.perf_counter() - self.written >= EVERY:
            self.flush()

    def flush(self) -> None:
        """Write what has been reached; a disk that takes no more does not end the run."""
        if self.reached is None or self.trouble:
            return
        outputs, states = self.reached.kept
        arrays = dict(_named(_rows(outputs, self.rows), "outputs"))
        if states is not None:
            arrays |= dict(_named(_rows(states, self.rows), "states"))
        arrays |= dict(_named(self.reached.state, "state"))
        arrays["numbers"] = np.array(
            [
                self.reached.time,
                self.reached.step,
                self.reached.steps,
                self.reached.rejected,
                self.wall_time,
            ]
        )
        packed = io.BytesIO()
        np.savez(packed, allow_pickle=False, **arrays)
        try:
            _append(self.file, packed.getbuffer())
        except OSError as error:
            self.trouble = error.strerror or str(error)
        self.rows = len(outputs["bus_rate"])
        self.written, self.reached = time.perf_counter(), None

    def close(self) -> None:
        """Write the rest and close the file."""
        self.flush()
        try:
            self.file.close()
        except OSError as error:  # what could not be written stays in its buffer
            self.trouble = self.trouble or error.strerror or str(error)


@dataclass(frozen=True)
class Found:
    """What a checkpoint holds."""

    task: Task
    reached: Reached | None  # None: nothing yet
    wall_time: float  # [s]
    length: int  # [bytes] of the file as far as it is sound


def is_checkpoint(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as checkpoints do."""
    with open(path, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read(path: str | os.PathLike[str]) -> Found:
    """Read a checkpoint, as far as it is sound.

    Raises:
        FileNotFoundError: no such file.
        CheckpointError: it is none, or its head is damaged.
    """
    path = pathlib.Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    if not stat.S_ISREG(path.stat().st_mode):
        raise CheckpointError(f"{path}: is no regular file")
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise CheckpointError(f"{path}: is no checkpoint of quietbus")
        records = _records(file)
        try:
            head, length = next(records)
            task = Task.from_dict(json.loads(head))
        except StopIteration:
            raise CheckpointError(f"{path}: a checkpoint without a sound beginning") from None
        except (ValueError, KeyError, TypeError, AttributeError, ScenarioError) as error:
            raise CheckpointError(f"{path}: a checkpoint of no known task ({error})") from None
        parts = []
        try:
            for record, end in records:
                with np.load(io.BytesIO(record), allow_pickle=False) as arrays:
                    parts.append({name: arrays[name] for name in arrays.files})
                length = end
            return Found(task, *_joined(task, parts), length)
        except (ValueError, KeyError, TypeError, OSError, EOFError) as error:
            raise CheckpointError(f"{path}: a checkpoint with a foreign record ({error})") from None


def _refuse_to_lose(path: pathlib.Path, task: Task) -> None:
    try:
        found = read(path)
    except (FileNotFoundError, CheckpointError):
        return
    if found.reached is not None and not differences(found.task, task):
        raise CheckpointError(
            f"{path}: holds this very run up to t = {found.reached.time:g} s: resume it, or "
            "delete the file to start anew"
        )


def to_run(found: Found, source: str) -> xr.Dataset:
    """A checkpoint as a run of status "interrupted"; a harmonic run's jitter is computed.

    Raises:
        CheckpointError: it holds no output yet.
    """
    if found.reached is None:
        raise CheckpointError(f"{source}: a checkpoint that holds no output yet")
    scenario, reached = found.task.scenario, found.reached
    outputs, states = reached.kept
    count = len(outputs["bus_rate"])
    solution = Solution(
        np.arange(count) / scenario.simulation.output_rate,
        outputs,
        states,
        reached.state,
        reached.steps,
        reached.rejected,
        f"a checkpoint: the run had come to t = {reached.time:g} s",
        True,
    )
    if not found.task.method.jitter_apart:
        return to_dataset(found.task, solution, found.wall_time)
    assert states is not None
    satellite, view = build_satellite(scenario), found.task.view()
    jitter, _ = respond(satellite, solution, view)
    return to_dataset(found.task, HarmonicSolution(solution, jitter), found.wall_time)


def _append(file: BinaryIO, record: Any) -> None:
    """Add a record, or nothing that counts."""
    file.write(_FRAME.pack(len(record), zlib.crc32(record)))
    file.write(record)
    file.flush()
    os.fsync(file.fileno())


def _records(file: BinaryIO) -> Iterator[tuple[bytes, int]]:
    """Sound records from here on, each with the place where it ends."""
    size = os.fstat(file.fileno()).st_size
    while True:
        frame = file.read(_FRAME.size)
        if len(frame) < _FRAME.size:
            return
        length, checksum = _FRAME.unpack(frame)
        if length > size - file.tell():
            return
        record = file.read(length)
        if zlib.crc32(record) != checksum:
            return
        yield record, file.tell()


def _joined(task: Task, parts: list[dict[str, np.ndarray]]) -> tuple[Reached | None, float]:
    """All records together, and the wall time [s]."""
    if not parts:
        return None, 0.0
    last = parts[-1]
    whole = {
        name: np.concatenate([part[name] for part in parts])
        for name in last
        if name.startswith(("outputs.", "states."))
    }
    outputs: Any = {
        name.removeprefix(_OUTPUTS): rows
        for name, rows in whole.items()
        if name.startswith(_OUTPUTS)
    }
    states = _state(whole, "states") if task.method.jitter_apart else None
    reached, step, steps, rejected, wall_time = last["numbers"].tolist()
    state = jax.tree.map(jnp.asarray, _state(last, "state"))
    kept = (outputs, states)
    return Reached(reached, step, state, int(steps), int(rejected), kept), wall_time


def _rows(tree: Any, start: int) -> Any:
    return jax.tree.map(lambda leaf: leaf[start:], tree)


def _named(tree: Any, path: str) -> Iterator[tuple[str, np.ndarray]]:
    """Arrays of a tree by the paths of their places in it."""
    for keys, leaf in jax.tree_util.tree_leaves_with_path(tree):
        names = (str(getattr(key, "key", getattr(key, "name", ""))) for key in keys)
        yield ".".join((path, *names)), np.asarray(leaf)


_OUTPUTS = "outputs."


def _state(arrays: Mapping[str, np.ndarray], path: str) -> State:
    """The state that ``_named`` took apart; KeyError, ValueError for what is none."""
    parts: dict[str, dict[str, dict[str, Any]]] = {"bodies": {}, "own": {}}
    for name, value in arrays.items():
        if name.startswith(f"{path}."):
            kind, owner, field = name.removeprefix(f"{path}.").split(".")
            parts[kind].setdefault(owner, {})[field] = value
    bodies = {name: BodyState(**fields) for name, fields in parts["bodies"].items()}
    own = {name: Own(**fields) for name, fields in parts["own"].items()}
    return State(bodies, own)
