"""The checks that evplace gives to those who add parts."""

from __future__ import annotations

from pathlib import Path

from evplace_example import reader
from evplace_example.descriptor import Thumbnail
from evplace_example.matcher import Majority
from evplace_example.representation import Repeated

from evplace.core.events import Events
from evplace.testing import check_descriptor, check_matcher, check_reader, check_representation


def test_the_matcher() -> None:
    check_matcher(Majority())
    check_matcher(Majority.presets["strict"])


def test_the_descriptor() -> None:
    check_descriptor(Thumbnail())
    check_descriptor(Thumbnail(width=100, height=3))


def test_the_representation() -> None:
    check_representation(Repeated)


def test_the_reader() -> None:
    check_reader(reader, write_diary)


def write_diary(folder: Path, events: Events) -> Path:
    """The events as a diary."""
    lines = [f"event diary {events.size[0]}x{events.size[1]}\n"]
    for t, x, y, p in zip(events.t_us, events.x, events.y, events.p, strict=True):
        lines.append(f"at {t} us, {x} {y} {'brighter' if p else 'darker'}\n")
    path = folder / "made.txt"
    path.write_text("".join(lines))
    return path
