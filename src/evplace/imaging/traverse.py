"""A traverse: the images of one drive with their times and, where there is GPS, positions.

On disk it is a folder of plain arrays: images.npy, t_us.npy, counts.npy, track.npy, mask.npy and
traverse.json; images are memory-mapped, so a traverse may be larger than memory.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core import folders
from evplace.core.errors import InputError, OutputError, SettingsError, TraverseError
from evplace.core.storage import GrowingArray, new_folder, read_array, read_json, write_array, write_json
from evplace.imaging.recipe import Recipe
from evplace.sources.tracks import Track

FORMAT = "evplace-traverse-2"
OLD_FORMAT = "evplace-traverse-1"
"""Its recipe lies in pieces in `info`."""
MARK = folders.TRAVERSE
"""What tells a folder that was written here from any other: only such a one is replaced."""


@dataclass(frozen=True)
class Traverse:
    """The images of one drive."""

    images: NDArray[np.uint8]
    """(n, h, w), or (n, h, w, C) with several channels or colours."""
    t_us: NDArray[np.int64]
    """(n,) times in microseconds, never decreasing: the end of each window."""
    counts: NDArray[np.int64]
    """(n,) events in each window, 0 for an empty one; -1 for camera images."""
    track: Track | None = None
    """Where each image was taken, NaN where there is no fix; None without GPS."""
    recipe: Recipe | None = None
    """How its images were made; None where that is not known, as of images that others made."""
    info: dict[str, Any] = field(default_factory=dict)
    """Where it comes from: source, spacing, what was guessed, dropped and left out."""
    mask: NDArray[np.bool_] | None = None
    """(H, W) True at the sensor's pixels whose events were left out; None where all were taken."""

    def __post_init__(self) -> None:
        if not self.images.size:
            raise TraverseError("a traverse without images: there is nothing to learn or to localise")
        self._check_arrays()
        lengths = {len(self.images), len(self.t_us), len(self.counts)}
        lengths |= {len(self.track.t_us)} if self.track is not None else set()
        if len(lengths) > 1:
            raise TraverseError(f"images, times, counts and track must be equally many, these are {lengths}")
        self._check_values()

    def __len__(self) -> int:
        return len(self.images)

    def __getitem__(self, part: slice) -> Traverse:
        """A stretch of the drive; images stay views."""
        track = self.track.at(self.t_us[part]) if self.track is not None else None
        return dataclasses.replace(
            self, images=self.images[part], t_us=self.t_us[part], counts=self.counts[part], track=track
        )

    @property
    def xy(self) -> NDArray[np.float64]:
        """(n, 2) easting and northing in metres, NaN where there is no fix."""
        return self.track.xy if self.track is not None else np.full((len(self), 2), np.nan)

    def save(self, path: str | Path, overwrite: bool = False) -> None:
        """Write the folder `path`; OutputError where it exists or cannot be written."""
        with new_traverse(path, self.info, overwrite) as writer:
            for image, t_us, count in zip(self.images, self.t_us, self.counts, strict=True):
                writer.add(image, int(t_us), int(count))
            writer.recipe, writer.track, writer.mask = self.recipe, self.track, self.mask

    @classmethod
    def load(cls, path: str | Path) -> Traverse:
        """The traverse in the folder `path`; TraverseError where it is none or is damaged."""
        folder = Path(path)
        what = f"the traverse {folder}"
        try:
            about = read_json(folder / MARK, what)
            recipe = _recipe(about, what)
            images = read_array(folder / "images.npy", what, memory_mapped=True)
            t_us, counts = read_array(folder / "t_us.npy", what), read_array(folder / "counts.npy", what)
            masked = (folder / "mask.npy").exists()
            mask = read_array(folder / "mask.npy", what) if masked else None
            track = _load_track(folder, t_us, about.get("track"), what)
            # Its own checks refuse an `info` of another kind.
            # Checked there, which mypy cannot know here.
            return cls(images, t_us, counts, track, recipe, about.get("info"), mask)  # type: ignore[arg-type]
        except SettingsError as error:
            raise TraverseError(f"{what} is damaged: {error}") from error
        except InputError as error:
            raise TraverseError(str(error)) from error

    def _check_arrays(self) -> None:
        """TraverseError where an array is not what it is said to be: folders are edited by other programs."""
        check_array(self.images, "images", np.uint8, (3, 4))
        for name in ("t_us", "counts"):
            check_array(getattr(self, name), name, np.int64, (1,))
        if self.mask is not None:
            check_array(self.mask, "mask", np.bool_, (2,))

    def _check_values(self) -> None:
        if np.any(np.diff(self.t_us) < 0):
            at = int(np.argmax(np.diff(self.t_us) < 0)) + 1
            raise TraverseError(f"the times run backwards at image {at}: images must stand in order of time")
        if np.any(self.counts < -1):
            raise TraverseError(
                f"an image of {self.counts.min()} events: counts are 0 or more, -1 for frames"
            )
        if not isinstance(self.info, dict):
            raise TraverseError(f"the info of a traverse is a JSON object, not {type(self.info).__name__}")


def check_array(array: NDArray[Any], name: str, kind: type[np.generic], dimensions: tuple[int, ...]) -> None:
    """TraverseError where an array has another type or another number of dimensions, or an empty side."""
    if array.dtype != kind or array.ndim not in dimensions or 0 in array.shape:
        wanted = " or ".join(map(str, dimensions))
        raise TraverseError(
            f"the array '{name}' is {array.dtype} {array.shape}: it must be {np.dtype(kind)} with {wanted} "
            "dimensions, none of them empty"
        )


def _recipe(about: Mapping[str, Any], what: str) -> Recipe | None:
    """The recipe that traverse.json holds, of this format or the one before."""
    if about.get("format") == FORMAT:
        recipe = about.get("recipe")
        if recipe is None or isinstance(recipe, dict):
            return None if recipe is None else Recipe.from_dict(recipe)
        raise TraverseError(f"{what} is damaged: its recipe is no JSON object")
    info = about.get("info")
    if about.get("format") == OLD_FORMAT and isinstance(info, dict):
        if "images" not in info:
            return None
        old = {name: info[name] for name in ("windows", "images", "cleaning") if name in info}
        return Recipe.from_dict({**old, "kind": info.get("input"), "size": info.get("sensor")})
    raise TraverseError(f"{what} has the format {about.get('format')!r}, this version reads {FORMAT}")


class TraverseWriter:
    """Takes one image after another."""

    def __init__(self, folder: Path, info: Mapping[str, Any]) -> None:
        """Write into `folder`, which exists; see `new_traverse`."""
        self.track: Track | None = None
        """Where each image was taken: set it before the end."""
        self.mask: NDArray[np.bool_] | None = None
        """(H, W) True at the pixels whose events were left out."""
        self.recipe: Recipe | None = None
        """How the images are made."""
        self.most_bytes: int | None = None
        """Bytes that the images may take; None for any number."""
        self.info = dict(info)
        """Saved at the end."""
        self.t_us: list[int] = []
        """Times of the images so far."""
        self._folder = folder
        self._counts: list[int] = []
        self._images: GrowingArray | None = None

    def add(self, image: NDArray[np.uint8], t_us: int, count: int = -1) -> None:
        """Add an image (h, w) or (h, w, C), its time and its count of events (-1 for a camera image).

        OutputError where the images come to more than `most_bytes`.
        """
        self.allow(len(self.t_us) + 1, image.nbytes)
        if self._images is None:
            self._images = GrowingArray(self._folder / "images.npy", np.uint8, image.shape)
        self._images.append(image)
        self.t_us.append(t_us)
        self._counts.append(count)

    def allow(self, images: int, bytes_each: int, more: str = "and more may come") -> None:
        """OutputError where so many images come to more than `most_bytes`, with how many there are."""
        if self.most_bytes is not None and images * bytes_each > self.most_bytes:
            raise OutputError(
                f"{images:,} images of {bytes_each:,} bytes are {images * bytes_each / 1e9:,.1f} GB, {more}: "
                "`yes` writes them all; a longer 'dt', or 'every_m', makes fewer"
            )

    def close(self) -> None:
        """Write what is left; TraverseError where no image came."""
        if self._images is None:
            raise TraverseError("no image came: the recording holds no events, or the folder no images")
        self._images.close()
        write_array(self._folder / "t_us.npy", np.array(self.t_us, np.int64))
        write_array(self._folder / "counts.npy", np.array(self._counts, np.int64))
        if self.mask is not None:
            write_array(self._folder / "mask.npy", self.mask)
        zone = None
        if self.track is not None:
            _save_track(self._folder, self.track)
            zone = {"zone": self.track.zone, "northern": self.track.northern}
        recipe = None if self.recipe is None else self.recipe.to_dict()
        write_json(
            self._folder / MARK, {"format": FORMAT, "track": zone, "recipe": recipe, "info": self.info}
        )

    def discard(self) -> None:
        """Let go of a traverse that will not be used; harmless after `close`."""
        if self._images is not None:
            self._images.discard()


@contextlib.contextmanager
def new_traverse(
    path: str | Path, info: Mapping[str, Any], overwrite: bool = False
) -> Iterator[TraverseWriter]:
    """A writer for the folder `path`, which appears whole when the block ends well."""
    with new_folder(path, overwrite, MARK) as folder:
        writer = TraverseWriter(folder, info)
        try:
            yield writer
            writer.close()
        finally:
            writer.discard()


def _save_track(folder: Path, track: Track) -> None:
    columns: Iterable[NDArray[np.float64]] = (
        track.latitude,
        track.longitude,
        track.easting,
        track.northing,
        track.heading_deg,
    )
    write_array(folder / "track.npy", np.stack(list(columns), axis=1))


def _load_track(folder: Path, t_us: NDArray[np.int64], zone: Any, what: str) -> Track | None:
    if zone is None:
        return None
    columns = read_array(folder / "track.npy", what)
    check_array(t_us, "t_us", np.int64, (1,))
    if columns.shape != (len(t_us), 5) or columns.dtype != np.float64 or np.isinf(columns).any():
        raise TraverseError(
            f"{what} is damaged: its track is {columns.dtype} {columns.shape} for {len(t_us)} images"
        )
    number, northern = (zone.get("zone"), zone.get("northern")) if isinstance(zone, dict) else (None, None)
    if not (isinstance(number, int) and 0 <= number <= 60 and isinstance(northern, bool)):
        raise TraverseError(f"{what} is damaged: {zone!r} is no UTM zone")
    latitude, longitude, easting, northing, heading = np.ascontiguousarray(columns.T)
    return Track(t_us, latitude, longitude, easting, northing, heading, number, northern)
