"""How the rows of an HDF5 file are stored: what was never written reads as zeros, which are no events."""

from __future__ import annotations

import math

import h5py

from evplace.core.errors import UnsupportedError

MOST_BYTES = 1 << 26
"""A piece that is unpacked at once takes no more than this; those of recordings take a few megabytes."""


def written(rows: h5py.Dataset, axis: int) -> int:
    """How many rows, along the axis of the events, come before the first that was never written.

    UnsupportedError where they are packed in pieces that are too large.
    """
    length = int(rows.shape[axis])
    if rows.chunks is None:
        return length if rows.id.get_storage_size() >= rows.size * rows.dtype.itemsize else 0
    if math.prod(rows.chunks) * rows.dtype.itemsize > MOST_BYTES:
        raise UnsupportedError(
            f"{rows.name} is packed in pieces of over {MOST_BYTES >> 20} MiB, which are not read"
        )
    across = [-(-side // piece) for side, piece in zip(rows.shape, rows.chunks, strict=True)]
    if rows.id.get_num_chunks() >= math.prod(across):
        return length
    found: dict[int, int] = {}

    def count(piece: h5py.h5d.StoreInfo) -> None:
        place = piece.chunk_offset[axis] // rows.chunks[axis]
        found[place] = found.get(place, 0) + 1

    rows.id.chunk_iter(count)
    whole = math.prod(across) // across[axis]
    first = next((place for place in range(across[axis]) if found.get(place, 0) < whole), across[axis])
    return min(length, first * int(rows.chunks[axis]))
