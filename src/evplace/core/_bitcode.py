"""What numba makes of a loop, as code that needs nothing of numba: LLVM's bitcode.

The loop stands behind an entry that takes arrays by their addresses. This is for loops that make no arrays,
and are called with plain arrays and numbers; numba does all other loops as ever.
"""

from __future__ import annotations

import contextlib
import re
import threading
from typing import Any

import numpy as np

from evplace.core._arguments import DATA, RETURNS, SHAPE, Kinds
from evplace.core._code_files import UNFIT, Code

C_LIBRARY = frozenset("memcpy memmove memset exp log pow sin cos floor ceil expf logf powf".split())
"""What machine code may call: every process of Python has it."""
WITHOUT_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of numba for what Python does not call."""
ALONE = WITHOUT_WRAPPERS | {"_nrt": False}
"""And for what must make no arrays: it does not count references to them either."""


_state = threading.local()


def compiles() -> bool:
    """Whether this thread compiles machine code that must stand alone."""
    return getattr(_state, "compiles", False)


def bitcode_of(loop: Any, kinds: Kinds, name: str) -> Code:
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
    module.get_function(made.fndesc.llvm_func_name).name = name
    if returns not in RETURNS or not _set_alone(module, name):
        return UNFIT
    return Code(returns, module.as_bitcode())


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
