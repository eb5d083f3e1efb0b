"""References in lists of like ones, of which a query reads the few that are most like it.

By the library faiss, an inverted file of bytes (Jégou, Douze and Schmid, PAMI 33, 2011). It needs the extra
`index`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import MissingExtraError, PlaceMapError, SettingsError
from evplace.searchers import Content, Found, Items, Vectors, array_of, damaged
from evplace.searchers._turned import Turned

FILE = "index_faiss"
BLOCK = 20_000
"""References that are turned, or read back, at once."""
LISTS = 4.0
"""Lists for the square root of the references."""
LEARNED_FROM = 40
"""References a list that the lists are learned from."""
ROUNDS = 8
"""Of learning them."""


@dataclass(frozen=True)
class Faiss:
    """How much of the references a query reads."""

    probes: int = 64
    """Lists that a query reads: of a million references one in sixty (ours)."""

    def __post_init__(self) -> None:
        if self.probes < 1:
            raise SettingsError(f"'probes' of faiss is 1 or more, not {self.probes}")

    def build(self, vectors: Vectors) -> FaissSearch:
        """See Searcher."""
        library = _library()
        turned, (items, dimensions) = Turned.of(vectors), vectors.shape
        lists = max(min(int(LISTS * math.sqrt(items)), items // LEARNED_FROM), 1)
        index = library.IndexIVFScalarQuantizer(
            library.IndexFlatIP(dimensions), dimensions, lists, library.ScalarQuantizer.QT_8bit_uniform,
            library.METRIC_INNER_PRODUCT,
        )  # fmt: skip
        index.cp.niter, index.cp.max_points_per_centroid = ROUNDS, LEARNED_FROM
        index.cp.min_points_per_centroid = 1
        index.set_direct_map_type(library.DirectMap.Array)
        index.train(turned.references(np.asarray(vectors[:: max(items // (LEARNED_FROM * lists), 1)])))
        searching = FaissSearch(self, turned, index)
        searching.add(vectors)
        return searching

    def open(self, content: Content) -> FaissSearch:
        """See Searcher."""
        turned, file = Turned.read(content), array_of(content, FILE, np.uint8, 1)
        index = _read(file)
        if index.d != len(turned.mean):
            raise damaged("its lists do not fit its turn")
        return FaissSearch(self, turned, index, file)


class FaissSearch:
    """See Searching."""

    compares_all = False

    def __init__(
        self, settings: Faiss, turned: Turned, index: Any, file: NDArray[np.uint8] | None = None
    ) -> None:
        """Over faiss's own object; `file` is what it reads from, where it may not be changed."""
        self._turned, self._index, self._file = turned, index, file
        self._index.nprobe = settings.probes
        self.items, self.dimensions = int(index.ntotal), int(index.d)

    def rows(self, vectors: Vectors) -> Vectors:
        """See Searching."""
        return self.scores(vectors, np.arange(self.items))

    def top(self, vectors: Vectors, many: int) -> Found:
        """See Searching; with fewer where the lists that are read hold no more."""
        queries, more = self._queries(vectors)
        found = [self._index.search(query[None], min(many, self.items)) for query in queries]
        held = min(int((items >= 0).sum()) for _, items in found)
        scores, items = (np.concatenate([one[column] for one in found])[:, :held] for column in (0, 1))
        return Found(items, np.asarray(scores + more[:, None], np.float32))

    def scores(self, vectors: Vectors, items: Items) -> Vectors:
        """See Searching."""
        queries, more = self._queries(vectors)
        out = np.empty((len(vectors), len(items)), np.float32)
        for start in range(0, len(items), BLOCK):
            some = self._index.reconstruct_batch(np.ascontiguousarray(items[start : start + BLOCK], np.int64))
            out[:, start : start + BLOCK] = queries @ some.T
        return out + more[:, None]

    def add(self, vectors: Vectors) -> None:
        """See Searching."""
        if self._file is not None:
            probes = self._index.nprobe
            self._index, self._file = _library().deserialize_index(np.array(self._file)), None
            self._index.nprobe = probes
        for start in range(0, len(vectors), BLOCK):
            self._index.add(self._turned.references(np.asarray(vectors[start : start + BLOCK])))
        self.items = int(self._index.ntotal)

    def content(self) -> Content:
        """See Searching."""
        file = _library().serialize_index(self._index) if self._file is None else self._file
        return {**self._turned.content, FILE: file}

    def _queries(self, vectors: Vectors) -> tuple[Vectors, Vectors]:
        return np.asarray(vectors @ self._turned.turn, np.float32), vectors @ self._turned.mean


def _library() -> Any:
    try:
        import faiss
    except ImportError as error:
        raise MissingExtraError(
            "faiss-cpu", "index", 'the searcher faiss (`index="bits"` needs no package)'
        ) from error
    return faiss


def _read(file: NDArray[np.uint8]) -> Any:
    """faiss's own object over what it wrote, which stays where it is; PlaceMapError where it is not such."""
    library = _library()
    try:
        source = library.ZeroCopyIOReader(library.swig_ptr(file), file.size)
        index = library.read_index(source, library.IO_FLAG_MMAP_IFC)
    except RuntimeError as error:
        raise PlaceMapError(
            f"the map's index cannot be read by faiss {library.__version__}: it is cut off, or of another "
            "version; copy the map again or train it again"
        ) from error
    if not isinstance(index, library.IndexIVFScalarQuantizer):
        raise damaged("it is of another kind")
    return index
