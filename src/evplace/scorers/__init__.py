"""Images -> score rows: one number for each map item, larger is better. One file a scorer.

A file holds a frozen dataclass of the same name: `scorers.NCC(sigma=2)`. It is a `Scorer`, which learns a
map's content from a drive and opens it later; or only a `Descriptor`, which turns images into vectors: then
the images themselves are the map, and an image scores by the product of its vector with each of theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import PartError, PlaceMapError, TraverseError
from evplace.imaging.traverse import Traverse
from evplace.places import Places
from evplace.searchers.exact import ExactSearch

Rows = NDArray[np.float32]
"""(queries, items) scores."""
Vectors = NDArray[np.float32]
"""(images, dimensions)."""
Content = Mapping[str, NDArray[Any] | bytes]
"""What learning leaves behind: arrays by their names, and files by their names with a suffix."""
REFERENCES = "references"
"""The content of a map whose items are images: (items, h, w) or (items, h, w, C) uint8."""
BLOCK = 64
"""Images that are described at once."""


@dataclass(frozen=True)
class Learning:
    """How a learning is watched, and where it goes on."""

    progress: Callable[[int, int, float], None] | None = None
    """Called with (step, steps, loss) after each step."""
    checkpoint: Path | None = None
    """A file name: a killed run of the same settings and images goes on from it."""


class Learned(NamedTuple):
    """What a scorer has learned."""

    content: Content
    images: NDArray[np.int64] | None = None
    """(items,) the reference image that each map item is; None where the items are the places."""


class OpenScorer(Protocol):
    """Compares images with a map."""

    distances: bool
    """Whether the scores are negated distances."""

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """(n, h, w) or (n, h, w, C) uint8 -> (n, items)."""


@runtime_checkable
class ComparesSome(Protocol):
    """An OpenScorer that can also compare with some items alone, which is faster."""

    def some(self, images: NDArray[np.uint8], items: NDArray[np.int64]) -> Rows:
        """(n, len(items)) what `rows` would give for these items."""


class Scored(NamedTuple):
    """What a scorer of several descriptors makes of some images."""

    rows: Rows
    """The scores of all its descriptors together."""
    verifying: Rows
    """z-scores of the same shape, of one of them alone."""


@runtime_checkable
class Verifies(Protocol):
    """An OpenScorer that adds up several descriptors, and also says what one of them alone makes of an image.

    All together find the place, since each errs elsewhere; the one tells better whether it is that place.
    """

    def scored(self, images: NDArray[np.uint8], items: NDArray[np.int64] | None = None) -> Scored:
        """(n, items), or (n, len(items)) of some items: what `rows` or `some` give, and that of the one."""


class Scorer(Protocol):
    """A way to compare, with its settings. A class may have `presets`: names and objects of it.

    One that learns by a package that may be missing has `require()`, which raises MissingExtraError then: it
    is asked before the work.
    """

    def learn(self, reference: Traverse, places: Places, learning: Learning) -> Learned:
        """Learn the drive; `usable` says which of its images have a place."""

    def open(self, content: Content) -> OpenScorer:
        """Over what was learned; PlaceMapError where it is not such."""


@runtime_checkable
class Descriptor(Protocol):
    """A way to describe an image, with its settings."""

    def describe(self, images: NDArray[np.uint8]) -> Vectors:
        """(n, h, w) or (n, h, w, C) uint8 -> (n, dimensions); the product of two vectors is a score."""


@runtime_checkable
class OfParts(Protocol):
    """A Scorer that describes images by descriptors, which contents that are opened together can share."""

    @property
    def parts(self) -> Mapping[str, Descriptor]:
        """The descriptors by their names."""

    def open(self, content: Content, parts: Mapping[str, Descriptor] | None = None) -> OpenScorer:
        """See Scorer; with other objects for `parts`."""


@runtime_checkable
class Thins(Protocol):
    """A Scorer that can do without some references."""

    def thinned(self, content: Content, items: NDArray[np.int64]) -> Content | None:
        """What is left of a content that was learned, with these of its items; None where it stays whole."""


class Remembering:
    """A descriptor that does not describe the last images anew."""

    def __init__(self, descriptor: Descriptor) -> None:
        self._descriptor = descriptor
        self._last: tuple[NDArray[np.uint8], Vectors] | None = None

    def describe(self, images: NDArray[np.uint8]) -> Vectors:
        """See Descriptor."""
        if self._last is None or not np.array_equal(self._last[0], images):
            self._last = images.copy(), self._descriptor.describe(images)
        return self._last[1]


@dataclass(frozen=True)
class Described:
    """The scorer that a descriptor makes: the map is its images."""

    descriptor: Descriptor

    def learn(self, reference: Traverse, places: Places, _: Learning) -> Learned:
        """See Scorer."""
        return keep_images(reference, places)

    def open(self, content: Content) -> OpenScorer:
        """See Scorer."""
        return _DescribedRows(self.descriptor, references_of(content))


class _DescribedRows:
    distances = False

    def __init__(self, descriptor: Descriptor, references: NDArray[np.uint8]) -> None:
        self._descriptor = descriptor
        self._search = ExactSearch(in_blocks(self._vectors, references))

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        return self._search.rows(self._vectors(images))

    def some(self, images: NDArray[np.uint8], items: NDArray[np.int64]) -> Rows:
        return self._search.scores(self._vectors(images), items)

    def _vectors(self, images: NDArray[np.uint8]) -> Vectors:
        vectors = self._descriptor.describe(images)
        if not (_are_numbers(vectors) and vectors.ndim == 2 and len(vectors) == len(images)):
            raise PartError(
                f"{families.described('scorers', self._descriptor)} must give finite vectors "
                f"({len(images)}, dimensions) for {len(images)} images, it gave {_kind_of(vectors)}"
            )
        return vectors


def in_blocks(vectors_of: Callable[[NDArray[np.uint8]], Vectors], images: NDArray[np.uint8]) -> Vectors:
    """(n, dimensions) of many images, BLOCK at a time: hardly more memory is needed than is kept."""
    first = vectors_of(images[:BLOCK])
    vectors = np.empty((len(images), *first.shape[1:]), first.dtype)
    vectors[:BLOCK] = first
    for start in range(BLOCK, len(images), BLOCK):
        vectors[start : start + BLOCK] = vectors_of(images[start : start + BLOCK])
    return vectors


def scorer_of(part: Scorer | Descriptor) -> Scorer:
    """The part itself, or the scorer that a descriptor makes."""
    return Described(part) if isinstance(part, Descriptor) else part


def opened_together(part: Scorer | Descriptor, contents: Sequence[Content]) -> list[OpenScorer]:
    """The part over each of some contents; an image that all are asked about is described once, if can be."""
    if isinstance(part, OfParts):
        shared = {name: Remembering(one) for name, one in part.parts.items()}
        return [part.open(content, shared) for content in contents]
    return [scorer_of(part).open(content) for content in contents]


def require(part: Scorer | Descriptor) -> None:
    """MissingExtraError where what a scorer learns with is not installed."""
    getattr(part, "require", lambda: None)()


def thinned(part: Scorer | Descriptor, content: Content, items: NDArray[np.int64]) -> Content | None:
    """What is left of a content with these of its items; None where the part cannot do without the others."""
    if isinstance(part, Thins):
        return part.thinned(content, items)
    return {REFERENCES: references_of(content)[items]} if set(content) == {REFERENCES} else None


def usable(reference: Traverse, places: Places) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """(n,) the place of each image of a drive, -1 for none; and (n,) which images can be learned.

    TraverseError where none can.
    """
    labels = places.label(places.where(reference.xy))
    used = (labels >= 0) & (reference.counts != 0)
    if not used.any():
        raise TraverseError("no image of the traverse has a place: check its track and its times")
    return labels, used


def keep_images(reference: Traverse, places: Places) -> Learned:
    """All images that have a place, as they are."""
    _, used = usable(reference, places)
    return Learned({REFERENCES: np.asarray(reference.images[used])}, np.flatnonzero(used))


def references_of(content: Content) -> NDArray[np.uint8]:
    """The reference images of a map; PlaceMapError where it holds none."""
    images = content.get(REFERENCES)
    if not isinstance(images, np.ndarray) or images.dtype != np.uint8 or images.ndim not in (3, 4):
        raise PlaceMapError("the map holds no reference images, which its scorer needs: train it again")
    return images


def _are_numbers(value: object) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and bool(np.isfinite(value).all())


def _kind_of(value: object) -> str:
    if not isinstance(value, np.ndarray):
        return type(value).__name__
    unfinite = value.dtype.kind in "fiu" and not _are_numbers(value)
    return f"{value.dtype} {value.shape}" + (" with NaN or infinity" if unfinite else "")


def __getattr__(name: str) -> Any:
    return families.class_called("scorers", name)
