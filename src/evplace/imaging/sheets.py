"""Pictures of several images: contact sheets, images side by side, films."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import OutputError
from evplace.core.storage import new_file

GAP = 4
"""Pixels between two images."""
FILMS = (".webp", ".gif")
"""How the name of a film ends."""

PICTURES = (".png", ".jpg", ".jpeg")
"""How that of a picture ends."""

Picture = NDArray[np.uint8]
"""(h, w, 3)."""


def contact_sheet(
    images: NDArray[np.uint8],
    path: str | Path,
    overwrite: bool = False,
    columns: int = 4,
    rows: int = 3,
    events: bool = True,
) -> None:
    """Write `columns` x `rows` images (n, h, w) or (n, h, w, 3), evenly chosen, as a .png.

    `events` says that they are event images, which are shown as ink on paper.
    """
    from PIL import Image

    chosen = images[np.linspace(0, len(images) - 1, min(len(images), columns * rows)).astype(int)]
    tiles = [_tile(image, events) for image in chosen]
    sheet = stacked([tiles[at : at + columns] for at in range(0, len(tiles), columns)], 200)
    with new_file(path, overwrite) as partial:
        Image.fromarray(sheet).save(partial, "PNG")


def stacked(rows: Sequence[Sequence[Picture]], grey: int = 255) -> Picture:
    """Pictures of one size side by side, rows below each other, with gaps of a grey; rows may be shorter."""
    height, width = rows[0][0].shape[:2]
    columns = max(map(len, rows))
    sheet = np.full((len(rows) * (height + GAP) - GAP, columns * (width + GAP) - GAP, 3), grey, np.uint8)
    for j, row in enumerate(rows):
        for i, picture in enumerate(row):
            y, x = j * (height + GAP), i * (width + GAP)
            sheet[y : y + height, x : x + width] = picture
    return sheet


def write_film(pictures: Sequence[Picture], path: str | Path, fps: int, overwrite: bool = False) -> None:
    """Write pictures of one size as a film that goes round, by the end of its name one of FILMS.

    Raises OutputError where it exists (unless `overwrite`) or cannot be written.
    """
    from PIL import Image

    first, *others = map(Image.fromarray, pictures)
    with new_file(path, overwrite) as partial:
        pause = round(1000 / fps)
        first.save(partial, save_all=True, append_images=others, duration=pause, loop=0, quality=50)


def check_ending(path: Path, endings: Sequence[str], what: str) -> None:
    """OutputError where a name is not that of `what` ("a film"): for saying so before the work."""
    if path.suffix.lower() not in endings:
        raise OutputError(f"{path} is no name of {what}: let it end in {', '.join(endings)}")


def as_shown(image: NDArray[np.uint8], events: bool) -> Picture:
    """An image (h, w) or (h, w, C) as (h, w, 3); an event image as ink on paper, a camera's as it is."""
    if image.ndim == 3 and image.shape[2] == 3:
        return image
    strongest = image if image.ndim == 2 else image.max(axis=2)  # of kinds of events, which are no colours
    return np.repeat((255 - strongest if events else strongest)[..., None], 3, axis=2)


def _tile(image: NDArray[np.uint8], events: bool) -> Picture:
    """An image as it is shown, at least 160 pixels wide."""
    shown = as_shown(image, events)
    zoom = max(1, 160 // shown.shape[1])
    return shown.repeat(zoom, axis=0).repeat(zoom, axis=1)
