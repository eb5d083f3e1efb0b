"""The flags of an event recording, shared by all commands that take one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from evplace.sources.readers import Recording, open_recording


@dataclass(frozen=True, kw_only=True)
class RecordingFlags:
    """What the user knows better than the file."""

    size: tuple[int, int] | None = None
    """Width and height of the sensor in pixels, where the file does not say or says it wrongly."""
    time_unit: Literal["s", "ms", "us", "ns"] | None = None
    """Unit of the times, where the file does not say."""
    stream: str | None = None
    """Which camera, where the file holds several: the name of a stream or topic, or a part of one."""
    columns: str | None = None
    """What the columns of a table are, where it does not say: t,x,y,p in their order; - passes one over."""

    def opened(self, path: Path) -> Recording:
        """The recording, read as the flags say."""
        return open_recording(
            path, self.size, time_unit=self.time_unit, stream=self.stream, columns=self.columns
        )
