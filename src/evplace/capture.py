"""Recordings and folders of images -> traverses."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace import settings as settings_room
from evplace.errors import DamagedRecordingError, TrackError, TraverseError
from evplace.events import Events, Size
from evplace.frames import Frames, is_frames, open_frames
from evplace.images import ImageSettings, frame_image
from evplace.readers import Recording, open_recording
from evplace.stream import event_images
from evplace.tracks import Track, open_track
from evplace.traverse import Traverse, TraverseWriter
from evplace.windows import WindowSettings


def open_traverse(
    path: str | Path,
    track: str | Path | Track | None = None,
    windows: WindowSettings | None = None,
    images: ImageSettings | None = None,
    size: Size | None = None,
    time_unit: str | None = None,
) -> Traverse:
    """A traverse folder, an event recording or a folder of images, whichever `path` is.

    Recordings and images are turned into images in memory; for long ones, write a traverse folder with
    `evplace images` first. `track` is a GPS log, or a Track; `size` and `time_unit` are
    for recordings that do not say (see `open_recording`). InputError where something cannot be read.
    """
    if (Path(path) / "traverse.json").exists():
        found = Traverse.load(path)
        aligned = _aligned(_opened(track), found.t_us)
        return found if aligned is None else dataclasses.replace(found, track=aligned)
    with tempfile.TemporaryDirectory(prefix="evplace-") as folder:
        writer = TraverseWriter(Path(folder), {})
        try:
            record(path, writer, track, windows, images, size, time_unit)
            writer.close()
        finally:
            writer.discard()
        found = Traverse.load(folder)
        return Traverse(np.array(found.images), found.t_us, found.counts, found.track, found.info)


def record(
    path: str | Path,
    writer: TraverseWriter,
    track: str | Path | Track | None = None,
    windows: WindowSettings | None = None,
    images: ImageSettings | None = None,
    size: Size | None = None,
    time_unit: str | None = None,
) -> str | None:
    """Write the images of an event recording or of a folder of images; returns what broke off, if any."""
    positions = _opened(track)
    if is_frames(Path(path)):
        record_frames(open_frames(path), path, writer, images, positions)
        return None
    return record_events(open_recording(path, size, time_unit=time_unit), writer, windows, images, positions)


def record_events(
    recording: Recording,
    writer: TraverseWriter,
    windows: WindowSettings | None = None,
    images: ImageSettings | None = None,
    track: Track | None = None,
) -> str | None:
    """Write a recording's event images; returns what broke off, where the recording is damaged."""
    windows, images = windows or WindowSettings(), images or ImageSettings()
    packets = _GoodPart(recording)
    for image, window in event_images(packets, recording.size, windows, images):
        writer.add(image, window.t_us, window.events)
    fault = packets.fault
    writer.track = _aligned(track, np.array(writer.t_us, np.int64))
    writer.info |= {
        "source": str(recording.path),
        "input": "events",
        "sensor": list(recording.size),
        "windows": settings_room.to_dict(windows),
        "images": settings_room.to_dict(images),
        "dropped": recording.dropped,
        "fault": fault,
    }
    return fault


def record_frames(
    frames: Frames,
    source: str | Path,
    writer: TraverseWriter,
    images: ImageSettings | None = None,
    track: Track | None = None,
) -> None:
    """Write camera images, cropped and resized as `images` says."""
    images = images or ImageSettings()
    shape = None
    for file, frame, t_us in zip(frames.files, frames, frames.t_us, strict=True):
        shape = shape or frame.shape
        if frame.shape != shape:
            raise TraverseError(f"{file} is {frame.shape}, the images before it are {shape}: make them alike")
        writer.add(frame_image(frame, images), int(t_us))
    writer.track = _aligned(track, frames.t_us)
    writer.info |= {
        "source": str(source),
        "input": "frames",
        "timed": frames.timed,
        "images": settings_room.to_dict(images),
    }


def _opened(track: str | Path | Track | None) -> Track | None:
    return open_track(track) if isinstance(track, str | Path) else track


def _aligned(track: Track | None, t_us: NDArray[np.int64]) -> Track | None:
    """The track at the times of the images; TrackError where it covers none of them."""
    if track is None or not len(t_us):
        return None
    aligned = track.at(t_us)
    if not aligned.known.any():
        raise TrackError(
            f"the track and the images do not overlap: the track runs from {_seconds(track.t_us)}, "
            f"the images from {_seconds(t_us)}; give the recording's own track, or shift the track's times"
        )
    return aligned


def _seconds(t_us: NDArray[np.int64]) -> str:
    return f"{t_us[0] / 1e6:.3f} s to {t_us[-1] / 1e6:.3f} s"


class _GoodPart:
    """A recording's packets up to where it broke off; what broke it off is kept in `fault`."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.fault: str | None = None

    def __iter__(self) -> Iterator[Events]:
        try:
            yield from self._recording.packets()
        except DamagedRecordingError as error:
            self.fault = str(error)
