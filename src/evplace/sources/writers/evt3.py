"""Prophesee raw, EVT 3.0, one event a word; the header's t0 holds what 24 bits of time cannot.

Layout: Prophesee, "EVT 3.0 format"; t0 as faery writes and reads it.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import OutputError
from evplace.core.events import Events, Size

ABOUT = "Prophesee raw file, EVT 3.0"
SUFFIX = ".raw"
LONGEST_GAP_US = 86_400_000_000
"""Gap between two events that can be written: each 4.096 ms of it takes a word, so that wraps are counted."""


def write(path: Path, packets: Iterable[Events], size: Size) -> None:
    """Words for time and row where they change, and one an event; OutputError for more than 2048 pixels."""
    if max(size) > 2048:
        raise OutputError(
            f"EVT 3 has room for 2048 columns and rows, not for {size[0]}x{size[1]}: choose npz"
        )
    state = np.full(3, -1, np.int64)
    with path.open("wb") as file:
        start_us: int | None = None
        for packet in packets:
            if start_us is None:
                start_us = int(packet.t_us[0])
                file.write(_header(size, start_us))
            words = np.empty(_room(packet.t_us - start_us, int(state[0])), np.uint16)
            used = _encode(packet.t_us - start_us, packet.x, packet.y, packet.p, state, words)
            file.write(words[:used].data)
        if start_us is None:
            file.write(_header(size, 0))


def _header(size: Size, start_us: int) -> bytes:
    width, height = size
    lines = (
        "evt 3.0",
        f"format EVT3;height={height};width={width}",
        f"geometry {width}x{height}",
        f"t0 {start_us}",
        "end",
    )
    return "".join(f"% {line}\n" for line in lines).encode("ascii")


def _room(t_us: NDArray[np.int64], high: int) -> int:
    """Words that events at these times can take; OutputError where nothing happens for too long."""
    last_us = max(high, 0) << 12
    if max(int(t_us[0]) - last_us, int(np.diff(t_us).max(initial=0))) > LONGEST_GAP_US:
        raise OutputError("EVT 3 cannot hold a gap of more than a day between events: choose npz")
    return 4 * len(t_us) + (int(t_us[-1]) - last_us >> 12) + 1


@njit(cache=True)
def _encode(
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.bool_],
    state: NDArray[np.int64],
    words: NDArray[np.uint16],
) -> int:
    """Fill `words`, return how many; `state` is the high bits, the low bits and the row sent last."""
    high, low, row = state
    used = 0
    for i in range(len(t_us)):
        while high != t_us[i] >> 12:
            high = high + 1 if high >= 0 else t_us[i] >> 12
            words[used] = 0x8000 | high & 0xFFF
            used += 1
            low = -1
        if low != t_us[i] & 0xFFF:
            low = t_us[i] & 0xFFF
            words[used] = 0x6000 | low
            used += 1
        if row != y[i]:
            row = y[i]
            words[used] = row
            used += 1
        words[used] = 0x2000 | p[i] << 11 | x[i]
        used += 1
    state[0], state[1], state[2] = high, low, row
    return used
