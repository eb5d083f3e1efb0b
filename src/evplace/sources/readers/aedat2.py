"""AEDAT 1.0 and 2.0 (jAER): text header, then a 32-bit address and a 32-bit time, high byte first, an event.

Layout: iniVation, "AEDAT 2.0 file format". Frames, IMU samples and external inputs share the addresses of
DAVIS cameras and are passed over. jAER counts columns from the right and rows from the bottom of the image;
both are turned here. The time wraps every 71.6 min.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import RecordingError
from evplace.core.events import Size
from evplace.sources.readers._clock import clock, unwrap
from evplace.sources.readers._prophesee import words
from evplace.sources.readers._source import Block, Hints, Source

ABOUT = "AEDAT 2.0 file of jAER"
MAGIC = b"#!AER-DAT2.0"
CAMERAS: dict[str, Size] = {
    "DVS128": (128, 128),
    "DAVIS128": (128, 128),
    "DAVIS208": (208, 192),
    "DAVIS240": (240, 180),
    "DAVIS346": (346, 260),
    "DAVIS640": (640, 480),
}
"""By the start of the chip's name in the header -> (width, height)."""
RECORD = np.dtype([("address", ">u4"), ("t", ">u4")])
EVENTS = 1 << 19
"""Events decoded at a time."""


def matches(path: Path, head: bytes) -> bool:
    """Whether the file starts with the format's version line."""
    return head.startswith(MAGIC)


def read(path: Path, hints: Hints) -> Source:
    """The header; RecordingError where it names no known chip and no size is given."""
    lines, start = _header(path)
    chip = re.search(rb"AEChip: \S*\.(\w+)", lines)
    name = chip.group(1).decode("ascii").upper() if chip else ""
    camera = next((camera for camera in CAMERAS if name.startswith(camera)), None)
    notes = []
    if camera is None:
        camera = {size: known for known, size in CAMERAS.items()}.get(hints.size or (0, 0))
        if camera is None:
            raise RecordingError(
                f"{path} names no known camera ('{name}'): give the `size` of one of {CAMERAS}"
            )
        notes.append(f"the header names no known camera: {camera} is taken for its size")
    size = CAMERAS[camera]
    return Source(size, partial(_blocks, path, start, camera == "DVS128", size), notes, turn_us=1 << 32)


def _header(path: Path) -> tuple[bytes, int]:
    """The lines that start with # and the first byte after them."""
    with path.open("rb") as file:
        lines, start = [], 0
        while (line := file.readline(1 << 16)).startswith(b"#") and line.endswith(b"\n"):
            lines.append(line)
            start = file.tell()
    return b"".join(lines), start


def _blocks(path: Path, start: int, dvs128: bool, size: Size) -> Iterator[Block]:
    state = None
    for run in words(path, start, RECORD, EVENTS):
        address, counter = run["address"].astype(np.uint32), run["t"].astype(np.uint32)
        if state is None:
            state = clock(int(counter[0]))
        t_us, x, y = (
            np.empty(len(run), np.int64),
            np.empty(len(run), np.uint16),
            np.empty(len(run), np.uint16),
        )
        p = np.empty(len(run), np.bool_)
        count = _decode(address, counter, dvs128, size[0], size[1], state, t_us, x, y, p)
        yield Block(t_us[:count], x[:count], y[:count], p[:count])


@njit(cache=True)
def _decode(
    address: NDArray[np.uint32],
    counter: NDArray[np.uint32],
    dvs128: bool,
    width: int,
    height: int,
    state: NDArray[np.int64],
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.bool_],
) -> int:
    """Fill the arrays with the change events among the addresses; return how many they are.

    A column or row outside the sensor stays outside it when turned, as the subtraction wraps.
    """
    count = 0
    for i in range(len(address)):
        word = address[i]
        if (word & 0x8000 if dvs128 else word & 0x80000400) != 0:
            continue
        t_us[count] = unwrap(state, np.int64(counter[i]), 0xFFFFFFFF)
        if dvs128:
            column, row, on = word >> 1 & 0x7F, word >> 8 & 0x7F, word & 1 == 0
        else:
            column, row, on = word >> 12 & 0x3FF, word >> 22 & 0x1FF, word >> 11 & 1 == 1
        x[count], y[count], p[count] = width - 1 - column, height - 1 - row, on
        count += 1
    return count
