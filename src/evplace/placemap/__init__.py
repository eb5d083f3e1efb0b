"""PlaceMap: what learning a route leaves behind, and all that localising needs.

On disk it is a folder: map.json (scorer, places, recipe), items.npy (where each map item is), drive.npy
(where each image of the drive was taken), what the scorer has learned (references.npy, or network.onnx and
weights.safetensors), and SHA256SUMS over all of them, which `sha256sum -c` checks too. A damaged file is
found on loading, before it answers anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace import places as places_of
from evplace.core import families
from evplace.core.errors import EvplaceError, InputError, PartError, PlaceMapError
from evplace.core.settings import to_dict
from evplace.core.storage import new_folder, read_array, write_array, write_json
from evplace.drives.to_traverse import open_traverse
from evplace.imaging.recipe import Recipe
from evplace.imaging.traverse import MARK as TRAVERSE
from evplace.imaging.traverse import Traverse
from evplace.placemap._files import (
    FORMAT,
    about_of,
    check_sums,
    file_of,
    read_content,
    write_content,
    write_sums,
)
from evplace.placemap._files import MARK as MARK
from evplace.places import Places
from evplace.scorers import REFERENCES, Content, Descriptor, Learned, Learning, Scorer, scorer_of, usable
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

    @property
    def references(self) -> NDArray[np.uint8] | None:
        """(items, h, w) or (items, h, w, C): the reference images, where these are the items."""
        images = self.content.get(REFERENCES)
        return images if isinstance(images, np.ndarray) else None

    @property
    def settings(self) -> dict[str, Any]:
        """How it was made, as plain values: what is saved with every result."""
        return {
            "scorer": _scorer_to_dict(self.scorer),
            "recipe": None if self.recipe is None else self.recipe.to_dict(),
            "image_shape": list(self.image_shape),
            "zone": None if self.zone is None else list(self.zone),
            "info": self.info,
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
        """Write the folder `path`; OutputError where it exists or cannot be written."""
        with new_folder(path, overwrite, MARK) as folder:
            for name, value in self.content.items():
                write_content(folder, name, value)
            columns = [self.items.place, *self.items.position.T, self.items.heading_deg]
            write_array(folder / "items.npy", np.stack(columns, axis=1).astype(np.float64))
            write_array(folder / "drive.npy", self.drive)
            description = {
                "format": FORMAT,
                **self.settings,
                "places": self.places.to_dict(),
                "items": "places" if self.items.are_places else "images",
                "content": [file_of(name, value) for name, value in self.content.items()],
            }
            write_json(folder / MARK, description)
            write_sums(folder)

    @classmethod
    def load(cls, path: str | Path, scorer: Scorer | Descriptor | None = None) -> PlaceMap:
        """The map in the folder `path`; PlaceMapError where it is none, or a byte of it has changed.

        `scorer` opens a map whose scorer no installed package offers: the object that it was trained with.
        """
        folder = Path(path)
        what = f"the map {folder}"
        if not (folder / MARK).is_file():
            raise PlaceMapError(f"{folder} is no map: a map is a folder that `evplace train` has written")
        try:
            about = about_of(folder, what)
            check_sums(folder, what, {MARK, "items.npy", "drive.npy", *about["content"]})
            place_map = cls(
                scorer=_scorer_from(about["scorer"], what) if scorer is None else scorer,
                places=places_of.from_dict(about["places"]),
                items=_items(folder, about, what),
                drive=read_array(folder / "drive.npy", what),
                content=read_content(folder, about["content"], what),
                image_shape=tuple(about["image_shape"]),
                recipe=None if about["recipe"] is None else Recipe.from_dict(about["recipe"]),
                zone=None if about["zone"] is None else (about["zone"][0], about["zone"][1]),
                info=about["info"],
            )
            _check_fit(place_map, what)
        except PlaceMapError:
            raise
        except (InputError, EvplaceError) as error:
            raise PlaceMapError(f"{error}" if what in str(error) else f"{what}: {error}") from error
        return place_map


def train(
    reference: Traverse,
    places: Places,
    scorer: str | Scorer | Descriptor = "network",
    preset: str | None = None,
    learning: Learning | None = None,
    **settings: object,
) -> PlaceMap:
    """Learn the map of `places` from the traverse `reference`.

    `scorer` is a name, with `settings` over those of its `preset`, or an object such as
    `scorers.NCC(sigma=1)`: network is trained; to ncc and the like the images themselves are the map. Raises
    SettingsError for an unknown name or setting, TraverseError where no image has a place.
    """
    part: Scorer | Descriptor = families.make("scorers", scorer, preset, settings)
    _, used = usable(reference, places)
    track = reference.track
    heading = track.heading_deg if track is not None else np.full(len(reference), np.nan)
    drive = np.column_stack([reference.xy, heading])
    with families.blaming("scorers", part):
        learned = scorer_of(part).learn(reference, places, learning or Learning())
    _check_learned(learned, len(reference), part)
    return PlaceMap(
        part,
        places,
        _learned_items(learned, reference, places, drive),
        drive[used],
        learned.content,
        reference.images.shape[1:],
        reference.recipe,
        (track.zone, track.northern) if track is not None else None,
        {key: reference.info[key] for key in ("source", "spacing") if key in reference.info},
    )


def _check_learned(learned: object, images: int, part: object) -> None:
    """PartError where a scorer has learned something that no map can hold."""
    fault = (
        _fault_of(learned, images) if isinstance(learned, Learned) else f"it gave {type(learned).__name__}"
    )
    if fault is not None:
        raise PartError(
            f"{families.described('scorers', part)} must learn arrays and bytes, and which images its items "
            f"are: {fault}"
        )


def _fault_of(learned: Learned, images: int) -> str | None:
    content: object = learned.content
    if not isinstance(content, Mapping):
        return f"its content is {type(content).__name__}"
    odd = [type(value).__name__ for value in content.values() if not isinstance(value, np.ndarray | bytes)]
    if odd:
        return f"its content holds {odd[0]}"
    if learned.images is not None and not _are_indices(learned.images, images):
        return f"its items are not some of the {images} images"
    return None


def _are_indices(chosen: object, images: int) -> bool:
    return (
        isinstance(chosen, np.ndarray)
        and chosen.ndim == 1
        and chosen.dtype.kind in "iu"
        and bool(np.all((chosen >= 0) & (chosen < images)))
    )


def _learned_items(
    learned: Learned, reference: Traverse, places: Places, drive: NDArray[np.float64]
) -> Items:
    if learned.images is None:
        return Items(np.arange(places.n), places.centres(), np.full(places.n, np.nan), are_places=True)
    labels = places.label(places.where(reference.xy))
    chosen = drive[learned.images]
    return Items(labels[learned.images], chosen[:, :2], chosen[:, 2])


def _scorer_to_dict(scorer: Scorer | Descriptor) -> dict[str, Any]:
    return {
        "name": families.name_of("scorers", scorer),
        "package": families.package_of(scorer),
        "settings": to_dict(scorer),
    }


def _scorer_from(values: Mapping[str, Any], what: str) -> Scorer | Descriptor:
    name, package = values["name"], values.get("package")
    if name not in families.names("scorers"):
        raise PlaceMapError(
            f"{what} wants the scorer '{name}' of the package '{package}', which is not installed: install "
            "it, or hand the scorer in: PlaceMap.load(path, scorer)"
        )
    found = families.package_of(families.load("scorers", name))
    if package is not None and found != package:
        raise PlaceMapError(
            f"{what} wants the scorer '{name}' of the package '{package}', but the one installed is of "
            f"'{found}': hand the right one in: PlaceMap.load(path, scorer)"
        )
    part: Scorer | Descriptor = families.make("scorers", name, values=values["settings"])
    return part


def _items(folder: Path, about: Mapping[str, Any], what: str) -> Items:
    columns = read_array(folder / "items.npy", what)
    if columns.ndim != 2 or columns.shape[1] != 4 or columns.dtype != np.float64 or not len(columns):
        raise PlaceMapError(f"{what} is damaged: items of shape {columns.shape}, {columns.dtype}")
    place = columns[:, 0]
    if not np.all((place >= -1) & (place < MOST_IMAGES) & (place == np.floor(place))):
        raise PlaceMapError(f"{what} is damaged: its items name places that cannot be")
    are_places = about["items"] == "places"
    return Items(place.astype(np.int64), columns[:, 1:3], columns[:, 3], are_places)


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
    images = place_map.references
    if images is not None and (
        images.dtype != np.uint8 or images.shape != (len(items), *place_map.image_shape)
    ):
        raise PlaceMapError(
            f"{what} is damaged: references of shape {images.shape} for {len(items)} items of "
            f"{place_map.image_shape}"
        )
