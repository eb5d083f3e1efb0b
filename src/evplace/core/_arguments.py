"""What compiled loops take and give, as their machine code does: addresses of arrays, and plain numbers."""

from __future__ import annotations

import ctypes
import functools
import os
import sys
from typing import Any

import numpy as np

TRIED_ON = (("linux", "x86_64"),)
"""Systems and processors, as Python names them."""
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


class _Two(ctypes.c_int64 * 2):  # type: ignore[misc]  # a class, which mypy takes for a product
    """Two numbers, whose `value` is a tuple as that of one is a number."""

    @property
    def value(self) -> tuple[int, ...]:
        return tuple(self)


RETURNS: dict[str, Any] = {
    "none": None,
    "bool": ctypes.c_bool,
    "int64": ctypes.c_int64,
    "uint64": ctypes.c_uint64,
    "float64": ctypes.c_double,
    "UniTuple(int64 x 2)": _Two,
}
"""What a loop may return, by numba's name."""
Kinds = tuple[Any, ...]
"""Of arguments, one after another: dtype and dimensions of an array, the class of a number, class and length
of a tuple and then the kinds of its fields, None."""


class UnfitError(Exception):
    """Arguments with which only numba itself can call a loop."""


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


def handed(kind: Any) -> list[Any]:
    """What is handed over of one kind."""
    if isinstance(kind, np.dtype):
        return [ctypes.c_void_p, ctypes.c_void_p]
    if kind is None or isinstance(kind, int) or issubclass(kind, tuple):
        return []
    return [ctypes.c_double if issubclass(kind, float | np.floating) else ctypes.c_int64]


@functools.cache
def is_known_here() -> bool:
    """Whether it was tried on such a system, and arrays lie in memory as entries read them."""
    if sys.implementation.name != "cpython" or (sys.platform, os.uname().machine) not in TRIED_ON:
        return False
    array = np.empty((3, 5), np.int8)
    words = (ctypes.c_int64 * (SHAPE + 1)).from_address(id(array))
    if (words[DATA], words[DIMENSIONS] & 0xFFFFFFFF) != (array.ctypes.data, array.ndim):
        return False
    return tuple((ctypes.c_ssize_t * 2).from_address(words[SHAPE])) == array.shape
