"""Text: orders of columns, separators, units, archives, exact times, and lines that are no events."""

from __future__ import annotations

import gzip
import zipfile
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import SIZE, some_events, text

from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.core.events import Events
from evplace.sources.readers import open_recording
from evplace.sources.readers._text_numbers import parse

SOME = some_events(20_000, 500_000)
ROWS = list(zip(SOME.t_us.tolist(), SOME.x.tolist(), SOME.y.tolist(), SOME.p.tolist(), strict=True))
LAYOUTS = {
    "x y p t in us": "".join(f"{x},{y},{p:d},{t}\n" for t, x, y, p in ROWS),
    "x y t p in us": "".join(f"{x} {y} {t} {p:d}\n" for t, x, y, p in ROWS),
    "signs and tabs": "# remark\n"
    + "".join(f"{t / 1e6:.9f}\t{x}\t{y}\t{2 * p - 1}\r\n" for t, x, y, p in ROWS),
    "named, in ns": "p;y;x;t_ns\n" + "".join(f"{p:d};{y};{x};{t * 1000}\n" for t, x, y, p in ROWS),
    "named, in ms": "timestamp,x,y,t_ms,polarity\n"
    + "".join(f"0,{x},{y},{t / 1000},{p:d}\n" for t, x, y, p in ROWS),
    "exponents": "".join(f"{t / 1e6:.18e} {x:.18e} {y:.18e} {p:.18e}\n" for t, x, y, p in ROWS),
    "no last newline": "".join(f"{t / 1e6:.6f} {x} {y} {p:d}\n" for t, x, y, p in ROWS)[:-1],
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts(name: str, tmp_path: Path) -> None:
    path = tmp_path / "events.txt"
    path.write_text(LAYOUTS[name], newline="")
    recording = open_recording(path, SIZE)
    back = Events.concatenate(list(recording.packets()))
    assert recording.format == "text"
    for field in ("t_us", "x", "y", "p"):
        assert np.array_equal(getattr(back, field), getattr(SOME, field)), field


def test_archives(tmp_path: Path) -> None:
    made = text(tmp_path, SOME)
    with zipfile.ZipFile(tmp_path / "set.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("images.txt", "0.1 images/frame_0.png\n")
        archive.write(made, "set/events.txt")
    with gzip.open(tmp_path / "set.gz", "wb") as packed:
        packed.write(made.read_bytes())
    for name in ("set.zip", "set.gz"):
        recording = open_recording(tmp_path / name)
        assert (recording.format, recording.size) == ("text", SIZE)
        assert sum(map(len, recording.packets())) == len(SOME)


def test_a_line_that_is_no_event_is_named(tmp_path: Path) -> None:
    path = text(tmp_path, SOME)
    lines = path.read_text().splitlines(keepends=True)
    lines[15_000] = "0.3 12 oops 1\n"
    path.write_text("".join(lines))
    recording = open_recording(path)
    with pytest.raises(DamagedRecordingError, match="line 15001 is no event"):
        list(recording.packets())
    assert recording.events == 14_999


@pytest.mark.parametrize(
    "content", ["a log of the day\n", "1 2 3\n4 5 6\n", "0.1 0.2 0.3 0.4\n", "9 1 2 1\n7 2 1 1\n" * 9]
)
def test_other_text_is_no_recording(content: str, tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text(content)
    with pytest.raises(RecordingError, match="no known recording format"):
        open_recording(path)


@given(st.decimals(-(10**9), 10**9, allow_nan=False, allow_infinity=False, places=9), st.booleans())
def test_numbers_are_read_exactly(value: Decimal, scientific: bool) -> None:
    line = f"{value:e}\n" if scientific else f"{value:f}\n"
    whole, fraction, used, lines = parse(np.frombuffer(line.encode(), np.uint8), 1, 10)
    assert (used, lines, whole.shape) == (len(line), 1, (1, 1))
    assert Decimal(int(whole[0, 0])) + Decimal(int(fraction[0, 0])) / 10**9 == value


@given(st.text("0123456789.-+eE #,\n\t", max_size=60))
def test_the_plain_twin_reads_the_same_rows(content: str) -> None:
    data = content + "\n"
    whole, fraction, _, _ = parse(np.frombuffer(data.encode(), np.uint8), 2, 100)
    expected = []
    for line in data.splitlines():
        words = [] if line.strip(" \t,").startswith("#") else line.replace(",", " ").split()
        if (words and len(words) != 2) or any(not plain_number(word) for word in words):
            break
        expected += [[float(word) for word in words]] if words else []
    found = whole + fraction / 1e9
    assert found.shape == (len(expected), 2)
    small = [abs(value) < 1e8 for row in expected for value in row]
    assert np.allclose(found.ravel()[small], np.array(expected).ravel()[small], atol=2e-9)


def plain_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return "_" not in word
