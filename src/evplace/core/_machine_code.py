"""The machine code of compiled loops: loading it takes a tenth of the time of importing numba.

numba gives a loop as LLVM's bitcode, once for all processors of a kind, and that may come with the package.
llvmlite alone makes machine code of it, which is kept for the next time, and loads it. On systems where it
was never tried, and for loops that need more, numba does all as ever.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
from collections.abc import Callable
from typing import Any

from evplace.core import _bitcode
from evplace.core._arguments import RETURNS, Kinds, handed, is_known_here
from evplace.core._code_files import Code, keep, kept, name_of, shipped, symbol_of

Entry = Callable[[list[Any]], Any]
"""Calls a loop with addresses and numbers, and gives what it returns."""
made: dict[str, Code] = {}
"""The bitcode that numba made in this process, by the names of its files."""


def entry_of(loop: Any, kinds: Kinds) -> Entry | None:
    """The entry of a compiled loop for arguments of these kinds; it is compiled where no file has it.

    None where numba itself must call it.
    """
    if not is_known_here() or (name := name_of(loop, kinds)) is None:
        return None
    code = kept(name)
    if code is None:
        code = _from_package(name) or _from_numba(loop, kinds, name)
        keep(name, code)
    return _loaded(symbol_of(name), code, kinds) if code.content else None


def _from_package(name: str) -> Code | None:
    bitcode = shipped(name)
    with contextlib.suppress(RuntimeError):  # another LLVM wrote it, and this one cannot read it
        return bitcode and _for_this_processor(bitcode)
    return None


def _from_numba(loop: Any, kinds: Kinds, name: str) -> Code:
    made[name] = _bitcode.bitcode_of(loop, kinds, symbol_of(name))
    return _for_this_processor(made[name])


def _for_this_processor(bitcode: Code) -> Code:
    from llvmlite import binding

    if not bitcode.content:
        return bitcode
    return bitcode._replace(content=_machine().emit_object(binding.parse_bitcode(bitcode.content)))


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


def _loaded(symbol: str, code: Code, kinds: Kinds) -> Entry:
    from llvmlite import binding

    engine = _engine()
    engine.add_object_file(binding.ObjectFileRef.from_data(code.content))
    engine.finalize_object()
    taken = [kind for each in kinds for kind in handed(each)]
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *taken)(
        engine.get_function_address(symbol)
    )
    returns = RETURNS[code.returns]

    def entry(values: list[Any]) -> Any:
        result, fault = (returns or ctypes.c_void_p)(), ctypes.c_void_p()
        if call(ctypes.addressof(result), ctypes.addressof(fault), *values):
            raise ArithmeticError("a compiled loop failed: it divided by zero")
        return None if returns is None else result.value

    return entry
