"""Matches as NMEA, as ROS 2 topics and as lines; outputs that are stuck hold up nothing."""

from __future__ import annotations

import dataclasses
import json
import math
import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import HANG_S
from evplace.core.errors import OutputError
from evplace.exports.nmea import sentence
from evplace.localizer import Match
from evplace.placemap import PlaceMap
from evplace.serving._feed import Counters
from evplace.serving._report import Report, epsg
from evplace.serving.nmea import sentences
from evplace.serving.outputs import Output
from evplace.serving.ros import (
    TYPES,
    diagnosis_of,
    diagnostics_message,
    fix_message,
    fix_of,
    frame_of,
    pose_message,
    pose_of,
)

HERE = (586_108.0, 4_134_189.9)
AT = Match(1_000_000, 5, 2, HERE, 0.5, "localised", 0.9, 10.0, 73.0, (6, 7))


@pytest.fixture
def city(image_map: PlaceMap) -> PlaceMap:
    """The map as if it lay in UTM zone 10 north."""
    return dataclasses.replace(image_map, zone=(10, True))


def reported(match: Match) -> Report:
    return Report(match, 1_795_727_164.25, 0.004, 1e6, 0.1, Counters(events=9, skipped=3))


def changed(**values: Any) -> Match:
    return dataclasses.replace(AT, **values)


# NMEA


def test_sentences_are_those_of_a_receiver(city: PlaceMap) -> None:
    gga, rmc = sentences(reported(AT), city).splitlines()
    assert gga.startswith("$GPGGA,210604.25,3721.02")
    assert ",N,12201.66" in gga
    assert gga.rpartition("*")[0].endswith(",W,6,00,2.0,,M,,M,,")
    assert rmc.rpartition("*")[0].endswith(",W,,73.0,261126,,,E")


@pytest.mark.parametrize("state", ["unseen", "lost", "ambiguous", "no-events"])
def test_without_a_place_there_is_no_fix(city: PlaceMap, state: Any) -> None:
    gga, rmc = sentences(reported(changed(state=state)), city).splitlines()
    assert gga.split(",")[2:7] == ["", "", "", "", "0"]
    assert rmc.split(",")[2] == "V"


def test_a_plane_of_its_own_has_no_fix(image_map: PlaceMap) -> None:
    assert ",0,00," in sentences(reported(AT), image_map)


def test_other_readers_read_it(city: PlaceMap, tmp_path: Path) -> None:
    """Our own reader of logs, and pynmeagps, find the position again."""
    path = tmp_path / "drive.nmea"
    texts = [sentences(dataclasses.replace(reported(AT), host_s=1_795_727_164 + n), city) for n in range(5)]
    path.write_text("".join(texts), newline="")
    from evplace.sources.tracks import open_track

    found = city.geodetic(HERE)
    assert found is not None
    track = open_track(path)
    np.testing.assert_allclose([track.latitude[0], track.longitude[0]], found, atol=1e-7)
    pynmeagps = pytest.importorskip("pynmeagps", reason="pynmeagps is not installed")
    for line in texts[0].splitlines():
        message = pynmeagps.NMEAReader.parse(line)
        np.testing.assert_allclose([message.lat, message.lon], found, atol=1e-6)


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="$*"), max_size=70))
def test_the_checksum_is_the_exclusive_or(body: str) -> None:
    text = sentence(body)
    total = 0
    for sign in body:
        total ^= ord(sign)
    assert text == f"${body}*{total:02X}"


@given(st.floats(-80, 80), st.floats(-180, 180))
def test_minutes_never_reach_sixty(latitude: float, longitude: float) -> None:
    from evplace.exports.nmea import _angle

    for degrees, digits in ((latitude, 2), (longitude, 3)):
        text = _angle(degrees, digits)
        assert float(text[digits:]) < 60
        assert int(text[:digits]) + float(text[digits:]) / 60 == pytest.approx(abs(degrees), abs=1e-6)


# ROS 2


def read_back(kind: str, data: bytes) -> Any:
    """A message as rosbags reads it; and its type's hash is the one that we name."""
    pytest.importorskip("rosbags", reason="rosbags is not installed: no other program reads our messages")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    name = kind.rpartition("/")[2]
    assert store.hash_rihs01(kind) == f"RIHS01_{TYPES[name][1]}"
    assert kind.startswith(TYPES[name][0])
    return store.deserialize_cdr(data, kind)


def test_a_fix_is_what_ros_reads(city: PlaceMap) -> None:
    fix = fix_of(AT, city)
    found = read_back("sensor_msgs/msg/NavSatFix", fix_message(fix, 7_000_000_009, "camera"))
    assert (found.header.stamp.sec, found.header.stamp.nanosec, found.header.frame_id) == (7, 9, "camera")
    assert (found.status.status, found.position_covariance_type) == (0, 1)
    assert (found.latitude, found.longitude) == city.geodetic(HERE)
    assert math.isnan(found.altitude)
    assert found.position_covariance[0] == pytest.approx((10 / 1.515) ** 2)
    assert fix_of(changed(state="lost"), city).status == -1


def test_a_pose_is_what_ros_reads(city: PlaceMap) -> None:
    pose = pose_of(AT, city)
    assert pose is not None
    found = read_back("geometry_msgs/msg/PoseWithCovarianceStamped", pose_message(pose, 1))
    at = found.pose.pose
    assert found.header.frame_id == frame_of(city) == "utm_10n"
    assert (at.position.x, at.position.y) == HERE
    turn = 2 * math.atan2(at.orientation.z, at.orientation.w)
    assert math.degrees(turn) == pytest.approx(90 - 73)
    assert found.pose.covariance.reshape(6, 6)[0, 0] == pytest.approx((10 / 1.515) ** 2)
    assert pose_of(changed(state="unseen"), city) is None
    assert pose_of(changed(position=None), city) is None


def test_diagnostics_are_what_ros_reads() -> None:
    data = diagnostics_message(diagnosis_of(reported(AT)), 1, "evplace: localizer")
    (status,) = read_back("diagnostic_msgs/msg/DiagnosticArray", data).status
    assert (status.level, status.name, status.message) == (0, "evplace: localizer", "localised")
    assert {value.key: value.value for value in status.values}["skipped"] == "3"
    assert diagnosis_of(reported(changed(state="lost"))).level == 1


def test_topics_arrive_over_zenoh(city: PlaceMap) -> None:
    zenoh = pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed")
    from evplace.serving.ros import Topics
    from evplace.sources.live.zenoh import leave, session

    with socket.socket() as any_one:
        any_one.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{any_one.getsockname()[1]}"
    robot = session("", "peer", endpoint)
    heard = robot.declare_subscriber("0/**", zenoh.handlers.RingChannel(100))
    topics = Topics("/car/", city, endpoint, "peer")
    found: dict[str, bytes] = {}
    while len(found) < 3:
        topics.publish(reported(AT))
        while (sample := heard.try_recv()) is not None:
            found[str(sample.key_expr)] = bytes(sample.payload)
    names = sorted(key.rpartition("/RIHS01_")[0] for key in found)
    assert names == [
        "0/car/fix/sensor_msgs::msg::dds_::NavSatFix_",
        "0/car/pose/geometry_msgs::msg::dds_::PoseWithCovarianceStamped_",
        "0/diagnostics/diagnostic_msgs::msg::dds_::DiagnosticArray_",
    ]
    data = next(data for key, data in found.items() if "NavSatFix" in key)
    assert read_back("sensor_msgs/msg/NavSatFix", data).latitude == fix_of(AT, city).latitude
    topics.close()
    leave(robot)


def test_frames_and_codes(city: PlaceMap, image_map: PlaceMap) -> None:
    assert (epsg(city), frame_of(city)) == (32610, "utm_10n")
    south = dataclasses.replace(city, zone=(56, False))
    assert (epsg(south), frame_of(south)) == (32756, "utm_56s")
    assert (epsg(image_map), frame_of(image_map)) == (None, "map")


# Where they go


def test_an_output_to_a_file(tmp_path: Path) -> None:
    output = Output(lambda report: f"{report.match.t_us}\n", str(tmp_path / "lines"))
    for n in range(5):
        output.publish(reported(changed(t_us=n)))
    output.close(HANG_S)
    assert (tmp_path / "lines").read_text() == "0\n1\n2\n3\n4\n"


def test_an_output_to_udp() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(HANG_S)
        output = Output(lambda report: json.dumps(report.match.state), f"udp:{receiver.getsockname()[1]}")
        output.publish(reported(AT))
        assert receiver.recv(1000) == b'"localised"'
        output.close(HANG_S)


def test_what_cannot_be_written_is_said(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"cannot write to .*nowhere"):
        Output(lambda _: "", str(tmp_path / "nowhere" / "file"))


def test_an_output_that_is_stuck_holds_up_nothing_and_loses_the_oldest(tmp_path: Path) -> None:
    import threading

    go_on, written = threading.Event(), []

    def text(report: Report) -> str:
        assert go_on.wait(HANG_S)
        written.append(report.match.t_us)
        return ""

    output = Output(text, str(tmp_path / "lines"))
    for n in range(1000):
        output.publish(reported(changed(t_us=n)))
    go_on.set()
    output.close(HANG_S)
    assert output.lost > 700
    assert written[-1] == 999
    assert len(written) + output.lost == 1000


def test_a_full_device_ends_that_output_alone() -> None:
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    output = Output(lambda _: "text\n", "/dev/full")
    output.publish(reported(AT))
    output.close(HANG_S)
    assert output.fault is not None
    assert "No space left" in output.fault
