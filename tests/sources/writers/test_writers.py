"""Round trips: what is written comes back, from our readers and from a second library."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evplace.core import families
from evplace.core.errors import DamagedRecordingError, DoubtfulRecordingError, OutputError
from evplace.core.events import Events
from evplace.sources.readers import open_recording
from evplace.sources.writers import write_recording

SIZE = (240, 180)
formats = pytest.mark.parametrize("form", families.names("writers"))


def some(count: int, start_us: int, span_us: int, seed: int = 0) -> Events:
    rng = np.random.default_rng(seed)
    t_us = start_us + np.sort(rng.integers(0, span_us, count))
    return Events.of(
        t_us, rng.integers(0, 240, count), rng.integers(0, 180, count), rng.random(count) < 0.5, SIZE
    )


def packets(events: Events, each: int) -> Iterator[Events]:
    return (events[start : start + each] for start in range(0, len(events), each))


def same(first: Events, second: Events) -> bool:
    fields = ("t_us", "x", "y", "p")
    return all(np.array_equal(getattr(first, field), getattr(second, field)) for field in fields)


@formats
@pytest.mark.parametrize("each", [7, 100_000])
@pytest.mark.parametrize(
    ("start_us", "span_us"), [(0, 100_000), (1_587_452_582_350_000, 3 << 24), (5, 200_000_000), (12, 1)]
)
def test_round_trip(form: str, each: int, start_us: int, span_us: int, tmp_path: Path) -> None:
    events = some(5000, start_us, span_us)
    path = tmp_path / f"made{families.load('writers', form).SUFFIX}"
    assert write_recording(path, packets(events, each), SIZE) == len(events)
    recording = open_recording(path)
    assert (recording.format, recording.size, recording.notes) == (form, SIZE, [])
    read = []
    with contextlib.suppress(DoubtfulRecordingError):  # all of them in one microsecond are read, then doubted
        read.extend(recording.packets())
    assert same(Events.concatenate(read), events)


@pytest.mark.parametrize("form", ["aedat4", "evt3"])
def test_a_second_library_reads_the_same(form: str, tmp_path: Path) -> None:
    faery: Any = pytest.importorskip("faery")
    events = some(5000, 77, 3 << 24)
    path = tmp_path / f"made{families.load('writers', form).SUFFIX}"
    write_recording(path, packets(events, 1000), SIZE)
    stream = faery.events_stream_from_file(path)
    theirs = np.concatenate(list(stream))
    assert stream.dimensions() == SIZE
    assert same(Events.of(theirs["t"], theirs["x"], theirs["y"], theirs["p"], SIZE), events)


def test_dsec_index_of_milliseconds(tmp_path: Path) -> None:
    h5py: Any = pytest.importorskip("h5py")
    events = some(5000, 1000, 50_000)
    write_recording(tmp_path / "made.h5", packets(events, 300), SIZE)
    with h5py.File(tmp_path / "made.h5") as file:
        t_us, index = file["events/t"][()], file["ms_to_idx"][()]
    assert np.array_equal(index, np.searchsorted(t_us, np.arange(0, t_us[-1] + 1, 1000)))


@formats
def test_no_events_make_a_file_without_any(form: str, tmp_path: Path) -> None:
    path = tmp_path / "none"
    assert write_recording(path, [Events.empty(SIZE)], SIZE, format=form) == 0
    assert list(open_recording(path).packets()) == []


@formats
def test_the_good_part_of_a_damaged_recording_is_written(form: str, tmp_path: Path) -> None:
    events = some(1000, 0, 10_000)

    def breaking() -> Iterator[Events]:
        yield from packets(events, 100)
        raise DamagedRecordingError("cut off")

    with pytest.raises(DamagedRecordingError, match="cut off"):
        write_recording(tmp_path / "part", breaking(), SIZE, format=form)
    assert same(Events.concatenate(list(open_recording(tmp_path / "part").packets())), events)


def test_outputs_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "there.npz").touch()
    with pytest.raises(OutputError, match="exists"):
        write_recording(tmp_path / "there.npz", [], SIZE)
    with pytest.raises(OutputError, match=r"suffix.*\.aedat4 \(aedat4\).*\.npz \(npz\)"):
        write_recording(tmp_path / "a.xyz", [], SIZE)
    for name, size in (("a.raw", (4096, 10)), ("a.aedat4", (40_000, 10))):
        with pytest.raises(OutputError, match="choose npz"):
            write_recording(tmp_path / name, [], size)
    assert [file.name for file in tmp_path.iterdir()] == ["there.npz"]


def test_a_gap_of_years_is_refused_where_each_part_of_it_takes_room(tmp_path: Path) -> None:
    events = Events.of([0, 1 << 50], [1, 2], [1, 2], [True, False], SIZE)
    with pytest.raises(OutputError, match="gap of more than a day"):
        write_recording(tmp_path / "a.raw", [events], SIZE)
