"""The node: event_camera_msgs/EventPacket in; NavSatFix, PoseWithCovarianceStamped and diagnostics out.

Topics: `events` in, `~/fix`, `~/pose` and `/diagnostics` out. Parameters: `map`, the map's folder (needed);
`matcher`, in place of the one that the map remembers.

Messages are decoded and localised on threads of their own: where that is too slow the oldest events are
dropped, counted and said in the diagnostics.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from event_camera_msgs.msg import EventPacket
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import NavSatFix

from evplace.core.errors import EvplaceError
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.serving.ros import diagnosis_of, fix_of, pose_of
from evplace.serving.service import Report, Service
from evplace.sources.live import WAIT_S, Item
from evplace.sources.readers._ros_encodings import ENCODINGS

HELD = 256
"""Messages that wait to be decoded at most."""


class Incoming:
    """A live source of the messages that ROS hands over."""

    pace = 1.0
    waits = False

    def __init__(self, size: tuple[int, int] | None) -> None:
        self.size = size
        self.lost = 0
        self.notes: list[str] = []
        self._messages: queue.Queue[Any] = queue.Queue(HELD)
        self._encodings: dict[str, Any] = {}
        self._closed = False

    def take(self, message: Any) -> None:
        """One message; called by ROS."""
        if self._messages.full():
            self._messages.get_nowait()
            self.lost += 1
        self._messages.put_nowait(message)

    def close(self) -> None:
        """End `blocks`."""
        self._closed = True

    def blocks(self) -> Iterator[Item]:
        """The events of the messages; one that cannot be decoded is counted as lost."""
        while not self._closed:
            try:
                message = self._messages.get(timeout=WAIT_S)
            except queue.Empty:
                yield None
                continue
            yield self._events(message)

    def _events(self, message: Any) -> Item:
        name = message.encoding
        if self.size is not None and (message.width, message.height) != self.size:
            return self._refused(f"messages of {message.width}x{message.height} pixels, not the map's")
        if name not in ENCODINGS:
            return self._refused(f"messages of the encoding '{name}': known are {', '.join(ENCODINGS)}")
        decode = self._encodings.setdefault(name, ENCODINGS[name]())
        try:
            block = decode(bytes(message.events), message.time_base)
        except ValueError as error:
            return self._refused(f"a message is damaged: {error}")
        return block if len(block.t_us) else None

    def _refused(self, reason: str) -> None:
        self.lost += 1
        self.notes = [reason]


class LocalizerNode(Node):
    """Localises what it hears."""

    def __init__(self) -> None:
        super().__init__("evplace")
        path = Path(str(self.declare_parameter("map", "").value))
        matcher = str(self.declare_parameter("matcher", "").value) or None
        self._map = PlaceMap.load(path)
        recipe = self._map.recipe
        self._incoming = Incoming(None if recipe is None else recipe.size)
        self._fix = self.create_publisher(NavSatFix, "~/fix", 10)
        self._pose = self.create_publisher(PoseWithCovarianceStamped, "~/pose", 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._last: Report | None = None
        self._lock = threading.Lock()
        where = Localizer(self._map, matcher)
        self._service = Service(where, self._incoming, path, "events", outputs=[self.publish])
        self.create_subscription(EventPacket, "events", self._incoming.take, qos_profile_sensor_data)
        self.create_timer(1.0, self.diagnose)
        self._service.start()

    def publish(self, report: Report) -> None:
        """The topics of one report; called on the localizer's thread."""
        stamp = self.get_clock().now().to_msg()
        with self._lock:
            self._last = report
        self._fix.publish(self._fix_message(report, stamp))
        pose = pose_of(report.match, self._map)
        if pose is not None:
            message = PoseWithCovarianceStamped()
            message.header.stamp, message.header.frame_id = stamp, pose.frame
            position, orientation = message.pose.pose.position, message.pose.pose.orientation
            position.x, position.y, position.z = pose.position
            orientation.x, orientation.y, orientation.z, orientation.w = pose.orientation
            message.pose.covariance = pose.covariance
            self._pose.publish(message)

    def diagnose(self) -> None:
        """Say how the localizer is doing, once a second."""
        with self._lock:
            report = self._last
        status = DiagnosticStatus(name="evplace: localizer", hardware_id="evplace")
        fault = self._service.drive.fault
        if report is None or fault is not None:
            status.level = DiagnosticStatus.WARN if fault is None else DiagnosticStatus.ERROR
            status.message = fault or "no events yet"
        else:
            found = diagnosis_of(report)
            status.level = DiagnosticStatus.OK if found.level == 0 else DiagnosticStatus.WARN
            status.message = found.message
            status.values = [KeyValue(key=key, value=value) for key, value in found.values.items()]
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    def close(self) -> None:
        """End the localizing."""
        self._service.close()

    def _fix_message(self, report: Report, stamp: Any) -> NavSatFix:
        fix = fix_of(report.match, self._map)
        message = NavSatFix()
        message.header.stamp, message.header.frame_id = stamp, "event_camera"
        message.status.status = fix.status
        message.latitude, message.longitude, message.altitude = fix.latitude, fix.longitude, fix.altitude
        message.position_covariance = fix.covariance
        message.position_covariance_type = fix.covariance_type
        return message


def main(arguments: list[str] | None = None) -> int:
    """Run the node until ROS ends."""
    rclpy.init(args=arguments)
    try:
        node = LocalizerNode()
    except EvplaceError as error:
        print(f"evplace: {error}")
        return 2
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.close()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0
