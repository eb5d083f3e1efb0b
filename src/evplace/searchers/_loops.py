"""The loops over all references: products with small numbers, and differing bits."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit

Floats = NDArray[np.float32]
Words = NDArray[np.uint64]

CHUNK = 64
"""References whose bits are counted before it is asked whether any of them is near."""
_PAIRS, _FOURS, _BYTES, _ONES = (np.uint64(int(byte * 8, 16)) for byte in ("55", "33", "0f", "01"))
_ONE, _TWO, _FOUR, _TOP = (np.uint64(shift) for shift in (1, 2, 4, 56))


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def products(query: Floats, references: NDArray[Any], out: Floats) -> None:
    """(items,) products of a query (d,) with references (items, d) of small whole numbers."""
    for item in range(references.shape[0]):
        total = np.float32(0)
        for k in range(references.shape[1]):
            total += query[k] * np.float32(references[item, k])
        out[item] = total


@njit(cache=True, nogil=True)
def _ones(word: np.uint64) -> np.uint64:
    """How many bits of a word are set: the compiler makes one instruction of it, several words at once."""
    word = word - ((word >> _ONE) & _PAIRS)
    word = (word & _FOURS) + ((word >> _TWO) & _FOURS)
    return (((word + (word >> _FOUR)) & _BYTES) * _ONES) >> _TOP


@njit(cache=True, nogil=True)
def nearest(
    query: Words, references: Words, first: int, many: int,
    items: NDArray[np.int64], apart: NDArray[np.int32], counts: NDArray[np.int64], state: NDArray[np.int64],
) -> None:  # fmt: skip
    """The `many` of references (n, words) that differ from a query (words,) in the fewest bits.

    Of those that differ in equally many the first ones. `items` and `apart`, with room for 4 * many + CHUNK,
    get their numbers, from `first` on, and in how many bits they differ. For the next block of references
    all is handed over again: `counts` (bits + 1,) of how many differ in so many bits, and in `state` how many
    are held and below how many bits one more must differ.
    """
    held, limit = state[0], state[1]
    differ = np.empty(CHUNK, np.int32)
    for begin in range(0, references.shape[0], CHUNK):
        end = min(begin + CHUNK, references.shape[0])
        if _count(query, references[begin:end], differ) >= limit:
            continue
        for i in range(end - begin):
            if differ[i] < limit:
                items[held], apart[held] = first + begin + i, differ[i]
                counts[differ[i]] += 1
                held += 1
        if held > 4 * many:
            limit = _limit(counts, many)
            held = _kept(items, apart, held, counts, limit)
    if held > many:
        limit = _limit(counts, many)
        held = _kept(items, apart, held, counts, limit)
    state[0], state[1] = held, limit


@njit(cache=True, nogil=True)
def _count(query: Words, references: Words, differ: NDArray[np.int32]) -> int:
    """In how many bits each differs, and the fewest."""
    least = np.int32(1 << 30)
    for i in range(references.shape[0]):
        total = np.int32(0)
        for k in range(references.shape[1]):
            total = np.int32(total + np.int32(_ones(query[k] ^ references[i, k])))
        differ[i] = total
        least = min(least, total)
    return int(least)


@njit(cache=True, nogil=True)
def _limit(counts: NDArray[np.int64], many: int) -> int:
    """In how many bits the last of the `many` nearest differs; of those that do, as many count as needed."""
    total = 0
    for bits in range(len(counts)):
        if total + counts[bits] >= many:
            counts[bits] = many - total
            counts[bits + 1 :] = 0
            return bits
        total += counts[bits]
    return len(counts)


@njit(cache=True, nogil=True)
def _kept(
    items: NDArray[np.int64], apart: NDArray[np.int32], held: int, counts: NDArray[np.int64], limit: int
) -> int:
    """Moves those that differ in less than `limit` bits, and as many of the others as count, to the front."""
    kept, ties = 0, counts[limit]
    for i in range(held):
        if apart[i] < limit or (apart[i] == limit and ties > 0):
            ties -= 1 if apart[i] == limit else 0
            items[kept], apart[kept] = items[i], apart[i]
            kept += 1
    return kept
