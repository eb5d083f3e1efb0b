"""How the city's loops are compiled: cached on disk, no fast-math, so that a seed gives the same bits.

A loop is made part of its caller: lights, looks and colours go by value, and handing on some fifty numbers
at each call took a third of the time of a frame.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from evplace.core.compiled import njit

Loop = TypeVar("Loop", bound=Callable[..., object])


def compiled(loop: Loop) -> Loop:
    """Decorator of every hot loop of the city; dividing by zero gives infinity, as in numpy."""
    return cast(Loop, njit(cache=True, error_model="numpy", forceinline=True)(loop))
