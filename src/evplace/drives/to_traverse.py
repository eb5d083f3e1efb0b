"""Recordings, videos, folders of images and data sets -> traverses."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from evplace.core import settings as settings_room
from evplace.core.errors import (
    DamagedRecordingError,
    RecordingError,
    SettingsError,
    TrackError,
    TraverseError,
)
from evplace.core.events import Size
from evplace.drives import datasets
from evplace.drives.datasets import Drive
from evplace.imaging.images import ImageSettings, frame_image
from evplace.imaging.spacing import Spacer, SpacingSettings
from evplace.imaging.stream import EventImages, images_of
from evplace.imaging.traverse import Traverse, TraverseWriter
from evplace.imaging.windows import WindowSettings
from evplace.sources.cleaning import CleaningSettings, MaskSource, pixel_mask
from evplace.sources.film import VIDEOS, Film, film_of, is_video, open_film
from evplace.sources.frames import is_frames, open_frames
from evplace.sources.readers import Recording, is_recording, open_recording
from evplace.sources.simulators.recording import SimulatedRecording
from evplace.sources.tracks import Track, open_track
from evplace.sources.tracks._apart import apart, on_day_of

T = TypeVar("T")
Kind = Literal["events", "frames"]
"""Event images, simulated where there are no events; or the camera's own images."""


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
    drive: str | None = None,
    dataset: str | None = None,
    kind: Kind | None = None,
) -> Traverse:
    """A traverse folder, an event recording, a video, a folder of images or a data set, as `path` is.

    `drive` names a drive of a data set, which is recognised by its layout or named by `dataset`; it brings
    its own track, mask and settings, unless others are given. `kind` is "events" (simulated where there are
    only images: the default for videos and for data sets of films) or "frames" (the camera's own images, in
    colour where they have colours).

    Recordings and images are turned into images in memory; for long ones, write a traverse folder with
    `evplace images` first. `track` is a GPS log, or a Track; `size` and `time_unit` are
    for recordings that do not say (see `open_recording`). `mask` names pixels of the recording to leave out
    (see `evplace.sources.cleaning.read_mask`), besides what `cleaning` says. InputError where something
    cannot be read, or where a traverse folder was cleaned or spaced in another way than is asked for.
    """
    if (Path(path) / "traverse.json").exists():
        found = Traverse.load(path)
        _check_made_so(Path(path), found, cleaning, spacing, mask)
        given = _opened(track)
        positions = None if given is None else on_day_of(given, int(found.t_us[0]))
        aligned = _aligned(positions, found.t_us)
        if aligned is None:
            return found
        return dataclasses.replace(found, track=aligned, info=found.info | _said(positions, found.info))
    with tempfile.TemporaryDirectory(prefix="evplace-") as folder:
        writer = TraverseWriter(Path(folder), {})
        try:
            source = open_source(path, size, time_unit, drive, dataset)
            record(source, writer, track, windows, images, cleaning, spacing, mask, kind)
            writer.close()
        finally:
            writer.discard()
        found = Traverse.load(folder)
        return dataclasses.replace(found, images=np.array(found.images))


def open_source(
    path: str | Path,
    size: Size | None = None,
    time_unit: str | None = None,
    drive: str | None = None,
    dataset: str | None = None,
    listing: str | Path | None = None,
    fps: float | None = None,
) -> Drive:
    """What `path` holds, as a drive: see `open_traverse`; `listing` and `fps` as in `open_frames`.

    A folder is a data set where it has the layout of one, whatever else lies in it. `size` is for
    a recording, `time_unit` for one or for images with times, `drive` and `dataset` for a data set's folder,
    `listing` and `fps` for a folder of images; SettingsError where one is given that has no meaning for what
    `path` is.
    """
    place = Path(path)
    of_recordings: dict[str, object] = {"--size": size}
    of_images: dict[str, object] = {"--list": listing, "--fps": fps}
    of_any = of_recordings | of_images | {"--time-unit": time_unit}
    is_folder = place.is_dir() and not is_recording(place)
    if drive is not None or dataset is not None or (is_folder and datasets.matching(place)):
        _refuse(
            f"{place} is a data set, which has its own size, times and order",
            of_any,
        )
        return datasets.open_drive(place, drive, dataset)
    if is_video(place):
        _refuse(f"{place} is a video, which has its own size and times", of_any)
        return Drive(open_film(place), simulate=True)
    for images in (place, place / "images") if is_folder else ():
        if is_frames(images):
            _refuse(f"{images} holds images, which have their own size", of_recordings)
            return Drive(_listed_film(images, listing, fps, time_unit))
    _refuse(f"{place} is no folder of images", of_images)
    return Drive(_recording(place, size, time_unit))


def record(
    drive: Drive,
    writer: TraverseWriter,
    track: str | Path | Track | None = None,
    windows: WindowSettings | None = None,
    images: ImageSettings | None = None,
    cleaning: CleaningSettings | None = None,
    spacing: SpacingSettings | None = None,
    mask: MaskSource | None = None,
    kind: Kind | None = None,
) -> str | None:
    """Write the images of a drive; what is not given is the drive's own. Returns what broke off, if any."""
    positions = on_its_day(drive.track if track is None else _opened(track), drive.source)
    windows, images = windows or drive.windows, images or drive.images
    mask = drive.mask if mask is None else mask
    source = _as(kind, drive)
    if isinstance(source, Film):
        check_uncleaned(source.path, cleaning, mask)
        return record_frames(source, writer, images, positions, spacing)
    return record_events(source, writer, windows, images, positions, cleaning, spacing, mask)


def record_events(
    recording: Recording | SimulatedRecording,
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
    packets = _GoodPart(recording.packets())
    overlap = _Overlap(track)
    for image, window in images_of(packets, stream):
        overlap.see(window.t_us)
        if spacer.keeps(window.t_us, window.events):
            writer.add(image, window.t_us, window.events)
    overlap.check()
    writer.track = _aligned(track, np.array(writer.t_us, np.int64))
    writer.info |= {
        "source": str(recording.path),
        "input": "events",
        "sensor": list(recording.size),
        "windows": settings_room.to_dict(windows),
        "images": settings_room.to_dict(images),
        "cleaning": settings_room.to_dict(cleaning),
        "spacing": settings_room.to_dict(spacer.settings),
        "dropped": recording.dropped,
        "cleaned": stream.cleaned,
        "left_out": spacer.left_out,
    } | _said(track, {"notes": recording.notes, "fault": packets.fault})
    if isinstance(recording, SimulatedRecording):
        writer.info["simulated"] = settings_room.to_dict(recording.sensor) | {"seed": recording.seed}
    return _fault(writer)


def record_frames(
    film: Film,
    writer: TraverseWriter,
    images: ImageSettings | None = None,
    track: Track | None = None,
    spacing: SpacingSettings | None = None,
) -> str | None:
    """Write camera images, cropped and resized as `images` says; returns what broke off, as above."""
    images, spacer = images or ImageSettings(), Spacer(spacing, track)
    shape, frames, overlap = None, _GoodPart(film.images()), _Overlap(track)
    for t_us, frame in frames:
        shape = shape or frame.shape
        if frame.shape != shape:
            raise TraverseError(
                f"{film.name(t_us)} is {frame.shape}, the images before it are {shape}: make them alike"
            )
        overlap.see(t_us)
        if spacer.keeps(t_us, -1):
            writer.add(frame_image(frame, images), t_us)
    overlap.check()
    writer.track = _aligned(track, np.array(writer.t_us, np.int64))
    writer.info |= {
        "source": str(film.path),
        "input": "frames",
        "timed": film.timed,
        "images": settings_room.to_dict(images),
        "spacing": settings_room.to_dict(spacer.settings),
        "left_out": spacer.left_out,
    } | _said(track, {"notes": film.notes, "fault": frames.fault})
    return _fault(writer)


def is_kept(drive: Drive, kind: Kind | None = None) -> bool:
    """Whether camera images are kept as they are, so that settings of events mean nothing."""
    return isinstance(_as(kind, drive), Film)


def _refuse(what: str, flags: Mapping[str, object]) -> None:
    """SettingsError where a flag is given that has no meaning."""
    said = [flag for flag, value in flags.items() if value is not None]
    if said:
        raise SettingsError(f"{what}: leave out {' and '.join(said)}")


def _listed_film(folder: Path, listing: str | Path | None, fps: float | None, time_unit: str | None) -> Film:
    rate = 30.0 if fps is None else fps
    frames = open_frames(folder, listing, rate, time_unit)
    if frames.timed:
        _refuse(f"the images in {folder} have times of their own", {"--fps": fps})
    return film_of(folder, frames)


def _recording(place: Path, size: Size | None, time_unit: str | None) -> Recording:
    try:
        return open_recording(place, size, time_unit=time_unit)
    except RecordingError as error:
        if not place.is_file() or not place.stat().st_size or is_recording(place):
            raise
        raise RecordingError(f"{error}; videos are {', '.join(VIDEOS)}") from error


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


def _as(kind: Kind | None, drive: Drive) -> Recording | SimulatedRecording | Film:
    """What is recorded of a drive: its events, simulated ones, or its images."""
    if isinstance(drive.source, Recording):
        if kind == "frames":
            raise TraverseError(
                f"{drive.source.path} is an event recording: it holds no camera images to keep"
            )
        return drive.source
    if kind == "events" and drive.simulate is None:
        raise TraverseError(f"the images in {drive.source.path} are no film: no events can be simulated")
    simulated = kind == "events" or (kind is None and drive.simulate)
    return SimulatedRecording(drive.source) if simulated else drive.source


def _opened(track: str | Path | Track | None) -> Track | None:
    return open_track(track) if isinstance(track, str | Path) else track


def _aligned(track: Track | None, t_us: NDArray[np.int64]) -> Track | None:
    """The track at the times of the images; TrackError where it covers none of them."""
    if track is None or not len(t_us):
        return None
    aligned = track.at(t_us)
    if not aligned.known.any():
        raise TrackError(str(apart(track, int(t_us[0]), int(t_us[-1]))))
    return aligned


def on_its_day(track: Track | None, source: Recording | Film) -> Track | None:
    """A track without dates takes that of the recording."""
    if track is None or track.dated:
        return track
    if isinstance(source, Film):
        first_us = next((t_us for t_us, _ in source.images()), None)
    else:
        first_us = next((int(events.t_us[0]) for events in source.packets() if len(events)), None)
    return track if first_us is None else on_day_of(track, first_us)


def _fault(writer: TraverseWriter) -> str | None:
    fault: str | None = writer.info["fault"]
    return fault


def _said(track: Track | None, info: Mapping[str, Any]) -> dict[str, Any]:
    """What was guessed and what broke off, of the recording and of its track."""
    notes, fault = info.get("notes") or [], info.get("fault")
    if track is None:
        return {"notes": notes, "fault": fault}
    return {"notes": [*notes, *track.notes], "fault": fault or track.fault}


class _Overlap:
    """Tells as early as can be that no image has a position: images come in the order of their times."""

    def __init__(self, track: Track | None) -> None:
        self._track = track
        self._seen: tuple[int, int] | None = None

    def see(self, t_us: int) -> None:
        """The time of the next image; TrackError where the first one comes after the track's end."""
        if self._track is None:
            return
        if self._seen is None and t_us > self._track.t_us[-1]:
            raise TrackError(str(apart(self._track, t_us, t_us)))
        self._seen = (self._seen or (t_us, t_us))[0], t_us

    def check(self) -> None:
        """After the last image; TrackError where it came before the track's begin."""
        if self._track is not None and self._seen is not None and self._seen[1] < self._track.t_us[0]:
            raise TrackError(str(apart(self._track, *self._seen)))


class _GoodPart(Generic[T]):
    """Packets, or images, up to where they broke off; what broke them off is kept in `fault`."""

    def __init__(self, parts: Iterable[T]) -> None:
        self._parts = parts
        self.fault: str | None = None

    def __iter__(self) -> Iterator[T]:
        try:
            yield from self._parts
        except DamagedRecordingError as error:
            self.fault = str(error)
