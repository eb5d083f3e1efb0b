"""AEDAT 4.0 (iniVation DV) with one stream of events, packed with LZ4.

Layout: iniVation, "AEDAT 4.0 file format"; the FlatBuffers of IOHeader and EventPacket are laid out by hand,
as each has one fixed shape. No table of packets is written: readers then go through the file.
"""

from __future__ import annotations

import struct
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from pathlib import Path

import lz4.frame
import numpy as np

from evplace.core.errors import OutputError
from evplace.core.events import Events, Size

ABOUT = "AEDAT 4.0 file of iniVation DV"
SUFFIX = ".aedat4"
EVENTS = 1 << 13
"""Events a packet."""
EVENT = np.dtype([("t", "<i8"), ("x", "<i2"), ("y", "<i2"), ("on", "u1"), ("pad", "V3")])
LZ4 = 1
"""Its number in the file header."""


def write(path: Path, packets: Iterable[Events], size: Size) -> None:
    """The header, then packets; OutputError for a sensor of more than 32,768 columns or rows."""
    if max(size) > 1 << 15:
        raise OutputError(
            f"AEDAT 4 has room for 32768 columns and rows, not for {size[0]}x{size[1]}: choose npz"
        )
    with path.open("wb") as file:
        file.write(b"#!AER-DAT4.0\r\n" + _io_header(size))
        for packet in packets:
            for start in range(0, len(packet), EVENTS):
                data = lz4.frame.compress(_event_packet(packet[start : start + EVENTS]))
                file.write(struct.pack("<ii", 0, len(data)) + data)


def _io_header(size: Size) -> bytes:
    """The FlatBuffer IOHeader with its length before it: compression, no table of packets, description."""
    text = ElementTree.tostring(_description(size)) + b"\0"
    fields = struct.pack(
        "<HHHHH6x", 10, 20, 4, 8, 16
    )  # at byte 8: length of it and of the table, three places
    table = struct.pack("<iiqI", 16, LZ4, -1, 4)  # at byte 24: way back to the fields, then their values
    data = struct.pack("<I4s", 24, b"IOHE") + fields + table + struct.pack("<I", len(text) - 1) + text
    return struct.pack("<I", len(data)) + data


def _description(size: Size) -> ElementTree.Element:
    root = ElementTree.Element("dv", version="2.0")
    place = "/mainloop/Recorder/outInfo/"
    streams = ElementTree.SubElement(root, "node", name="outInfo", path=place)
    stream = ElementTree.SubElement(streams, "node", name="0", path=f"{place}0/")
    texts = {
        "compression": "LZ4",
        "originalModuleName": "evplace",
        "originalOutputName": "events",
        "typeDescription": "Array of events (polarity ON/OFF).",
        "typeIdentifier": "EVTS",
    }
    for key, value in texts.items():
        ElementTree.SubElement(stream, "attr", key=key, type="string").text = value
    info = ElementTree.SubElement(stream, "node", name="info", path=f"{place}0/info/")
    for key, number in zip(("sizeX", "sizeY"), size, strict=True):
        ElementTree.SubElement(info, "attr", key=key, type="int").text = str(number)
    ElementTree.SubElement(info, "attr", key="source", type="string").text = "evplace"
    return root


def _event_packet(events: Events) -> bytes:
    """The FlatBuffer EventPacket with its length before it: one vector of event structs."""
    rows = np.zeros(len(events), EVENT)
    rows["t"], rows["x"], rows["y"], rows["on"] = events.t_us, events.x, events.y, events.p
    fields = struct.pack("<HHH2x", 6, 8, 4)  # at byte 8
    table = struct.pack("<iI", 8, 4)  # at byte 16
    data = struct.pack("<I4s", 16, b"EVTS") + fields + table + struct.pack("<I", len(rows)) + rows.tobytes()
    return struct.pack("<I", len(data)) + data
