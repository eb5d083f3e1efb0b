"""Loops that numba compiles. It is imported with the first call: who calls none does not wait for it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any


def njit(**options: Any) -> Any:
    """A decorator as numba's own of this name, with its options; like that one it says nothing of types."""
    return functools.partial(_Compiled, options=options)


class _Compiled:
    """A loop; other compiled loops may call it."""

    def __init__(self, loop: Callable[..., Any], options: dict[str, Any]) -> None:
        self._loop, self._options = loop, options
        functools.update_wrapper(self, loop)

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)

    @functools.cached_property
    def dispatcher(self) -> Any:
        """What numba makes of it."""
        import numba

        return numba.njit(**self._options)(self._loop)

    @property
    def _numba_type_(self) -> Any:
        """Numba asks for this where one loop calls another."""
        import numba

        return numba.typeof(self.dispatcher)
