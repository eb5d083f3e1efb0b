"""Loops that numba compiles. It is imported with the first call: who calls none does not wait for it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any


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
        self._loop, self._options, self._before = loop, options, before
        functools.update_wrapper(self, loop)

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)

    @functools.cached_property
    def dispatcher(self) -> Any:
        """What numba makes of it."""
        import numba

        if self._before is not None:
            self._before()
        return numba.njit(**self._options)(self._loop)

    @property
    def _numba_type_(self) -> Any:
        """Numba asks for this where one loop calls another."""
        import numba

        return numba.typeof(self.dispatcher)
