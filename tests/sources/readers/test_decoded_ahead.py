"""Recordings that are decoded in a thread of its own, against those that are not: nothing may differ."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from made import MAKERS
from test_canvas import drive, opened

from evplace.core.errors import EvplaceError
from evplace.sources.readers import _recording

LARGEST = 1 << 62


def told(form: str, path: Path, large: int, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    monkeypatch.setattr(_recording, "LARGE", large)
    found: list[Any] = []
    try:
        recording = opened(form, path)
        for packet in recording.packets():
            found.append([column.tobytes() for column in (packet.t_us, packet.x, packet.y, packet.p)])
    except EvplaceError as error:
        return [*found, type(error), str(error)]
    return [*found, recording.dropped, recording.events]


@pytest.mark.parametrize("form", sorted(set(MAKERS) - {"hdf5", "parquet"}))
def test_whole_and_cut_recordings(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = MAKERS[form](tmp_path, drive(5000))
    assert told(form, path, 0, monkeypatch) == told(form, path, LARGEST, monkeypatch)
    if path.is_file():
        path.write_bytes(path.read_bytes()[: path.stat().st_size * 3 // 5])
        assert told(form, path, 0, monkeypatch) == told(form, path, LARGEST, monkeypatch)
    assert not any(thread.name == "ahead" for thread in threading.enumerate())
