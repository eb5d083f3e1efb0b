"""The ROS 2 node with stand-ins for rclpy and the messages: ROS itself is not needed, and was not at hand."""

from __future__ import annotations

import dataclasses
import importlib
import sys
import threading
import time
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from conftest import HANG_S, Drive
from evplace.core.events import Events
from evplace.placemap import PlaceMap

ROOT = Path(__file__).parents[1] / "ros" / "evplace_ros"


class Message(SimpleNamespace):
    """A message whose fields are there once they are asked for."""

    OK, WARN, ERROR = b"\0", b"\1", b"\2"

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        made = Message()
        setattr(self, name, made)
        return made


class Publisher:
    def __init__(self) -> None:
        self.published: list[Any] = []

    def publish(self, message: Any) -> None:
        self.published.append(message)


class StandInNode:
    """What we use of rclpy's Node."""

    parameters: ClassVar[dict[str, Any]] = {}

    def __init__(self, name: str) -> None:
        self.name = name
        self.publishers_: dict[str, Publisher] = {}
        self.subscriptions_: dict[str, Callable[[Any], None]] = {}
        self.timers_: list[Callable[[], None]] = []

    def declare_parameter(self, name: str, usual: Any) -> Any:
        return SimpleNamespace(value=self.parameters.get(name, usual))

    def create_publisher(self, kind: Any, topic: str, depth: int) -> Publisher:
        return self.publishers_.setdefault(topic, Publisher())

    def create_subscription(self, kind: Any, topic: str, take: Callable[[Any], None], qos: Any) -> None:
        self.subscriptions_[topic] = take

    def create_timer(self, seconds: float, call: Callable[[], None]) -> None:
        self.timers_.append(call)

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: "now"))

    def destroy_node(self) -> None:
        pass


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    made = {
        "rclpy": {"init": lambda args: None, "spin": lambda node: None, "try_shutdown": lambda: None},
        "rclpy.node": {"Node": StandInNode},
        "rclpy.qos": {"qos_profile_sensor_data": None},
        "event_camera_msgs.msg": {"EventPacket": Message},
        "sensor_msgs.msg": {"NavSatFix": Message},
        "geometry_msgs.msg": {"PoseWithCovarianceStamped": Message},
        "diagnostic_msgs.msg": {"DiagnosticArray": Message, "DiagnosticStatus": Message, "KeyValue": Message},
    }
    for name, values in made.items():
        package = name.partition(".")[0]
        monkeypatch.setitem(sys.modules, package, sys.modules.get(package) or types.ModuleType(package))
        stand_in = types.ModuleType(name)
        vars(stand_in).update(values)
        monkeypatch.setitem(sys.modules, name, stand_in)
    monkeypatch.syspath_prepend(str(ROOT))
    for name in ("evplace_ros", "evplace_ros.node"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    yield importlib.import_module("evplace_ros.node")
    sys.modules.pop("evplace_ros.node", None)


def packets(events: Events, size: tuple[int, int] = (80, 60)) -> Iterator[Any]:
    """The drive as `mono` messages."""
    import numpy as np

    for start in range(0, len(events), 1000):
        part = events[start : start + 1000]
        words = part.t_us.astype(np.uint64) * np.uint64(1000)
        words |= part.x.astype(np.uint64) << np.uint64(32) | part.y.astype(np.uint64) << np.uint64(48)
        words |= part.p.astype(np.uint64) << np.uint64(63)
        yield Message(encoding="mono", width=size[0], height=size[1], time_base=0, events=words.tobytes())


def until(done: Callable[[], Any]) -> None:
    until_s = time.monotonic() + HANG_S
    while not done():
        assert time.monotonic() < until_s
        time.sleep(0.005)


@pytest.fixture
def node(module: Any, image_map: PlaceMap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    dataclasses.replace(image_map, zone=(10, True)).save(tmp_path / "street.evp")
    parameters = {"map": str(tmp_path / "street.evp"), "matcher": "best"}
    monkeypatch.setattr(StandInNode, "parameters", parameters)
    made = module.LocalizerNode()
    yield made
    made.close()


def test_packets_become_fixes_poses_and_diagnostics(node: Any, night_drive: Drive) -> None:
    fixes, poses = node.publishers_["~/fix"].published, node.publishers_["~/pose"].published
    node.timers_[0]()
    assert node.publishers_["/diagnostics"].published[-1].status[0].message == "no events yet"
    for message in packets(night_drive.events):
        node.subscriptions_["events"](message)
    until(lambda: len(fixes) >= 50)
    assert fixes[20].status.status == 0
    assert fixes[20].header.stamp == "now"
    assert -90 < fixes[20].latitude < 90
    assert poses[20].header.frame_id == "utm_10n"
    assert poses[30].pose.pose.position.x > poses[10].pose.pose.position.x
    node.timers_[0]()
    status = node.publishers_["/diagnostics"].published[-1].status[0]
    assert "state" in {value.key for value in status.values}


def test_messages_that_cannot_be_used_are_counted_and_said(
    node: Any, night_drive: Drive, module: Any
) -> None:
    take = node.subscriptions_["events"]
    take(Message(encoding="morse", width=80, height=60, time_base=0, events=b""))
    take(next(packets(night_drive.events, size=(640, 480))))
    take(Message(encoding="libcaer_cmp", width=80, height=60, time_base=0, events=b"\xff\xff"))
    until(lambda: node._incoming.lost == 3)
    assert "damaged" in node._incoming.notes[0]


def test_a_missing_map_is_one_line(
    module: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(StandInNode, "parameters", {"map": "nowhere.evp"})
    assert module.main([]) == 2
    assert capsys.readouterr().out.startswith("evplace: nowhere.evp is no map")


def test_messages_that_wait_too_long_are_dropped(module: Any) -> None:
    incoming = module.Incoming((80, 60))
    for _ in range(module.HELD + 10):
        incoming.take(Message(encoding="mono", width=80, height=60, time_base=0, events=b""))
    assert incoming.lost == 10
    ended = threading.Event()

    def run() -> None:
        list(incoming.blocks())
        ended.set()

    threading.Thread(target=run, daemon=True).start()
    incoming.close()
    assert ended.wait(HANG_S)


def test_the_package_names_itself_everywhere() -> None:
    assert (ROOT / "resource" / "evplace_ros").exists()
    assert "<build_type>ament_python</build_type>" in (ROOT / "package.xml").read_text()
    assert "localizer = {NAME}.node:main" in (ROOT / "setup.py").read_text()
    assert "script_dir=$base/lib/evplace_ros" in (ROOT / "setup.cfg").read_text()
