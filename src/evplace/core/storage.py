"""Outputs appear whole or not at all: a temporary name in the same folder, fsync, rename.

While an output is being written it is locked; a second writer is refused at once. The lock is an
operating-system file lock: it dies with its process, so a killed writer blocks nobody.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import math
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import InputError, OutputError


@contextlib.contextmanager
def new_folder(path: str | Path, overwrite: bool = False, mark: str = "") -> Iterator[Path]:
    """A temporary folder beside `path` that takes its name when the block ends well, else vanishes.

    `overwrite` replaces a folder that was written as this one is: one that is empty, or holds a file
    called `mark` (which may have wildcards). Raises OutputError where `path` exists otherwise, another
    process is writing it, or the disk is full.
    """
    target = named(path)
    partial = target.with_name(f".{target.name}.partial")
    with _explained(target, partial), locked(target):
        check_new_folder(target, overwrite, mark)
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
        try:
            yield partial
            for file in partial.rglob("*"):
                _fsync(file)
            _replace(target, partial)
        finally:
            shutil.rmtree(partial, ignore_errors=True)


@contextlib.contextmanager
def new_file(path: str | Path, overwrite: bool = False) -> Iterator[Path]:
    """A temporary file name beside `path`; what the block writes there takes its name when it ends well.

    `overwrite` replaces a file, never a folder. Raises OutputError as `new_folder` does.
    """
    target = named(path)
    partial = target.with_name(f".{target.stem}.partial{target.suffix}")
    with _explained(target, partial), locked(target):
        check_new_file(target, overwrite)
        try:
            yield partial
            _fsync(partial)
            _replace(target, partial)
        finally:
            partial.unlink(missing_ok=True)


def check_new_folder(path: str | Path, overwrite: bool, mark: str) -> None:
    """OutputError where `new_folder` would refuse `path`: for saying so before the work."""
    target = named(path)
    _refuse_existing(target, overwrite)
    if not target.exists():
        return
    if not target.is_dir():
        raise OutputError(f"{target} is a file, which no folder replaces: choose another name, or remove it")
    if any(target.iterdir()) and not (mark and any(target.glob(mark))):
        raise OutputError(
            f"{target} holds other things than what is to be written there (no {mark or 'sign of it'}), and "
            "is not replaced: choose another name, or remove it yourself"
        )


def check_new_file(path: str | Path, overwrite: bool) -> None:
    """OutputError where `new_file` would refuse `path`: for saying so before the work."""
    target = named(path)
    if target.is_dir():
        raise OutputError(f"{target} is a folder, which no file replaces: choose the name of a file")
    _refuse_existing(target, overwrite)


def named(path: str | Path) -> Path:
    """`path`, if it ends in a name that an output can have; OutputError where it is . or .. or a disk."""
    target = Path(path)
    if target.name in ("", ".."):
        raise OutputError(f"'{path}' is no name of an output: give the name of what is to be written")
    return target


@contextlib.contextmanager
def locked(target: Path) -> Iterator[None]:
    """Hold the one writer's place for `target`; OutputError if another process holds it, or it cannot be."""
    lock = named(target).with_name(f".{target.name}.lock")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise OutputError(f"cannot write {target}: {error.strerror or error}") from error
    try:
        # A lock on a file that its last owner has removed meanwhile is no lock.
        if not (_try_lock(handle) and lock.exists() and os.path.samestat(os.fstat(handle), lock.stat())):
            raise OutputError(
                f"{target} is being written by another process: wait for it, or write elsewhere"
            )
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)
    finally:
        os.close(handle)


def write_json(path: Path, value: object) -> None:
    """`value` as indented JSON; NaN and infinity are refused, because JSON has none."""
    path.write_text(json.dumps(value, indent=1, allow_nan=False) + "\n", "utf-8")


def read_bytes(path: Path, what: str) -> bytes:
    """The bytes of a file; InputError, naming `what` it should be, where there is none, or a device."""
    try:
        _refuse_device(path, what)
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {what}: {path}: {error.strerror}") from error


def read_json(path: Path, what: str) -> dict[str, Any]:
    """The JSON object in `path`; InputError, naming `what` it should be, where there is none."""
    try:
        value = json.loads(read_bytes(path, what), parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{what} is damaged: {path} is not JSON ({error})") from error
    if not isinstance(value, dict):
        raise InputError(f"{what} is damaged: {path} holds no JSON object")
    return value


class GrowingArray:
    """A .npy file that grows along its first axis, so that no traverse has to fit into memory."""

    def __init__(self, path: Path, dtype: type[np.generic], item_shape: tuple[int, ...]) -> None:
        """Begin the file `path` with no items of `item_shape`."""
        self._dtype, self._item_shape, self._length = np.dtype(dtype), item_shape, 0
        self._file = path.open("wb")
        self._write_header()

    def append(self, item: NDArray[Any] | np.generic | int | float) -> None:
        """Add one item."""
        array = np.asarray(item, self._dtype)
        assert array.shape == self._item_shape, (array.shape, self._item_shape)
        self._file.write(array.tobytes())
        self._length += 1

    def extend(self, items: NDArray[Any]) -> None:
        """Add many items at once."""
        array = np.ascontiguousarray(items, self._dtype)
        assert array.shape[1:] == self._item_shape, (array.shape, self._item_shape)
        self._file.write(array.tobytes())
        self._length += len(array)

    def close(self) -> None:
        """Write the final length into the header; numpy leaves room in it for that."""
        self._file.seek(0)
        self._write_header()
        self._file.close()

    def discard(self) -> None:
        """Let go of a file that will not be used; harmless after `close`."""
        with contextlib.suppress(OSError):
            self._file.close()

    def _write_header(self) -> None:
        shape = (self._length, *self._item_shape)
        header = {"descr": self._dtype.str, "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(self._file, header)


def read_array(path: str | Path, what: str, memory_mapped: bool = False) -> NDArray[Any]:
    """The array in a .npy file; InputError, naming `what` it should be, where there is none.

    It is mapped first, whatever is wanted: then what a damaged header claims is held against the file's
    length, where reading would allocate it. Nothing is unpickled.
    """
    try:
        _refuse_device(Path(path), what)
        with np.errstate(over="raise"):  # a shape whose size no number holds
            array: NDArray[Any] = np.lib.format.open_memmap(path, mode="r")
        return array if memory_mapped else np.array(array)
    except OSError as error:
        raise InputError(f"cannot read {what}: {path}: {error.strerror or error}") from error
    except (ValueError, TypeError, EOFError, ArithmeticError) as error:
        raise InputError(f"{what} is damaged: {path} is not a whole .npy array ({error})") from error


def sha256(path: Path) -> str:
    """The checksum of a file's bytes, as hexadecimal text."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _finite(text: str) -> float:
    """A number of JSON; ValueError for NaN, infinity, and what is too large for any but that."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is no finite number")
    return value


def _refuse_device(path: Path, what: str) -> None:
    """InputError for a pipe or a device, which would be read for ever."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise InputError(f"cannot read {what}: {path} is no file")


def _refuse_existing(target: Path, overwrite: bool) -> None:
    if target.exists() and not overwrite:
        raise OutputError(f"{target} exists: choose another name, remove it, or add `overwrite=True`")


def _replace(target: Path, partial: Path) -> None:
    """Give `partial` the name of `target`; what stood there goes only once the new one is in its place."""
    old = target.with_name(f".{target.name}.old")
    if target.exists():
        target.rename(old)
    try:
        partial.rename(target)
    except OSError:
        if old.exists():
            old.rename(target)
        raise
    _fsync(target.parent)
    if old.is_dir():
        shutil.rmtree(old)
    else:
        old.unlink(missing_ok=True)


@contextlib.contextmanager
def _explained(target: Path, partial: Path) -> Iterator[None]:
    """Turn the system's errors of writing `target` into ours; others pass, for they are not about it."""
    try:
        yield
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise OutputError(f"the disk is full: {target} was not written") from error
        names = str(error.filename or "")
        if names.startswith((str(partial), str(target.parent))):
            raise OutputError(f"cannot write {target}: {error.strerror or error}") from error
        raise


def _fsync(path: Path) -> None:
    """Have the bytes on the disk before the name says that they are; folders only where the system can."""
    if path.is_dir() and sys.platform == "win32":
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _try_lock(handle: int) -> bool:
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
