"""HDF5: each layout by its keys, times in its unit, and files that do not fit."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import some_events

from conftest import HANG_S
from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.core.events import Events
from evplace.sources.readers import _isolated, open_recording

h5py: Any = pytest.importorskip("h5py")
SOME = some_events(20_000, 500_000)


def written(path: Path, **entries: Any) -> Path:
    """An HDF5 file with entries `place__name` = values, and `place____name` = attribute."""
    with h5py.File(path, "w") as file:
        for name, values in entries.items():
            place, _, attribute = name.partition("____")
            if attribute:
                file.require_group(place.replace("__", "/") or "/").attrs[attribute] = values
            else:
                file[name.replace("__", "/")] = values
    return path


def rows(times: np.ndarray, prefix: str) -> dict[str, np.ndarray]:
    return {f"{prefix}__t": times, f"{prefix}__x": SOME.x, f"{prefix}__y": SOME.y, f"{prefix}__p": SOME.p}


def read(path: Path, **options: Any) -> Events:
    return Events.concatenate(list(open_recording(path, **options).packets()))


def test_dsec(tmp_path: Path) -> None:
    path = written(
        tmp_path / "e.h5", **rows(SOME.t_us.astype("u4"), "events"), t_offset=49_599_300_523, ms_to_idx=[0]
    )
    assert np.array_equal(read(path).t_us, SOME.t_us + 49_599_300_523)


def test_m3ed(tmp_path: Path) -> None:
    entries = rows(SOME.t_us, "prophesee__left") | {"prophesee__left__ms_map_idx": [0]}
    right = rows(SOME.t_us, "prophesee__right")
    path = written(tmp_path / "m.h5", **entries, **right, prophesee__left__calib__resolution=[1280, 720])
    recording = open_recording(path)
    assert recording.size == (1280, 720)
    assert "there are also prophesee/right" in recording.notes[0]
    assert np.array_equal(read(path).t_us, SOME.t_us)


def test_nsavp(tmp_path: Path) -> None:
    path = written(
        tmp_path / "n.h5",
        events__timestamps=SOME.t_us * 1000,
        events__x_coordinates=SOME.x,
        events__y_coordinates=SOME.y,
        events__polarities=SOME.p.astype("u1"),
        events____width=240,
        events____height=180,
    )
    back = read(path)
    assert back.size == (240, 180)
    assert np.array_equal(back.t_us, SOME.t_us)
    assert np.array_equal(back.p, SOME.p)


def test_the_unit_in_the_attribute_units(tmp_path: Path) -> None:
    path = written(tmp_path / "u.h5", **rows(SOME.t_us * 1000, "events"))
    with h5py.File(path, "a") as file:
        file["events/t"].attrs["units"] = "nanoseconds"
    assert np.array_equal(read(path).t_us, SOME.t_us)


def test_prophesee(tmp_path: Path) -> None:
    table = np.zeros(len(SOME), [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    table["x"], table["y"], table["p"], table["t"] = SOME.x, SOME.y, SOME.p, SOME.t_us
    back = read(written(tmp_path / "p.hdf5", CD__events=table, ____geometry="240x180"))
    assert back.size == (240, 180)
    assert np.array_equal(back.t_us, SOME.t_us)
    assert np.array_equal(back.y, SOME.y)


def test_a_unit_that_is_not_clear_must_be_given(tmp_path: Path) -> None:
    path = written(tmp_path / "b.h5", **rows(SOME.t_us * 10, "tenths"))
    with pytest.raises(RecordingError, match=r"not clear.*time_unit=us"):
        open_recording(path)
    assert np.array_equal(read(path, time_unit="us").t_us, SOME.t_us * 10)


def test_files_that_do_not_fit(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"without events.*images"):
        open_recording(written(tmp_path / "i.h5", images=[1]))
    uneven = rows(SOME.t_us, "events") | {"events__x": SOME.x[:-1], "ms_to_idx": [0]}
    with pytest.raises(RecordingError, match="one length"):
        list(open_recording(written(tmp_path / "u.h5", **uneven), (240, 180)).packets())


def test_a_decoder_that_hangs_or_crashes_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path / "e.h5", **rows(SOME.t_us, "events"), ms_to_idx=[0])
    monkeypatch.setattr(_isolated, "PATIENCE_S", 0.01)
    with pytest.raises(DamagedRecordingError, match="gave nothing"):
        open_recording(path)
    monkeypatch.undo()
    with pytest.raises(DamagedRecordingError, match="crashed"):
        _isolated.isolated("no_such_reader", path, _isolated.Hints())


def test_a_decoder_that_works_without_end_is_stopped(tmp_path: Path) -> None:
    """In a process of its own, whose limit is a moment; waiting is not working, and is not stopped."""
    code = (
        "import time; from evplace.sources.readers import _decoder\n"
        "_decoder.WORK_S = 0.2; _decoder.limit_work(); time.sleep(0.5); print('waited', flush=True)\n"
        "while True: pass"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=HANG_S)
    assert (answer.stdout, answer.returncode) == ("waited\n", -signal.SIGPROF)


def test_a_filter_that_is_missing_is_named(tmp_path: Path) -> None:
    """In a process of its own, as filters stay known to a process once they are."""
    hdf5plugin: Any = pytest.importorskip("hdf5plugin")
    with h5py.File(tmp_path / "b.h5", "w") as file:
        group = file.create_group("events")
        for name, rows_of in (("t_us", SOME.t_us), ("x", SOME.x), ("y", SOME.y), ("p", SOME.p)):
            group.create_dataset(name, data=rows_of, **hdf5plugin.Blosc(cname="zstd"))
    assert np.array_equal(read(tmp_path / "b.h5").t_us, SOME.t_us)
    code = (
        "import sys; from pathlib import Path; from evplace.sources.readers import Hints, _hdf5\n"
        "_hdf5._load_filters = lambda: None\n"
        "_hdf5.open_here(Path(sys.argv[1]), Hints())"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "b.h5")], capture_output=True, text=True
    )
    assert "pip install 'evplace[hdf5]'" in answer.stderr


def test_a_file_whose_writer_was_killed(tmp_path: Path) -> None:
    """Neither format survives it: HDF5 keeps its tables, and Parquet its footer, until the file is closed."""
    code = (
        "import os, sys, h5py, numpy as np\n"
        "file = h5py.File(sys.argv[1], 'w')\n"
        "for name in 'txyp': file.create_dataset(f'events/{name}', data=np.arange(100_000), chunks=(1000,))\n"
        "os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "killed.h5")])
    assert (tmp_path / "killed.h5").stat().st_size > 0
    with pytest.raises(RecordingError, match=r"damaged HDF5 file|no known recording format"):
        open_recording(tmp_path / "killed.h5", (240, 180))


@pytest.mark.parametrize("signs", [(0, 1), (-1, 1), (False, True)])
def test_polarities_of_every_kind(signs: tuple[int, int], tmp_path: Path) -> None:
    entries = rows(SOME.t_us, "events") | {"events__p": np.array(signs)[SOME.p.astype(int)], "ms_to_idx": [0]}
    assert np.array_equal(read(written(tmp_path / "p.h5", **entries), size=(240, 180)).p, SOME.p)
