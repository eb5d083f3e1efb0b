"""Films to simulate from: video files, and folders of images with their times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.errors import InputError, MissingExtraError
from evplace.events import Size
from evplace.frames import is_frames, open_frames

Grey = NDArray[np.uint8]


@dataclass(frozen=True)
class Film:
    """Grey frames with times."""

    path: Path
    size: Size
    """(width, height) of the first frame."""
    fps: float
    """Images a second of a folder without times; a video, or timestamps.txt, has its own."""

    def __iter__(self) -> Iterator[tuple[int, Grey]]:
        """Each frame: microseconds, uint8 (H, W). InputError where one cannot be decoded."""
        return _folder(self.path, self.fps) if self.path.is_dir() else _video(self.path)


def open_film(path: str | Path, fps: float = 30.0) -> Film:
    """A video file, or a folder of images with or without timestamps.txt (seconds).

    Raises InputError where it cannot be decoded, its times do not increase or it holds fewer than two
    frames; MissingExtraError where a video needs the package av.
    """
    film = Path(path)
    if not film.exists():
        raise InputError(f"there is no video or folder of images {film}")
    if film.is_dir() and not is_frames(film):
        inner = film / "images"
        if not (inner.is_dir() and is_frames(inner)):
            raise InputError(f"{film} holds no images: give a video, or a folder of images")
        film = inner
    opened = Film(film, (0, 0), fps)
    for _, first in opened:
        return Film(film, (first.shape[1], first.shape[0]), fps)
    raise InputError(f"{film} holds no frames")


def _folder(folder: Path, fps: float) -> Iterator[tuple[int, Grey]]:
    frames = open_frames(folder, fps=fps)
    for t_us, image in zip(frames.t_us, frames, strict=True):
        yield int(t_us), image if image.ndim == 2 else _grey(image)


def _grey(image: Grey) -> Grey:
    """(H, W) of a (H, W, 3) image (ITU-R BT.601)."""
    return np.asarray(image @ np.array([0.299, 0.587, 0.114]) + 0.5).astype(np.uint8)


def _video(path: Path) -> Iterator[tuple[int, Grey]]:
    """Frames as they are shown, with the times in the file, from 0; frames of one time give the first."""
    av = _av()
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise InputError(f"{path} holds no video")
            yield from _decoded(path, container)
    except (av.error.FFmpegError, OSError) as error:
        raise InputError(f"cannot decode the video {path}: {error}") from error


def _decoded(path: Path, container: Any) -> Iterator[tuple[int, Grey]]:
    begin = None
    for frame in container.decode(video=0):
        if frame.time is None:
            raise InputError(f"{path}: a frame has no time: convert the video, or give a folder of images")
        t_us = round(frame.time * 1e6)
        begin = t_us if begin is None else begin
        yield t_us - begin, frame.to_ndarray(format="gray")


def _av() -> Any:
    try:
        import av
    except ImportError:
        raise MissingExtraError("av", "video", "reading a video") from None
    return av
