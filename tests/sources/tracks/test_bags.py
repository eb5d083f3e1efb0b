"""Positions inside a bag: ROS 1, db3 and mcap, fixes and poses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evplace.core.errors import TrackError
from evplace.sources.tracks import open_track
from made_bags import Topics, db3, mcap, nav_sat_fix, pose, ros1
from made_logs import START_S, Log

BAGS: dict[str, Callable[[Path, Topics], Path]] = {"ros1": ros1, "db3": db3, "mcap": mcap}
LOG = Log(30)
FIX = ("/gps/fix", "sensor_msgs/NavSatFix")
POSE = ("/slam/pose", "geometry_msgs/PoseStamped")
COVARIANCE = ("/slam/cov", "geometry_msgs/PoseWithCovarianceStamped")
ODOMETRY = ("/odom", "nav_msgs/Odometry")
OTHER = ("/imu", "sensor_msgs/Imu")


def fixes(aligned: bool) -> list[bytes]:
    return [nav_sat_fix(t, lat, lon, aligned) for t, lat, lon, _, _ in LOG.rows()]


def poses(aligned: bool, child: bytes = b"") -> list[bytes]:
    return [pose(t, 10.0 * n, 5.0 * n, aligned, child) for n, (t, *_) in enumerate(LOG.rows())]


@pytest.mark.parametrize("bag", BAGS)
def test_fixes(tmp_path: Path, bag: str) -> None:
    track = open_track(BAGS[bag](tmp_path, {OTHER: [b"\0" * 40], FIX: fixes(bag != "ros1")}))
    assert (len(track), track.zone, track.dropped, track.fault) == (30, 56, {}, None)
    assert (track.t_us / 1e6).tolist() == LOG.t_s.tolist()
    assert track.latitude.tolist() == LOG.latitude.tolist()
    assert track.notes == ("the positions are those of /gps/fix",)


@pytest.mark.parametrize("bag", BAGS)
@pytest.mark.parametrize(
    ("topic", "child"), [(POSE, b""), (COVARIANCE, b""), (ODOMETRY, b"base"), (ODOMETRY, b"b")]
)
def test_poses(tmp_path: Path, bag: str, topic: tuple[str, str], child: bytes) -> None:
    track = open_track(BAGS[bag](tmp_path, {topic: poses(bag != "ros1", child)}))
    assert (len(track), track.zone) == (30, 0)
    assert track.xy.tolist() == [[10.0 * n, 5.0 * n] for n in range(30)]
    assert "plane xy (z up)" in track.notes[1]


@pytest.mark.parametrize("bag", BAGS)
def test_fixes_come_before_poses_and_a_topic_can_be_chosen(tmp_path: Path, bag: str) -> None:
    aligned = bag != "ros1"
    path = BAGS[bag](tmp_path, {POSE: poses(aligned), FIX: fixes(aligned)})
    track = open_track(path)
    assert track.zone == 56
    assert (
        track.notes[0] == "the positions are those of /gps/fix, not of /slam/pose: the setting topic chooses"
    )
    assert open_track(path, topic="/slam/pose").zone == 0
    with pytest.raises(TrackError, match=r"its topic /none has no positions .* it holds /slam/pose"):
        open_track(path, topic="/none")


@pytest.mark.parametrize("bag", BAGS)
def test_messages_without_a_fix_are_counted(tmp_path: Path, bag: str) -> None:
    aligned = bag != "ros1"
    messages = fixes(aligned)
    messages[3] = nav_sat_fix(START_S + 3, np.nan, np.nan, aligned)
    messages[4] = nav_sat_fix(START_S + 4, LOG.latitude[4], LOG.longitude[4], aligned, status=-1)
    messages[5] = nav_sat_fix(0, LOG.latitude[5], LOG.longitude[5], aligned)
    messages[6] = messages[6][:20]
    track = open_track(BAGS[bag](tmp_path, {FIX: messages}))
    assert len(track) == 26
    assert track.dropped == {"no fix": 2, "no time stamp": 1, "damaged message": 1}
    assert any("no fix (first message 5 of /gps/fix)" in note for note in track.notes)


@pytest.mark.parametrize("bag", BAGS)
def test_a_bag_without_positions_says_what_it_holds(tmp_path: Path, bag: str) -> None:
    with pytest.raises(TrackError, match=r"no positions \(sensor_msgs/NavSatFix, .*/imu \(sensor_msgs/Imu\)"):
        open_track(BAGS[bag](tmp_path, {OTHER: [b"\0" * 40]}))


@pytest.mark.parametrize("bag", ["ros1", "mcap"])
def test_a_cut_bag_gives_its_good_part(tmp_path: Path, bag: str) -> None:
    topics = {FIX: fixes(bag != "ros1"), POSE: poses(bag != "ros1") * 40}
    path = BAGS[bag](tmp_path, topics)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * 0.9)])
    track = open_track(path)
    assert len(track) > 0
    assert track.fault is not None
    assert "\n" not in track.fault
