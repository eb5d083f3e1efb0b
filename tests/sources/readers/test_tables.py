"""Tables of events in HDF5, npz and npy: the columns are told by names, by values, or by the caller."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import some_events

from evplace.core.errors import RecordingError, UnsupportedError
from evplace.core.events import Events
from evplace.sources.readers import _order, open_recording

h5py: Any = pytest.importorskip("h5py")
SOME = some_events(20_000, 500_000)
SIGNS = 2 * SOME.p.astype(np.int64) - 1
EPOCH_S = 1_587_452_582


def table(order: str, kind: str, signs: bool = False, unit: float = 1.0, start: float = 0.0) -> np.ndarray:
    """(N, k) of fields by their letters: i counts rows, 0 is zero, w is a fraction."""
    columns = {
        "t": start + SOME.t_us * unit, "x": SOME.x, "y": SOME.y, "p": SIGNS if signs else SOME.p,
        "i": np.arange(len(SOME)), "0": np.zeros(len(SOME)), "w": 50 + 40 * np.sin(np.arange(len(SOME))),
    }  # fmt: skip
    return np.stack([columns[letter] for letter in order], axis=1).astype(kind)


TABLES: dict[str, tuple[np.ndarray, str, str]] = {
    "MVSEC": (table("xytp", "f8", signs=True, unit=1e-6, start=EPOCH_S), "x,y,t,p", "s"),
    "v2e": (table("txyp", "u4"), "t,x,y,p", "us"),
    "whole numbers as fractions": (table("txyp", "f8"), "t,x,y,p", "us"),
    "polarity first": (table("ptxy", "i8"), "p,t,x,y", "us"),
    "time last, signs": (table("xypt", "i8", signs=True), "x,y,p,t", "us"),
    "with an index": (table("itxyp", "i8"), "-,t,x,y,p", "us"),
    "with a column of zeros": (table("txyp0", "i8"), "t,x,y,p,-", "us"),
    "nanoseconds": (table("txyp", "i8", unit=1000), "t,x,y,p", "ns"),
    "nanoseconds since 1970": (table("txyp", "i8", unit=1000, start=EPOCH_S * 10**9), "t,x,y,p", "ns"),
    "microseconds since 1970": (table("txyp", "i8", start=EPOCH_S * 10**6), "t,x,y,p", "us"),
    "milliseconds since 1970": (table("txyp", "f8", unit=1e-3, start=EPOCH_S * 10**3), "t,x,y,p", "ms"),
}
"""Name -> rows, what each column is, the unit of time."""
tables = pytest.mark.parametrize("name", TABLES)


def as_npz(path: Path, rows: np.ndarray) -> Path:
    np.savez_compressed(path / "a.npz", events=rows)
    return path / "a.npz"


def as_npy(path: Path, rows: np.ndarray) -> Path:
    np.save(path / "a.npy", rows)
    return path / "a.npy"


def as_hdf5(path: Path, rows: np.ndarray) -> Path:
    with h5py.File(path / "a.h5", "w") as file:
        file["davis/left/events"] = rows
        file["davis/left/imu"] = np.ones((100, 6))
    return path / "a.h5"


FILES = {"npz": as_npz, "npy": as_npy, "hdf5": as_hdf5}
files = pytest.mark.parametrize("file", FILES.values(), ids=FILES)
Writer = Callable[[Path, np.ndarray], Path]


def same(path: Path, **options: Any) -> bool:
    recording = open_recording(path, **options)
    back = Events.concatenate(list(recording.packets()))
    assert sum(recording.dropped.values()) == 0
    shift = int(back.t_us[0] - SOME.t_us[0])
    assert shift in (0, EPOCH_S * 10**6)
    assert np.array_equal(back.t_us - shift, SOME.t_us)
    return all(np.array_equal(getattr(back, name), getattr(SOME, name)) for name in ("x", "y", "p"))


@files
@tables
def test_columns_are_told_by_their_values(name: str, file: Writer, tmp_path: Path) -> None:
    rows, order, unit = TABLES[name]
    path = file(tmp_path, rows)
    notes = " ".join(open_recording(path).notes)
    assert f"columns are taken as {order} by their values" in notes
    assert f"are taken as {unit}" in notes
    assert same(path)


@files
@pytest.mark.parametrize("lie", [np.asfortranarray, np.transpose, lambda rows: np.asfortranarray(rows.T)])
def test_tables_that_lie_the_other_way(
    lie: Callable[[np.ndarray], np.ndarray], file: Writer, tmp_path: Path
) -> None:
    assert same(file(tmp_path, lie(TABLES["MVSEC"][0])))
    assert same(file(tmp_path, lie(TABLES["v2e"][0])))


@files
def test_what_cannot_be_known_is_asked_for(file: Writer, tmp_path: Path) -> None:
    path = file(tmp_path, table("txypw", "f8"))
    assert same(path)  # the fraction is none of the four
    path = file(tmp_path, np.hstack([table("txy", "i8"), table("pp", "i8")]))
    with pytest.raises(RecordingError, match="columns 4 and 5 could both be p: give `columns=t,x,y,p` in"):
        open_recording(path)
    assert same(path, columns="t,x,y,p,-")
    path = file(tmp_path, table("txxyp", "i8"))
    with pytest.raises(RecordingError, match=r"columns 2, 3, 4 could all be x or y"):
        open_recording(path)
    assert same(path, columns="t,-,x,y,p")


@files
def test_the_caller_says_that_y_stands_first(file: Writer, tmp_path: Path) -> None:
    path = file(tmp_path, table("yxpt", "i8"))
    assert same(path, columns="y,x,p,t")
    assert same(path, size=(240, 180)), "only this way does it fit the sensor"
    told = "it could be x,y,p,t of a sensor taller than wide, or y,x,p,t: give `columns="
    with pytest.raises(RecordingError, match=told):
        open_recording(path)
    for wrong in ("y,x,p", "y,x,p,p", "t,sec,x,y,p", ""):
        with pytest.raises(RecordingError, match="must name t, x, y and p once each"):
            open_recording(path, columns=wrong)


STRUCTS = {
    "usual": ("t", "x", "y", "p"),
    "long": ("timestamp", "x_pos", "y_pos", "polarity"),
    "capitals": ("Time [us]", "X", "Y", "Polarity"),
    "of events": ("event_t", "event_x", "event_y", "event_p"),
    "row and column": ("ts", "column", "row", "on"),
}


@files
@pytest.mark.parametrize("names", STRUCTS.values(), ids=STRUCTS)
def test_fields_with_names(names: tuple[str, ...], file: Writer, tmp_path: Path) -> None:
    rows = np.zeros(len(SOME), [(name, "<i8") for name in (names[2], names[0], names[3], names[1])])
    for name, values in zip(names, (SOME.t_us, SOME.x, SOME.y, SOME.p), strict=True):
        rows[name] = values
    assert same(file(tmp_path, rows))
    strange = rows.astype([("a", "<i8"), ("b", "<i8"), ("c", "<i8"), ("d", "<i8")])
    path = file(tmp_path, strange)
    with pytest.raises(RecordingError, match="t, x, y"):
        open_recording(path)
    assert same(path, columns="y,t,p,x")


@files
def test_whole_seconds_and_billionths(file: Writer, tmp_path: Path) -> None:
    t_ns = EPOCH_S * 10**9 + SOME.t_us * 1000 * 7
    rows = np.stack([t_ns // 10**9, t_ns % 10**9, SOME.x, SOME.y, SOME.p], axis=1).astype("i8")
    recording = open_recording(file(tmp_path, rows))
    back = Events.concatenate(list(recording.packets()))
    assert "columns are taken as sec,nsec,x,y,p by their values" in " ".join(recording.notes)
    assert np.array_equal(back.t_us, t_ns // 1000)


@pytest.mark.parametrize("container", ["npz", "hdf5"])
def test_evimo2(container: str, tmp_path: Path) -> None:
    arrays = {
        "events_t": SOME.t_us / 1e6, "events_xy": np.stack([SOME.x, SOME.y], 1), "events_p": SOME.p,
        "frames_t": np.arange(9.0), "K": np.eye(3), "index": np.arange(500),
    }  # fmt: skip
    if container == "npz":
        np.savez(tmp_path / "e", **arrays)
    else:
        with h5py.File(tmp_path / "e", "w") as file:
            for name, values in arrays.items():
                file[name] = values
    assert same(next(tmp_path.iterdir()))


def test_left_and_right_can_be_chosen(tmp_path: Path) -> None:
    left, right = TABLES["MVSEC"][0], table("xytp", "f8", unit=1e-6)[:, :]
    right[:, 0] = 239 - right[:, 0]
    np.savez(tmp_path / "s.npz", left=left, right=right)
    with h5py.File(tmp_path / "s.h5", "w") as file:
        file["davis/left/events"], file["davis/right/events"] = left, right
    for name, streams in (
        ("s.npz", ["left", "right"]),
        ("s.h5", ["davis/left/events", "davis/right/events"]),
    ):
        recording = open_recording(tmp_path / name)
        assert recording.streams == streams
        assert recording.notes[0].startswith(
            f"events are read from {streams[0]}; there are also {streams[1]}"
        )
        assert same(tmp_path / name)
        other = Events.concatenate(list(open_recording(tmp_path / name, stream="right").packets()))
        assert np.array_equal(239 - other.x, SOME.x)


SIZES: dict[str, tuple[str, dict[str, Any], tuple[int, int]]] = {
    "bytes": ("/", {"geometry": b"640x480"}, (640, 480)),
    "numpy bytes": ("/", {"geometry": np.bytes_("640x480")}, (640, 480)),
    "rows of text": ("/", {"geometry": np.array([b"640x480"])}, (640, 480)),
    "e2vid": ("/", {"sensor_resolution": (480, 640)}, (640, 480)),
    "width and height as text": ("events", {"width": "640", "height": b"480"}, (640, 480)),
    "arrays of one": ("events", {"width": [640], "height": np.array([480])}, (640, 480)),
}


@pytest.mark.parametrize("name", SIZES)
def test_sizes_however_they_are_stored(name: str, tmp_path: Path) -> None:
    place, attributes, size = SIZES[name]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for field, values in (("ts", SOME.t_us / 1e6), ("xs", SOME.x), ("ys", SOME.y), ("ps", SOME.p)):
            file[f"events/{field}"] = values
        for attribute, value in attributes.items():
            file[place].attrs[attribute] = value
    assert open_recording(tmp_path / "a.h5").size == size


def test_the_unit_as_bytes(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for field, values in (("t", SOME.t_us * 10), ("x", SOME.x), ("y", SOME.y), ("p", SOME.p)):
            file[f"events/{field}"] = values
        file["events/t"].attrs["units"] = b"microseconds"
    back = Events.concatenate(list(open_recording(tmp_path / "a.h5").packets()))
    assert np.array_equal(back.t_us, SOME.t_us * 10)


@pytest.mark.parametrize("way", ["external link", "external storage", "virtual"])
def test_nothing_outside_the_file_is_read(way: str, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    np.arange(len(SOME), dtype="<u2").tofile(secret)
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = SOME.x
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for field, values in (("t", SOME.t_us), ("y", SOME.y), ("p", SOME.p)):
            file[f"events/{field}"] = values
        if way == "external link":
            file["events/x"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "x")
        elif way == "external storage":
            file["events"].create_dataset(
                "x", (len(SOME),), "<u2", external=[(str(secret), 0, 2 * len(SOME))]
            )
        else:
            layout = h5py.VirtualLayout((len(SOME),), "<u2")
            layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", (len(SOME),))
            file["events"].create_virtual_dataset("x", layout)
    with pytest.raises(UnsupportedError, match="keeps events/x outside itself"):
        open_recording(tmp_path / "a.h5")


def test_a_cut_array_gives_its_good_part(tmp_path: Path) -> None:
    path = as_npy(tmp_path, TABLES["v2e"][0])
    path.write_bytes(path.read_bytes()[: -1000 * 16 - 5])
    recording = open_recording(path)
    with pytest.raises(RecordingError, match="ends too early"):
        list(recording.packets())
    assert recording.events == len(SOME) - 1001


@given(st.permutations("txyp"), st.booleans())
def test_any_order_with_x_before_y(letters: list[str], signs: bool) -> None:
    order = "".join(letters)
    found = _order.by_values(table(order, "f8", signs), {}, size=(240, 240))
    assert found is not None
    expected = order if order.index("x") < order.index("y") else order.translate(str.maketrans("xy", "yx"))
    assert found.words(4) == ",".join(expected)
