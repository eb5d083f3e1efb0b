"""An event store: where events fell, a bit a pixel and short window; images are made of it without decoding.

Images of any `dt` that is a multiple of the store's, and of any blur, crop and size, come out as they would
from the recording, to the last bit: the binary image of a window is that of its short windows laid together.
A store is a folder: bits.npy (n, H, W / 8), and the number and events of each short window that is not empty.
At 1/240 s a sensor of 1280x720 pixels takes at most 27.6 MB a second, 99.5 GB an hour, however many events
come; one of 346x260 9.9 GB.

It is used only where it is whole, by its checksum, and of the same recording, cleaned in the same way.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import InputError, OutputError
from evplace.core.events import Events, Size
from evplace.core.storage import GrowingArray, new_folder, read_array, read_json, write_array, write_json
from evplace.imaging.images import Imager
from evplace.imaging.recipe import Recipe
from evplace.imaging.representations.binary import Binary
from evplace.imaging.stream import EventImage, EventImages
from evplace.imaging.windows import MOST_EMPTY, Window
from evplace.sources.cleaning import Mask

FORMAT = "evplace-store-1"
MARK = "store.json"
"""What tells a folder that was written here from any other."""
SHORT = Fraction(1, 240)
"""Length of a short window in seconds, where `dt` is a multiple of it; else it is `dt` itself."""
ENDS = 1 << 16
"""Bytes at a recording's begin and end by which it is known, besides its length and time of change."""
BLOCK = 256
"""Short windows whose checksum is taken at once."""

Bits = NDArray[np.uint8]


def fits(recipe: Recipe) -> bool:
    """Whether images made by the recipe show no more than a store keeps."""
    return recipe.images.representation == "binary" and not recipe.windows.count


def identity(path: Path, recipe: Recipe, mask: Mask | None, reading: Mapping[str, Any]) -> dict[str, Any]:
    """What a store must be of: a recording, how it was read (`reading`), and what was left out of it."""
    length = path.stat().st_size
    with path.open("rb") as file:
        ends = file.read(ENDS)
        file.seek(max(0, length - ENDS))
        ends += file.read(ENDS)
    return {
        "name": path.name,
        "bytes": length,
        "changed_ns": path.stat().st_mtime_ns,
        "ends": hashlib.sha256(ends).hexdigest(),
        "reading": dict(reading),
        "size": list(recipe.size or ()),
        "cleaning": vars(recipe.cleaning),
        "mask": "" if mask is None else hashlib.sha256(mask.tobytes()).hexdigest(),
    }


def short_of(seconds: Fraction) -> Fraction:
    """The short windows of which windows of that many seconds are made."""
    return seconds if seconds % SHORT else SHORT


class Store:
    """A store that is whole and of the recording."""

    def __init__(self, path: Path, wanted: Mapping[str, Any], seconds: Fraction) -> None:
        """InputError, which says why, where there is none that windows of `seconds` can be made of."""
        what = f"the store {path}"
        about = read_json(path / MARK, what)
        if about.get("format") != FORMAT or about.get("of") != wanted:
            raise InputError(f"{what} is of another recording, or of one that was read or cleaned otherwise")
        names = ("numbers", "counts", "mask", "bits")
        arrays = [read_array(path / f"{name}.npy", what, memory_mapped=name == "bits") for name in names]
        more = [about.get(name) for name in ("short", "first_us", "info")]
        if checksum(arrays, more) != about.get("checksum"):
            raise InputError(f"{what} is damaged: its checksum is not that of what it holds")
        self._short = Fraction(about["short"])
        if seconds % self._short:
            raise InputError(f"{what} has windows of {self._short} s, of which {seconds} s is no multiple")
        self._numbers, self._counts, mask, self._bits = arrays
        self._size: Size = (wanted["size"][0], wanted["size"][1])
        self.first_us: int = about["first_us"]
        """The time that windows are counted from."""
        self.info: dict[str, Any] = about["info"]
        """What was said of the recording's reading: dropped, cleaned, notes and fault."""
        self.mask: Mask | None = mask if mask.size else None
        """(H, W) True at the pixels whose events were left out."""

    def images(self, recipe: Recipe) -> Iterator[EventImage]:
        """All images by the recipe, as the recording gives them."""
        made = JoinedImages(self._size, recipe, self._short, self.first_us)
        for number, count, bits in zip(
            self._numbers.tolist(), self._counts.tolist(), self._bits, strict=True
        ):
            yield from made.push(number, count, bits)
        yield from made.finish()


def checksum(arrays: Sequence[NDArray[Any]], more: object) -> int:
    """Of all that a store holds; the arrays are read in parts."""
    found = zlib.crc32(json.dumps(more).encode())
    for array in arrays:
        for start in range(0, len(array), BLOCK):
            found = zlib.crc32(np.ascontiguousarray(array[start : start + BLOCK]).data, found)
    return found


def first_of(window: Window, short: Fraction) -> int:
    """The time that short windows are counted from, by any of them."""
    return window.t_us - math.floor(window.n * short * 1_000_000)


class JoinedImages:
    """Short windows laid over each other to windows, and these as images."""

    def __init__(self, size: Size, recipe: Recipe, short: Fraction, first_us: int) -> None:
        """`short` is the length of the short windows in seconds, of which a window is a multiple."""
        self._imager = Imager(size, recipe.images)
        self._each = int(recipe.windows.seconds / short)
        self._window_us, self.first_us = recipe.windows.seconds * 1_000_000, first_us
        self._bits = np.zeros((size[1], -(-size[0] // 8)), np.uint8)
        self._open, self._events = 1, 0

    def push(self, number: int, count: int, bits: Bits) -> Iterator[EventImage]:
        """The images of all windows that are over with a short window, which holds events."""
        while self._open * self._each < number:
            yield self._close()
        self._bits |= bits
        self._events += count

    def finish(self) -> Iterator[EventImage]:
        """The image of the last window."""
        if self._events:
            yield self._close()

    def _close(self) -> EventImage:
        grid = self._imager.grid
        assert grid is not None
        if self._events:
            grid[:] = np.unpackbits(self._bits, axis=1, count=grid.shape[1]).view(np.int8)
            np.negative(grid, out=grid)
        end_us = self.first_us + math.floor(self._open * self._window_us)
        made = EventImage(self._imager.image(end_us), Window(self._open, end_us, self._events))
        self._open, self._events = self._open + 1, 0
        self._bits.fill(0)
        return made


class Packer:
    """In an imager's place: a window as bits."""

    def __init__(self, size: Size) -> None:
        self._binary = Binary(size)
        self.grid = self._binary.grid

    def add(self, events: Events) -> None:
        """Take events of the open window; RecordingError where an event lies outside the sensor."""
        self._binary.add(events)

    def image(self, t_us: int) -> Bits:  # noqa: ARG002 - as an imager's
        """(H, W / 8) the window's bits; starts the next one."""
        bits = np.packbits(self.grid, axis=1)
        self._binary.clear()
        return bits


def short_windows(size: Size, recipe: Recipe, mask: Mask | None) -> EventImages:
    """Gives short windows as bits, where a stream of images gives images."""
    short = short_of(recipe.windows.seconds)
    stream = EventImages(size, recipe.changed(dt=str(short)), mask, Packer(size))
    stream.allow_empty(MOST_EMPTY * int(recipe.windows.seconds / short))
    return stream


class StoreWriter:
    """Writes a store while images are made; where it cannot go on, `lost` says why, and images go on."""

    def __init__(self, path: Path, of: Mapping[str, Any], size: Size, short: Fraction) -> None:
        self.lost: str | None = None
        """Why there is no store."""
        self._about = {"format": FORMAT, "of": dict(of), "short": str(short)}
        self._numbers: list[int] = []
        self._counts: list[int] = []
        self._bits: GrowingArray | None = None
        self._stack = contextlib.ExitStack()
        with self._giving_up():
            self._folder = self._stack.enter_context(new_folder(path, True, MARK))
            shape = (size[1], -(-size[0] // 8))
            self._bits = GrowingArray(self._folder / "bits.npy", np.uint8, shape)

    def add(self, number: int, count: int, bits: Bits) -> None:
        """The next short window that holds events."""
        if self.lost is None and self._bits is not None:
            with self._giving_up():
                self._bits.append(bits)
                self._numbers.append(number)
                self._counts.append(count)

    def close(self, first_us: int, info: Mapping[str, Any], mask: Mask | None) -> None:
        """Write what is left; from then on the store is there."""
        if self.lost is not None or self._bits is None:
            return
        with self._giving_up():
            self._bits.close()
            small = {
                "numbers": np.array(self._numbers, np.int64),
                "counts": np.array(self._counts, np.int64),
                "mask": np.zeros((0, 0), np.bool_) if mask is None else mask,
            }
            for name, array in small.items():
                write_array(self._folder / f"{name}.npy", array)
            bits = read_array(self._folder / "bits.npy", "the store", memory_mapped=True)
            found = checksum([*small.values(), bits], [self._about["short"], first_us, info])
            more = {"first_us": first_us, "info": info, "checksum": found}
            write_json(self._folder / MARK, self._about | more)
            self._stack.close()

    def discard(self) -> None:
        """Let go of a store that is not whole; harmless after `close`."""
        with contextlib.suppress(_DiscardedError):
            self._leave(_DiscardedError())

    @contextlib.contextmanager
    def _giving_up(self) -> Iterator[None]:
        """Where writing fails, nothing of the store is left, and why is kept."""
        try:
            try:
                yield
            except OSError as error:
                self._leave(error)
                raise
        except (OSError, OutputError) as error:
            self.lost = str(error)

    def _leave(self, error: Exception) -> None:
        """Have the folder vanish; raises the error as one of writing, where it is one."""
        if self._bits is not None:
            self._bits.discard()
        self._stack.__exit__(type(error), error, None)


class _DiscardedError(Exception):
    """Has a folder vanish in place of taking its name."""
