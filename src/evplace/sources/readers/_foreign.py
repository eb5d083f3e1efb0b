"""Files that are known, but not read: what they are, and what to do."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from evplace.sources.readers._prophesee import evt_version, header
from evplace.sources.readers._source import printable

UNPACK = "unpack it first"
CONVERT = "convert it with the program that wrote it"
STARTS = {
    b"BZh": ("packed with bzip2", UNPACK),
    b"\xfd7zXZ\x00": ("packed with xz", UNPACK),
    b"\x28\xb5\x2f\xfd": ("packed with zstd, and no ROS 2 bag", UNPACK),
    b"\x1f\x8b": ("packed with gzip, and no text", UNPACK),
    b"7z\xbc\xaf\x27\x1c": ("a 7z archive", UNPACK),
    b"Rar!": ("a rar archive", UNPACK),
    b"PK\x03\x04": ("a zip archive without events as text or numpy arrays", UNPACK),
    b"MATLAB 5.0": ("a MATLAB file of version 5", "write t, x, y and p as text or HDF5"),
    b"ARROW1": ("an Arrow file", "write it as Parquet"),
    b"FEA1": ("a Feather file", "write it as Parquet"),
    b"PARE": ("an encrypted Parquet file", "decrypt it first"),
    b"\x80\x02": ("a Python pickle", "write t, x, y and p as .npz"),
    b"\x80\x03": ("a Python pickle", "write t, x, y and p as .npz"),
    b"\x80\x04": ("a Python pickle", "write t, x, y and p as .npz"),
    b"\x80\x05": ("a Python pickle", "write t, x, y and p as .npz"),
}
"""How a file starts -> what it is, and what to do."""
VERSIONS = {
    re.compile(rb"#!AER-DAT([\w.]+)"): "an AEDAT file of version {}: 2.0, 3.0, 3.1 and 4.0 are read",
    re.compile(rb"#ROSBAG V([\w.]+)"): "a ROS bag of version {}: 2.0 is read",
    re.compile(rb"\x89MCAP(.)\r\n"): "an MCAP file of version {}: 0 is read",
}
"""Formats by their version lines, of versions that no reader takes."""


def foreign(path: Path, head: bytes) -> str | None:
    """What a file is that no reader takes, why it is not read and what to do; None where it is unknown."""
    kinds: tuple[Callable[[bytes], str | None], ...] = (_of_version, _prophesee, _packed)
    return _bag(path) if path.is_dir() else next(filter(None, (kind(head) for kind in kinds)), None)


def _of_version(head: bytes) -> str | None:
    for line, what in VERSIONS.items():
        if (found := line.match(head)) is not None:
            return what.format(printable(found.group(1).decode("latin-1")))
    return None


def _prophesee(head: bytes) -> str | None:
    version = evt_version(header(head).fields)
    if not version:
        return None
    return f"a Prophesee raw file of EVT {version}: 2.0, 2.1 and 3.0 are read"


def _packed(head: bytes) -> str | None:
    found = next((about for start, about in STARTS.items() if head.startswith(start)), None)
    return None if found is None else f"{found[0]}, which is not read: {found[1]}"


def _bag(folder: Path) -> str | None:
    """Of a ROS 2 bag with files of another kind."""
    about = folder / "metadata.yaml"
    if not about.is_file():
        return None
    text = about.read_text("utf-8", "replace")[: 1 << 16]
    if "rosbag2_bagfile_information" not in text:
        return None
    storage = re.search(r"storage_identifier: *[\"']?(\w+)", text)
    packed = re.search(r"compression_format: *[\"']?(\w+)", text)
    stored, method = (found.group(1) if found else "nothing known" for found in (storage, packed))
    return (
        f"a ROS 2 bag (storage {stored}, compression {method}) without a file that is read: .mcap and .db3 "
        f"are, plain or packed with zstd"
    )
