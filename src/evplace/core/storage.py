"""Outputs appear whole or not at all: a temporary name in the same folder, fsync, one rename.

While an output is being written it is locked; a second writer is refused at once. The lock is an
operating-system file lock: it dies with its process, so a killed writer blocks nobody. Temporary names cannot
be guessed, so that nobody can lay a link under them in a folder that is shared; what a killed writer left
under one goes when the same output is written again.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import hashlib
import json
import math
import os
import re
import secrets
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import InputError, OutputError

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_HERE, _EXCHANGE = -100, 2
"""Of Linux: paths count from the current folder (AT_FDCWD); two names change places (RENAME_EXCHANGE)."""


@contextlib.contextmanager
def new_folder(path: str | Path, overwrite: bool = False, mark: str = "") -> Iterator[Path]:
    """A temporary folder beside `path` that takes its name when the block ends well, else vanishes.

    `overwrite` replaces a folder that was written as this one is: one that is empty, or holds a file
    called `mark` (which may have wildcards). Raises OutputError where `path` exists otherwise or is a link,
    another process is writing it, or the disk is full.
    """
    target = named(path)
    partial = _temporary(target.name, target)
    with _explained(target), locked(target):
        _clean(target.name, target)
        check_new_folder(target, overwrite, mark)
        partial.mkdir()
        try:
            yield partial
            for file in partial.rglob("*"):
                _fsync(file)
            _replace(target, partial)
        finally:
            _remove(partial)


@contextlib.contextmanager
def new_file(path: str | Path, overwrite: bool = False) -> Iterator[Path]:
    """A temporary file name beside `path`; what the block writes there takes its name when it ends well.

    `overwrite` replaces a file, never a folder. Raises OutputError as `new_folder` does.
    """
    target = named(path)
    partial = _temporary(target.stem, target, target.suffix)
    with _explained(target), locked(target):
        _clean(target.stem, target, target.suffix)
        check_new_file(target, overwrite)
        try:
            yield partial
            _fsync(partial)
            partial.replace(target)
            _fsync(target.parent)
        finally:
            partial.unlink(missing_ok=True)


def check_new_folder(path: str | Path, overwrite: bool, mark: str) -> None:
    """OutputError where `new_folder` would refuse `path`: for saying so before the work."""
    target = named(path)
    _refuse_existing(target, overwrite)
    if not target.exists():
        return _check_place(target)
    if not target.is_dir():
        raise OutputError(f"{target} is a file, which no folder replaces: choose another name, or remove it")
    if any(target.iterdir()) and not (mark and any(target.glob(mark))):
        raise OutputError(
            f"{target} holds other things than what is to be written there (no {mark or 'sign of it'}), and "
            "is not replaced: choose another name, or remove it yourself"
        )
    return _check_place(target)


def check_new_file(path: str | Path, overwrite: bool) -> None:
    """OutputError where `new_file` would refuse `path`: for saying so before the work."""
    target = named(path)
    if target.is_dir():
        raise OutputError(f"{target} is a folder, which no file replaces: choose the name of a file")
    _refuse_existing(target, overwrite)
    _check_place(target)


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
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
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


def remove_left(path: str | Path) -> None:
    """Remove what a killed writer of `path` left beside it, unless another is writing it."""
    target = named(path)
    if target.parent.is_dir():
        with contextlib.suppress(OutputError), locked(target):
            _clean(target.name, target)


def write_json(path: Path, value: object) -> None:
    """`value` as indented JSON; NaN and infinity are refused, because JSON has none."""
    path.write_text(json.dumps(value, indent=1, allow_nan=False) + "\n", "utf-8")


def write_array(path: Path, array: NDArray[Any]) -> None:
    """A .npy file; unlike numpy's own writing, its error on a full disk is one that says so."""
    rows = np.ascontiguousarray(array).reshape(np.shape(array))
    with path.open("wb") as file:
        _write_header(file, rows.dtype, rows.shape)
        file.write(rows.data)


def read_bytes(path: Path, what: str) -> bytes:
    """The bytes of a file; InputError, naming `what` it should be, where there is none, or a device."""
    try:
        _refuse_device(path, what)
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {what}: {path}: {error.strerror}") from error


def is_stream(path: Path) -> bool:
    """Whether it is a pipe, a socket or a device, which may block for ever, or never end."""
    return path.exists() and not (path.is_file() or path.is_dir())


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
        _write_header(self._file, self._dtype, (self._length, *self._item_shape))


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
    if is_stream(path):
        raise InputError(f"cannot read {what}: {path} is no file")


def _refuse_existing(target: Path, overwrite: bool) -> None:
    if target.is_symlink():
        raise OutputError(f"{target} is a link to {target.readlink()}: give the name of what it points to")
    if is_stream(target):
        raise OutputError(f"{target} is a pipe or a device, which no output replaces: choose another name")
    if target.exists() and not overwrite:
        raise OutputError(f"{target} exists: choose another name, remove it, or add `overwrite=True`")


def _check_place(target: Path) -> None:
    """OutputError where the folder that an output is to stand in, or the nearest that exists, takes none."""
    place = next(folder for folder in target.absolute().parents if folder.exists())
    if not place.is_dir():
        raise OutputError(f"cannot write {target}: {place} is no folder")
    if not os.access(place, os.W_OK | os.X_OK):
        raise OutputError(f"cannot write {target}: nothing can be written in {place}")


def _temporary(begin: str, target: Path, end: str = "") -> Path:
    """A name beside an output that nobody can guess, by which it is known as its own."""
    return target.with_name(f".{begin}.{secrets.token_hex(8)}.partial{end}")


def _clean(begin: str, target: Path, end: str = "") -> None:
    """Remove what a killed writer of this output left; an old output that it was replacing comes back."""
    left = re.compile(rf"\.{re.escape(begin)}\.[0-9a-f]{{16}}\.(partial|old){re.escape(end)}")
    for path in sorted(target.parent.iterdir()):
        if left.fullmatch(path.name):
            if path.suffix == ".old" and not os.path.lexists(target):
                path.rename(target)
            else:
                _remove(path)


def _remove(path: Path) -> None:
    """A folder with all in it, a file, or a link, but not what it points to."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _replace(target: Path, partial: Path) -> None:
    """Give the folder `partial` the name of `target`; what stood there takes its place."""
    if not target.exists():
        partial.rename(target)
    elif not _exchange(target, partial):
        old = partial.with_suffix(".old")
        target.rename(old)
        try:
            partial.rename(target)
        except OSError:
            old.rename(target)
            raise
        _remove(old)
    _fsync(target.parent)


def _exchange(one: Path, other: Path) -> bool:
    """Have two names change places, in one step; False where the system or the disk cannot."""
    rename = getattr(ctypes.CDLL(None), "renameat2", None) if sys.platform == "linux" else None
    return rename is not None and rename(_HERE, bytes(one), _HERE, bytes(other), _EXCHANGE) == 0


def _write_header(file: Any, kind: np.dtype[Any], shape: tuple[int, ...]) -> None:
    header = {"descr": np.lib.format.dtype_to_descr(kind), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)


@contextlib.contextmanager
def _explained(target: Path) -> Iterator[None]:
    """Turn the system's errors of writing `target` into ours; others pass, for they are not about it."""
    try:
        yield
    except OSError as error:
        if error.errno in _FULL:
            raise OutputError(f"the disk is full: {target} was not written") from error
        if str(error.filename or "").startswith(str(target.parent)):
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
