"""Vectors of queries -> the references that are most like them. One file a way to search.

A score is the product of two vectors, larger is better. A file holds a frozen dataclass of the same name, a
`Searcher`: `build` over the vectors of all references, or `open` what another one has kept, gives a
`Searching`. What is kept is arrays by their names, which may lie in a map or in a folder of their own; they
are mapped into memory, not read.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import PlaceMapError
from evplace.core.settings import to_dict

Vectors = NDArray[np.float32]
"""(vectors, dimensions)."""
Items = NDArray[np.int64]
"""Numbers of references, from 0 in the order in which they were added."""
Content = Mapping[str, NDArray[Any] | bytes]
"""What is kept: arrays by their names, and files by their names with a suffix."""
ABOUT = "index.json"
"""Content that says what kept it."""
FORMAT = "evplace-index-1"
MANY = 300_000
"""Above so many references, an index is what searches by default."""


class Found(NamedTuple):
    """The best references for each query."""

    items: Items
    """(queries, many), best first; fewer where there are not so many."""
    scores: Vectors
    """(queries, many)."""


class Searching(Protocol):
    """Compares vectors with those of all references, or of some."""

    items: int
    """References."""
    dimensions: int
    """Of a vector."""
    compares_all: bool
    """Whether `rows` compares with all references; else `top` is what is cheap."""

    def rows(self, vectors: Vectors) -> Vectors:
        """(n, dimensions) -> (n, items) scores with all references."""

    def top(self, vectors: Vectors, many: int) -> Found:
        """The references that score highest, or nearly all of them."""

    def scores(self, vectors: Vectors, items: Items) -> Vectors:
        """(n, len(items)) scores with these references alone."""

    def add(self, vectors: Vectors) -> None:
        """More references, after those that there are."""

    def content(self) -> Content:
        """What `open` needs, but for `ABOUT`."""


class Searcher(Protocol):
    """A way to search, with its settings."""

    def build(self, vectors: Vectors) -> Searching:
        """Over the vectors of references, at least one."""

    def open(self, content: Content) -> Searching:
        """Over what was kept; PlaceMapError where it is not such."""


def kept(searcher: Searcher, searching: Searching) -> dict[str, NDArray[Any] | bytes]:
    """All that `opened` needs."""
    content = searching.content()
    about = {
        "format": FORMAT,
        "searcher": families.name_of("searchers", searcher),
        "settings": to_dict(searcher),
        "items": searching.items,
        "dimensions": searching.dimensions,
        "shapes": {name: list(np.shape(value)) for name, value in content.items()},
    }
    return {**content, ABOUT: json.dumps(about, indent=1).encode()}


def opened(content: Content, items: int, dimensions: int) -> Searching:
    """Over what `kept` gave; PlaceMapError where it is not such, or not of so many items and dimensions."""
    about = _about(content)
    searcher: Searcher = families.make("searchers", about["searcher"], values=about["settings"])
    for name, shape in about["shapes"].items():
        array = content.get(name)
        if not isinstance(array, np.ndarray) or list(array.shape) != shape:
            raise damaged(f"'{name}' is not of the shape {shape} that {ABOUT} says")
    searching = searcher.open(content)
    found, said = (searching.items, searching.dimensions), (about.get("items"), about.get("dimensions"))
    for held, what in ((said, "says"), (found, "holds")):
        if held != (items, dimensions):
            raise PlaceMapError(
                f"the map's index does not fit its references: it {what} {held[0]} vectors of {held[1]} "
                f"numbers, the map has {items} of {dimensions}: copy the map again or train it again"
            )
    return searching


def usual(items: int) -> str:
    """The name of the searcher for so many references where none is named."""
    return "exact" if items <= MANY else "faiss"


def array_of(content: Content, name: str, kind: Any, dimensions: int) -> NDArray[Any]:
    """A kept array; PlaceMapError where there is none, or it is of another type or number of dimensions."""
    array = content.get(name)
    if not isinstance(array, np.ndarray) or array.dtype != kind or array.ndim != dimensions or not array.size:
        raise damaged(f"'{name}' is missing or of a wrong kind")
    return array


def damaged(fault: str) -> PlaceMapError:
    """The error of content that no `kept` has given."""
    return PlaceMapError(f"the map's index is damaged: {fault}; copy the map again or train it again")


def best_of(items: Items, scores: Vectors, many: int) -> Found:
    """The `many` best of candidates (n, ...), sorted; of equal ones that with the smaller number first."""
    order = np.lexsort((items, -scores), axis=-1)[:, :many]
    return Found(np.take_along_axis(items, order, 1), np.take_along_axis(scores, order, 1))


def _about(content: Content) -> dict[str, Any]:
    text = content.get(ABOUT)
    try:
        found = json.loads(text) if isinstance(text, bytes) else None
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise PlaceMapError(f"the map does not say how its index was made ({ABOUT}): train it again")
    if found.get("format") != FORMAT:
        raise PlaceMapError(
            f"the map's index has the format {found.get('format')!r}, this version reads {FORMAT}: train "
            "the map again, or use the evplace that it was made with"
        )
    kinds = {"searcher": str, "settings": dict, "shapes": dict}
    if not all(isinstance(found.get(name), kind) for name, kind in kinds.items()):
        raise damaged(f"{ABOUT} lacks {', '.join(kinds)}, or one is of a wrong kind")
    return found


def __getattr__(name: str) -> Any:
    return families.class_called("searchers", name)
