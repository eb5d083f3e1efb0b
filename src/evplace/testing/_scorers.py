"""What holds for every scorer, and for every descriptor."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers import Descriptor, OpenScorer, Rows, Scorer
from evplace.sources.tracks import Track
from evplace.testing._require import check_settings, held_to_it, require

Images = NDArray[np.uint8]
SHAPES = [(24, 40), (24, 40, 3)]
"""Of the images that a part is tried on: grey ones, and such with three channels."""
TOLERANCE = 1e-4
"""How far a score may be from that of another batch, as a share of the largest: sums of another order."""


def check_descriptor(descriptor: Descriptor) -> None:
    """AssertionError where a descriptor breaks what `evplace.scorers.Descriptor` promises.

    Vectors are finite, float32, of one length, the same each time, and those of one image are, but for
    rounding, those of the image among many. The scorer that it makes is held to `check_scorer`.
    """
    who = families.described("scorers", descriptor)
    require(isinstance(descriptor, Descriptor), f"{who} must have the method 'describe'")
    for shape in SHAPES:
        images = _images(shape)
        before, many = images.copy(), descriptor.describe(images)
        _check_vectors(many, len(images), who, f"images of shape {shape}")
        require(np.array_equal(before, images), f"{who} changes the images that it is given")
        require(np.array_equal(many, descriptor.describe(images)), f"{who} describes images anew each time")
        ones = [descriptor.describe(images[n : n + 1]) for n in range(len(images))]
        _check_vectors(ones[0], 1, who, "one image")
        _require_close(np.concatenate(ones), many, f"{who} describes an image otherwise among others")
        flat = descriptor.describe(np.full((2, *shape), 7, np.uint8))
        _check_vectors(flat, 2, who, "images without contrast")
        require(flat.shape[1] == many.shape[1], f"{who} gives vectors of several lengths")
    check_scorer(descriptor)


def check_scorer(scorer: Scorer | Descriptor) -> None:
    """AssertionError where a scorer, with its settings, breaks what `evplace.scorers.Scorer` promises.

    It learns a small drive, grey and in three channels. Its map comes back from the disk and scores alike;
    scores are finite, the same each time and in any order, and those of one image are, but for rounding,
    those of the image among many. Where images are the items, an image is more like itself than like others.
    """
    check_settings("scorers", scorer)
    who = families.described("scorers", scorer)
    for shape in SHAPES:
        reference = _drive(shape)
        with held_to_it():
            learned = train(reference, PlaceGrid.from_track(_track_of(reference)), scorer)
            where = Localizer(learned)
            rows = where.rows(reference.images)
        _check_items(learned, reference, who)
        _check_rows(where.scorer, reference.images, rows, who)
        if not learned.items.are_places:
            _check_likeness(where, learned, who)
        with tempfile.TemporaryDirectory(prefix="evplace-") as folder:
            learned.save(Path(folder) / "map")
            loaded = PlaceMap.load(Path(folder) / "map", scorer)
            again = Localizer(loaded).rows(reference.images)
            require(np.array_equal(rows, again), f"{who} scores otherwise with its map read from the disk")


def _check_items(learned: PlaceMap, reference: Traverse, who: str) -> None:
    usable = int(np.isfinite(reference.xy).all(axis=1).sum())
    items = len(learned.items)
    require(
        items == learned.places.n if learned.items.are_places else 0 < items <= usable,
        f"{who} learns {items} items of {usable} images that have a place, and {learned.places.n} places",
    )


def _check_rows(opened: OpenScorer, images: Images, rows: Rows, who: str) -> None:
    before = images.copy()
    require(isinstance(opened.distances, bool), f"{who} must say whether its scores are 'distances'")
    require(np.array_equal(rows, opened.rows(images)), f"{who} scores images anew each time")
    require(np.array_equal(before, images), f"{who} changes the images that it is given")
    if opened.distances:
        require((rows <= 0).all(), f"{who} says that its scores are distances: these enter negated")
    ones = [opened.rows(images[n : n + 1]) for n in range(len(images))]
    _require_close(np.concatenate(ones), rows, f"{who} scores an image otherwise in a batch with others")
    back = opened.rows(np.ascontiguousarray(images[::-1]))[::-1]
    _require_close(back, rows, f"{who} scores images otherwise in another order")


def _check_likeness(where: Localizer, learned: PlaceMap, who: str) -> None:
    """That larger is better: an item's own image scores above the mean of the others."""
    images = learned.references
    if images is None:
        return
    rows = where.rows(np.asarray(images))
    own, others = np.diag(rows).mean(), (rows.sum() - np.trace(rows)) / (rows.size - len(rows))
    require(
        own > others, f"{who} finds an image less like itself ({own:.3g}) than like others ({others:.3g})"
    )


def _check_vectors(vectors: Any, images: int, who: str, what: str) -> None:
    good = isinstance(vectors, np.ndarray) and vectors.ndim == 2 and len(vectors) == images
    require(good and vectors.shape[1] > 0, f"{who} must give ({images}, dimensions) vectors for {what}")
    require(vectors.dtype == np.float32, f"{who} must give float32 for {what}, it gave {vectors.dtype}")
    require(np.isfinite(vectors).all(), f"{who} gives NaN or infinity for {what}")


def _require_close(one: Rows, other: Rows, sentence: str) -> None:
    apart = float(np.abs(one - other).max())
    size = max(float(np.abs(other).max()), 1e-6)
    require(apart <= TOLERANCE * size, f"{sentence}: by {apart:.3g} of {size:.3g}")


def _images(shape: tuple[int, ...], n: int = 24) -> Images:
    """(n, ...) a picture that slides past, 3 columns an image."""
    height, width = shape[:2]
    street = np.random.default_rng(0).integers(0, 256, (height, width + 3 * n, *shape[2:]), np.uint8)
    return np.stack([street[:, 3 * i : 3 * i + width] for i in range(n)])


def _drive(shape: tuple[int, ...]) -> Traverse:
    """Images of a straight road, 4 m an image; the last two have no position."""
    images = _images(shape)
    t_us = np.arange(len(images), dtype=np.int64) * 100_000
    xy = np.stack([500_000 + 4.0 * np.arange(len(images)), np.full(len(images), 4e6)], axis=1)
    track = Track.local(t_us, xy)
    easting = np.where(np.arange(len(images)) < len(images) - 2, track.easting, np.nan)
    track = dataclasses.replace(track, easting=easting)
    return Traverse(images, t_us, np.full(len(images), -1, np.int64), track)


def _track_of(reference: Traverse) -> Track:
    assert reference.track is not None
    return reference.track
