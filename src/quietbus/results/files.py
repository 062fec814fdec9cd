"""Files of runs: written, read and checked."""

import contextlib
import hashlib
import io
import os
import pathlib
import warnings
from collections.abc import Iterator
from typing import Any, BinaryIO

import h5netcdf
import h5py
import xarray as xr

from quietbus.arguments import path as argument_path
from quietbus.results.characters import as_characters
from quietbus.results.checkpoint import is_checkpoint, read, to_run
from quietbus.results.checks import check_file_parts, check_heaps, check_run
from quietbus.results.origin import refuse_no_run
from quietbus.writing import replacing

SIGNATURE = b"\x89HDF\r\n\x1a\n"  # with which HDF5 files begin
# behind the end of what HDF5 reads, with the hash of all before; who changes the file cuts it off
SEAL = b"quietbus seal 1\n"


def save_run(run: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a run as NetCDF-4; an older run of that name is replaced once the new one is whole.

    Raises:
        OutputError: (an OSError) the file cannot be written, or is no run and so not replaced.
    """
    path = argument_path("path", path)
    refuse_no_run(run)
    with replacing(path, "run (NetCDF-4)") as file:
        disk = _Disk(file.raw)
        with h5netcdf.File(disk, "w") as stored:
            as_characters(run).dump_to_store(xr.backends.H5NetCDFStore(stored))
        if disk.refused is not None:
            raise disk.refused
        file.seek(0, os.SEEK_END)
        file.write(SEAL + _digest(file, file.tell()))


def _digest(file: BinaryIO, size: int) -> bytes:
    """Hash of the first bytes of a file, whose place is then behind them."""
    digest = hashlib.blake2b(digest_size=16)
    file.seek(0)
    while size:
        part = file.read(min(size, 1 << 20))
        if not part:
            break
        digest.update(part)
        size -= len(part)
    return digest.digest()


def _refuse_broken_seal(file: BinaryIO, size: int) -> None:
    """Tell a file that is not as ``save_run`` wrote it; one changed by HDF5's tools has no seal."""
    inner = size - len(SEAL) - 16
    if inner <= 0:
        return
    file.seek(inner)
    if file.read(len(SEAL)) == SEAL and file.read(16) != _digest(file, inner):
        raise ValueError("its checksum is wrong: it was damaged since it was written")


class _Disk(io.RawIOBase):
    """A file for HDF5 to write to, which ends in a segmentation fault where a write fails.

    Here none does: the first refusal is kept, and what comes after it goes into memory, where HDF5
    finds it again, until the file is closed and given up.
    """

    def __init__(self, file: io.RawIOBase):
        self.file, self.refused = file, None
        self.position = self.size = 0
        self.unwritten: list[tuple[int, bytes]] = []

    refused: OSError | None

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self.position

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self.position, os.SEEK_END: self.size}[whence]
        self.position = start + offset
        return self.position

    def readinto(self, buffer: Any) -> int:
        start, end = self.position, min(self.position + len(buffer), self.size)
        found = bytearray(max(end - start, 0))
        with self._noted():
            self.file.seek(start)
            self.file.readinto(found)
        for at, data in self.unwritten:
            low, high = max(at, start), min(at + len(data), end)
            if low < high:
                found[low - start : high - start] = data[low - at : high - at]
        buffer[: len(found)] = found
        self.position += len(found)
        return len(found)

    def write(self, data: Any) -> int:
        data, start = memoryview(data).cast("B"), self.position
        self.position += len(data)
        self.size = max(self.size, self.position)
        if self.refused is None:
            with self._noted():
                self._put(start, data)
        if self.refused is not None:
            self.unwritten.append((start, bytes(data)))
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        self.size = self.position if size is None else size
        with self._noted():
            self.file.truncate(self.size)
        return self.size

    def _put(self, start: int, data: memoryview) -> None:
        self.file.seek(start)
        while data:
            data = data[self.file.write(data) :]

    @contextlib.contextmanager
    def _noted(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.refused = self.refused or error


def load_run(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a run that ``save_run`` or ``quietbus simulate -o`` has written, or a checkpoint.

    A checkpoint, of a run that goes on or was killed, is a run of status "interrupted".

    Raises:
        FileNotFoundError: no such file.
        ValueError: the file is not a run of quietbus, or a damaged one; the message says what of
            it is wrong.
    """
    path = pathlib.Path(argument_path("path", path))
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; expected the file of a run")
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    if not path.is_file():
        raise ValueError(f"{path}: is a pipe, socket or device; expected the file of a run")
    try:
        run = to_run(read(path), str(path)) if is_checkpoint(path) else _load(path)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    try:
        check_run(run)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return run


def _load(path: pathlib.Path) -> xr.Dataset:
    """All of a NetCDF-4 file in memory."""
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(SIGNATURE)) != SIGNATURE:
            raise ValueError(f"{path}: not a NetCDF-4 file (expected a run, as simulate writes it)")
    try:
        with path.open("rb") as file:
            _refuse_broken_seal(file, size)
            check_heaps(file, size)
        with path.open("rb") as file, h5py.File(file, "r") as stored:
            check_file_parts(stored, size)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of xarray, about files that are no runs anyway
                with xr.open_dataset(path, engine="h5netcdf") as opened:
                    return opened.load()
    except Exception as error:  # the readers of damaged files raise whatever they stumble over
        told = " ".join(str(error).split())[:200] or type(error).__name__
        raise ValueError(f"{path}: not a NetCDF-4 file ({told})") from None
