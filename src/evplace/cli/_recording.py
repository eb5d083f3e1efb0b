"""The flags of an event recording, shared by all commands that take one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from evplace.cli._settings import a_part_of
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


@dataclass(frozen=True, kw_only=True)
class DriveFlags(RecordingFlags):
    """Which drive, where a folder holds several, and what the user knows better than its files."""

    drive: str | None = None
    """For a data set: which drive."""
    dataset: Annotated[str | None, a_part_of("datasets")] = None
    """For a data set that is not recognised by its layout: its name."""

    def reading(self) -> dict[str, Any]:
        """How the source is read, as arguments of `open_traverse`; its size only where it is given."""
        names = ("time_unit", "stream", "columns", "drive", "dataset")
        known: dict[str, Any] = {name: getattr(self, name) for name in names}
        return known if self.size is None else known | {"size": self.size}
