"""Cuts and flipped bits, each known by its number; run as a script, many of them are read in this process.

    python damage.py READER FILE cut|flip SEED FIRST COUNT

READER is a module of evplace.sources.readers with `open_here`. The number of each is printed before it is
read, so that whoever started this knows which one brought it down.
"""

from __future__ import annotations

import contextlib
import importlib
import random
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from evplace.core.errors import EvplaceError
from evplace.core.events import Events
from evplace.sources.readers import _decoder
from evplace.sources.readers._recording import Recording
from evplace.sources.readers._source import Hints

STRUCTURE = 2000
"""Bytes at the start in which half of the flips lie."""


def cuts(length: int, seed: int, count: int) -> list[int]:
    """Places to cut a file of `length` bytes."""
    rng = random.Random(seed)
    return [rng.randrange(length) for _ in range(count)]


def flipped(data: bytes, seed: int, number: int) -> bytes:
    """`data` with one bit flipped."""
    rng = random.Random(f"{seed} {number}")
    at = rng.randrange(len(data) if number % 2 else min(len(data), STRUCTURE))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def damaged(data: bytes, kind: str, seed: int, number: int, count: int) -> bytes:
    """Cut or flip of that number, of `count`."""
    return flipped(data, seed, number) if kind == "flip" else data[: cuts(len(data), seed, count)[number]]


def check(packets: Iterable[Events], size: tuple[int, int]) -> None:
    """Times never decrease and pixels lie on the sensor."""
    last = -(1 << 63)
    for packet in packets:
        assert np.all(np.diff(packet.t_us) >= 0)
        assert packet.t_us[0] >= last
        assert packet.x.max() < size[0]
        assert packet.y.max() < size[1]
        last = int(packet.t_us[-1])


def main(reader: str, file: str, kind: str, seed: int, first: int, count: int) -> None:
    _decoder.limit_memory()
    module, path = importlib.import_module(f"evplace.sources.readers.{reader}"), Path(file)
    data, bad, size = path.read_bytes(), path.with_name(f"damaged{path.suffix}"), (240, 180)
    for number in range(first, count):
        print(number, flush=True)
        _decoder.limit_work()
        bad.write_bytes(damaged(data, kind, seed, number, count))
        packets = []
        with contextlib.suppress(EvplaceError):
            for packet in Recording(bad, reader, module.open_here(bad, Hints(size)), size).packets():
                packets.append(packet)
        check(packets, size)


if __name__ == "__main__":
    main(*sys.argv[1:4], *map(int, sys.argv[4:]))
