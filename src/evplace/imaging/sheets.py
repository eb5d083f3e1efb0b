"""Contact sheets: some images of a traverse at a glance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core.storage import new_file

GAP = 4
"""Grey pixels between two images."""


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
    height, width = tiles[0].shape[:2]
    n_rows = -(-len(tiles) // columns)
    sheet = np.full((n_rows * (height + GAP) - GAP, columns * (width + GAP) - GAP, 3), 200, np.uint8)
    for index, tile in enumerate(tiles):
        top, left = index // columns * (height + GAP), index % columns * (width + GAP)
        sheet[top : top + height, left : left + width] = tile
    with new_file(path, overwrite) as partial:
        Image.fromarray(sheet).save(partial, "PNG")


def as_shown(image: NDArray[np.uint8], events: bool) -> NDArray[np.uint8]:
    """An image (h, w) or (h, w, C) as (h, w, 3); an event image as ink on paper, a camera's as it is."""
    if image.ndim == 3 and image.shape[2] == 3:
        return image
    strongest = image if image.ndim == 2 else image.max(axis=2)  # of kinds of events, which are no colours
    return np.repeat((255 - strongest if events else strongest)[..., None], 3, axis=2)


def _tile(image: NDArray[np.uint8], events: bool) -> NDArray[np.uint8]:
    """An image as it is shown, at least 160 pixels wide."""
    shown = as_shown(image, events)
    zoom = max(1, 160 // shown.shape[1])
    return shown.repeat(zoom, axis=0).repeat(zoom, axis=1)
