"""Recordings and folders of images -> traverses."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace import settings as settings_room
from evplace.cleaning import CleaningSettings, MaskSource, pixel_mask
from evplace.errors import DamagedRecordingError, TrackError, TraverseError
from evplace.events import Events, Size
from evplace.frames import Frames, is_frames, open_frames
from evplace.images import ImageSettings, frame_image
from evplace.readers import Recording, open_recording
from evplace.spacing import Spacer, SpacingSettings
from evplace.stream import EventImages, images_of
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
    cleaning: CleaningSettings | None = None,
    spacing: SpacingSettings | None = None,
    mask: MaskSource | None = None,
) -> Traverse:
    """A traverse folder, an event recording or a folder of images, whichever `path` is.

    Recordings and images are turned into images in memory; for long ones, write a traverse folder with
    `evplace images` first. `track` is a GPS log, or a Track; `size` and `time_unit` are
    for recordings that do not say (see `open_recording`). `mask` names pixels of the recording to leave out
    (see `evplace.cleaning.read_mask`), besides what `cleaning` says. InputError where something cannot be
    read, or where a traverse folder was cleaned or spaced in another way than is asked for.
    """
    if (Path(path) / "traverse.json").exists():
        found = Traverse.load(path)
        _check_made_so(Path(path), found, cleaning, spacing, mask)
        aligned = _aligned(_opened(track), found.t_us)
        return found if aligned is None else dataclasses.replace(found, track=aligned)
    with tempfile.TemporaryDirectory(prefix="evplace-") as folder:
        writer = TraverseWriter(Path(folder), {})
        try:
            record(path, writer, track, windows, images, size, time_unit, cleaning, spacing, mask)
            writer.close()
        finally:
            writer.discard()
        found = Traverse.load(folder)
        return dataclasses.replace(found, images=np.array(found.images))


def record(
    path: str | Path,
    writer: TraverseWriter,
    track: str | Path | Track | None = None,
    windows: WindowSettings | None = None,
    images: ImageSettings | None = None,
    size: Size | None = None,
    time_unit: str | None = None,
    cleaning: CleaningSettings | None = None,
    spacing: SpacingSettings | None = None,
    mask: MaskSource | None = None,
) -> str | None:
    """Write the images of an event recording or of a folder of images; returns what broke off, if any."""
    positions = _opened(track)
    if is_frames(Path(path)):
        check_uncleaned(path, cleaning, mask)
        record_frames(open_frames(path), path, writer, images, positions, spacing)
        return None
    recording = open_recording(path, size, time_unit=time_unit)
    return record_events(recording, writer, windows, images, positions, cleaning, spacing, mask)


def record_events(
    recording: Recording,
    writer: TraverseWriter,
    windows: WindowSettings | None = None,
    images: ImageSettings | None = None,
    track: Track | None = None,
    cleaning: CleaningSettings | None = None,
    spacing: SpacingSettings | None = None,
    mask: MaskSource | None = None,
) -> str | None:
    """Write a recording's event images; returns what broke off, where the recording is damaged."""
    windows, images = windows or WindowSettings(), images or ImageSettings()
    cleaning, spacer = cleaning or CleaningSettings(), Spacer(spacing, track)
    writer.mask = pixel_mask(recording.packets(), recording.size, cleaning, mask)
    stream = EventImages(recording.size, windows, images, cleaning, writer.mask)
    packets = _GoodPart(recording)
    for image, window in images_of(packets, stream):
        if spacer.keeps(window.t_us, window.events):
            writer.add(image, window.t_us, window.events)
    fault = packets.fault
    writer.track = _aligned(track, np.array(writer.t_us, np.int64))
    writer.info |= {
        "source": str(recording.path),
        "input": "events",
        "sensor": list(recording.size),
        "windows": settings_room.to_dict(windows),
        "images": settings_room.to_dict(images),
        "cleaning": settings_room.to_dict(cleaning),
        "spacing": settings_room.to_dict(spacer.settings),
        "notes": recording.notes,
        "dropped": recording.dropped,
        "cleaned": stream.cleaned,
        "left_out": spacer.left_out,
        "fault": fault,
    }
    return fault


def record_frames(
    frames: Frames,
    source: str | Path,
    writer: TraverseWriter,
    images: ImageSettings | None = None,
    track: Track | None = None,
    spacing: SpacingSettings | None = None,
) -> None:
    """Write camera images, cropped and resized as `images` says."""
    images, spacer = images or ImageSettings(), Spacer(spacing, track)
    shape = None
    for file, frame, t_us in zip(frames.files, frames, frames.t_us, strict=True):
        shape = shape or frame.shape
        if frame.shape != shape:
            raise TraverseError(f"{file} is {frame.shape}, the images before it are {shape}: make them alike")
        if spacer.keeps(int(t_us), -1):
            writer.add(frame_image(frame, images), int(t_us))
    writer.track = _aligned(track, np.array(writer.t_us, np.int64))
    writer.info |= {
        "source": str(source),
        "input": "frames",
        "timed": frames.timed,
        "images": settings_room.to_dict(images),
        "spacing": settings_room.to_dict(spacer.settings),
        "left_out": spacer.left_out,
    }


def _check_made_so(
    path: Path,
    found: Traverse,
    cleaning: CleaningSettings | None,
    spacing: SpacingSettings | None,
    mask: MaskSource | None,
) -> None:
    """TraverseError where images that are made already were to be cleaned or spaced in another way."""
    asked = {"cleaning": cleaning or CleaningSettings(), "spacing": spacing or SpacingSettings()}
    for name, settings in asked.items():
        made = settings_room.make(type(settings), found.info.get(name) or {})
        if settings not in (made, type(settings)()):
            raise TraverseError(
                f"the images in {path} were made with {name} {settings_room.to_dict(made)}, not "
                f"{settings_room.to_dict(settings)}: make them again from the recording with `evplace images`"
            )
    if mask is not None:
        raise TraverseError(
            f"the images in {path} are made already: give the mask to `evplace images` with the recording"
        )


def check_uncleaned(path: str | Path, cleaning: CleaningSettings | None, mask: MaskSource | None) -> None:
    """TraverseError where camera images were to be cleaned."""
    if mask is not None or cleaning not in (None, CleaningSettings()):
        raise TraverseError(f"{path} holds camera images, which have no events to clean: leave that out")


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
