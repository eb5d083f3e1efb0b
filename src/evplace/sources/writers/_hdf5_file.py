"""The process that writes an HDF5 file: see `hdf5`, which starts it.

Its job is a line of JSON on standard input; packets follow: their number of events, and the columns t_us, x,
y and p of so many. A packet of none is the end: what ends before it is not whole. It answers with JSON: that
all is written, else the system's number of the error and a text.
"""

from __future__ import annotations

import json
import os
import re
import struct
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from evplace.core.events import Events, Size

LENGTH = struct.Struct("<q")
CHUNK = 1 << 16
"""Events that are compressed together."""
FIELDS = {"t": np.int64, "x": np.uint16, "y": np.uint16, "p": np.uint8}
_COLUMNS = (np.int64, np.uint16, np.uint16, np.bool_)


def main() -> None:
    """Write what the job names."""
    pipe = sys.stdin.buffer
    job = json.loads(pipe.readline())
    try:
        write(Path(job["path"]), _packets(pipe, tuple(job["size"])), tuple(job["size"]))
        _end({"whole": True})
    except EOFError:
        os._exit(1)  # its caller has gone
    except (OSError, RuntimeError) as error:  # the library's own errors are either
        text = " ".join(str(error).split())
        found = re.search(r"errno = ([0-9]+)", text)
        _end({"errno": int(found[1]) if found else getattr(error, "errno", None), "text": text[:300]})


def _end(answer: dict[str, Any]) -> None:
    """Answer, and end at once: at its own end, the library would write once more what it cannot write."""
    print(json.dumps(answer), flush=True)
    os._exit(0 if "whole" in answer else 1)


def _packets(pipe: IO[bytes], size: Size) -> Iterator[Events]:
    """The packets as they come; EOFError where they end before their end."""
    while (length := LENGTH.unpack(_exactly(pipe, LENGTH.size))[0]) > 0:
        columns: list[NDArray[Any]] = [
            np.frombuffer(_exactly(pipe, length * np.dtype(kind).itemsize), kind) for kind in _COLUMNS
        ]
        yield Events(columns[0], columns[1], columns[2], columns[3], size)


def _exactly(pipe: IO[bytes], length: int) -> bytes:
    data = pipe.read(length)
    if len(data) < length:
        raise EOFError
    return data


def write(path: Path, packets: Iterable[Events], size: Size) -> None:
    """Packets one after the other, in this process.

    On a full disk nothing is closed, and the columns stay open until all is flushed: at closing, the library
    passes over errors, or crashes.
    """
    file = h5py.File(path, "w")
    group = file.create_group("events")
    group.attrs["width"], group.attrs["height"] = size
    how = {
        "maxshape": (None,),
        "chunks": (CHUNK,),
        "compression": "gzip",
        "compression_opts": 1,
        "shuffle": True,
    }
    columns = {name: group.create_dataset(name, (0,), kind, **how) for name, kind in FIELDS.items()}
    starts, offset_us = [np.zeros(0, np.int64)], None
    for packet in _gathered(packets):
        offset_us = int(packet.t_us[0]) if offset_us is None else offset_us
        first_ms = sum(map(len, starts))
        starts.append(_millisecond_starts(packet.t_us - offset_us, first_ms, len(columns["t"])))
        _append(columns, packet, offset_us)
    file["t_offset"] = np.int64(offset_us or 0)
    file["ms_to_idx"] = np.concatenate(starts)
    file.flush()
    file.close()


def _gathered(packets: Iterable[Events]) -> Iterator[Events]:
    """Packets joined to at least CHUNK events, so that no chunk is compressed again and again."""
    held: list[Events] = []
    for packet in packets:
        held.append(packet)
        if sum(map(len, held)) >= CHUNK:
            yield Events.concatenate(held)
            held = []
    if held:
        yield Events.concatenate(held)


def _append(columns: Mapping[str, h5py.Dataset], packet: Events, offset_us: int) -> None:
    for name, rows in (("t", packet.t_us - offset_us), ("x", packet.x), ("y", packet.y), ("p", packet.p)):
        column = columns[name]
        column.resize((len(column) + len(rows),))
        column[-len(rows) :] = rows


def _millisecond_starts(t_us: NDArray[np.int64], first_ms: int, first: int) -> NDArray[np.int64]:
    """For each millisecond from `first_ms` that begins in this packet, the first event at or after it."""
    milliseconds = np.arange(first_ms, int(t_us[-1]) // 1000 + 1)
    return first + np.searchsorted(t_us, milliseconds * 1000)


if __name__ == "__main__":
    main()
