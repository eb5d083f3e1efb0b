from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evplace.core.errors import SettingsError
from evplace.matchers import open_matcher
from evplace.matchers._seqslam_search import enhance, trajectories
from evplace.matchers.seqslam import SeqSLAM, offsets_of, sequence_scores


def plain_contrast(distances: np.ndarray, R: int) -> np.ndarray:
    """OpenSeqSLAM 2.0's enhancement by its definition; `distances` (queries, items)."""
    items = distances.shape[1]
    contrast = np.zeros(distances.shape)
    for r in range(items):
        around = distances[:, max(0, r - R // 2) : r + R // 2 + 1].astype(np.float64)
        if around.shape[1] > 1:
            spread = around.std(1, ddof=1)
            deviation = distances[:, r] - around.mean(1)
            contrast[:, r] = np.where(spread > 0, deviation / np.where(spread > 0, spread, 1), 0)
    return contrast - contrast.min()


def plain_scores(distances: np.ndarray, s: SeqSLAM) -> np.ndarray:
    """The three searches by their definitions."""
    contrast, nearest = plain_contrast(distances, s.R), distances.argmin(1)
    queries, items = distances.shape
    offsets = offsets_of(s)
    span = offsets.shape[1]
    scores = np.full(distances.shape, np.nan)
    for q in range(span // 2, queries - (span - 1 - span // 2)):
        columns = q - span // 2 + np.arange(span)
        for r in range(items):
            rows = [line for line in r + offsets if (line >= 0).all() and (line < items).all()]
            if s.search == "hybrid":
                rows = [line for line in rows if np.isin(line, nearest[columns]).any()]
            if not rows:
                continue
            if s.search == "cone":
                hit = [nearest[c] in [line[k] for line in rows] for k, c in enumerate(columns)]
                scores[q, r] = 1 - np.mean(hit)
            else:
                scores[q, r] = min(contrast[columns, line].sum() for line in rows)
    return scores


@settings(max_examples=40)
@given(
    st.sampled_from(["trajectory", "hybrid", "cone"]),
    st.integers(2, 7),
    st.sampled_from([2, 4, 10]),
    st.sampled_from([(0.8, 1.2), (0.5, 2.0), (1.0, 1.0)]),
    st.integers(1, 20),
    st.integers(0, 14),
    st.integers(0, 999),
)
def test_equals_the_definition(search, ds, R, velocities, items, queries, seed) -> None:
    distances = np.random.default_rng(seed).integers(0, 200, (queries, items)).astype(np.float32)
    s = SeqSLAM(ds=ds, R=R, v_min=velocities[0], v_max=velocities[1], search=search)
    ours, plain = sequence_scores(-distances, s), plain_scores(distances, s) if queries else distances
    np.testing.assert_allclose(ours, plain, atol=2e-4)


@settings(max_examples=30)
@given(
    st.integers(-1000, 1000), st.integers(0, 999), st.sampled_from(["trajectory", "hybrid", "cone", "2013"])
)
def test_adding_a_constant_to_all_distances_changes_no_match(constant, seed, search) -> None:
    distances = np.random.default_rng(seed).integers(0, 200, (30, 25)).astype(np.float32)
    paths = []
    for table in (distances, distances + constant):
        matcher = open_matcher("seqslam", ds=6, search=search)
        matcher.extend(-table)
        paths.append(matcher.path())
    for one, other in zip(*paths, strict=True):
        np.testing.assert_array_equal(one, other)


def test_contrast_loop_equals_numpy_and_is_0_where_flat() -> None:
    rows = np.random.default_rng(0).normal(size=(5, 40)).astype(np.float32)
    rows[0] = 0.1
    out, work = np.empty((5, 40), np.float32), np.empty((2, 40), np.float32)
    for row, line in zip(rows, out, strict=True):
        enhance(row, 5, line, work)
    assert (out[0] == 0).all()
    np.testing.assert_allclose(out - out.min(), plain_contrast(-rows, 10), atol=1e-4)


def test_openseqslam2_has_three_trajectories_by_default() -> None:
    assert len(trajectories(15, 0.8, 1.2, 0.1, every=False)) == 3
    assert len(trajectories(20, 0.5, 2, 0.1, every=False)) == 16


def test_steps_answer_for_the_middle_of_the_sequence() -> None:
    rows = -(np.abs(np.arange(30)[:, None] - np.arange(30)[None]).astype(np.float32) ** 0.5)
    matcher = open_matcher("seqslam", ds=5)
    answers = [matcher.step(row) for row in rows]
    assert answers[:4] == [None] * 4
    assert [a.query for a in answers[4:]] == list(range(2, 28))
    path = matcher.path()
    assert path.item.tolist() == [-1, -1, *range(2, 28), -1, -1]
    assert np.isnan(path.score[[0, 1, 28, 29]]).all()
    assert not path.accepted[[0, 1, 28, 29]].any()


@pytest.mark.parametrize("shape", [(3, 20), (20, 1), (20, 3), (0, 20)])
def test_too_few_queries_or_references_have_no_answer(shape) -> None:
    matcher = open_matcher("seqslam")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        matcher.extend(np.random.default_rng(0).normal(size=shape))
        path = matcher.path()
    assert (path.item == -1).all()
    assert not path.accepted.any()


@pytest.mark.parametrize("preset", ["openseqslam2", "openseqslam2013"])
def test_equal_distances_give_the_lowest_reference_and_are_not_accepted(preset) -> None:
    matcher = open_matcher("seqslam", preset)
    matcher.extend(np.full((30, 40), -7.0))
    path = matcher.path()
    assert len(set(path.item[path.item >= 0])) == 1
    assert not path.accepted.any()


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"R": 5}, "even number"),
        ({"R": 0}, "even number"),
        ({"ds": 1}, "at least 2"),
        ({"v_min": 1.3}, "v_min <= v_max"),
        ({"v_min": 0.0}, "v_min <= v_max"),
        ({"v_step": 0.0}, "v_step > 0"),
        ({"window": -1}, "negative"),
        ({"search": "2013", "ds": 20, "v_min": 0.5, "v_max": 2.0}, "velocities"),
        ({"search": "greedy"}, "it takes 'trajectory'"),
    ],
)
def test_settings_that_the_original_rejects(values, text) -> None:
    with pytest.raises(SettingsError, match=text):
        open_matcher("seqslam", **values)


def test_contrasts_at_the_edge_of_single_precision_stay_finite() -> None:
    rows = (np.random.default_rng(0).random((20, 40)) * 1e-20).astype(np.float32)
    out, work = np.empty(40, np.float32), np.empty((2, 40), np.float32)
    for row in rows:
        enhance(row, 5, out, work)
        assert np.isfinite(out).all()
