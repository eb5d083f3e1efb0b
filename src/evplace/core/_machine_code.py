"""The machine code of compiled loops, kept in files: loading it takes a tenth of the time of importing numba.

numba compiles a loop behind an entry that takes arrays by their addresses, and gives the code as LLVM's text;
llvmlite alone makes a file of that, and loads it again. This is for loops that need nothing of numba when
they run: they make no arrays, and are called with plain arrays and numbers. On systems where it was never
tried, and for all other loops, numba does all as ever.

A file is named after all that its code depends on, so that nothing stale is found, and ends in a checksum.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import importlib.util
import inspect
import os
import re
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

TRIED_ON = (("linux", "x86_64"),)
"""Systems and processors, as Python names them."""
FORMAT = 1
"""Of the files; counted up where an entry is called otherwise."""
WORD = 8
"""Bytes of an address."""
DATA = object.__basicsize__ // WORD
DIMENSIONS, SHAPE = DATA + 1, DATA + 2
"""Where an array of numpy holds the address of its data, the number of its dimensions and the address of its
shape, in words (PyArrayObject in numpy's C API)."""
PLAIN = 0x101
"""Flags of an array without gaps whose address suits its type (numpy's C API)."""
NUMBERS = frozenset("?bBhHiIlLqQfd")
"""Types of numbers that arrays may hold."""
C_LIBRARY = frozenset("memcpy memmove memset exp log pow sin cos floor ceil expf logf powf".split())
"""What machine code may call: every process of Python has it."""
RETURNS: dict[str, Any] = {
    "none": None,
    "bool": ctypes.c_bool,
    "int64": ctypes.c_int64,
    "uint64": ctypes.c_uint64,
    "float64": ctypes.c_double,
}
"""What a loop may return, by numba's name."""
CHECKSUM = 32
WITHOUT_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of numba for what Python does not call."""
ALONE = WITHOUT_WRAPPERS | {"_nrt": False}
"""And for what must make no arrays: it does not count references to them either."""

Kinds = tuple[Any, ...]
"""Of arguments, one after another: dtype and dimensions of an array, the class of a number, class and length
of a tuple and then the kinds of its fields, None."""
Entry = Callable[[list[Any]], Any]
"""Calls a loop with addresses and numbers, and gives what it returns."""


class UnfitError(Exception):
    """Arguments with which only numba itself can call a loop."""


class Code(NamedTuple):
    """What a file holds."""

    symbol: str
    """The entry's name."""
    returns: str
    """What the loop returns, by numba's name."""
    machine: bytes


UNFIT = Code("", "", b"")
"""Kept of a loop that only numba itself can call."""


def flattened(arguments: tuple[Any, ...]) -> tuple[Kinds, list[Any]]:
    """The kinds of arguments, and what an entry takes of them; UnfitError where one is not plain."""
    kinds: list[Any] = []
    values: list[Any] = []
    _flatten(arguments, kinds, values)
    return tuple(kinds), values


def _flatten(arguments: tuple[Any, ...], kinds: list[Any], values: list[Any]) -> None:
    for value in arguments:
        kind = type(value)
        if isinstance(value, np.ndarray):
            if value.flags.num & PLAIN != PLAIN or not value.ndim or value.dtype.char not in NUMBERS:
                raise UnfitError
            kinds += (value.dtype, value.ndim)
            values += (id(value), id(value))
        elif kind in (int, bool, float):
            if kind is int and not -(1 << 63) <= value < 1 << 63:
                raise UnfitError
            kinds.append(kind)
            values.append(value)
        elif value is None:
            kinds.append(None)
        elif isinstance(value, np.generic) and value.dtype.char in NUMBERS:
            kinds.append(kind)
            values.append(value.item())
        elif isinstance(value, tuple):
            kinds += (kind, len(value))
            _flatten(value, kinds, values)
        else:
            raise UnfitError


def entry_of(loop: Any, kinds: Kinds) -> Entry | None:
    """The entry of a compiled loop for arguments of these kinds; it is compiled where no file has it.

    None where numba itself must call it.
    """
    if not _is_known_here():
        return None
    name = _file_name(loop, kinds)
    code = next(filter(None, (_read(folder / name) for folder in _folders(loop))), None)
    if code is None:
        code = _compiled(loop, kinds, f"entry_{_digest([name])}")
        _write(loop, name, code)
    return _loaded(code, kinds) if code.machine else None


@functools.cache
def _is_known_here() -> bool:
    """Whether it was tried on such a system, and arrays lie in memory as entries read them."""
    if sys.implementation.name != "cpython" or (sys.platform, os.uname().machine) not in TRIED_ON:
        return False
    array = np.empty((3, 5), np.int8)
    words = (ctypes.c_int64 * (SHAPE + 1)).from_address(id(array))
    if (words[DATA], words[DIMENSIONS] & 0xFFFFFFFF) != (array.ctypes.data, array.ndim):
        return False
    return tuple((ctypes.c_ssize_t * 2).from_address(words[SHAPE])) == array.shape


# What a file's name says


def _file_name(loop: Any, kinds: Kinds) -> str:
    """Which code it is, for which Python and processor; then of which source it was made."""
    what = _digest([*map(str, kinds), *_environment()])
    return f"{_stem(loop)}-{what}.{_digest(_sources(loop))}.code"


def _stem(loop: Any) -> str:
    return f"{loop.__module__.rpartition('.')[2]}.{loop.__name__}"


def _digest(words: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]


@functools.cache
def _environment() -> list[str]:
    import llvmlite
    from llvmlite import binding

    numba = importlib.util.find_spec("numba")
    origin = "" if numba is None or numba.origin is None else numba.origin
    features = binding.get_host_cpu_features().flatten()
    return [
        str(FORMAT), sys.version, np.__version__, llvmlite.__version__, _stamp(origin),
        binding.get_process_triple(), binding.get_host_cpu_name(), features,
    ]  # fmt: skip


def _sources(loop: Any) -> list[str]:
    """The files that the loop, and all that it calls, stand in, with their times of change."""
    found: dict[Any, str] = {}
    _reach(loop.loop, found)
    return sorted(map(_stamp, set(found.values())))


def _reach(function: Any, found: dict[Any, str]) -> None:
    found[function] = function.__code__.co_filename
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        called = getattr(value, "loop", value)
        if inspect.isfunction(called) and called not in found and called.__module__.startswith("evplace"):
            _reach(called, found)


def _stamp(path: str) -> str:
    try:
        status = Path(path).stat()
    except OSError:
        return path
    return f"{path} {status.st_mtime_ns} {status.st_size}"


# Files


def _folders(loop: Any) -> Iterator[Path]:
    """Where files may lie, that which is written to first."""
    if "NUMBA_CACHE_DIR" in os.environ:
        yield Path(os.environ["NUMBA_CACHE_DIR"]) / "evplace"
        return
    yield Path(loop.loop.__code__.co_filename).parent / "__pycache__"
    yield Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "evplace"


def _read(path: Path) -> Code | None:
    """None where there is no such file, or it was damaged."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    body, checksum = content[:-CHECKSUM], content[-CHECKSUM:]
    if hashlib.sha256(body).digest() != checksum:
        return None
    symbol, returns, machine = body.split(b"\n", 2)
    return Code(symbol.decode(), returns.decode(), machine)


def _write(loop: Any, name: str, code: Code) -> None:
    """Keep it where that is possible, in place of what was made of another source."""
    body = b"\n".join([code.symbol.encode(), code.returns.encode(), code.machine])
    for folder in _folders(loop):
        partial = folder / f"{name}.{os.getpid()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for stale in folder.glob(f"{name.rsplit('.', 2)[0]}.*.code"):
                stale.unlink()
            partial.write_bytes(body + hashlib.sha256(body).digest())
            partial.replace(folder / name)
        except OSError:  # read-only, or full: the next folder, else it is compiled anew each time
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)
            continue
        return


# To make machine code


_state = threading.local()


def compiles() -> bool:
    """Whether this thread compiles machine code that must stand alone."""
    return getattr(_state, "compiles", False)


def _compiled(loop: Any, kinds: Kinds, name: str) -> Code:
    """The code, or UNFIT; `name` is that of the entry, and no other entry's."""
    _state.compiles = True
    try:
        return _compiled_alone(loop, kinds, name)
    except Exception:  # numba fails in many ways where arrays are made; all else it will say again
        return UNFIT
    finally:
        _state.compiles = False


def _compiled_alone(loop: Any, kinds: Kinds, name: str) -> Code:
    import numba
    from llvmlite import binding

    text, types = _entry_text(kinds, name)
    classes = {f"class_{at}": kind for at, kind in enumerate(kinds) if isinstance(kind, type)}
    scope: dict[str, Any] = {"loop": loop.alone, "carray": numba.carray, **classes}
    exec(text, scope)
    entry = numba.njit(tuple(types), **WITHOUT_WRAPPERS)(scope[name])
    made = entry.overloads[entry.signatures[0]]
    returns = str(numba.types.unliteral(made.signature.return_type))
    module = binding.parse_assembly(entry.inspect_llvm(entry.signatures[0]))
    symbol = made.fndesc.llvm_func_name
    if returns not in RETURNS or not _set_alone(module, symbol):
        return UNFIT
    return Code(symbol, returns, _machine().emit_object(module))


def _entry_text(kinds: Kinds, name: str) -> tuple[str, list[Any]]:
    """A function that takes what `flattened` gives and calls `loop`, and the types of what it takes."""
    from numba import types
    from numba.np.numpy_support import from_dtype

    parameters: list[str] = []
    taken: list[Any] = []
    left = iter(enumerate(kinds))

    def value() -> str:
        at, kind = next(left)
        if kind is None:
            return "None"
        if isinstance(kind, np.dtype):
            _, dimensions = next(left)
            parameters.extend((f"array_{at}", f"shape_{at}"))
            taken.extend(types.CPointer(types.CPointer(of)) for of in (from_dtype(kind), types.intp))
            lengths = "".join(f"shape_{at}[{SHAPE}][{axis}], " for axis in range(dimensions))
            return f"carray(array_{at}[{DATA}], ({lengths}))"
        if issubclass(kind, tuple):
            fields = "".join(f"{value()}, " for _ in range(next(left)[1]))
            return f"({fields})" if kind is tuple else f"class_{at}({fields})"
        parameters.append(f"number_{at}")
        is_float = issubclass(kind, float | np.floating)
        taken.append(types.float64 if is_float else types.int64)
        return f"number_{at}" if kind in (int, float) else f"class_{at}(number_{at})"

    values = []
    with contextlib.suppress(StopIteration):
        while True:
            values.append(value())
    return f"def {name}({', '.join(parameters)}):\n    return loop({', '.join(values)})\n", taken


def _set_alone(module: Any, entry: str) -> bool:
    """Leave nothing to be seen or called but the entry; whether that calls only what every process has."""
    counting = {each.name for each in module.functions if each.name.startswith("NRT_")}
    missing = {each.name for each in [*module.functions, *module.global_variables] if each.is_declaration}
    code = ""
    for function in module.functions:
        if function.name in counting:  # numba's counting of references
            function.linkage = "available_externally"
        elif not function.is_declaration:
            code += str(function)
            function.linkage = "external" if function.name == entry else "internal"
    named = {name.strip('"') for name in re.findall(r'@([\w.$]+|"[^"]+")', code)}
    called = {name for name in named & (missing | counting) if not name.startswith("llvm.")}
    return called <= C_LIBRARY


# To call it


@functools.cache
def _machine() -> Any:
    """Makes code for this processor, as numba does."""
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    features = binding.get_host_cpu_features().flatten()
    target = binding.Target.from_triple(binding.get_process_triple())
    return target.create_target_machine(binding.get_host_cpu_name(), features, opt=3, jit=True)


@functools.cache
def _engine() -> Any:
    from llvmlite import binding

    machine = _machine()
    return binding.create_mcjit_compiler(binding.parse_assembly(""), machine)


def _loaded(code: Code, kinds: Kinds) -> Entry:
    from llvmlite import binding

    engine = _engine()
    engine.add_object_file(binding.ObjectFileRef.from_data(code.machine))
    engine.finalize_object()
    taken = [kind for each in kinds for kind in _handed(each)]
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *taken)(
        engine.get_function_address(code.symbol)
    )
    returns = RETURNS[code.returns]

    def entry(values: list[Any]) -> Any:
        result, fault = (returns or ctypes.c_void_p)(), ctypes.c_void_p()
        if call(ctypes.addressof(result), ctypes.addressof(fault), *values):
            raise ArithmeticError("a compiled loop failed: it divided by zero")
        return None if returns is None else result.value

    return entry


def _handed(kind: Any) -> list[Any]:
    """What is handed over of one kind."""
    if isinstance(kind, np.dtype):
        return [ctypes.c_void_p, ctypes.c_void_p]
    if kind is None or isinstance(kind, int) or issubclass(kind, tuple):
        return []
    return [ctypes.c_double if issubclass(kind, float | np.floating) else ctypes.c_int64]
