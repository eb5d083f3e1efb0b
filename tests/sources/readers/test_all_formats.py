"""What holds for every format: the events come back, a cut leaves the good part, damage one error."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import damage
import numpy as np
import pytest
from made import MAKERS, SIZE, some_events

from conftest import HANG_S
from evplace.core import families
from evplace.core.errors import DamagedRecordingError, EvplaceError, RecordingError
from evplace.core.events import Events
from evplace.sources.readers import open_recording
from evplace.testing import check_reader
from evplace.testing._readers import check_packets

CUTS = int(os.environ.get("EVPLACE_CUTS", "200"))
FLIPS = int(os.environ.get("EVPLACE_FLIPS", "2000"))
SEED = int(os.environ.get("EVPLACE_SEED", "0"))
UNREADABLE_WHEN_CUT = ("npz", "hdf5", "parquet")
"""Formats that keep whole columns and an index, so that a cut takes something of every event."""
ISOLATED = {"hdf5": "_hdf5", "parquet": "_parquet"}
"""Formats that start a process for each reading -> what runs in it: here many readings share one."""
formats = pytest.mark.parametrize("form", sorted(MAKERS))


def test_each_format_has_a_maker() -> None:
    assert sorted(MAKERS) == families.names("readers")


def read_all(path: Path) -> tuple[list[Events], EvplaceError | None]:
    """All packets, and the error that ended them."""
    packets: list[Events] = []
    try:
        for packet in open_recording(path, SIZE).packets():
            packets.append(packet)
    except EvplaceError as error:
        return packets, error
    return packets, None


@formats
def test_each_reader_meets_the_contract(form: str) -> None:
    """Of the formats that start a process for each reading, a few cuts and flips: see below for more."""
    cuts, flips = (3, 3) if form in ISOLATED else (CUTS, FLIPS)
    reader = families.load("readers", form)
    check_reader(reader, MAKERS[form], cuts, flips, SEED, whole=form in UNREADABLE_WHEN_CUT)


@pytest.mark.parametrize("kind", ["cut", "flip"])
@pytest.mark.parametrize("form", sorted(ISOLATED))
def test_damage_that_the_decoder_may_not_survive(form: str, kind: str, tmp_path: Path) -> None:
    """What brings the decoder down is read again as users read it: in a process that may die."""
    path = MAKERS[form](tmp_path, some_events(500))
    data, first, count = path.read_bytes(), 0, CUTS if kind == "cut" else FLIPS
    while first < count:
        arguments = [ISOLATED[form], str(path), kind, str(SEED), str(first), str(count)]
        worker = [sys.executable, str(Path(damage.__file__)), *arguments]
        try:
            answer = subprocess.run(worker, capture_output=True, text=True, timeout=HANG_S + count)
            output, survived = answer.stdout, answer.returncode >= 0
            assert answer.returncode <= 0, answer.stderr[-2000:]
        except subprocess.TimeoutExpired as late:
            output, survived = (late.stdout or b"").decode(), False
        first = int(output.split()[-1]) + 1
        if not survived:
            bad = tmp_path / f"bad{path.suffix}"
            bad.write_bytes(damage.damaged(data, kind, SEED, first - 1, count))
            packets, error = read_all(bad)
            assert isinstance(error, RecordingError)
            check_packets(packets, SIZE, form)


def test_a_cut_inside_a_word_is_said(tmp_path: Path) -> None:
    path = MAKERS["aedat2"](tmp_path, some_events())
    path.write_bytes(path.read_bytes()[:-3])
    packets, error = read_all(path)
    assert sum(map(len, packets)) == 2999
    assert isinstance(error, DamagedRecordingError)
    assert "cut off" in str(error)


@pytest.mark.parametrize(
    ("content", "words"),
    [(None, "No such file"), (b"", "is empty"), (b"GIF89a junk", "no known recording format")],
)
def test_what_is_no_recording_is_said(content: bytes | None, words: str, tmp_path: Path) -> None:
    path = tmp_path / "holiday.aedat4"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RecordingError, match=words):
        open_recording(path)


def test_unknown_content_lists_the_known_formats(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"folder.*aedat4.*ros1"):
        open_recording(tmp_path)


@formats
def test_a_name_does_not_matter(form: str, tmp_path: Path) -> None:
    path = MAKERS[form](tmp_path, some_events(50))
    assert open_recording(path.rename(tmp_path / "recording.xyz")).format == form


def test_memory_is_bounded(tmp_path: Path) -> None:
    """20 M events stay under 400 MB in a process of their own."""
    if not Path("/proc/self/status").exists():
        pytest.skip("this system does not tell a process's peak memory in /proc")
    path, one = tmp_path / "long.dat", np.zeros(1_000_000, [("t", "<u4"), ("data", "<u4")])
    with path.open("wb") as file:
        file.write(b"% Version 2\n% Width 640\n% Height 480\n\x0c\x08")
        for part in range(20):
            one["t"] = np.arange(part * 1_000_000, (part + 1) * 1_000_000)
            file.write(one.tobytes())
    code = (
        "import sys; from evplace.sources.readers import open_recording; r = open_recording(sys.argv[1])\n"
        "for packet in r.packets(): pass\n"
        "peak = next(line for line in open('/proc/self/status') if line.startswith('VmHWM'))\n"
        "print(r.events, int(peak.split()[1]) // 1024)"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True
    )
    events, megabytes = map(int, answer.stdout.split())
    assert events == 20_000_000
    assert megabytes < 400


@formats
def test_a_format_forced_on_something_else_is_an_error_or_gives_nothing(form: str, tmp_path: Path) -> None:
    path = tmp_path / "letter"
    path.write_bytes(b"Dear reader, this is no recording.\n" * 20)
    delivered = 0
    with contextlib.suppress(RecordingError):
        delivered = sum(map(len, open_recording(path, SIZE, format=form, time_unit="us").packets()))
    # Formats of bare words take any bytes for words; what they make of these is out of range or untimed.
    assert delivered < 50
    with pytest.raises(RecordingError):
        open_recording(tmp_path, SIZE, format=form, time_unit="us")


def test_a_recording_that_vanishes_is_an_error(tmp_path: Path) -> None:
    path = MAKERS["evt2"](tmp_path, some_events(50))
    recording = open_recording(path)
    path.unlink()
    with pytest.raises(DamagedRecordingError, match="No such file"):
        list(recording.packets())
