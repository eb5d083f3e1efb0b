"""Cells in the order of first visit, and the rule of eight neighbours."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evplace import places
from evplace.core.errors import PlaceMapError, SettingsError, TrackError
from evplace.places import PlaceGrid, PlaceRuns
from evplace.sources.tracks import Track

POSITIONS = arrays(np.float64, st.tuples(st.integers(1, 40), st.just(2)), elements=st.floats(-300, 300))


def test_cells_are_numbered_in_the_order_of_first_visit() -> None:
    xy = [[5, 5], [25, 5], [25, 25], [-1, 5], [5, 5], [np.nan, 0]]
    grid = PlaceGrid.from_positions(xy)
    assert grid.cells.tolist() == [[0, 0], [1, 0], [1, 1], [-1, 0]]
    assert grid.label(xy).tolist() == [0, 1, 2, 3, 0, -1]
    assert grid.centres()[1].tolist() == [30.0, 10.0]


def test_the_origin_moves_the_cells() -> None:
    grid = PlaceGrid.from_positions([[19, 0], [21, 0]], cell_m=20, origin=(10, 0))
    assert grid.n == 1
    assert grid.centres().tolist() == [[20.0, 10.0]]


def test_eight_neighbours_are_right_and_the_next_ring_is_not() -> None:
    grid = PlaceGrid.from_positions([[10, 10]])
    ring = np.array([[x, y] for x in range(-30, 60, 20) for y in range(-30, 60, 20)], float)
    near = np.abs(ring - 10).max(axis=1) <= 20
    assert grid.accepts(np.zeros(25, int), ring).tolist() == near.tolist()
    assert grid.seen(ring).tolist() == near.tolist()
    assert not grid.accepts([-1], [[10, 10]]).any()


@given(POSITIONS, POSITIONS)
def test_label_accepts_seen_and_right_agree(reference: np.ndarray, query: np.ndarray) -> None:
    grid = PlaceGrid.from_positions(reference)
    right = grid.right(query)
    assert (grid.seen(query) == right.any(axis=1)).all()
    labels = grid.label(query)
    inside = labels >= 0
    assert grid.accepts(labels[inside], query[inside]).all()
    for place in range(grid.n):
        assert (grid.accepts(np.full(len(query), place), query) == right[:, place]).all()
    cells = [tuple(cell) for cell in np.floor(query / 20).astype(int)]
    known = {tuple(cell): place for place, cell in enumerate(grid.cells.tolist())}
    assert labels.tolist() == [known.get(cell, -1) for cell in cells]
    order = grid.label(reference)
    assert list(dict.fromkeys(order.tolist())) == list(range(grid.n))


@given(POSITIONS)
def test_json_gives_the_same_grid(xy: np.ndarray) -> None:
    grid = PlaceGrid.from_track(Track.local(np.arange(len(xy)), xy), cell_m=7.5, origin=(1.0, -2.0))
    again = places.from_dict(json.loads(json.dumps(grid.to_dict())))
    assert isinstance(again, PlaceGrid)
    assert again.to_dict() == grid.to_dict()
    assert (again.label(xy) == grid.label(xy)).all()


def test_a_loop_comes_back_to_its_first_places(data: Path) -> None:
    poses = np.loadtxt(data / "gps/kitti06/06.txt").reshape(-1, 3, 4)
    xy = poses[:, [0, 2], 3]
    grid = PlaceGrid.from_positions(xy, cell_m=20)
    labels = grid.label(xy)
    assert (labels >= 0).all()
    assert (np.diff(np.maximum.accumulate(labels)) <= 1).all()
    assert grid.n == 35
    assert labels[850:].max() < 20  # the end of the drive repeats its beginning


def test_impossible_grids_are_refused() -> None:
    with pytest.raises(TrackError, match="no position is known"):
        PlaceGrid.from_positions([[np.nan, np.nan]])
    for cell_m in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(SettingsError, match="impossible"):
            PlaceGrid.from_positions([[0, 0]], cell_m=cell_m)


def test_positions_off_any_ground_have_no_place() -> None:
    grid = PlaceGrid.from_positions([[0, 0], [1e300, 0]])
    assert grid.n == 1
    assert grid.label([[1e300, 0], [np.inf, 0]]).tolist() == [-1, -1]


def test_runs_of_images() -> None:
    runs = PlaceRuns(10, every=4, tolerance=1)
    assert runs.n == 3
    images = runs.where(np.full((14, 2), np.nan))
    assert runs.label(images).tolist() == [0] * 4 + [1] * 4 + [2] * 2 + [-1] * 4
    assert (runs.seen(images) == runs.right(images).any(axis=1)).all()
    for place in range(3):
        assert (runs.accepts(np.full(14, place), images) == runs.right(images)[:, place]).all()
    assert not runs.accepts([-1], [0]).any()
    assert places.from_dict(runs.to_dict()) == runs
    with pytest.raises(SettingsError, match="at least 1 image"):
        PlaceRuns(0)


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"kind": "hexagons"},
        {"kind": "runs", "n_images": 0, "every": 1, "tolerance": 0},
        {"kind": "grid", "cell_m": 20},
        {"kind": "grid", "cell_m": 20, "origin": [0, 0], "zone": 0, "northern": True, "cells": []},
        {
            "kind": "grid",
            "cell_m": 20,
            "origin": [0, 0],
            "zone": 0,
            "northern": True,
            "cells": [[1, 1], [1, 1]],
        },
        {"kind": "grid", "cell_m": 20, "origin": [0, 0], "zone": 0, "northern": True, "cells": [[1, 1], [1]]},
    ],
)
def test_damaged_places_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(PlaceMapError):
        places.from_dict(values)
