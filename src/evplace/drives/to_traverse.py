"""Recordings, videos, folders of images and data sets -> traverses."""

from __future__ import annotations

import contextlib
import dataclasses
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import (
    DamagedRecordingError,
    RecordingError,
    SettingsError,
    TrackError,
    TraverseError,
    UnsupportedError,
)
from evplace.core.events import Size
from evplace.core.folders import TRAVERSE, instead, mark_of
from evplace.core.settings import make, to_dict
from evplace.drives import datasets
from evplace.drives._recorded import GoodPart, RecordedImages, StorePlace
from evplace.drives.datasets import Drive
from evplace.imaging.images import Imager, frame_image
from evplace.imaging.recipe import OF_EVENTS, Kind, Recipe, shown
from evplace.imaging.spacing import Spacer, SpacingSettings
from evplace.imaging.traverse import MARK, Traverse, TraverseWriter
from evplace.sources.cleaning import CleaningSettings, MaskSource
from evplace.sources.film import VIDEOS, Film, film_of, is_video, open_film
from evplace.sources.frames import is_frames, open_frames
from evplace.sources.readers import Recording, is_recording, open_recording
from evplace.sources.simulators.recording import SimulatedRecording
from evplace.sources.tracks import Track, open_track
from evplace.sources.tracks._apart import apart, on_day_of

FAST = 5_000_000
"""Bytes of images a second of the drive from which on their number is foretold."""
FORETOLD = 4_000_000
"""Events from which it is."""


class Reading(NamedTuple):
    """What is known of a source that does not say it: see `open_source`."""

    time_unit: str | None = None
    stream: str | None = None
    columns: str | None = None
    drive: str | None = None
    dataset: str | None = None


def open_traverse(
    path: str | Path,
    track: str | Path | Track | None = None,
    recipe: Recipe | None = None,
    time_unit: str | None = None,
    spacing: SpacingSettings | None = None,
    mask: MaskSource | None = None,
    drive: str | None = None,
    dataset: str | None = None,
    stream: str | None = None,
    columns: str | None = None,
    **settings: object,
) -> Traverse:
    """A traverse folder, an event recording, a video, a folder of images or a data set, as `path` is.

    `recipe` says how its images are made, and `settings` are single ones over it: `dt="1/60"`, `size=(640,
    480)` for a recording that does not say, `kind="frames"` for a camera's own images in place of simulated
    events (which is what videos and data sets of films become otherwise). Without a recipe it is the source's
    own. `drive` names a drive of a data set, which is recognised by its layout or named by `dataset`; it
    brings its own track, mask and recipe, unless others are given.

    Recordings and images are turned into images in memory; for long ones, write a traverse folder with
    `evplace images` first. `track` is a GPS log, or a Track; `time_unit`, `stream` and `columns` are for
    recordings that do not say (see `open_recording`). `mask` names pixels to leave out (see
    `evplace.sources.cleaning.read_mask`), besides what the recipe says. InputError where something cannot be
    read, or where a traverse folder was made otherwise than is asked for.
    """
    if (Path(path) / MARK).exists():
        asked = {
            "time_unit": time_unit, "spacing": spacing, "mask": mask, "drive": drive, "dataset": dataset,
            "stream": stream, "columns": columns,
        }  # fmt: skip
        return _opened_again(Path(path), _opened(track), recipe, settings, asked)
    reading = Reading(time_unit, stream, columns, drive, dataset)
    source = open_source_for(path, recipe, settings, reading)
    with tempfile.TemporaryDirectory(prefix="evplace-") as folder:
        writer = TraverseWriter(Path(folder), {})
        try:
            record(source, writer, track, recipe, spacing, mask, None, **settings)
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
    stream: str | None = None,
    columns: str | None = None,
) -> Drive:
    """What `path` holds, as a drive: see `open_traverse`; `listing` and `fps` as in `open_frames`.

    A folder is a data set where it has the layout of one, whatever else lies in it. `size`, `stream` and
    `columns` are for a recording, `time_unit` for one or for images with times, `drive` and `dataset` for a
    data set's folder, `listing` and `fps` for a folder of images; SettingsError where one is given that has
    no meaning for what `path` is.
    """
    place = Path(path)
    of_recordings: dict[str, object] = {"size": size, "stream": stream, "columns": columns}
    of_images: dict[str, object] = {"listing": listing, "fps": fps}
    of_any = of_recordings | of_images | {"time_unit": time_unit}
    is_folder = place.is_dir() and not is_recording(place)
    if drive is not None or dataset is not None or (is_folder and datasets.matching(place)):
        _refuse(
            f"{place} is a data set, which has its own size, times and order",
            of_any,
        )
        return datasets.open_drive(place, drive, dataset)
    if is_folder and mark_of(place) is not None:
        _refuse_own(place)
    if is_video(place):
        _refuse(f"{place} is a video, which has its own size and times", of_any)
        return Drive(open_film(place), simulate=True)
    for images in (place, place / "images") if is_folder else ():
        if is_frames(images):
            _refuse(f"{images} holds images, which have their own size", of_recordings)
            return Drive(_listed_film(images, listing, fps, time_unit))
    _refuse(f"{place} is no folder of images", of_images)
    if is_folder:
        _refuse_own(place)
    return Drive(_recording(place, size, time_unit, stream, columns))


def record(
    drive: Drive,
    writer: TraverseWriter,
    track: str | Path | Track | None = None,
    recipe: Recipe | None = None,
    spacing: SpacingSettings | None = None,
    mask: MaskSource | None = None,
    store: StorePlace | None = None,
    **settings: object,
) -> str | None:
    """Write the images of a drive; what is not given is the drive's own. Returns what broke off, if any.

    `recipe` and `settings` as in `open_traverse`; a recording's event `store` is used, and written where that
    is asked for. SettingsError where `settings` name what means nothing for
    the drive; TraverseError where the recipe is of another sensor.
    """
    asked = (recipe or drive.recipe).changed(**settings)
    source = recorded_as(asked.kind, drive)
    _check_meant(source, settings)
    positions = on_its_day(drive.track if track is None else _opened(track), drive.source)
    mask = drive.mask if mask is None else mask
    if isinstance(source, Film):
        check_uncleaned(source.path, asked, mask)
        return _record_frames(source, writer, asked, positions, spacing)
    return _record_events(source, writer, asked, positions, spacing, mask, store)


def _record_events(
    recording: Recording | SimulatedRecording,
    writer: TraverseWriter,
    asked: Recipe,
    track: Track | None,
    spacing: SpacingSettings | None,
    mask: MaskSource | None,
    place: StorePlace | None,
) -> str | None:
    """Write a recording's event images; returns what broke off, where the recording is damaged."""
    recipe = dataclasses.replace(asked, kind="events", size=recording.size)
    recipe.require_same(asked, str(recording.path), "the images asked for", "they cannot be made of it")
    spacer = Spacer(spacing, track)
    writer.recipe = recipe
    if isinstance(recording, Recording) and spacer.settings == SpacingSettings():
        _foretell(recording, recipe, writer)
    images = RecordedImages(recording, recipe, mask, place)
    overlap = _Overlap(track)
    for image, window in images:
        overlap.see(window.t_us)
        if spacer.keeps(window.t_us, window.events):
            writer.add(image, window.t_us, window.events)
    overlap.check()
    writer.mask, writer.track = images.mask, _aligned(track, np.array(writer.t_us, np.int64))
    writer.info |= {
        "source": str(recording.path),
        "spacing": to_dict(spacer.settings),
        "dropped": images.info["dropped"],
        "cleaned": images.info["cleaned"],
        "store": images.info["store"],
        "left_out": spacer.left_out,
    } | _remarks(track, images.info)
    if isinstance(recording, SimulatedRecording):
        writer.info["simulated"] = to_dict(recording.sensor) | {"seed": recording.seed}
    return _fault(writer)


def _foretell(recording: Recording, recipe: Recipe, writer: TraverseWriter) -> None:
    """OutputError before any image is made, where all would come to more than the writer may take.

    Only images that come fast are foretold, from the first events: the usual ones are not worth the time.
    """
    image_bytes, seconds = Imager(recording.size, recipe.images).image(0).nbytes, recipe.windows.seconds
    if writer.most_bytes is None or image_bytes < FAST * seconds or recipe.windows.count:
        return
    first_us, last_us, events, more = None, 0, 0, "in all"
    with contextlib.suppress(DamagedRecordingError, UnsupportedError):  # raised when they are made
        for packet in recording.packets():
            first_us = int(packet.t_us[0]) if first_us is None else first_us
            events, last_us = events + len(packet), int(packet.t_us[-1])
            if events > FORETOLD:
                more = f"for the first {(last_us - first_us) / 1e6:,.1f} s alone"
                break
    writer.allow(int((last_us - (first_us or 0)) / 1e6 / seconds) + 1, image_bytes, more)


def _record_frames(
    film: Film, writer: TraverseWriter, asked: Recipe, track: Track | None, spacing: SpacingSettings | None
) -> str | None:
    """Write camera images, cropped and resized as the recipe says; returns what broke off, as above."""
    shape, frames, overlap = None, GoodPart(film.images()), _Overlap(track)
    spacer = Spacer(spacing, track)
    for t_us, frame in frames:
        if shape is None:
            shape = frame.shape
            writer.recipe = dataclasses.replace(asked, kind="frames", size=(shape[1], shape[0]))
            writer.recipe.require_same(
                asked, str(film.path), "the images asked for", "they cannot be made of it"
            )
        if frame.shape != shape:
            raise TraverseError(
                f"{film.name(t_us)} is {frame.shape}, the images before it are {shape}: make them alike"
            )
        overlap.see(t_us)
        if spacer.keeps(t_us, -1):
            writer.add(frame_image(frame, asked.images), t_us)
    overlap.check()
    writer.track = _aligned(track, np.array(writer.t_us, np.int64))
    writer.info |= {
        "source": str(film.path),
        "timed": film.timed,
        "spacing": to_dict(spacer.settings),
        "left_out": spacer.left_out,
    } | _remarks(track, {"notes": film.notes, "fault": frames.fault})
    return _fault(writer)


def open_source_for(
    path: str | Path, recipe: Recipe | None, settings: Mapping[str, Any], reading: Reading
) -> Drive:
    """What `path` holds; a recording that does not state its sensor's size has that of the recipe."""
    opened = open_source(path, settings.get("size"), **reading._asdict())
    source = opened.source
    if recipe is None or recipe.size is None or "size" in settings:
        return opened
    if not isinstance(source, Recording) or source.states_size:
        return opened
    again = _recording(source.path, recipe.size, reading.time_unit, reading.stream, reading.columns)
    return dataclasses.replace(opened, source=again)


def _opened_again(
    path: Path,
    track: Track | None,
    recipe: Recipe | None,
    settings: Mapping[str, Any],
    asked: Mapping[str, object],
) -> Traverse:
    """A traverse folder; TraverseError where its images were made otherwise than is asked for."""
    found = Traverse.load(path)
    again = "make it again from the recording with `evplace images`"
    if asked["spacing"] is not None:
        asked = {**asked, "spacing": _other_spacing(found, asked["spacing"])}
    given = [name for name, value in asked.items() if value is not None]
    if given:
        raise TraverseError(
            f"the images in {path} are made already: `{given[0]}` cannot change them, leave it out or {again}"
        )
    if recipe is not None and found.recipe is not None:
        found.recipe.require_same(recipe, f"the traverse {path}", "the recipe asked for", again)
    if settings:
        _check_made_so(path, found.recipe, settings, again)
    positions = None if track is None else on_day_of(track, int(found.t_us[0]))
    aligned = _aligned(positions, found.t_us)
    if aligned is None:
        return found
    return dataclasses.replace(found, track=aligned, info=found.info | _remarks(positions, found.info))


def _other_spacing(found: Traverse, asked: object) -> object:
    """The spacing that is asked for, where the traverse has another; None where it has this one."""
    made = make(SpacingSettings, found.info.get("spacing") or {})
    return None if asked in (made, SpacingSettings()) else asked


def _check_made_so(path: Path, made: Recipe | None, settings: Mapping[str, Any], again: str) -> None:
    """TraverseError where images that are made already have another value of a setting."""
    if made is None:
        raise TraverseError(
            f"how the images in {path} were made is not known: leave out `{next(iter(settings))}`"
        )
    apart = made.changed(**settings).differences(made)
    for name, (wanted, value) in apart.items():
        raise TraverseError(
            f"the images in {path} were made with {name} {shown(value)}, not {shown(wanted)}: {again}"
        )
    _check_kind(made.kind, str(path), settings)


def _check_meant(source: Recording | SimulatedRecording | Film, settings: Mapping[str, Any]) -> None:
    is_film = isinstance(source, Film)
    instead = ", or add `kind=events`" if is_film else ""
    _check_kind("frames" if is_film else "events", str(source.path), settings, instead)


def _check_kind(kind: Kind | None, path: str, settings: Mapping[str, Any], instead: str = "") -> None:
    """SettingsError where a setting is named that means nothing for camera images, or for events."""
    idle = [name for name in settings if name in (OF_EVENTS if kind == "frames" else ("tone",))]
    if idle:
        what = "camera images" if kind == "frames" else "events"
        mean, it = ("means", "it") if len(idle) == 1 else ("mean", "them")
        named = " and ".join(f"`{name}`" for name in idle)
        raise SettingsError(f"{named} {mean} nothing for the {what} of {path}: leave {it} out{instead}")


def _refuse_own(folder: Path) -> None:
    """TraverseError for a folder that evplace wrote and that is no drive, or that holds some."""
    if mark_of(folder) == TRAVERSE:
        raise TraverseError(
            f"{folder} is a traverse, images that are made already: give the recording or film they are of"
        )
    if (told := instead(folder, TRAVERSE)) is not None:
        raise TraverseError(told)


def _refuse(what: str, arguments: Mapping[str, object]) -> None:
    """SettingsError where an argument is given that has no meaning."""
    said = [f"`{name}`" for name, value in arguments.items() if value is not None]
    if said:
        raise SettingsError(f"{what}: leave out {' and '.join(said)}")


def _listed_film(folder: Path, listing: str | Path | None, fps: float | None, time_unit: str | None) -> Film:
    rate = 30.0 if fps is None else fps
    frames = open_frames(folder, listing, rate, time_unit)
    if frames.timed:
        _refuse(f"the images in {folder} have times of their own", {"fps": fps})
    return film_of(folder, frames)


def _recording(
    place: Path, size: Size | None, time_unit: str | None, stream: str | None, columns: str | None
) -> Recording:
    try:
        return open_recording(place, size, time_unit=time_unit, stream=stream, columns=columns)
    except RecordingError as error:
        known = isinstance(error, UnsupportedError) or is_recording(place)
        if not place.is_file() or not place.stat().st_size or known:
            raise
        raise RecordingError(f"{error}; videos are {', '.join(VIDEOS)}") from error


def check_uncleaned(path: str | Path, recipe: Recipe, mask: MaskSource | None) -> None:
    """TraverseError where camera images were to be cleaned."""
    if mask is not None or recipe.cleaning != CleaningSettings():
        raise TraverseError(f"{path} holds camera images, which have no events to clean: leave that out")


def recorded_as(kind: Kind | None, drive: Drive) -> Recording | SimulatedRecording | Film:
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


def _remarks(track: Track | None, info: Mapping[str, Any]) -> dict[str, Any]:
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
