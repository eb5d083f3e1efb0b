"""What counts as right, on closed cases, against plain twins, and on a given real matrix."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evplace.core.errors import EvaluationError
from evplace.evaluation import truth
from evplace.places import PlaceGrid, PlaceRuns
from evplace.sources.tracks import Track

POSITIONS = arrays(
    np.float64,
    st.tuples(st.integers(1, 20), st.just(2)),
    elements=st.one_of(st.floats(-100, 100), st.just(np.nan)),
)


def looking(xy: list[list[float]], heading_deg: list[float]) -> Track:
    return Track.local(np.arange(len(xy)), xy, heading_deg)


@given(POSITIONS, POSITIONS, st.sampled_from([(0.0, 0.0), (7.0, -3.0)]))
def test_cells_of_references_agree_with_places(
    query: np.ndarray, reference: np.ndarray, origin: tuple[float, float]
) -> None:
    reference[0] = 1.0
    grid = PlaceGrid.from_positions(reference, origin=origin)
    of_places, of_images = truth.by_places(grid, query), truth.by_cells(query, reference, origin=origin)
    labels = grid.label(reference)
    assert (of_places.right[:, labels] & (labels >= 0) == of_images.right).all()
    assert (of_places.seen == of_images.seen).all()
    assert (of_places.seen == grid.seen(query)).all()
    assert (of_places.judged == np.isfinite(query).all(axis=1)).all()


@given(POSITIONS, POSITIONS)
def test_radius_against_a_plain_twin(query: np.ndarray, reference: np.ndarray) -> None:
    right = truth.by_radius(query, reference, 30).right
    for i, q in enumerate(query):
        for j, r in enumerate(reference):
            assert right[i, j] == (((q - r) ** 2).sum() <= 900)


def test_opposite_directions_are_not_the_same_view() -> None:
    reference = looking([[0, 0], [0, 10], [0, 90]], [350, 180, 0])
    query = looking([[5, 0], [5, 0], [5, 0], [5, 0]], [20, 24.1, 150, np.nan])
    found = truth.by_view(query, reference)
    assert found.right.tolist() == [[True, False, False], [False] * 3, [False, True, False], [False] * 3]
    assert found.judged.tolist() == [True, True, True, False]


def test_only_views_makes_crossings_unseen() -> None:
    reference = looking([[10, 10], [30, 10]], [90, 90])
    query = looking([[12, 10], [12, 10], [np.nan, 0]], [90, 0, 0])
    grid = PlaceGrid.from_track(reference)
    plain = truth.by_places(grid, query.xy)
    strict = truth.only_views(plain, query, reference)
    assert plain.seen.tolist() == [True, True, False]
    assert strict.seen.tolist() == [True, False, False]
    assert strict.judged.tolist() == [True, True, False]
    assert strict.rule["view_angle_deg"] == 34.0


def test_frames_with_one_tolerance_or_one_each() -> None:
    assert truth.by_frames(3, 3, 1).right.tolist() == [
        [True, True, False],
        [True, True, True],
        [False, True, True],
    ]
    found = truth.by_frames(3, 2, [0, 1, 5], alignment=[1, 1, -1])
    assert found.right.tolist() == [[False, True], [True, True], [False, False]]
    with pytest.raises(EvaluationError, match="give the alignment"):
        truth.by_frames(3, 2)
    with pytest.raises(EvaluationError, match="outside the map"):
        truth.by_frames(1, 2, alignment=[2])
    with pytest.raises(EvaluationError, match="do not fit 3"):
        truth.by_frames(3, 2, alignment=[0])


def test_runs_need_no_positions() -> None:
    found = truth.by_places(PlaceRuns(4, every=2), np.full((4, 2), np.nan))
    assert found.judged.all()
    assert found.right.tolist() == [[True, False]] * 2 + [[False, True]] * 2


def test_the_given_real_matrix(data: Path) -> None:
    path = data / "traverses/lens/brisevent/davis346/sunset2_sunset1_GT.npy"
    found = truth.by_matrix(path, 724, 641)
    assert np.flatnonzero(~found.seen).tolist() == [193, 194, 625, 626]
    assert truth.by_matrix(path, 641, 724, rows="references").right.shape == (641, 724)
    with pytest.raises(EvaluationError, match='it fits with rows="references"'):
        truth.by_matrix(path, 641, 724)


@pytest.mark.parametrize(
    ("shape", "rows", "taken"),
    [
        ((3, 5), None, "queries"),
        ((5, 3), None, "references"),
        ((3, 5), "queries", "queries"),
        ((5, 3), "references", "references"),
        ((4, 4), None, "queries"),
        ((4, 4), "references", "references"),
    ],
)
def test_what_the_rows_are_is_asked_or_told_by_the_shape(
    shape: tuple[int, int], rows: str | None, taken: str
) -> None:
    right = np.random.default_rng(0).random(shape) < 0.5
    n_queries, n_items = shape if taken == "queries" else shape[::-1]
    found = truth.by_matrix(right, n_queries, n_items, rows)  # type: ignore[arg-type]
    assert (found.right == (right if taken == "queries" else right.T)).all()
    assert found.rule["rows"] == taken


@pytest.mark.parametrize(
    ("matrix", "words"),
    [(np.zeros(3), "shape"), (np.full((2, 3), 0.5), "0 and 1"), (np.full((2, 3), np.nan), "0 and 1")],
)
def test_unfit_matrices_are_refused(matrix: np.ndarray, words: str) -> None:
    with pytest.raises(EvaluationError, match=words):
        truth.by_matrix(matrix, 2, 3)


def test_unreadable_matrices_are_refused(tmp_path: Path) -> None:
    with pytest.raises(EvaluationError, match="No such file"):
        truth.by_matrix(tmp_path / "none.npy", 2, 3)
    for content in (b"", b"text", b"\x93NUMPY\x01\x00"):
        (tmp_path / "bad.npy").write_bytes(content)
        with pytest.raises(EvaluationError, match=r"bad\.npy"):
            truth.by_matrix(tmp_path / "bad.npy", 2, 3)
    np.save(tmp_path / "objects.npy", np.array([{}]))
    with pytest.raises(EvaluationError, match=r"objects\.npy"):
        truth.by_matrix(tmp_path / "objects.npy", 1, 1)


def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    found = truth.by_matrix(rng.random((50, 7)) < 0.2, 50, 7)
    items = rng.integers(-1, 7, 50)
    whole = found.accepts(items)
    monkeypatch.setattr(truth, "_BLOCK_CELLS", 20)
    assert len(list(found.blocks())) == 25
    assert (found.accepts(items) == whole).all()
    assert (found.seen == found.right.any(axis=1)).all()
    assert whole.tolist() == [item >= 0 and bool(found.right[q, item]) for q, item in enumerate(items)]
