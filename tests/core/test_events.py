"""Packets of events: what a camera hands over is checked once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evplace.core.errors import InputError
from evplace.core.events import Events
from evplace.imaging.stream import EventImages
from evplace.sources.readers import open_recording

SIZE = (8, 6)
GOOD: dict[str, Any] = {
    "t_us": np.arange(4) * 40_000, "x": np.arange(4), "y": np.arange(4), "p": np.array([0, 1, 1, 0]),
}  # fmt: skip


@pytest.mark.parametrize(
    ("p", "brighter"),
    [
        ([True, False], [True, False]),
        ([1, 0], [True, False]),
        ([1, -1], [True, False]),
        ([1.0, -1.0], [True, False]),
        ([-1, 0], [False, False]),
        (np.array([255, 0], "u1") // 255, [True, False]),
    ],
)
def test_polarities(p: object, brighter: list[bool]) -> None:
    assert Events.of([0, 1], [0, 0], [0, 0], p, SIZE).p.tolist() == brighter


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("t_us", GOOD["t_us"] / 1e6, "whole microseconds, not float64: round seconds"),
        ("t_us", ["a", "b", "c", "d"], "whole microseconds"),
        ("t_us", GOOD["t_us"][::-1], "event 1 is earlier"),
        ("t_us", [0, 5, 4, 6], "event 2 is earlier"),
        ("t_us", np.arange(8).reshape(4, 2), "of one length"),
        ("x", [0, 1], "of one length"),
        ("y", np.arange(5), "of one length"),
        ("p", [True], "of one length"),
        ("x", [0, 1, 2, -1], "not -1 to 2"),
        ("y", [0, 1, 2, 65_536], "0 to 65536"),
        ("x", [0.5, 1, 2, 3], "whole columns, not float64"),
        ("p", [0, 1, 2, 1], "-1 and 1"),
        ("p", [0, 1, np.nan, 1], "-1 and 1"),
        ("p", ["on", "off", "on", "on"], "-1 and 1"),
    ],
)
def test_what_is_no_event(name: str, values: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        Events.of(**(GOOD | {name: values}), size=SIZE)


def test_no_events_are_a_packet_too() -> None:
    assert len(Events.of([], [], [], [], SIZE)) == 0


def test_packets_come_in_the_order_of_their_times() -> None:
    images = EventImages(SIZE)
    packet = Events.of(**GOOD, size=SIZE)
    assert len(list(images.push(packet))) == 3
    with pytest.raises(InputError, match="a packet begins at 0 us, before the last event, at 120000 us"):
        list(images.push(packet))
    list(images.push(Events.empty(SIZE)))
    list(images.push(packet[3:]))


@pytest.mark.parametrize(
    "packet",
    [
        Events(GOOD["t_us"] / 1e6, *(np.zeros(4, "u2"),) * 2, np.zeros(4, bool), SIZE),
        Events(GOOD["t_us"], np.zeros(2, "u2"), np.zeros(4, "u2"), np.zeros(4, bool), SIZE),
        Events(GOOD["t_us"][::-1], *(np.zeros(4, "u2"),) * 2, np.zeros(4, bool), SIZE),
        Events([0, 1], [0, 1], [0, 1], [True, True], SIZE),  # type: ignore[arg-type]
    ],
)
def test_packets_that_were_made_otherwise_are_checked_at_the_door(packet: Events) -> None:
    with pytest.raises(InputError):
        list(EventImages(SIZE).push(packet))


@pytest.mark.parametrize("size", [(0, 1), (1, 1 << 17), (-3, 4), (5,)])
def test_sensors_that_cannot_be(size: Any) -> None:
    with pytest.raises(InputError, match="cannot be"):
        Events.of([0], [0], [0], [1], size)


def test_what_a_recording_gives_is_not_checked_again(tmp_path: Path) -> None:
    np.savez(tmp_path / "made.npz", t_us=GOOD["t_us"], x=GOOD["x"], y=GOOD["y"], p=GOOD["p"])
    (packet,) = open_recording(tmp_path / "made.npz", SIZE).packets()
    assert packet.checked
    assert packet[1:].checked
    assert not packet[::-1].checked
    assert not replace(packet, x=packet.y).checked
    assert not Events.of(**GOOD, size=SIZE).checked
    for other in (packet[::-1], replace(packet, t_us=packet.t_us[::-1])):
        with pytest.raises(InputError, match="earlier than the one before"):
            list(EventImages(SIZE).push(other))


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("t_us", np.array([1, 2, 3, 2**63 + 5], "u8"), "no clock counts so far"),
        ("t_us", np.ma.array([1, 2, 3, 4], mask=[0, 0, 1, 0]), "is masked at some"),
        ("x", [[1], [1, 2], [1], [1]], "whole columns, one each"),
        ("size", None, "cannot be"),
        ("size", (8.0, 6.0), "cannot be"),
        ("size", "8x6", "cannot be"),
    ],
)
def test_what_numpy_would_make_something_of(name: str, values: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        Events.of(**(GOOD | {"size": SIZE} | {name: values}))


@pytest.mark.parametrize("packet", [None, ([0], [0], [0], [1]), np.zeros((4, 4))])
def test_packets_are_events(packet: Any) -> None:
    with pytest.raises(InputError, match="packets are Events, not"):
        list(EventImages(SIZE).push(packet))


def test_a_packet_of_another_sensor_is_held_against_that_of_the_images() -> None:
    packet = Events.of([0, 1, 50_000], [100, 2, 1], [0, 0, 0], [1, 1, 1], (640, 480))
    with pytest.raises(InputError, match=r"a packet is of a \(640, 480\) sensor, these images are of"):
        list(EventImages(SIZE).push(packet))
