"""What holds for every reader."""

from __future__ import annotations

import random
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import EvplaceError, RecordingError
from evplace.core.events import Events
from evplace.sources.readers import HEAD, Hints, Recording
from evplace.sources.readers._source import checked_source
from evplace.testing._require import held_to_it, require

SIZE = (240, 180)
"""Width and height of the sensor whose events are written."""
OTHER_CONTENT = [b"GIF89a junk", b"Dear reader, this is no recording.\n" * 20, bytes(5000), b"\xff" * 5000]
"""Of no recording."""
STRUCTURE = 2000
"""Bytes at the start in which half of the flipped bits lie."""
MOST_WORK_S = 10
"""Seconds of work, which a busy machine does not make more, after which a damaged file is taken to hang."""

Maker = Callable[[Path, Events], Path]


def check_reader(
    module: ModuleType,
    make_file: Maker,
    cuts: int = 100,
    flips: int = 200,
    seed: int = 0,
    whole: bool = False,
) -> None:
    """AssertionError where a reader breaks what `evplace.sources.readers` promises.

    `make_file(folder, events)` writes events of a 240x180 sensor into a folder and returns the file. The
    events come back, but for the order of those of one time and for the time of the first; `matches` knows
    this content and no other, and no other reader knows it; events that cannot be are counted as dropped. A
    file that is cut gives what came before the cut, and one with a flipped bit events in order, or one
    RecordingError.
    `whole` says that the format keeps whole columns, of which a cut leaves nothing.
    """
    who = families.described("readers", module)
    about = getattr(module, "ABOUT", "")
    require(about and "\n" not in about, f"{who} must say in one line of text, 'ABOUT', what the format is")
    with tempfile.TemporaryDirectory(prefix="evplace-") as name, held_to_it():

        def made(events: Events) -> Path:
            return make_file(Path(tempfile.mkdtemp(dir=name)), events)

        _check_events(module, made(some_events()), who)
        _check_matches(module, made(some_events(50)), who)
        _check_drops(module, made(some_events()), who)
        _check_cuts(module, made(some_events()), cuts, seed, who, whole)
        _check_flips(module, made(some_events(500)), flips, seed, who)


def some_events(count: int = 3000, span_us: int = 100_000, seed: int = 0) -> Events:
    """Random events of a 240x180 sensor, in order."""
    rng = np.random.default_rng(seed)
    t_us = np.sort(rng.integers(0, span_us, count))
    x, y = rng.integers(0, SIZE[0], count), rng.integers(0, SIZE[1], count)
    return Events.of(t_us, x, y, rng.random(count) < 0.5, SIZE)


def cut_at(length: int, seed: int, count: int) -> list[int]:
    """Places to cut a file of `length` bytes."""
    rng = random.Random(seed)
    return [rng.randrange(length) for _ in range(count)]


def flipped(data: bytes, seed: int, number: int) -> bytes:
    """`data` with one bit flipped, another for each number."""
    rng = random.Random(f"{seed} {number}")
    at = rng.randrange(len(data) if number % 2 else min(len(data), STRUCTURE))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def check_packets(packets: Iterable[Events], size: tuple[int, int], who: str) -> None:
    """That times never decrease and pixels lie on the sensor."""
    last = -(1 << 63)
    for packet in packets:
        require(np.all(np.diff(packet.t_us) >= 0), f"{who} gives events that run backwards")
        require(packet.t_us[0] >= last, f"{who} gives packets that run backwards")
        inside = packet.x.max() < size[0] and packet.y.max() < size[1]
        require(inside, f"{who} gives events outside the sensor")
        last = int(packet.t_us[-1])


def _opened(module: ModuleType, path: Path, size: tuple[int, int] | None = SIZE) -> Recording:
    source = checked_source(module.read(path, Hints(size)), "readers", module)
    return Recording(path, families.name_of("readers", module), source, size)


def _read(module: ModuleType, path: Path, who: str) -> tuple[list[Events], EvplaceError | None]:
    """All packets, and the error that ended them."""
    packets: list[Events] = []
    try:
        for packet in _opened(module, path).packets():
            packets.append(packet)
    except RecordingError as error:
        require("\n" not in str(error), f"an error of {who} is more than one line: {error}")
        return packets, error
    return packets, None


def _check_events(module: ModuleType, path: Path, who: str) -> None:
    events, recording = some_events(), _opened(module, path, None)
    back = Events.concatenate(list(recording.packets()))
    moved = Events(events.t_us + (back.t_us[0] - events.t_us[0]), events.x, events.y, events.p, SIZE)
    require(recording.size == SIZE, f"{who} gives {recording.size} for a sensor of {SIZE}")
    require(
        np.array_equal(_sorted(back), _sorted(moved)), f"{who} does not give the events that were written"
    )
    require(not any(recording.dropped.values()), f"{who} drops good events: {recording.dropped}")
    again = sum(map(len, recording.packets()))
    require(again == len(events), f"{who} gives {again} of {len(events)} events when it is read again")


def _check_matches(module: ModuleType, path: Path, who: str) -> None:
    """That the content, not the name, is known to this reader, and to no other."""
    folder = path.parent
    path = path.rename(folder / "recording.xyz")
    with path.open("rb") as file:
        head = file.read(HEAD)
    require(module.matches(path, head), f"{who} does not know its own content under another name")
    for name, other in families.loadable("readers"):
        if other is not module:
            require(
                not other.matches(path, head), f"the reader '{name}' takes the content of {who} for its own"
            )
    for content in OTHER_CONTENT:
        letter = folder / "other"
        letter.write_bytes(content)
        require(not module.matches(letter, content), f"{who} takes {content[:12]!r} for its own")
    empty = folder / "empty"
    empty.mkdir()
    require(not module.matches(empty, b""), f"{who} takes an empty folder for its own")


def _check_drops(module: ModuleType, path: Path, who: str) -> None:
    """That nothing is silently lost: an event beyond a smaller sensor is counted."""
    events, recording = some_events(), _opened(module, path, (SIZE[0] // 2, SIZE[1]))
    kept, dropped = sum(map(len, recording.packets())), sum(recording.dropped.values())
    require(
        (kept, kept + dropped) == (int((events.x < SIZE[0] // 2).sum()), len(events)),
        f"{who} gives {kept} events and counts {dropped} as dropped, of {len(events)}",
    )


def _check_cuts(module: ModuleType, path: Path, cuts: int, seed: int, who: str, whole: bool) -> None:
    all_events = Events.concatenate(_read(module, path, who)[0])
    data, most = path.read_bytes(), 0
    cut_file = path.with_name(f"cut{path.suffix}")
    for at in [*cut_at(len(data), seed, cuts), len(data) * 9 // 10, len(data) - 1]:
        cut_file.write_bytes(data[:at])
        packets, _ = _read(module, cut_file, who)
        count = sum(map(len, packets))
        most = max(most, count)
        if packets:
            times = Events.concatenate(packets).t_us
            good = np.array_equal(times, all_events.t_us[:count])
            require(good, f"{who} gives other events for a file cut after {at} bytes")
    require(
        most > len(all_events) // 2 or whole,
        f"{who} gives at most {most} of {len(all_events)} events of a file that was cut",
    )


def _check_flips(module: ModuleType, path: Path, flips: int, seed: int, who: str) -> None:
    data = path.read_bytes()
    flipped_file = path.with_name(f"flipped{path.suffix}")
    for number in range(flips):
        flipped_file.write_bytes(flipped(data, seed, number))
        start_s = time.process_time()
        packets, _ = _read(module, flipped_file, who)
        took_s = time.process_time() - start_s
        require(took_s < MOST_WORK_S, f"{who} works {took_s:.0f} s on a damaged file (bit {number})")
        check_packets(packets, SIZE, who)


def _sorted(events: Events) -> NDArray[np.int64]:
    """(4, n): formats may change the order of events of one time."""
    order = np.lexsort((events.p, events.x, events.y, events.t_us))
    return np.stack([events.t_us[order], events.x[order], events.y[order], events.p[order]])
