"""Cuts and flipped bits, each known by its number; run as a script, many of them are read in this process.

    python damage.py READER FILE cut|flip SEED FIRST COUNT

READER is a module of evplace.sources.readers with `open_here`. The number of each is printed before it is
read, so that whoever started this knows which one brought it down.
"""

from __future__ import annotations

import contextlib
import importlib
import sys
from pathlib import Path

from evplace.core.errors import EvplaceError
from evplace.sources.readers import _decoder
from evplace.sources.readers._recording import Recording
from evplace.sources.readers._source import Hints
from evplace.testing._readers import check_packets, cut_at, flipped


def damaged(data: bytes, kind: str, seed: int, number: int, count: int) -> bytes:
    """Cut or flip of that number, of `count`."""
    return flipped(data, seed, number) if kind == "flip" else data[: cut_at(len(data), seed, count)[number]]


def main(reader: str, file: str, kind: str, seed: int, first: int, count: int) -> None:
    module, path = importlib.import_module(f"evplace.sources.readers.{reader}"), Path(file)
    _decoder.limit_memory()
    data, bad, size = path.read_bytes(), path.with_name(f"damaged{path.suffix}"), (240, 180)
    for number in range(first, count):
        print(number, flush=True)
        _decoder.limit_work()
        bad.write_bytes(damaged(data, kind, seed, number, count))
        packets = []
        with contextlib.suppress(EvplaceError):
            for packet in Recording(bad, reader, module.open_here(bad, Hints(size)), size).packets():
                packets.append(packet)
        check_packets(packets, size, reader)


if __name__ == "__main__":
    main(*sys.argv[1:4], *map(int, sys.argv[4:]))
