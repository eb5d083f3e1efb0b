"""PlaceMap: what learning a route leaves behind, and all that localising needs.

On disk it is a folder: map.json (scorer, places, settings), items.npy (where each map item is), drive.npy
(where each image of the drive was taken), the network as weights.safetensors and network.onnx, or the
reference images as references.npy, and SHA256SUMS over all of them, which `sha256sum -c` checks too. A
damaged file is found on loading, before it answers anything.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace import places
from evplace.core.errors import InputError, PlaceMapError
from evplace.core.storage import new_folder, read_array, read_json, sha256, write_json
from evplace.places import Places

FORMAT = "evplace-map-1"
SUMS = "SHA256SUMS"
MARK = "map.json"
"""What tells a folder that was written here from any other: only such a one is replaced."""


@dataclass(frozen=True)
class Items:
    """What score rows are about: one place each (network), or one reference image each (sad, ncc)."""

    place: NDArray[np.int64]
    """(items,) the place of each item, -1 where the image had no position."""
    position: NDArray[np.float64]
    """(items, 2) easting and northing in metres, NaN where unknown."""
    heading_deg: NDArray[np.float64]
    """(items,) clockwise from north, NaN where unknown or where an item has many."""

    def __len__(self) -> int:
        return len(self.place)


@dataclass(frozen=True)
class PlaceMap:
    """A learned route."""

    scorer: str
    """Which scorer reads it: network, ncc, ..."""
    places: Places
    """The places and the rule of what counts as the same place."""
    items: Items
    """What each entry of a score row stands for."""
    drive: NDArray[np.float64]
    """(images, 3) easting, northing and heading of each image that the map was learned from, NaN where
    unknown: it tells whether the map has a view, not only a place."""
    settings: dict[str, Any] = field(default_factory=dict)
    """How it was made: source, sensor, windows, images, train, scorer, zone."""
    network: bytes | None = None
    """The trained network as ONNX."""
    weights: dict[str, NDArray[np.float32]] = field(default_factory=dict)
    """The trained network's weights."""
    references: NDArray[np.uint8] | None = None
    """(items, h, w) or (items, h, w, C): the reference images of image scorers."""

    @property
    def items_are_places(self) -> bool:
        """Whether a score row has one entry a place (a network), not one a reference image."""
        return self.references is None

    @property
    def image_shape(self) -> tuple[int, ...]:
        """Shape of the images that it was learned from: (h, w) or (h, w, C)."""
        return tuple(self.settings["image_shape"])

    def save(self, path: str | Path, overwrite: bool = False) -> None:
        """Write the folder `path`; OutputError where it exists or cannot be written."""
        with new_folder(path, overwrite, MARK) as folder:
            if self.network is not None:
                from safetensors.numpy import save_file

                (folder / "network.onnx").write_bytes(self.network)
                save_file(self.weights, folder / "weights.safetensors")
            if self.references is not None:
                np.save(folder / "references.npy", self.references)
            columns = [self.items.place, *self.items.position.T, self.items.heading_deg]
            np.save(folder / "items.npy", np.stack(columns, axis=1).astype(np.float64))
            np.save(folder / "drive.npy", self.drive)
            description = {
                "format": FORMAT,
                "scorer": self.scorer,
                "places": self.places.to_dict(),
                "settings": self.settings,
            }
            write_json(folder / MARK, description)
            sums = [f"{sha256(file)}  {file.name}\n" for file in sorted(folder.iterdir())]
            (folder / SUMS).write_text("".join(sums), "ascii")

    @classmethod
    def load(cls, path: str | Path) -> PlaceMap:
        """The map in the folder `path`; PlaceMapError where it is none, or a byte of it has changed."""
        folder = Path(path)
        what = f"the map {folder}"
        if not (folder / MARK).exists():
            raise PlaceMapError(f"{folder} is no map: a map is a folder that `evplace train` has written")
        _check_sums(folder)
        try:
            description = read_json(folder / MARK, what)
            if description.get("format") != FORMAT:
                raise PlaceMapError(f"{what} has the format {description.get('format')}, this is {FORMAT}")
            columns = read_array(folder / "items.npy", what)
            drive = read_array(folder / "drive.npy", what)
        except PlaceMapError:
            raise
        except InputError as error:
            raise PlaceMapError(str(error)) from error
        return cls(
            scorer=description["scorer"],
            places=places.from_dict(description["places"]),
            items=Items(columns[:, 0].astype(np.int64), columns[:, 1:3], columns[:, 3]),
            drive=drive,
            settings=description["settings"],
            **_content(folder, what),
        )


def _content(folder: Path, what: str) -> dict[str, Any]:
    if (folder / "references.npy").exists():
        return {"references": read_array(folder / "references.npy", what, memory_mapped=True)}
    from safetensors.numpy import load_file

    weights = load_file(folder / "weights.safetensors")
    return {"network": (folder / "network.onnx").read_bytes(), "weights": weights}


def _check_sums(folder: Path) -> None:
    try:
        lines = (folder / SUMS).read_text("ascii").splitlines()
        sums = {name: wanted for wanted, name in (line.split("  ", 1) for line in lines)}
    except (OSError, ValueError) as error:
        raise PlaceMapError(f"the map {folder} has no readable {SUMS}: train it again ({error})") from error
    for name, wanted in sums.items():
        file = folder / name
        if not file.exists():
            raise PlaceMapError(f"the map {folder} lacks {name}: copy it again or train it again")
        if sha256(file) != wanted:
            raise PlaceMapError(
                f"the map {folder} is damaged: {name} has changed since it was saved; copy it again"
            )
