"""numpy archives: names, units, signs, and archives that claim too much or hold something else."""

from __future__ import annotations

import io
import resource
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import some_events

from evplace.core.errors import DamagedRecordingError, DoubtfulRecordingError, RecordingError
from evplace.core.events import Events
from evplace.sources.readers import is_recording, open_recording

SOME = some_events(30_000, 1_000_000)


def archive(folder: Path, **arrays: Any) -> Path:
    np.savez(folder / "a.npz", **arrays)
    return folder / "a.npz"


def columns(**other: Any) -> dict[str, Any]:
    return {"t": SOME.t_us, "x": SOME.x, "y": SOME.y, "p": SOME.p} | other


@pytest.mark.parametrize(
    ("name", "times", "note"),
    [
        ("t", SOME.t_us, "taken as us"),
        ("timestamps", SOME.t_us / 1e6, "taken as s"),
        ("t_us", SOME.t_us, None),
        ("t_ns", SOME.t_us * 1000, None),
        ("t_ms", SOME.t_us / 1e3, None),
        ("t_s", SOME.t_us / 1e6, None),
    ],
)
def test_units_of_time(name: str, times: np.ndarray, note: str | None, tmp_path: Path) -> None:
    arrays = {"xs": SOME.x, "y": SOME.y, "pol": SOME.p.astype(np.int8) * 2 - 1, name: times}
    recording = open_recording(archive(tmp_path, **arrays))
    back = Events.concatenate(list(recording.packets()))
    assert np.array_equal(back.t_us, SOME.t_us)
    assert np.array_equal(back.p, SOME.p)
    assert any(note in text for text in recording.notes) if note else len(recording.notes) == 1  # the size


def test_a_unit_that_is_not_clear_is_an_error_until_it_is_given(tmp_path: Path) -> None:
    path = archive(tmp_path, **columns(t=SOME.t_us * 10))
    with pytest.raises(RecordingError, match=r"not clear.*time_unit=us"):
        open_recording(path)
    back = Events.concatenate(list(open_recording(path, time_unit="us").packets()))
    assert np.array_equal(back.t_us, SOME.t_us * 10)
    with pytest.raises(RecordingError, match="known are s, ms, us, ns"):
        open_recording(path, time_unit="minutes")


def test_fields_of_one_array(tmp_path: Path) -> None:
    rows = np.zeros(len(SOME), [("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("p", "?")])
    rows["t"], rows["x"], rows["y"], rows["p"] = SOME.t_us, SOME.x, SOME.y, SOME.p
    back = Events.concatenate(list(open_recording(archive(tmp_path, events=rows)).packets()))
    assert np.array_equal(back.x, SOME.x)


def test_numbers_no_pixel_or_clock_can_have_are_dropped_and_counted(tmp_path: Path) -> None:
    x, t_s = SOME.x.astype(np.float64), SOME.t_us / 1e6
    x[:4] = [-1, 65541, np.nan, 240]
    t_s[10:13] = np.nan, np.inf, -np.inf
    recording = open_recording(archive(tmp_path, t_s=t_s, x=x, y=SOME.y, p=SOME.p), (240, 180))
    assert sum(map(len, recording.packets())) == len(SOME) - 7
    assert recording.dropped == {"out_of_range": 4, "backwards": 0, "jump": 0, "untimed": 3}


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"images": np.zeros(3)}, "t, x, y and p are needed"),
        (columns(x=SOME.x[:-1]), "of one length"),
        (columns(x=SOME.x.astype(str)), "rows of numbers"),
        (columns(x=SOME.x.reshape(2, -1)), "of one length"),
        (columns(x=np.array([None] * len(SOME), object)), "Python objects"),
    ],
)
def test_archives_without_events(arrays: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=words):
        open_recording(archive(tmp_path, **arrays))


def written(path: Path, claimed: int, blocks: int, each: int) -> Path:
    """An archive of zeros: `blocks` times `each` of them, whatever the headers claim."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        for name, kind in (("t_us", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "?")):
            head = io.BytesIO()
            header = {"descr": kind, "fortran_order": False, "shape": (claimed,)}
            np.lib.format.write_array_header_1_0(head, header)
            with made.open(f"{name}.npy", "w") as file:
                file.write(head.getvalue())
                for _ in range(blocks):
                    file.write(bytes(each * np.dtype(kind).itemsize))
    return path


def test_an_archive_that_unpacks_to_a_thousand_times_its_size_stays_small_in_memory(tmp_path: Path) -> None:
    path = written(tmp_path / "bomb.npz", 40_000_000, 40, 1_000_000)
    assert path.stat().st_size < 600_000
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    recording, events = open_recording(path, (10, 10)), 0
    with pytest.raises(DoubtfulRecordingError, match="40,000,000 events in 0 s are more"):
        for packet in recording.packets():
            events += len(packet)
    assert events == 40_000_000
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000


def test_an_array_that_claims_more_than_it_holds_gives_what_it_holds(tmp_path: Path) -> None:
    recording = open_recording(written(tmp_path / "short.npz", 1 << 40, 1, 10), (10, 10))
    with pytest.raises(DamagedRecordingError, match="ends too early"):
        list(recording.packets())
    assert recording.events == 10


def test_what_is_a_recording(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("my drives\n")
    (tmp_path / "empty.npz").write_bytes(b"")
    np.savez(tmp_path / "day.npz", t=SOME.t_us, x=SOME.x, y=SOME.y, p=SOME.p)
    found = {file.name: is_recording(file) for file in [tmp_path, tmp_path / "none", *tmp_path.iterdir()]}
    assert [name for name, is_one in found.items() if is_one] == ["day.npz"]
