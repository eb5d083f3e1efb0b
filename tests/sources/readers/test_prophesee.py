"""Prophesee's files: headers of any bytes, and EVT 2.1 in both orders of words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made import SIZE, evt3_words, evt21_words, some_events

from evplace.core.errors import UnsupportedError
from evplace.core.events import Events
from evplace.sources.readers import open_recording

SOME = some_events(3000)
HEADERS = {
    "utf-8": "% place Zürich, Hörsaal 21 °C\n".encode(),
    "latin-1": "% place Zürich, Hörsaal 21 °C\n".encode("latin-1"),
    "utf-16": b"% place " + "Zürich".encode("utf-16") + b"\n",
    "control codes": b"% place \x00\x01\x1b[2J\x7f\n",
    "a percent sign alone": b"%\n",
    "no blank": b"%place lab\n",
    "long": b"% place " + b"\xc3\xbc" * 4000 + b"\n",
    "windows": "% place Zürich\r\n".encode(),
    "end inside a remark": b"% place the \xff end\n",
}


def same(path: Path, size: tuple[int, int] | None = None) -> bool:
    recording = open_recording(path, size)
    back = Events.concatenate(list(recording.packets()))
    assert (recording.size, sum(recording.dropped.values())) == (SIZE, 0)
    return all(np.array_equal(getattr(back, name), getattr(SOME, name)) for name in ("t_us", "x", "y", "p"))


@pytest.mark.parametrize("odd", [b"", b"% a\n", b"% ab\n", b"% abc\n"])
@pytest.mark.parametrize("name", HEADERS)
def test_a_header_of_any_bytes_and_length(name: str, odd: bytes, tmp_path: Path) -> None:
    path = tmp_path / "made.raw"
    lines = HEADERS[name] + odd + b"% geometry 240x180\n"
    path.write_bytes(b"% evt 3.0\n" + lines + b"% end\n" + evt3_words(SOME).tobytes())
    assert same(path)


@pytest.mark.parametrize("name", ["utf-8", "latin-1", "no blank", "windows", "end inside a remark"])
def test_a_header_whose_end_is_not_marked(name: str, tmp_path: Path) -> None:
    path = tmp_path / "made.raw"
    path.write_bytes(b"% evt 3.0\n" + HEADERS[name] + b"% geometry 240x180\n" + evt3_words(SOME).tobytes())
    assert same(path)


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("order", ["little", "legacy"])
@pytest.mark.parametrize("events", [SOME, SOME[:1]], ids=["many", "one"])
def test_both_orders_of_words(events: Events, order: str, stated: bool, tmp_path: Path) -> None:
    words = evt21_words(events)
    halves = words.view("<u4").reshape(-1, 2)
    field = f"endianness={order};" if stated else ""
    head = f"% evt 2.1\n% format EVT21;{field}height=180;width=240\n% end\n"
    path = tmp_path / "made.raw"
    path.write_bytes(head.encode() + (halves[:, ::-1] if order == "legacy" else halves).tobytes())
    recording = open_recording(path)
    back = Events.concatenate(list(recording.packets()))
    for field in ("t_us", "x", "y", "p"):
        assert np.array_equal(getattr(back, field), getattr(events, field))
    told = f"the header states no order of the words of EVT 2.1: in '{order}' order the clock runs"
    assert recording.notes == ([] if stated else [told])


def test_an_order_of_words_that_is_not_known(tmp_path: Path) -> None:
    path = tmp_path / "made.raw"
    path.write_bytes(b"% evt 2.1\n% format EVT21;endianness=middle\n% end\n" + evt21_words(SOME).tobytes())
    with pytest.raises(UnsupportedError, match="'middle': little and legacy are read"):
        open_recording(path)


@pytest.mark.parametrize("line", ["evt 2.1", "format EVT21;height=180;width=240", "format EVT2.1"])
def test_the_version_stands_in_either_line(line: str, tmp_path: Path) -> None:
    path = tmp_path / "made.raw"
    path.write_bytes(f"% {line}\n% geometry 240x180\n% end\n".encode() + evt21_words(SOME).tobytes())
    assert open_recording(path).format == "evt21"
    assert same(path)
