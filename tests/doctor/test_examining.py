"""One pass over a recording: all examinations, whatever the packets, whatever the file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from examined import SIZE, noise, outcome, road

from conftest import make_drive, write_drive
from evplace.core import families
from evplace.core.errors import InputError, OutputError, SettingsError, TrackError
from evplace.core.events import Events
from evplace.doctor import STATES, Examination, as_json, draw, examine
from evplace.sources.writers import write_recording

PARTS = [families.load("doctor", name) for name in families.names("doctor")]


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.__name__.rpartition(".")[2])
def test_each_part_names_its_subjects(part: object) -> None:
    assert set(part.OF) <= {"events", "frames"}  # type: ignore[attr-defined]
    assert part.__doc__


OF_EVENTS = [part for part in PARTS if "events" in part.OF and not part.__name__.endswith(".reading")]


@pytest.mark.parametrize("part", OF_EVENTS, ids=lambda part: part.__name__.rpartition(".")[2])
def test_the_size_of_the_packets_changes_nothing(part: object) -> None:
    events = noise(600, 8)
    track = road(np.arange(0, 9.0), 5 * np.arange(0, 9.0))
    whole, cut = (outcome(part, events, track, packet=packet).findings for packet in (10**6, 37))  # type: ignore[arg-type]
    assert whole == cut


def test_a_good_drive_has_no_alarm(tmp_path: Path) -> None:
    recording, track = write_drive(tmp_path, "day", make_drive(windows=300))
    found = examine(recording, track)
    assert found.fault is None
    assert not found.count("bad")
    assert {finding.name for finding in found.findings if finding.state == "look"} <= {"GPS gaps", "GPS log"}
    assert found.facts | {"t_last_us": 0} == {
        "kind": "events", "width": 80, "height": 60, "events": len(make_drive(windows=300).events),
        "t_first_us": 0, "t_last_us": 0, "format": "aedat4",
        "dropped": dict.fromkeys(("out_of_range", "backwards", "jump", "untimed"), 0),
    }  # fmt: skip


def test_the_worst_comes_first_and_json_is_finite(tmp_path: Path) -> None:
    recording, _ = write_drive(tmp_path, "day", make_drive(windows=30))
    found = examine(recording, road(np.arange(9.0) + 500, np.arange(9.0)))
    order = [STATES.index(finding.state) for finding in found.findings]
    assert order == sorted(order)
    assert found.findings[0].name == "GPS coverage"
    written = as_json(found)
    assert json.loads(json.dumps(written, allow_nan=False)) == written
    assert len({finding["name"] for finding in written["findings"]}) == len(written["findings"])
    for finding in written["findings"]:
        assert finding["sentence"].endswith(".")
        assert (finding["state"] in ("good", "unknown")) == (not finding["advice"])


def cut(folder: Path, share: float) -> Path:
    events = make_drive(windows=60).events
    write_recording(
        folder / "whole.aedat4", [events[n : n + 500] for n in range(0, len(events), 500)], events.size
    )
    content = (folder / "whole.aedat4").read_bytes()
    (folder / "cut.aedat4").write_bytes(content[: int(share * len(content))])
    return folder / "cut.aedat4"


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_damaged_recordings_good_part_is_examined(tmp_path: Path, share: float) -> None:
    found = examine(cut(tmp_path, share))
    assert found.fault is not None
    assert 0 < found.facts["events"] < len(make_drive(windows=60).events)
    assert found.findings[0].name == "reading"
    assert found.named("event rate").state == "good"


@pytest.mark.parametrize("track", [None, road(np.arange(9.0), np.arange(9.0))])
@pytest.mark.parametrize("times", [[], [5], [5, 5], [0, 10], [0, 10**14]])
def test_next_to_nothing_is_examined_too(tmp_path: Path, times: list[int], track: object) -> None:
    n = len(times)
    np.savez(
        tmp_path / "a.npz", t_us=np.array(times, np.int64), x=np.zeros(n, np.uint16),
        y=np.zeros(n, np.uint16), p=np.zeros(n, np.bool_), width=64, height=48,
    )  # fmt: skip
    found = examine(tmp_path / "a.npz", track, time_unit="us")  # type: ignore[arg-type]
    assert found.facts["events"] == n
    json.dumps(as_json(found), allow_nan=False)


def test_what_cannot_be_examined(tmp_path: Path) -> None:
    recording, track = write_drive(tmp_path, "day", make_drive(windows=5))
    with pytest.raises(SettingsError, match="dt"):
        examine(recording, dt="0")
    (tmp_path / "empty").mkdir()
    for path in (tmp_path / "none.aedat4", track, tmp_path / "none.mp4", tmp_path / "empty"):
        with pytest.raises(InputError):
            examine(path)
    with pytest.raises(InputError, match=r"none\.nmea"):
        examine(recording, tmp_path / "none.nmea")


def test_a_track_with_unknown_positions_is_its_known_ones(tmp_path: Path) -> None:
    recording, _ = write_drive(tmp_path, "day", make_drive(windows=300))
    whole = road(np.arange(0, 10.5, 0.5), 2 * np.arange(0, 10.5, 0.5))
    asked = whole.at(np.arange(-3_000_000, 13_000_000, 250_000))
    assert not asked.known.all()
    by_log, by_asking = (examine(recording, track).named("GPS coverage") for track in (whole, asked))
    assert by_log == by_asking
    with pytest.raises(TrackError, match="no fix"):
        examine(recording, whole.at([-5, -4]))


def test_pictures(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="pictures need the extra 'report'")
    recording, track = write_drive(tmp_path, "day", make_drive(windows=300))
    found: Examination = examine(recording, track)
    draw(found, tmp_path / "day.doctor")
    written = {file.name for file in (tmp_path / "day.doctor").iterdir()}
    assert {
        "findings.json",
        "rate.png",
        "hot_pixels.png",
        "flicker.png",
        "activity.png",
        "speed.png",
    } <= written
    assert json.loads((tmp_path / "day.doctor" / "findings.json").read_text()) == as_json(found)
    with pytest.raises(OutputError, match="exists"):
        draw(found, tmp_path / "day.doctor")
    draw(found, tmp_path / "day.doctor", overwrite=True)


ALARMS = {
    "dvxplorer_lite_320x240.aedat4": {"hot pixels": "look"},
    "davis346.aedat4": {},
    "davis240c_translBoxes.aedat": {},
    "dvs_320x240.es": {},
    "gen4_1280x720.dat": {},
    "evt2_640x480.raw": {"remarks": "look", "quick repeats": "look"},
    "evt3_packets_640x480.bag": {"flicker": "bad", "hot pixels": "look", "remarks": "look"},
}
"""Real recordings -> what is to be said of them. A spectrum, too, shows the bag's lamps at 120 Hz."""


@pytest.mark.parametrize("name", ALARMS)
def test_real_recordings(data: Path, name: str) -> None:
    found = examine(data / "events" / name)
    assert {f.name: f.state for f in found.findings if f.state in ("bad", "look")} == ALARMS[name]
    if "flicker" in ALARMS[name]:
        assert found.named("flicker").advice == "`flicker_hz=120`"


def test_real_frames_and_a_real_track(data: Path) -> None:
    found = examine(data / "frames" / "vid2e", data / "gps" / "amod_walk.nmea")
    assert found.named("image motion").state == "good"
    assert found.named("GPS coverage").state == "bad"
    assert found.named("GPS fixes").value == 0


def test_events_of_no_time_have_no_rate() -> None:
    events = Events.of([9] * 50, range(50), [0] * 50, [1] * 50, SIZE)
    for part in OF_EVENTS:
        outcome(part, events)
