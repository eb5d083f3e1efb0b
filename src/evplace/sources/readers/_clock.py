"""Counters of the camera's clock that wrap around, made into times that do not.

A counter of b bits is read as going forward, any number of times around; steps back of up to a sixteenth of
its range stay steps back. One wrong value must not shift all that follow: after a leap, the value before it
is remembered, and a counter that returns there has not
wrapped. (So a clock must be read more than twice a turn; cameras send theirs hundreds of times.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit

NONE = np.int64(-(1 << 62))
"""Stands for a value before a leap where there was none."""


def clock(first: int = 0) -> NDArray[np.int64]:
    """The state of an unwrapped counter: its value, and the value before the last leap."""
    return np.array([first, NONE], np.int64)


@njit(cache=True)
def unwrap(state: NDArray[np.int64], counter: int, mask: int) -> int:
    """The unwrapped value of `counter`, whose range is [0, mask], mask + 1 a power of two."""
    now = state[0]
    ahead = (counter - now) & mask
    near = mask >> 4
    if ahead <= near:
        state[0] = now + ahead
    elif mask + 1 - ahead <= near:
        state[0] = now + ahead - mask - 1
    else:
        _leap(state, counter, mask)
        return int(state[0])
    state[1] = NONE
    return int(state[0])


@njit(cache=True)
def _leap(state: NDArray[np.int64], counter: int, mask: int) -> None:
    """Go back to where the counter was before its last leap, if it did, else leap forward."""
    before = state[1]
    back = ((counter - before + (mask >> 4)) & mask) - (mask >> 4)
    if before != NONE and back <= mask >> 4:
        state[0] = before + back
        state[1] = NONE
    else:
        state[1] = state[0]
        state[0] += (counter - state[0]) & mask


@njit(cache=True)
def unwrap_32(state: NDArray[np.int64], counters: NDArray[np.uint32]) -> NDArray[np.int64]:
    """(N,) unwrapped 32-bit counter values; `state` goes on from one call to the next."""
    values = np.empty(len(counters), np.int64)
    for i in range(len(counters)):
        values[i] = unwrap(state, np.int64(counters[i]), 0xFFFFFFFF)
    return values
