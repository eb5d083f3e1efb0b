"""Files of the code of compiled loops, named after all that it depends on: nothing stale is found.

Bitcode is the same for all processors of a kind and comes with the package; machine code is of one processor,
and kept in a folder of the user's own. A file ends in a checksum of its place and its content: one that was
damaged or moved is as if it were not there.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.util
import inspect
import os
import secrets
import stat
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple

import numpy as np

from evplace.core._arguments import DATA

FORMAT = 2
"""Of the files; counted up where an entry is called otherwise."""
SHIPPED = Path(__file__).with_name("_shipped")
"""The package's own folder of bitcode; `python -m evplace_lab.cli.precompile` fills it."""
CHECKSUM = 32
CONSTANTS = (bool, int, float, complex, str, tuple, np.generic, np.ndarray)
"""What a compiled loop may use by name, and holds as it was then."""
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


class Code(NamedTuple):
    """What a file holds."""

    returns: str
    """What the loop returns, by numba's name."""
    content: bytes
    """Bitcode or machine code; nothing of a loop that only numba itself can call."""


UNFIT = Code("", b"")


def shipped(name: str) -> Code | None:
    """Bitcode that came with the package."""
    return _read(SHIPPED / name)


def ship(name: str, code: Code) -> None:
    """Have it come with the package."""
    SHIPPED.mkdir(exist_ok=True)
    _write(SHIPPED / name, code)


def kept(name: str) -> Code | None:
    """Machine code for this processor."""
    folder = _own_folder()
    return None if folder is None else _read(folder / name)


def keep(name: str, code: Code) -> None:
    """Keep machine code, where that is possible, in place of what was made of another source."""
    with contextlib.suppress(OSError):  # read-only, or full: it is made anew each time
        if (folder := _own_folder(make=True)) is not None:
            _write(folder / name, code)


# A file's name


def name_of(loop: Any, kinds: Iterable[Any]) -> str | None:
    """Which loop it is, for which arguments; then of which source, or None where no file has that."""
    stem = f"{loop.__module__.rpartition('.')[2]}.{loop.__name__}"
    machine = (FORMAT, DATA, sys.platform, os.uname().machine)
    what = _digest(map(str, (loop.__module__, *machine, *kinds)))
    try:
        return f"{stem}-{what}.{_digest(_sources(loop, kinds))}"
    except OSError:
        return None


def symbol_of(name: str) -> str:
    """What the entry in a file of this name is called; no other is called so."""
    return f"entry_{_digest([name])}"


def _digest(words: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]


def _sources(loop: Any, kinds: Iterable[Any]) -> list[str]:
    """All that a loop reaches: files by their checksums, constants by their values, and its options."""
    found = {
        f"{name} {sorted(value) if isinstance(value, set) else value}" for name, value in loop.options.items()
    }
    seen: set[Any] = set()
    waiting = [("", value) for value in (loop, *filter(inspect.isclass, kinds))]
    while waiting:
        name, value = waiting.pop()
        if isinstance(value, CONSTANTS):
            found.add(f"{name} {value.tolist() if isinstance(value, np.generic | np.ndarray) else value}")
        elif _is_ours(value, loop) and value not in seen:
            seen.add(value)
            found.add(_checksum_of(getattr(sys.modules.get(value.__module__), "__file__", "") or ""))
            waiting += _used_by(value)
    return sorted(found)


def _is_ours(value: Any, loop: Any) -> bool:
    module = str(getattr(value, "__module__", ""))
    return callable(value) and (module == loop.__module__ or module.startswith("evplace"))


def _used_by(value: Any) -> Iterator[tuple[str, Any]]:
    """The function in a compiled loop, and what is called before it is compiled; what a function names."""
    if hasattr(value, "loop"):
        yield from (("", value.loop), ("", value.before))
    elif inspect.isfunction(function := inspect.unwrap(value)):
        yield from ((name, function.__globals__.get(name)) for name in _names(function.__code__))


def _names(code: CodeType) -> Iterator[str]:
    """Those in functions within a function, too."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


@functools.cache
def _checksum_of(file: str) -> str:
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


# Folders and files


@functools.cache
def _environment() -> str:
    """All else that machine code may depend on."""
    import llvmlite
    from llvmlite import binding

    numba = importlib.util.find_spec("numba")
    origin = "" if numba is None or numba.origin is None else numba.origin
    features = binding.get_host_cpu_features().flatten()
    return _digest([
        __file__, sys.version, np.__version__, llvmlite.__version__, origin, _time_of_change(origin),
        binding.get_process_triple(), binding.get_host_cpu_name(), features,
    ])  # fmt: skip


def _time_of_change(file: str) -> str:
    try:
        return str(Path(file).stat().st_mtime_ns)
    except OSError:
        return ""


def _own_folder(make: bool = False) -> Path | None:
    """Of this processor and these versions; None where there is none that only the user can write to."""
    try:
        folder = _cache() / _environment()
        if make:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.lstat()
    except (OSError, RuntimeError):  # a user without a home
        return None
    is_own = stat.S_ISDIR(status.st_mode) and status.st_uid == os.geteuid()
    return folder if is_own and not status.st_mode & OTHERS_WRITE else None


def _cache() -> Path:
    if "NUMBA_CACHE_DIR" in os.environ:
        return Path(os.environ["NUMBA_CACHE_DIR"], "evplace")
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "evplace"


def _read(path: Path) -> Code | None:
    """None where there is no such file, or it was damaged."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    body, checksum = content[:-CHECKSUM], content[-CHECKSUM:]
    if _checksum(path, body) != checksum:
        return None
    returns, _, rest = body.partition(b"\n")
    return Code(returns.decode(), rest)


def _write(path: Path, code: Code) -> None:
    """In one step, whoever else writes it; what was made of another source goes."""
    for stale in path.parent.glob(f"{path.name.rpartition('.')[0]}.*"):
        if stale != path:
            stale.unlink(missing_ok=True)
    body = code.returns.encode() + b"\n" + code.content
    partial = path.with_name(f"{path.name}.{secrets.token_hex(8)}")
    try:
        partial.write_bytes(body + _checksum(path, body))
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _checksum(path: Path, body: bytes) -> bytes:
    return hashlib.sha256(f"{path.parent.name}/{path.name}\n".encode() + body).digest()
