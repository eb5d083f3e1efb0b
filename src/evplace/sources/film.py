"""Films to simulate from: video files, and folders of images with their times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import (
    DamagedRecordingError,
    InputError,
    MissingExtraError,
    SettingsError,
    UnreadableImageError,
)
from evplace.core.events import Size
from evplace.core.grey import to_grey
from evplace.sources.frames import Frames, is_frames, open_frames

Grey = NDArray[np.uint8]

VIDEOS = (".mp4", ".m4v", ".mov", ".mkv", ".avi", ".webm", ".mpg", ".mpeg")
"""Suffixes of the usual containers; others are given to `evplace simulate`, which takes any that av reads."""
SLACK_US = 100_000
"""Beside two frames' time, so much may be missing at the end of a video that is whole."""
STATING = ("mov", "matroska")
"""Containers, by av's names, whose header says how long they are; of others the length of the file tells."""


@dataclass(frozen=True)
class Film:
    """Camera images with their times."""

    path: Path
    """The video, or the folder of the images."""
    size: Size
    """(width, height) of the first image."""
    frames: Frames | None
    """The images on disk; None where `path` is a video."""

    @property
    def timed(self) -> bool:
        """Whether the times are the camera's, not made up from a rate."""
        return self.frames is None or self.frames.timed

    @property
    def notes(self) -> list[str]:
        """What was guessed of the times."""
        return [] if self.frames is None else list(self.frames.notes)

    def name(self, t_us: int) -> str:
        """What the image at that time is called in errors."""
        if self.frames is None:
            return f"the image at {t_us / 1e6:.3f} s of {self.path}"
        return str(self.frames.files[int(np.searchsorted(self.frames.t_us, t_us))])

    def __iter__(self) -> Iterator[tuple[int, Grey]]:
        """Each image in grey: microseconds, uint8 (H, W); errors as `images`."""
        if self.frames is None:
            return _video(self.path, "gray")  # the luma that a video holds beside its colours
        return ((t_us, image if image.ndim == 2 else to_grey(image)) for t_us, image in self.images())

    def images(self) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """Each image as it is: microseconds, uint8 (H, W), or (H, W, 3) where it has colours.

        A damaged image on disk is left out: DamagedRecordingError at the end says how many. Of a video the
        same after the last good image, where a later one cannot be decoded, does not come after the one
        before it, or is missing at the end. InputError where no image can be decoded.
        """
        return _video(self.path, "rgb24") if self.frames is None else _on_disk(self.frames)


def open_film(path: str | Path, fps: float = 30.0, time_unit: str | None = None) -> Film:
    """A video file, or a folder of images with or without times, as `open_frames`.

    `fps` is for a folder without times, `time_unit` for one with. Raises InputError where it cannot be
    decoded, its times do not increase or it holds no image; MissingExtraError where a video needs the package
    av.
    """
    film = Path(path)
    if not film.exists():
        raise InputError(f"there is no video or folder of images {film}")
    if not film.is_dir():
        if time_unit is not None:
            raise SettingsError(f"{film} is a video, which has its own times: leave out time_unit")
        return _sized(Film(film, (0, 0), None))
    if not is_frames(film):
        inner = film / "images"
        if not (inner.is_dir() and is_frames(inner)):
            raise InputError(f"{film} holds no images: give a video, or a folder of images")
        film = inner
    return film_of(film, open_frames(film, fps=fps, time_unit=time_unit))


def film_of(path: Path, frames: Frames) -> Film:
    """Images on disk as a film; `path` is where they come from."""
    return _sized(Film(path, (0, 0), frames))


def is_video(path: Path) -> bool:
    """Whether the name of `path` is a video's."""
    return path.suffix.lower() in VIDEOS and not path.is_dir()


def _sized(film: Film) -> Film:
    for _, first in film:
        return Film(film.path, (first.shape[1], first.shape[0]), film.frames)
    raise InputError(f"{film.path} holds no frames")


def _on_disk(frames: Frames) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    lost: list[str] = []
    for n, (t_us, file) in enumerate(zip(frames.t_us.tolist(), frames.files, strict=True)):
        try:
            image = frames.read(file)
        except UnreadableImageError as error:
            lost.append(str(error))
            continue
        except InputError as error:
            if n == 0:
                raise
            raise DamagedRecordingError(str(error)) from error
        yield t_us, image
    if len(lost) == len(frames):
        raise InputError(lost[0] if len(lost) == 1 else f"none of {len(lost)} images can be read: {lost[0]}")
    if lost:
        what = f"{len(lost)} of {len(frames)} images cannot be read and are left out"
        raise DamagedRecordingError(f"{what}, the first: {lost[0]}")


def _video(path: Path, pixels: str) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Frames as they are shown, in the format `pixels`, with the times in the file, from 0."""
    av = _av()
    frames = 0
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise InputError(f"{path} holds no video")
            for found in _decoded(path, container, pixels):
                yield found
                frames += 1
    except (av.error.FFmpegError, OSError) as error:
        kind = DamagedRecordingError if frames else InputError
        raise kind(f"cannot decode the video {path}: {error}") from error


def _decoded(path: Path, container: Any, pixels: str) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    begin, last, longest = None, -1, 0
    for frame in container.decode(video=0):
        if frame.time is None:
            raise InputError(f"{path}: a frame has no time: convert the video, or give a folder of images")
        begin = round(frame.time * 1e6) if begin is None else begin
        t_us = round(frame.time * 1e6) - begin
        if t_us <= last:
            raise DamagedRecordingError(
                f"{path}: a frame at {t_us / 1e6:.6f} s does not come after the one at {last / 1e6:.6f} s: "
                "convert the video, or give a folder of images with timestamps.txt"
            )
        longest, last = max(longest, t_us - max(last, 0)), t_us
        # A display turns the frame counterclockwise by `rotation` degrees, as rot90 does.
        turned = np.rot90(frame.to_ndarray(format=pixels), round(frame.rotation / 90))
        yield t_us, np.ascontiguousarray(turned)
    stated = _stated_us(container, begin or 0)
    if stated is not None and stated - last > 2 * longest + SLACK_US:
        raise DamagedRecordingError(
            f"{path} ends at {last / 1e6:.3f} s, where its header states {stated / 1e6:.3f} s: it was cut off"
        )


def _stated_us(container: Any, begin_us: int) -> int | None:
    """The length of the video from its first frame on as its header states it, None where it does not."""
    if container.format.name.partition(",")[0] not in STATING:
        return None
    stream = container.streams.video[0]
    if stream.duration is not None:
        return int(stream.duration * stream.time_base * 1_000_000)
    if container.duration is None or len(container.streams) > 1:  # sound may be longer than the images
        return None
    return int(container.duration) - max(begin_us, 0)


def _av() -> Any:
    try:
        import av
    except ImportError:
        raise MissingExtraError("av", "video", "reading a video") from None
    return av
