"""Loops that numba compiles. Their machine code is kept and, where that can be, called without numba."""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable
from typing import Any

from evplace.core import _bitcode
from evplace.core._arguments import Kinds, UnfitError, flattened
from evplace.core._machine_code import Entry, entry_of

SEEN_AT_WORK = any(name.startswith("NUMBA_") and name != "NUMBA_CACHE_DIR" for name in os.environ)
"""Whoever sets numba's variables wants to see numba itself at work."""
COMPILING = threading.RLock()
"""Held by the one thread that makes or loads machine code."""


def njit(before: Callable[[], None] | None = None, **options: Any) -> Any:
    """A decorator as numba's own of this name, with its options; like that one it says nothing of types.

    `before` is called before a loop is compiled: what it tells numba need not be told at import.
    """
    return functools.partial(_Compiled, options=options, before=before)


class _Compiled:
    """A loop; other compiled loops may call it."""

    def __init__(
        self, loop: Callable[..., Any], options: dict[str, Any], before: Callable[[], None] | None
    ) -> None:
        self.loop, self.options, self.before = loop, options, before
        self._entries: dict[Kinds, Entry | None] = {}
        self._kept = bool(options.get("cache")) and not SEEN_AT_WORK
        functools.update_wrapper(self, loop)

    def __call__(self, *arguments: Any) -> Any:
        if self._kept:
            try:
                kinds, values = flattened(arguments)
            except UnfitError:
                return self.dispatcher(*arguments)
            if (entry := self._entry(kinds)) is not None:
                return entry(values)
        return self.dispatcher(*arguments)

    def _entry(self, kinds: Kinds) -> Entry | None:
        """Its machine code for arguments of these kinds; None where numba itself must call it."""
        if kinds not in self._entries:
            with COMPILING:
                self._entries[kinds] = entry_of(self, kinds)
        return self._entries[kinds]

    @functools.cached_property
    def dispatcher(self) -> Any:
        """What numba makes of it."""
        return self._made(self.options)

    @functools.cached_property
    def alone(self) -> Any:
        """The same as part of machine code that needs nothing of numba."""
        without = {name: value for name, value in self.options.items() if name != "cache"}
        return self._made(without | _bitcode.ALONE)

    def _made(self, options: dict[str, Any]) -> Any:
        import numba

        if self.before is not None:
            self.before()
        return numba.njit(**options)(self.loop)

    @property
    def _numba_type_(self) -> Any:
        """Numba asks for this where one loop calls another."""
        import numba

        return numba.typeof(self.alone if _bitcode.compiles() else self.dispatcher)
