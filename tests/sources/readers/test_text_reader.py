"""Text: orders of columns, separators, units, archives, exact times, and lines that are no events."""

from __future__ import annotations

import gzip
import re
import zipfile
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import SIZE, some_events, text

from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
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


def lines(form: str) -> str:
    """A line for each event; `form` has i (its number), t in us, s in seconds, x, y, p and its sign."""
    return "".join(
        form.format(i=i, t=t, s=t / 1e6, x=x, y=y, p=int(p), sign=2 * p - 1)
        for i, (t, x, y, p) in enumerate(ROWS)
    )


BOOL = "".join(f"{t},{x},{y},{bool(p)}\n" for t, x, y, p in ROWS)
WORDS = "".join(f"{t} {x} {y} {'ON' if p else 'OFF'}\n" for t, x, y, p in ROWS)
EPOCH = 1_587_452_582
SEEN: dict[str, tuple[bytes, str | None]] = {
    "mark of utf-8": (("\ufefft,x,y,p\n" + lines("{t},{x},{y},{p}\n")).encode(), None),
    "utf-16": (("t,x,y,p\n" + lines("{t},{x},{y},{p}\n")).encode("utf-16"), None),
    "utf-16 without a mark": (lines("{t} {x} {y} {p}\n").encode("utf-16-be"), "t,x,y,p"),
    "remark in utf-8": (("# Zeit in µs\n" + lines("{t} {x} {y} {p}\n")).encode(), "t,x,y,p"),
    "remark in latin-1": (("# Zeit in µs\n" + lines("{t} {x} {y} {p}\n")).encode("latin-1"), "t,x,y,p"),
    "remark in shift-jis": (("# 時間は秒\n" + lines("{s:.6f} {x} {y} {p}\n")).encode("shift-jis"), "t,x,y,p"),
    "remarks between": (lines("{t} {x} {y} {p}\n").replace("\n", "\n% é\n", 3).encode("latin-1"), "t,x,y,p"),
    "geometry": (("%geometry:240,180\n" + lines("{x},{y},{p},{t}\n")).encode(), "x,y,p,t"),
    "sizes in names": (("t,x@240,y@180,on\n" + lines("{t},{x},{y},{p}\n")).encode(), None),
    "an index with an empty name": ((",t,x,y,p\n" + lines("{i},{t},{x},{y},{p}\n")).encode(), None),
    "an index without a name": (("t,x,y,p\n" + lines("{i},{t},{x},{y},{p}\n")).encode(), None),
    "an index, no names": (lines("{i} {t} {x} {y} {p}\n").encode(), "-,t,x,y,p"),
    "quotes": (('"t","x","y","p"\n' + lines('"{t}","{x}","{y}","{p}"\n')).encode(), None),
    "single quotes": (lines("'{x}';'{y}';'{t}';'{sign}'\n").encode(), "x,y,t,p"),
    "a fifth column": (("t,x,y,p,camera\n" + lines("{t},{x},{y},{p},0\n")).encode(), None),
    "a fifth column, no names": (lines("{t} {x} {y} {p} 0\n").encode(), "t,x,y,p,-"),
    "long names": (("event_time_us,x_pos,y_pos,polarity\n" + lines("{t},{x},{y},{p}\n")).encode(), None),
    "units in brackets": (("Time [µs];X [px];Y [px];Polarity\n" + lines("{t};{x};{y};{p}\n")).encode(), None),
    "strange names": (("a,b,c,d\n" + lines("{t},{x},{y},{sign}\n")).encode(), "t,x,y,p"),
    "True and False": (BOOL.encode(), "t,x,y,p"),
    "ON and OFF": (WORDS.encode(), "t,x,y,p"),
    "bare carriage returns": (("t,x,y,p\r" + lines("{t},{x},{y},{p}\r")).encode(), None),
    "carriage returns twice": (lines("{t} {x} {y} {p}\r\r\n").encode(), "t,x,y,p"),
    "polarity first": (lines("{p}\t{s:.6f}\t{x}\t{y}\n").encode(), "p,t,x,y"),
    "nanoseconds": (lines("{t}000 {x} {y} {p}\n").encode(), "t,x,y,p"),
}
"""Name -> a file's bytes, and what its columns are told to be by their values."""


@pytest.mark.parametrize("name", SEEN)
def test_text_as_people_have_it(name: str, tmp_path: Path) -> None:
    data, order = SEEN[name]
    path = tmp_path / "events.csv"
    path.write_bytes(data)
    recording = open_recording(path, None if name in ("geometry", "sizes in names") else SIZE)
    back = Events.concatenate(list(recording.packets()))
    assert (recording.size, sum(recording.dropped.values())) == (SIZE, 0)
    for field in ("t_us", "x", "y", "p"):
        assert np.array_equal(getattr(back, field), getattr(SOME, field)), field
    told = [note for note in recording.notes if note.startswith("columns")]
    assert told == (
        []
        if order is None
        else [f"columns are taken as {order} by their values: if wrong, give `columns=t,x,y,p`"]
    )


@pytest.mark.parametrize(
    ("head", "form", "ns"),
    [
        ("sec,nsec,x,y,polarity", "{s},{f},{x},{y},{p}\n", 1),
        ("ts.secs ts.nsecs x y pol", "{s} {f} {x} {y} {p}\n", 1),
        ("x,y,p,timestamp_sec,timestamp_nsec", "{x},{y},{p},{s},{f}\n", 1),
        ("tv_sec;tv_usec;x;y;p", "{s};{f};{x};{y};{p}\n", 1000),
        ("", "{s} {f} {x} {y} {p}\n", 1),
        ("", "{x} {y} {s} {f} {p}\n", 1),
    ],
)
def test_seconds_and_their_parts(head: str, form: str, ns: int, tmp_path: Path) -> None:
    t_us = EPOCH * 10**6 + SOME.t_us * 5
    path = tmp_path / "events.csv"
    rows = zip(t_us.tolist(), SOME.x.tolist(), SOME.y.tolist(), SOME.p.tolist(), strict=True)
    text = "".join(
        form.format(s=t // 10**6, f=t % 10**6 * 1000 // ns, x=x, y=y, p=int(p)) for t, x, y, p in rows
    )
    path.write_text((head + "\n" if head else "") + text)
    back = Events.concatenate(list(open_recording(path, SIZE).packets()))
    assert np.array_equal(back.t_us, t_us)
    assert np.array_equal(back.x, SOME.x)
    order = form.strip().translate(str.maketrans(" ;", ",,")).replace("{s}", "sec").replace("{f}", "nsec")
    if ns == 1:
        said = open_recording(path, SIZE, columns=re.sub("[{}]", "", order))
        assert np.array_equal(Events.concatenate(list(said.packets())).t_us, t_us)


UNCLEAR = {
    "taller than wide": (
        "",
        "{y},{x},{p},{t}\n",
        "it could be x,y,p,t of a sensor taller",
        "y,x,p,t",
    ),
    "two polarities": (
        "# a remark\n",
        "{t} {x} {y} {p} {p}\n",
        "columns 4 and 5 could both be p",
        "t,x,y,-,p",
    ),
    "three coordinates": ("", "{t} {x} {x} {y} {p}\n", "columns 2, 3, 4 could all be x or y", "t,-,x,y,p"),
    "two clocks": ("", "{t} {t}9 {x} {y} {p}\n", "columns 1 and 2 could both be t", "t,-,x,y,p"),
    "two names": ("t,x_a,x_b,y,p\n", "{t},{x},{x},{y},{p}\n", "columns 2, 3 could all be x", "t,x,-,y,p"),
}


@pytest.mark.parametrize("name", UNCLEAR)
def test_what_cannot_be_known_is_asked_for(name: str, tmp_path: Path) -> None:
    head, form, told, columns = UNCLEAR[name]
    path = tmp_path / "events.csv"
    path.write_text(head + lines(form))
    line = head.count("\n") + 1
    with pytest.raises(RecordingError, match=rf"line {line} \('.*'\): {told}.*give `columns=t,x,y,p`"):
        open_recording(path)
    back = Events.concatenate(list(open_recording(path, SIZE, columns=columns).packets()))
    for field in ("t_us", "x", "y", "p"):
        assert np.array_equal(getattr(back, field), getattr(SOME, field)), field


@pytest.mark.parametrize(
    ("line", "odd"),
    [
        ("{t},{x},{y},+", "+"),
        ("2023-05-01T10:00:00.5Z,{x},{y},{p}", "2023-05-01T10:00:00.5Z"),
        ("{t},{x},{y},rising", "rising"),
        ("{t} us,{x},{y},{p}", "us"),
        ("0x10,{x},{y},{p}", "0x10"),
    ],
)
def test_a_word_below_names_that_is_no_number_is_named(line: str, odd: str, tmp_path: Path) -> None:
    path = tmp_path / "events.csv"
    path.write_text("t,x,y,polarity\n" + lines(line + "\n"))
    with pytest.raises(RecordingError, match=rf"line 2 \('.*'\) is no event: '{re.escape(odd)}'"):
        open_recording(path)


def test_columns_that_the_caller_gives_must_fit(tmp_path: Path) -> None:
    path = text(tmp_path, SOME)
    with pytest.raises(RecordingError, match=r"line 2 \('.*'\): it has 4 columns, not the 5"):
        open_recording(path, columns="-,t,x,y,p")
    swapped = Events.concatenate(list(open_recording(path, (240, 240), columns="t,y,x,p").packets()))
    assert np.array_equal(swapped.x, SOME.y)


@pytest.mark.parametrize("mark", [";", "\t", " ", " ; "])
@pytest.mark.parametrize("seconds", ["{s:.6f}", "{s:.6e}"])
def test_decimal_commas_are_not_read(mark: str, seconds: str, tmp_path: Path) -> None:
    path = tmp_path / "events.csv"
    row = mark.join([seconds, "{x}", "{y}", "{p}"])
    path.write_text(mark.join("txyp") + "\n" + lines(row + "\n").replace(".", ","))
    with pytest.raises(UnsupportedError, match=r"line 2 .* has decimal commas"):
        open_recording(path)


def test_an_archive_of_two_cameras(tmp_path: Path) -> None:
    made = text(tmp_path, SOME)
    with zipfile.ZipFile(tmp_path / "set.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("images.txt", "0.1 images/frame_0.png\n")
        archive.write(made, "left/events.txt")
        archive.writestr("right/events.txt", lines("{s:.6f} {x} {y} {p}\n").replace(" 0\n", " 1\n"))
    recording = open_recording(tmp_path / "set.zip")
    assert recording.streams == ["left/events.txt", "right/events.txt"]
    right = Events.concatenate(list(open_recording(tmp_path / "set.zip", SIZE, stream="right").packets()))
    assert right.p.all()


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
