"""Packets of events -> recordings. One file a format; its name is the format's name.

Each file holds `ABOUT`, one line of text; `SUFFIX`, by which the format is chosen from a file's name; and
`write(path, packets, size)`, which writes all packets (`size` is the sensor's width and height) in bounded
memory. Whole files only: the file takes its name once it is complete.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from evplace.core import families
from evplace.core.errors import DamagedRecordingError, OutputError
from evplace.core.events import Events, Size
from evplace.core.storage import new_file


def write_recording(
    path: str | Path,
    packets: Iterable[Events],
    size: Size,
    format: str | None = None,
    overwrite: bool = False,
) -> int:
    """Write `packets` of a sensor of `size` (width, height); return how many events they held.

    `format` names a writer; without it, the suffix of `path` does. Where the packets break off with a
    DamagedRecordingError, what came before is written, then the error is raised. Raises OutputError for an
    unknown suffix, an output that exists (unless `overwrite`) or a full disk.
    """
    target = Path(path)
    module = families.load("writers", format or _by_suffix(target))
    counted = _Counted(packets)
    with new_file(target, overwrite) as partial, families.blaming("writers", module, OSError):
        module.write(partial, counted, size)
    if counted.fault is not None:
        raise counted.fault
    return counted.events


def _by_suffix(path: Path) -> str:
    """The writer whose suffix the path has."""
    suffixes: dict[str, str] = {}
    for name, part in families.loadable("writers"):
        suffixes.setdefault(part.SUFFIX, name)
    if path.suffix.lower() not in suffixes:
        known = ", ".join(f"{suffix} ({name})" for suffix, name in suffixes.items())
        raise OutputError(f"cannot tell the format of {path} from its suffix: known are {known}")
    return suffixes[path.suffix.lower()]


class _Counted:
    """Packets on their way: counted, empty ones left out, and ended by a fault instead of raising it."""

    def __init__(self, packets: Iterable[Events]) -> None:
        self._packets = packets
        self.events = 0
        self.fault: DamagedRecordingError | None = None

    def __iter__(self) -> Iterator[Events]:
        try:
            for packet in self._packets:
                self.events += len(packet)
                if len(packet):
                    yield packet
        except DamagedRecordingError as error:
            self.fault = error
