"""PlaceMap: what learning a route leaves behind, and all that localising needs.

On disk it is a folder: map.json (scorer, places, recipe), items.npy (where each map item is), drive.npy
(where each image of the drive was taken), what the scorer has learned (references.npy, or network.onnx and
weights.safetensors), and SHA256SUMS over all of them, which `sha256sum -c` checks too. A damaged file is
found on loading, before it answers anything. A map of several drives also has belongs.npy, and each of its
drives is a map of its own in the folder `drives`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evplace import places as places_of
from evplace.core import families
from evplace.core.errors import EvplaceError, InputError, PlaceMapError
from evplace.core.folders import instead
from evplace.core.settings import to_dict
from evplace.core.storage import new_folder, read_array, sha256, write_array, write_json
from evplace.drives.to_traverse import open_traverse
from evplace.imaging.recipe import Recipe
from evplace.imaging.traverse import MARK as TRAVERSE
from evplace.imaging.traverse import Traverse
from evplace.matchers import Learned as LearnedByMatcher
from evplace.matchers import Matcher, Route
from evplace.placemap._files import (
    BELONGS,
    DRIVES,
    FORMAT,
    FORMAT_OF_SEVERAL,
    SUMS,
    TIMES,
    about_of,
    check_sums,
    file_of,
    files_of,
    linked,
    of_matcher,
    read_content,
    write_content,
    write_sums,
)
from evplace.placemap._files import MARK as MARK
from evplace.placemap._parts import Part, images_of, joined_rows
from evplace.places import Places
from evplace.scorers import REFERENCES, Content, Descriptor, OpenScorer, Scorer, opened_together, scorer_of
from evplace.sources.cleaning import MaskSource
from evplace.sources.tracks import Track

MOST_IMAGES = 100_000_000
"""Images of a drive that are believed: half a year at 1/60 s would be more."""


@dataclass(frozen=True)
class Items:
    """What score rows are about: one place each (network), or one reference image each (sad, ncc)."""

    place: NDArray[np.int64]
    """(items,) the place of each item, -1 where the image had no position."""
    position: NDArray[np.float64]
    """(items, 2) easting and northing in metres, NaN where unknown."""
    heading_deg: NDArray[np.float64]
    """(items,) clockwise from north, NaN where unknown or where an item has many."""
    are_places: bool = False
    """Whether there is one item a place, not one a reference image."""
    t_us: NDArray[np.int64] | None = None
    """(items,) when each reference image was taken, microseconds; None where that is not kept."""

    def __len__(self) -> int:
        return len(self.place)


@dataclass(frozen=True)
class PlaceMap:
    """A learned route."""

    scorer: Scorer | Descriptor
    """What compares images with it, with its settings."""
    places: Places
    """The places and the rule of what counts as the same place."""
    items: Items
    """What each entry of a score row stands for."""
    drive: NDArray[np.float64]
    """(images, 3) easting, northing and heading of each image that the map was learned from, NaN where
    unknown: it tells whether the map has a view, not only a place."""
    content: Content
    """What the scorer has learned: arrays and files by their names."""
    image_shape: tuple[int, ...]
    """Shape of the images that it was learned from: (h, w) or (h, w, C)."""
    recipe: Recipe | None = None
    """How those images were made, and how a query's are; None where that is not known."""
    zone: tuple[int, bool] | None = None
    """UTM zone and whether it is northern, of all metres; None without positions."""
    info: dict[str, Any] = field(default_factory=dict)
    """Where it comes from: the source of its drive, how its images were chosen."""
    matcher: Matcher | None = None
    """What turns its score rows into answers where nothing else is asked for."""
    learned: LearnedByMatcher | None = None
    """What that matcher has learned of the map; None where it learns nothing."""
    parts: tuple[Part, ...] = ()
    """The drives of a map of several, in the order in which they came; of a map of one, none."""
    sums: str | None = field(default=None, repr=False, compare=False)
    """The checksum of the checksums of the folder that it was read from."""

    @property
    def references(self) -> NDArray[np.uint8] | None:
        """(items, h, w) or (items, h, w, C): the reference images, where these are the items."""
        images = self.content.get(REFERENCES)
        return images if isinstance(images, np.ndarray) else None

    def images_of(self, items: ArrayLike) -> NDArray[np.uint8] | None:
        """(n, h, w) or (n, h, w, C): an image of each of some items (n,); None where the map holds none."""
        chosen = np.asarray(items, np.int64)
        if self.parts:
            return images_of(self.parts, chosen)
        return None if self.references is None else np.asarray(self.references[chosen])

    def scoring(self) -> OpenScorer:
        """What compares images with its items; PlaceMapError where its content is not what that needs."""
        with families.blaming("scorers", self.scorer):
            if not self.parts:
                return scorer_of(self.scorer).open(self.content)
            opened = opened_together(self.scorer, [part.map.content for part in self.parts])
            return joined_rows(opened, [part.item for part in self.parts])

    def route(self, learned: bool = True) -> Route:
        """What a matcher may know of the items; with what the map's own matcher has learned, or without."""
        items = self.items
        return Route(items.position, items.heading_deg, items.t_us, learned=self.learned if learned else None)

    @property
    def settings(self) -> dict[str, Any]:
        """How it was made, as plain values: what is saved with every result."""
        return {
            "scorer": part_to_dict("scorers", self.scorer),
            "recipe": None if self.recipe is None else self.recipe.to_dict(),
            "image_shape": list(self.image_shape),
            "zone": None if self.zone is None else list(self.zone),
            "info": self.info,
            "matcher": None if self.matcher is None else part_to_dict("matchers", self.matcher),
        }

    def open(
        self,
        path: str | Path,
        track: str | Path | Track | None = None,
        time_unit: str | None = None,
        mask: MaskSource | None = None,
        drive: str | None = None,
        dataset: str | None = None,
        stream: str | None = None,
        columns: str | None = None,
        **settings: object,
    ) -> Traverse:
        """A later drive, its images made exactly as this map's; see `open_traverse` for what `path` may be.

        Raises TraverseError where that cannot be: for a traverse that was made otherwise, another sensor, and
        `settings` that are not the map's own.
        """
        recipe = self.recipe
        if (Path(path) / TRAVERSE).exists():
            made = open_traverse(
                path, track, None, time_unit, None, mask, drive, dataset, stream, columns, **settings
            )
            self.require_same(made)
            return made
        if recipe is not None and settings:
            recipe.require_same(
                recipe.changed(**settings),
                "the map",
                "what is asked for",
                "leave that out, or train the map so",
            )
        return open_traverse(
            path, track, recipe, time_unit, None, mask, drive, dataset, stream, columns, **settings
        )

    def geodetic(self, position: tuple[float, float]) -> tuple[float, float] | None:
        """Latitude and longitude in degrees (WGS 84) of a position in this map's metres.

        None on a local plane.
        """
        if self.zone is None or not self.zone[0]:
            return None
        import utm

        latitude, longitude = utm.to_latlon(*position, self.zone[0], northern=self.zone[1], strict=False)
        return float(latitude), float(longitude)

    def require_same(self, query: Traverse) -> None:
        """PlaceMapError where a query's images were not made as this map's: they cannot be compared."""
        if self.recipe is not None and query.recipe is not None:
            self.recipe.require_same(
                query.recipe, "the map", "the query", "make the query from its recording by `PlaceMap.open`, "
                "which evplace localize and evaluate do by themselves",
            )  # fmt: skip
        shape = query.images.shape[1:]
        if shape != self.image_shape:
            raise PlaceMapError(
                f"the map was made from images of shape {self.image_shape}, the query's are {shape}: make "
                "the query with the map's recipe (`PlaceMap.open`, or evplace evaluate on its recording)"
            )

    def save(self, path: str | Path, overwrite: bool = False) -> None:
        """Write the folder `path`; OutputError where it exists or cannot be written.

        Drives of a map of several that lie there already are not written again.
        """
        with new_folder(path, overwrite, MARK) as folder:
            self._write(folder)
            for part in self.parts:
                _write_part(part, folder / DRIVES / part.name, Path(path))
            write_sums(folder)

    def _write(self, folder: Path) -> None:
        """All but the checksums and the drives of a map of several."""
        for name, value in self.content.items():
            write_content(folder, name, value)
        for name, array in (self.learned or {}).items():
            write_array(folder / of_matcher(name), array)
        columns = [self.items.place, *self.items.position.T, self.items.heading_deg]
        write_array(folder / "items.npy", np.stack(columns, axis=1).astype(np.float64))
        write_array(folder / "drive.npy", self.drive)
        if self.items.t_us is not None:
            write_array(folder / TIMES, self.items.t_us)
        if self.parts:
            write_array(folder / BELONGS, np.concatenate([part.item for part in self.parts]))
        description = {
            "format": FORMAT_OF_SEVERAL if self.parts else FORMAT,
            **self.settings,
            "places": self.places.to_dict(),
            "items": "places" if self.items.are_places else "images",
            "content": [file_of(name, value) for name, value in self.content.items()],
            "learned": sorted(self.learned or {}),
            "times": self.items.t_us is not None,
        }
        several = {"drives": [part.name for part in self.parts]} if self.parts else {}
        write_json(folder / MARK, description | several)

    @classmethod
    def load(
        cls,
        path: str | Path,
        scorer: Scorer | Descriptor | None = None,
        matcher: Matcher | None = None,
        unchecked: bool = False,
    ) -> PlaceMap:
        """The map in the folder `path`; PlaceMapError where it is none, or a byte of it has changed.

        What its scorer has learned is mapped into memory, so that it may be larger than that. Its checksums
        take reading all of it once: `unchecked` leaves them out, and then a changed byte may not be found.
        `scorer` and `matcher` open a map whose parts no installed package offers: the objects that it was
        trained with.
        """
        folder = Path(path)
        what = f"the map {folder}"
        if not (folder / MARK).is_file():
            made = f"{folder} is no map: a map is a folder that `evplace train` has written"
            raise PlaceMapError(instead(folder, MARK) or made)
        try:
            about = about_of(folder, what)
            if not unchecked:
                check_sums(folder, what, files_of(about))
            place_map = cls(
                scorer=_part_from("scorers", about["scorer"], what) if scorer is None else scorer,
                places=places_of.from_dict(about["places"]),
                items=_items(folder, about, what),
                drive=read_array(folder / "drive.npy", what),
                content=read_content(folder, about["content"], what),
                image_shape=tuple(about["image_shape"]),
                recipe=None if about["recipe"] is None else Recipe.from_dict(about["recipe"]),
                zone=None if about["zone"] is None else (about["zone"][0], about["zone"][1]),
                info=about["info"],
                matcher=_matcher(about, what) if matcher is None else matcher,
                learned={name: read_array(folder / of_matcher(name), what) for name in about["learned"]}
                or None,
                parts=_parts(folder, about, what, scorer),
                sums=sha256(folder / SUMS),
            )
            _check_fit(place_map, what)
        except PlaceMapError:
            raise
        except (InputError, EvplaceError) as error:
            raise PlaceMapError(f"{error}" if what in str(error) else f"{what}: {error}") from error
        return place_map


def _write_part(part: Part, folder: Path, path: Path) -> None:
    """Write one drive of a map into `folder`, or take it from the map that lies at `path`."""
    for old in (path / DRIVES / part.name, path):
        if part.map.sums is not None and (old / SUMS).is_file() and sha256(old / SUMS) == part.map.sums:
            return linked(old, folder)
    folder.mkdir(parents=True)
    part.map._write(folder)
    return write_sums(folder)


def _parts(
    folder: Path, about: Mapping[str, Any], what: str, scorer: Scorer | Descriptor | None
) -> tuple[Part, ...]:
    """The drives of a map of several."""
    if not about["drives"]:
        return ()
    maps = [PlaceMap.load(folder / DRIVES / name, scorer) for name in about["drives"]]
    item = read_array(folder / BELONGS, what)
    ends = np.cumsum([len(one.items) for one in maps])
    if item.dtype != np.int64 or item.shape != (ends[-1],):
        raise PlaceMapError(f"{what} is damaged: {item.dtype} {item.shape} for {ends[-1]} references")
    return tuple(
        Part(name, one, own)
        for name, one, own in zip(about["drives"], maps, np.split(item, ends[:-1]), strict=True)
    )


def remembered(folder: Path) -> str:
    """The name of the matcher of a map, which is not opened; PlaceMapError where it is none."""
    about = about_of(folder, f"the map {folder}")
    if about["matcher"] is not None:
        return str(about["matcher"]["name"])
    return "local" if about["items"] == "places" else "bayes"


def part_to_dict(family: str, part: object) -> dict[str, Any]:
    """A scorer or a matcher as plain values, for JSON; `_part_from` makes it anew."""
    return {
        "name": families.name_of(family, part),
        "package": families.package_of(part),
        "settings": to_dict(part),
    }


def _part_from(family: str, values: Mapping[str, Any], what: str) -> Any:
    """The part that `part_to_dict` described; PlaceMapError where it is not installed."""
    name, package, kind = values["name"], values.get("package"), family.removesuffix("s")
    if name not in families.names(family):
        raise PlaceMapError(
            f"{what} wants the {kind} '{name}' of the package '{package}', which is not installed: install "
            f"it, or hand the {kind} in: PlaceMap.load(path, {kind}=...)"
        )
    found = families.package_of(families.load(family, name))
    if package is not None and found != package:
        raise PlaceMapError(
            f"{what} wants the {kind} '{name}' of the package '{package}', but the one installed is of "
            f"'{found}': hand the right one in: PlaceMap.load(path, {kind}=...)"
        )
    return families.make(family, name, values=values["settings"])


def _items(folder: Path, about: Mapping[str, Any], what: str) -> Items:
    columns = read_array(folder / "items.npy", what)
    if columns.ndim != 2 or columns.shape[1] != 4 or columns.dtype != np.float64 or not len(columns):
        raise PlaceMapError(f"{what} is damaged: items of shape {columns.shape}, {columns.dtype}")
    place = columns[:, 0]
    if not np.all((place >= -1) & (place < MOST_IMAGES) & (place == np.floor(place))):
        raise PlaceMapError(f"{what} is damaged: its items name places that cannot be")
    are_places = about["items"] == "places"
    times = read_array(folder / TIMES, what) if about["times"] else None
    if times is not None and (times.dtype != np.int64 or times.shape != place.shape):
        raise PlaceMapError(f"{what} is damaged: times of {times.dtype} {times.shape} for {len(place)} items")
    return Items(place.astype(np.int64), columns[:, 1:3], columns[:, 3], are_places, times)


def _matcher(about: Mapping[str, Any], what: str) -> Matcher | None:
    matcher: Matcher | None = (
        None if about["matcher"] is None else _part_from("matchers", about["matcher"], what)
    )
    return matcher


def _check_fit(place_map: PlaceMap, what: str) -> None:
    """PlaceMapError where the parts of a map are not of one map."""
    items, places = place_map.items, place_map.places
    if places.n > MOST_IMAGES or (items.are_places and len(items) != places.n):
        raise PlaceMapError(f"{what} is damaged: {len(items)} items for {places.n} places")
    if items.place.max() >= places.n:
        raise PlaceMapError(f"{what} is damaged: an item of place {items.place.max()} of {places.n}")
    drive = place_map.drive
    if (
        drive.ndim != 2
        or drive.shape[1] != 3
        or not len(drive)
        or drive.dtype != np.float64
        or np.isinf(drive).any()
    ):
        raise PlaceMapError(f"{what} is damaged: its drive is {drive.dtype} {drive.shape}")
    if np.isinf(items.position).any() or np.isinf(items.heading_deg).any():
        raise PlaceMapError(f"{what} is damaged: its items lie at infinity")
    if place_map.parts:
        _check_parts(place_map, what)
    images = place_map.references
    if images is not None and (
        images.dtype != np.uint8 or images.shape != (len(items), *place_map.image_shape)
    ):
        raise PlaceMapError(
            f"{what} is damaged: references of shape {images.shape} for {len(items)} items of "
            f"{place_map.image_shape}"
        )


def _check_parts(place_map: PlaceMap, what: str) -> None:
    """PlaceMapError where the drives of a map are not such as belong together."""
    items = len(place_map.items)
    belong = np.concatenate([part.item for part in place_map.parts])
    if len(np.unique(belong)) != items or belong.min() != 0 or belong.max() != items - 1:
        raise PlaceMapError(f"{what} is damaged: its references do not belong to its {items} items")
    for part in place_map.parts:
        if part.map.parts or part.map.scorer != place_map.scorer:
            raise PlaceMapError(f"{what} is damaged: its drive '{part.name}' is no map of one drive like it")
        if part.map.image_shape != place_map.image_shape or part.map.items.are_places:
            raise PlaceMapError(f"{what} is damaged: its drive '{part.name}' has images of another shape")


from evplace.placemap._changing import (  # noqa: E402 - they make a PlaceMap
    add,
    merge,
    named,
    names_of,
    parts_of,
    split,
    versions_of,
)
from evplace.placemap._training import calibrate, default_matcher, default_scorer, train  # noqa: E402

__all__ = [
    "MARK",
    "Items",
    "Part",
    "PlaceMap",
    "add",
    "calibrate",
    "default_matcher",
    "default_scorer",
    "merge",
    "named",
    "names_of",
    "parts_of",
    "remembered",
    "split",
    "train",
    "versions_of",
]
