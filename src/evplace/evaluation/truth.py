"""What counts as right: for each query, the map items that are right answers.

The paper's rule is `by_places` (network) or `by_cells` (reference images): the true cell and its eight
neighbours (section 3.4). A query is *seen* where any item is right; elsewhere "not seen before" is the
right answer. By the stricter rule of views, `only_views`, a query is seen where the map holds a reference
near it that looks the same way: at a crossing, the map may have passed in another direction.

Truth is made block by block: a large map's whole matrix need not fit into memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evplace.core.errors import EvaluationError, InputError
from evplace.core.storage import read_array
from evplace.places import Places
from evplace.sources.tracks import Track

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Block = Callable[[slice], Bools]
"""Queries -> (those queries, items) right answers."""

_BLOCK_CELLS = 1 << 18
"""Queries x items looked at in one go: as many as the processor's cache holds."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Which map items are right answers for each query."""

    block: Block
    """The right answers of a stretch of queries."""
    n_items: int
    """Items in the map."""
    judged: Bools
    """(queries,) False where nothing is known of the query (no position): it is left out of all figures."""
    rule: dict[str, Any]
    """The rule and its parameters, saved with results."""

    @property
    def n_queries(self) -> int:
        """The number of queries."""
        return len(self.judged)

    @property
    def right(self) -> Bools:
        """(queries, items) the whole matrix at once."""
        return self.block(slice(0, self.n_queries))

    @cached_property
    def seen(self) -> Bools:
        """(queries,) whether any item is right."""
        return np.concatenate([right.any(axis=1) for _, right in self.blocks()])

    def blocks(self) -> Iterator[tuple[slice, Bools]]:
        """Stretches of queries and their right answers, (stretch, items) each, in order; at least one."""
        step = max(1, _BLOCK_CELLS // max(1, self.n_items))
        for start in range(0, max(1, self.n_queries), step):
            stretch = slice(start, min(start + step, self.n_queries))
            yield stretch, self.block(stretch)

    def accepts(self, items: ArrayLike) -> Bools:
        """(queries,) whether each query's answer (queries,) is right; -1 never is."""
        chosen = np.asarray(items, np.int64)
        parts = [
            right[np.arange(len(right)), chosen[stretch]] & (chosen[stretch] >= 0)
            for stretch, right in self.blocks()
        ]
        return np.concatenate(parts)

    def only(self, seen: ArrayLike, rule: dict[str, Any]) -> Truth:
        """The same, but where `seen` (queries,) is False no item is right."""
        mask = np.asarray(seen, np.bool_)
        _check_length(mask, self.n_queries, "seen queries")
        return replace(self, block=lambda part: self.block(part) & mask[part, None], rule=self.rule | rule)


def by_places(places: Places, xy: ArrayLike) -> Truth:
    """Items are places; right are those that `places` accepts at the positions `xy` (queries, 2)."""
    where = places.where(np.asarray(xy, np.float64).reshape(-1, 2))
    judged = np.ones(len(where), np.bool_) if where.ndim == 1 else np.isfinite(where).all(axis=1)
    rule = {key: value for key, value in places.to_dict().items() if key != "cells"}
    return Truth(lambda part: places.right(where[part]), places.n, judged, {"by": "places"} | rule)


def by_cells(
    query_xy: ArrayLike,
    reference_xy: ArrayLike,
    cell_m: float = 20.0,
    origin: tuple[float, float] = (0.0, 0.0),
) -> Truth:
    """Items are reference images; right are those in the query's cell or its 8 neighbours.

    Positions are (n, 2) in metres of one zone; a reference without position is never right.
    """
    query, reference = _positions(query_xy), _positions(reference_xy)
    wanted = np.floor((query - np.asarray(origin)) / cell_m)
    given = np.floor((reference - np.asarray(origin)) / cell_m)

    def block(part: slice) -> Bools:
        near = np.abs(wanted[part, None, 0] - given[None, :, 0]) <= 1
        near &= np.abs(wanted[part, None, 1] - given[None, :, 1]) <= 1
        return np.asarray(near, np.bool_)

    rule = {"by": "cells", "cell_m": float(cell_m), "origin": [float(value) for value in origin]}
    judged = np.asarray(np.isfinite(wanted).all(axis=1), np.bool_)
    return Truth(block, len(given), judged, rule)


def by_radius(query_xy: ArrayLike, reference_xy: ArrayLike, radius_m: float = 25.0) -> Truth:
    """Items are reference images; right are those at most `radius_m` metres from the query.

    25 m is the field's usual radius; 10, 30 and 70 are in use too.
    """
    query, reference = _positions(query_xy), _positions(reference_xy)

    def block(part: slice) -> Bools:
        return _near(query[part], reference, radius_m)

    judged = np.asarray(np.isfinite(query).all(axis=1), np.bool_)
    return Truth(block, len(reference), judged, {"by": "radius", "radius_m": float(radius_m)})


def by_view(query: Track, reference: Track, radius_m: float = 20.0, angle_deg: float = 34.0) -> Truth:
    """Items are reference images; right are those near the query that look within `angle_deg` of its heading.

    `query` and `reference` are tracks at the times of the images (`Track.at`). A query without position or
    heading is not judged; a reference without either is never right.
    """

    here, there = query.xy, reference.xy

    def block(part: slice) -> Bools:
        near = _near(here[part], there, radius_m)
        turn = query.heading_deg[part, None] - reference.heading_deg
        return near & (np.abs((turn + 180) % 360 - 180) <= angle_deg)

    rule = {"by": "view", "radius_m": float(radius_m), "angle_deg": float(angle_deg)}
    return Truth(block, len(reference), query.known & np.isfinite(query.heading_deg), rule)


def only_views(
    truth: Truth, query: Track, reference: Track, radius_m: float = 20.0, angle_deg: float = 34.0
) -> Truth:
    """`truth`, but queries whose view no reference has are unseen: there, -1 is the right answer.

    Queries without heading are no longer judged.
    """
    view = by_view(query, reference, radius_m, angle_deg)
    known = {"view_radius_m": float(radius_m), "view_angle_deg": float(angle_deg)}
    return replace(truth.only(view.seen, known), judged=truth.judged & view.judged)


def by_frames(
    n_queries: int, n_items: int, tolerance: ArrayLike = 0, alignment: ArrayLike | None = None
) -> Truth:
    """Right are the items at most `tolerance` from the query's own: its number, or `alignment` (queries,).

    `tolerance` is one number or (queries,). An alignment of -1 means that the map has not seen the query.
    Raises EvaluationError where the numbers differ and no alignment is given.
    """
    if alignment is None and n_queries != n_items:
        raise EvaluationError(
            f"{n_queries} queries and {n_items} items are not in step: give the alignment, one item a query"
        )
    own = np.arange(n_queries) if alignment is None else np.asarray(alignment, np.int64)
    _check_length(own, n_queries, "entries of the alignment")
    if np.any((own < -1) | (own >= n_items)):
        raise EvaluationError(
            f"the alignment points outside the map: items are 0 to {n_items - 1}, -1 for none"
        )
    reach = np.broadcast_to(np.asarray(tolerance, np.int64), own.shape)

    def block(part: slice) -> Bools:
        near = np.abs(np.arange(n_items) - own[part, None]) <= reach[part, None]
        return np.asarray(near & (own[part, None] >= 0), np.bool_)

    rule = {"by": "frames", "tolerance": np.unique(reach).tolist(), "aligned": alignment is not None}
    return Truth(block, n_items, np.ones(n_queries, np.bool_), rule)


def by_matrix(
    given: str | Path | ArrayLike,
    n_queries: int,
    n_items: int,
    rows: Literal["queries", "references"] | None = "queries",
) -> Truth:
    """A matrix of 0 and 1, or a .npy file of one; `rows` says what its rows are.

    None: what fits the shape, queries where both do; the truth's rule says what was taken. Raises
    EvaluationError where it is not (n_queries, n_items) or holds anything but 0 and 1.
    """
    matrix = _loaded(given) if isinstance(given, str | Path) else np.asarray(given)
    name = str(given) if isinstance(given, str | Path) else "the given truth"
    if rows is None:
        turned = matrix.shape == (n_items, n_queries) and n_queries != n_items
        rows = "references" if turned else "queries"
    if matrix.ndim == 2 and rows == "references":
        matrix = matrix.T
    if matrix.shape != (n_queries, n_items):
        raise EvaluationError(f"{name}: {_shape_fault(matrix.shape, n_queries, n_items, rows)}")
    if matrix.dtype.kind not in "biuf" or not np.all((matrix == 0) | (matrix == 1)):
        raise EvaluationError(f"{name}: a truth matrix holds 0 and 1 only, this one holds other values")
    right = matrix.astype(np.bool_)
    return Truth(
        lambda part: right[part], n_items, np.ones(n_queries, np.bool_), {"by": "matrix", "rows": rows}
    )


def _loaded(path: str | Path) -> NDArray[Any]:
    try:
        return read_array(path, "the truth matrix", memory_mapped=True)
    except InputError as error:
        raise EvaluationError(str(error)) from error


def _shape_fault(shape: tuple[int, ...], n_queries: int, n_items: int, rows: str) -> str:
    in_order = shape if rows == "queries" else shape[::-1]
    other = "references" if rows == "queries" else "queries"
    hint = f': it fits with rows="{other}"' if shape == (n_items, n_queries) else ""
    return f"its shape {in_order} does not fit {n_queries} queries and {n_items} items{hint}"


def _positions(xy: ArrayLike) -> Floats:
    positions = np.asarray(xy, np.float64)
    if positions.ndim != 2 or positions.shape[1] != 2:
        raise EvaluationError(
            f"positions have the shape (n, 2), metres east and north, not {positions.shape}"
        )
    return positions


def _near(query: Floats, reference: Floats, radius_m: float) -> Bools:
    """(queries, references) at most `radius_m` apart; False for NaN."""
    east = query[:, None, 0] - reference[None, :, 0]
    north = query[:, None, 1] - reference[None, :, 1]
    return np.asarray(east * east + north * north <= radius_m * radius_m, np.bool_)


def _check_length(values: NDArray[Any], wanted: int, what: str) -> None:
    if len(values) != wanted:
        raise EvaluationError(f"{len(values)} {what} do not fit {wanted} queries")
