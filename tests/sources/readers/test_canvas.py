"""Events marked as they are decoded, against events that are stored and checked first: nothing may differ."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import MAKERS, encoded, libcaer_words, mono_words, ros1_bag
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import EvplaceError
from evplace.core.events import Events, Size
from evplace.imaging.recipe import Recipe
from evplace.imaging.stream import EventImages
from evplace.sources.readers import Hints, Recording, Source, _source
from evplace.sources.readers._ros import PACKED
from evplace.testing._readers import cut_at, flipped

SIZE: Size = (240, 180)
MARKING = ["dat", "es", "evt2", "evt21", "evt3", "ros1", "ros2_db3", "ros2_mcap"]
"""The formats whose readers mark."""
DAMAGES = 25
"""Cuts and flips of each file."""
UNJUDGED = 4097
"""Events that are stored first, since the first can only be judged by those that follow."""


def drive(count: int, seed: int = 0) -> Events:
    """Events in bursts over 0.3 s, a few windows without any."""
    rng = np.random.default_rng(seed)
    t_us = 10_000 + np.sort(
        rng.integers(0, 300_000, count) // 50_000 * 50_000 + rng.integers(0, 40_000, count)
    )
    return Events.of(
        t_us, rng.integers(0, 240, count), rng.integers(0, 180, count), rng.random(count) < 0.5, SIZE
    )


def opened(form: str, path: Path) -> Recording:
    """Of a known format and size, whatever a flipped bit has made of the header."""
    module = families.load("readers", form)
    source: Source = module.read(path, Hints(SIZE))
    return Recording(path, form, source, SIZE)


def told(recording: Recording, stream: EventImages, marking: bool) -> list[Any]:
    """All images with their windows, what was counted, and what ended the reading."""
    found: list[Any] = []
    try:
        for packet in recording.packets(stream.canvas if marking else None):
            found += [(made.window, made.image.tobytes()) for made in stream.push(packet)]
    except EvplaceError as error:
        found.append((type(error), str(error)))
    found += [(made.window, made.image.tobytes()) for made in stream.finish()]
    counts = recording.events, recording.t_first_us, recording.t_last_us, recording.back_us
    return [*found, counts, dict(recording.dropped), dict(stream.cleaned)]


def same(form: str, path: Path, recipe: Recipe, mask: NDArray[np.bool_] | None = None) -> list[Any]:
    """What both ways say; a header that cannot be read says nothing."""
    try:
        both = [told(opened(form, path), EventImages(SIZE, recipe, mask), way) for way in (True, False)]
    except EvplaceError:
        return []
    assert both[0] == both[1]
    return both[0]


def masked() -> NDArray[np.bool_]:
    return np.random.default_rng(5).random(SIZE[::-1]) < 0.3


@pytest.mark.parametrize("form", MARKING)
@pytest.mark.parametrize("representation", ["binary", "count"])
def test_images_drops_and_counts_are_the_same(
    form: str, representation: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words(monkeypatch, form, 256)
    events = drive(12_000)
    path, recipe = MAKERS[form](tmp_path, events), Recipe().changed(representation=representation)
    found = same(form, path, recipe)
    assert len([one for one in found if isinstance(one, tuple) and len(one) == 2]) >= 8
    assert same(form, path, recipe, masked())[-1] == {"masked": int(masked()[events.y, events.x].sum())}


@pytest.mark.parametrize("form", MARKING)
def test_most_events_are_marked(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words(monkeypatch, form, 256)
    recording, stream = opened(form, MAKERS[form](tmp_path, drive(20_000))), EventImages(SIZE)
    stored = 0
    for packet in recording.packets(stream.canvas):
        stored += len(packet)
        list(stream.push(packet))
    assert recording.events == 20_000
    assert UNJUDGED < stored < UNJUDGED + 3000


@pytest.mark.parametrize("form", MARKING)
def test_damage_changes_nothing(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data, bad = MAKERS[form](tmp_path, drive(9000)).read_bytes(), tmp_path / "bad"
    for number in range(DAMAGES):
        words(monkeypatch, form, 1 << (4 + number % 9))
        for content in (data[: cut_at(len(data), 1, DAMAGES)[number]], flipped(data, 1, number)):
            bad.write_bytes(content)
            same(form, bad, Recipe().changed(dt="1/120"), masked() if number % 2 else None)


def arrays(events: Events) -> bytes:
    """A serialised dvs_msgs/EventArray of ROS 1."""
    head = struct.pack("<IIII3sII", 0, 7, 0, 3, b"cam", 180, 240)
    rows = np.zeros(len(events), PACKED)
    rows["x"], rows["y"], rows["p"] = events.x, events.y, events.p
    rows["s"], rows["ns"] = events.t_us // 1_000_000, events.t_us % 1_000_000 * 1000
    return head + struct.pack("<I", len(rows)) + rows.tobytes()


def messages(events: Events, kind: str) -> list[bytes]:
    """In messages of 700 events; "mixed" has an encoding that stores among one that marks."""
    if kind == "arrays":
        return [arrays(events[start : start + 700]) for start in range(0, len(events), 700)]
    found = []
    for number, start in enumerate(range(0, len(events), 700)):
        part = events[start : start + 700]
        stores = kind == "mixed" and number % 3 == 1
        made = libcaer_words(part) if stores else mono_words(part)
        found.append(encoded("libcaer" if stores else "mono", 7_000_000_000 * stores, made.tobytes()))
    return found


@pytest.mark.parametrize("kind", ["arrays", "mono", "mixed"])
def test_messages_of_each_encoding(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_source, "GATHERED", 900)
    name = "dvs_msgs/EventArray" if kind == "arrays" else "event_camera_msgs/EventPacket"
    path, bad = ros1_bag(tmp_path, name, messages(drive(15_000), kind)), tmp_path / "bad.bag"
    assert len(same("ros1", path, Recipe().changed(dt="1/120"))) > 30
    data = path.read_bytes()
    for number in range(DAMAGES):
        bad.write_bytes(flipped(data, 2, number))
        same("ros1", bad, Recipe().changed(dt="1/120"), masked() if number % 2 else None)


def words(monkeypatch: pytest.MonkeyPatch, form: str, count: int) -> None:
    """Have a reader decode so many words at a time."""
    module = families.load("readers", form)
    monkeypatch.setattr(_source, "GATHERED", count)
    for name in ("WORDS", "EVENTS", "BYTES"):
        if hasattr(module, name):
            monkeypatch.setattr(module, name, count)


KINDS = [0x0, 0x2, 0x2, 0x2, 0x3, 0x4, 0x5, 0x6, 0x8]
runs = st.lists(st.tuples(st.sampled_from(KINDS), st.integers(0, 0xFFF)), min_size=1, max_size=300)


def steady(run: list[tuple[int, int]]) -> Iterator[int]:
    """Words whose clock mostly goes on, and whose rows and columns mostly lie on the sensor."""
    high = 0
    for number, (kind, value) in enumerate(run):
        if kind == 0x8 and value % 8:
            high += value % 3
            value = high & 0xFFF
        elif kind == 0x6 and value % 8:
            value = number * 13 % 4096
        elif kind in (0x0, 0x2, 0x3) and value % 16:
            value = value & 0x800 | value % 180
        yield kind << 12 | value


@given(runs, st.integers(1, 64), st.sampled_from(["1/1000", "1/120", "1/30"]), st.booleans())
def test_any_words_in_slices_of_any_size(
    tmp_path_factory: pytest.TempPathFactory,
    run: list[tuple[int, int]],
    slice_of: int,
    dt: str,
    with_mask: bool,
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.raw"
    first = [(0x8, 0), *[(0x2, number % 180) for number in range(UNJUDGED)]]
    data = np.fromiter(steady([*first, *run]), np.uint16)
    path.write_bytes(b"% evt 3.0\n% geometry 240x180\n% end\n" + data.astype("<u2").tobytes())
    with pytest.MonkeyPatch.context() as patch:
        words(patch, "evt3", slice_of)
        same("evt3", path, Recipe().changed(dt=dt), masked() if with_mask else None)
