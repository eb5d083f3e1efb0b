"""The default: edges, which need no training, and the trained descriptor, side by side; each errs elsewhere.

An image is averaged with the one a tenth of a second before it, and the map keeps a reference a metre. What
each part scores becomes z-scores, which mean the same whatever its scale, and these are added, those of the
trained descriptor twice, where images have the pixels for it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import PlaceMapError, SettingsError
from evplace.core.zscores import ordered, robust_z, z_by
from evplace.imaging.activity import activity
from evplace.imaging.averaging import Averaging, averaged
from evplace.imaging.spacing import Spacer, SpacingSettings
from evplace.imaging.traverse import Traverse
from evplace.places import Places
from evplace.scorers import (
    REFERENCES,
    Content,
    Descriptor,
    Learned,
    Learning,
    OpenScorer,
    Rows,
    Scored,
    in_blocks,
    references_of,
    usable,
)
from evplace.scorers._compressed import Compressed, compress
from evplace.scorers._indexed import IndexedRows, indexed, scale
from evplace.scorers.edges import FEW_PIXELS, Edges
from evplace.scorers.trained import Trained
from evplace.searchers import ABOUT, usual

VERSIONS = "descriptors.json"
"""Content of a map: which descriptors made its vectors."""
WEIGHTS = {"edges": 1.0, "trained": 2.0}
"""How much the z-scores of each part count: on towns for tuning, in halls and on LENS's example better than
alike, or about as good (ours)."""
EVEN_WEIGHTS = {"edges": 1.0, "trained": 1.0}
"""The same for images of few pixels, which are not what the network was trained on (ours)."""
EDGES_VERSION = "2"
"""Vectors of another version of `Edges` cannot be compared with these."""
STANDING = 0.5
"""Without positions, images that show less than this share of the usual are left out: the camera stood."""
FAR_APART_US = 500_000
"""Images so far apart do not tell whether the camera stood between them."""


@dataclass(frozen=True)
class Fused:
    """How a map is made; scores are robust z-scores: the usual reference has 0."""

    every_m: float = 1.0
    """Metres between two references; 0 keeps all images."""
    averaging: Averaging = field(default_factory=Averaging)
    """How an image is averaged with those before it."""
    trained: bool = True
    """Whether the trained descriptor takes part; False leaves the edges alone."""
    components: int = 256
    """Numbers that are kept of a vector of the edges; half as many of one of the trained descriptor."""
    index: str | None = None
    """How references are searched: a part of `evplace.searchers`, of which exact compares with all of them.
    Default: exact up to 300,000 references, beyond that faiss."""

    presets: ClassVar[Mapping[str, Fused]]

    def __post_init__(self) -> None:
        if not 0 <= self.every_m < 1e6 or self.components < 2:
            raise SettingsError("the settings of fused need every_m of 0 or more, components of 2 or more")
        if self.index is not None:
            families.load("searchers", self.index)

    @property
    def parts(self) -> dict[str, Descriptor]:
        """The descriptors by their names; the first one verifies."""
        return {"edges": Edges()} | ({"trained": Trained()} if self.trained else {})

    def learn(self, reference: Traverse, places: Places, _: Learning) -> Learned:
        """See Scorer."""
        kept = _kept(reference, places, self.every_m)
        filled = np.flatnonzero(reference.counts != 0)
        means = averaged(reference.images[filled], reference.t_us[filled], self.averaging)
        references = means[np.searchsorted(filled, kept)]
        content: dict[str, NDArray[Any] | bytes] = {REFERENCES: references}
        found = {}
        for name, part in self.parts.items():
            many = self.components if name == "edges" else self.components // 2
            found[name] = compress(in_blocks(part.describe, references), many)
        index = self.index or usual(len(kept))
        content |= _side_by_side(found) if index == "exact" else indexed(found, _weights(references), index)
        content[VERSIONS] = json.dumps(_versions(self), indent=1).encode()
        return Learned(content, kept)

    def thinned(self, content: Content, items: NDArray[np.int64]) -> Content | None:
        """See Thins: an index stays whole."""
        if ABOUT in content:
            return None
        of_items = {REFERENCES, *(f"{name}_vectors" for name in self.parts)}
        return {
            name: value[items] if name in of_items and isinstance(value, np.ndarray) else value
            for name, value in content.items()
        }

    def open(self, content: Content, parts: Mapping[str, Descriptor] | None = None) -> OpenScorer:
        """See OfParts."""
        references = references_of(content)
        items = len(references)
        _check_versions(content, _versions(self))
        used, weights = parts or self.parts, _weights(references)
        opened: IndexedRows | _FusedRows = (
            IndexedRows(used, weights, content, items)
            if ABOUT in content
            else _FusedRows(
                [(weights[name], part, _read(content, name, items)) for name, part in used.items()]
            )
        )
        try:
            opened.some(np.asarray(references[:1]), np.zeros(1, np.int64))
        except ValueError as error:  # of numpy, whose products fit no other numbers
            raise PlaceMapError("the map's vectors do not fit its images: train it again") from error
        return opened


Fused.presets = {"best": Fused()}


class _FusedRows:
    """See OpenScorer, ComparesSome and Verifies."""

    distances = False

    def __init__(self, parts: list[tuple[float, Descriptor, Compressed]]) -> None:
        """Each part with its weight and its vectors."""
        self._parts = parts

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        return self.scored(images).rows

    def some(self, images: NDArray[np.uint8], items: NDArray[np.int64]) -> Rows:
        return self.scored(images, items).rows

    def scored(self, images: NDArray[np.uint8], items: NDArray[np.int64] | None = None) -> Scored:
        """Image by image, so that a row does not depend on what else is asked."""
        each = [images[at : at + 1] for at in range(len(images))]
        pairs = [self._row(image) if items is None else self._some(image, items) for image in each]
        return Scored(*(np.stack(rows) for rows in zip(*pairs, strict=True)))

    def _row(self, image: NDArray[np.uint8]) -> tuple[Rows, Rows]:
        """(items,) of all parts, and of the first."""
        scores = [robust_z(searched.rows(part.describe(image))[0]) for _, part, searched in self._parts]
        weighed = [weight * row for (weight, _, _), row in zip(self._parts, scores, strict=True)]
        return robust_z(np.sum(weighed, axis=0)), scores[0]

    def _some(self, image: NDArray[np.uint8], items: NDArray[np.int64]) -> tuple[Rows, Rows]:
        """(len(items),) the same of some: what is usual is told by those that tell it of a whole row."""
        weights = [weight for weight, _, _ in self._parts]
        described = [part.describe(image) @ searched.basis for _, part, searched in self._parts]
        held = [searched.vectors for _, _, searched in self._parts]
        usual = [one.dot(all_.T[:, ordered(len(all_))])[0] for one, all_ in zip(described, held, strict=True)]
        by = scale(usual, weights)
        scores = [one.dot(all_[items].T)[0] for one, all_ in zip(described, held, strict=True)]
        weighed = [np.float32(factor) * row for factor, row in zip(by.factors, scores, strict=True)]
        row = np.asarray(np.sum(weighed, axis=0) - np.float32(by.shift), np.float32)
        return row, z_by(usual[0], scores[0])


def _weights(images: NDArray[np.uint8]) -> Mapping[str, float]:
    """What each part counts for images (n, h, w, ...) of this size."""
    return EVEN_WEIGHTS if images.shape[1] * images.shape[2] < FEW_PIXELS else WEIGHTS


def _side_by_side(found: Mapping[str, Compressed]) -> dict[str, NDArray[np.float32]]:
    """The content of a map whose references are all compared."""
    bases = {f"{name}_basis": one.basis for name, one in found.items()}
    return bases | {f"{name}_vectors": one.vectors for name, one in found.items()}


def _kept(reference: Traverse, places: Places, every_m: float) -> NDArray[np.int64]:
    """(items,) the images that become references: one every so many metres, or of a camera that moved."""
    _, used = usable(reference, places)
    if not every_m:
        return np.flatnonzero(used)
    if np.isfinite(reference.xy[used]).all():
        spacer = Spacer(SpacingSettings(every_m=every_m), reference.track)
        chosen = np.flatnonzero(used).tolist()
        return np.array([at for at in chosen if spacer.keeps(int(reference.t_us[at]), -1)], np.int64)
    if np.median(np.diff(reference.t_us, prepend=reference.t_us[0])) >= FAR_APART_US:
        return np.flatnonzero(used)
    shown = activity(reference.images, of_events=bool((reference.counts >= 0).any()))
    return np.flatnonzero(used & ~(shown < STANDING * np.nanmedian(shown[used])))


def _versions(settings: Fused) -> dict[str, str]:
    return {"edges": EDGES_VERSION} | ({"trained": Trained().version} if settings.trained else {})


def _check_versions(content: Content, wanted: dict[str, str]) -> None:
    """PlaceMapError where a map's vectors are of other descriptors than these."""
    text = content.get(VERSIONS)
    try:
        found = json.loads(text) if isinstance(text, bytes) else None
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise PlaceMapError(f"the map does not say which descriptors made it ({VERSIONS}): train it again")
    for name, version in wanted.items():
        if found.get(name) != version:
            raise PlaceMapError(
                f"the map was made by version {str(found.get(name))[:12]} of the descriptor '{name}', this "
                f"is version {version[:12]}: train it again, or use the evplace that it was made with"
            )


def _read(content: Content, name: str, items: int) -> Compressed:
    """The vectors of one part; PlaceMapError where they do not fit the map."""
    basis, vectors = content.get(f"{name}_basis"), content.get(f"{name}_vectors")
    for array in (basis, vectors):
        good = isinstance(array, np.ndarray) and array.dtype == np.float32 and array.ndim == 2
        if not good or not np.isfinite(np.asarray(array)).all():
            raise PlaceMapError(f"the map's vectors of '{name}' are missing or damaged: train it again")
    basis, vectors = np.array(basis), np.array(vectors)  # in memory: every image reads all of them
    if len(vectors) != items or basis.shape[1] != vectors.shape[1]:
        raise PlaceMapError(
            f"the map holds vectors of '{name}' of shape {vectors.shape} by {basis.shape} for {items} items"
        )
    return Compressed(basis, vectors)
