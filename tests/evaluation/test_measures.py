"""Figures of what a matcher says it knows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace.evaluation._measures import auroc, reliability, within

Pairs = st.lists(
    st.tuples(st.sampled_from([0.0, 0.2, 0.5, 0.9, np.nan]), st.booleans()), min_size=2, max_size=30
)


@given(Pairs)
def test_auroc_counts_pairs(pairs: list[tuple[float, bool]]) -> None:
    scores = [-np.inf if np.isnan(score) else score for score, _ in pairs]
    seen = [score for score, (_, known) in zip(scores, pairs, strict=True) if known]
    unseen = [score for score, (_, known) in zip(scores, pairs, strict=True) if not known]
    found = auroc([score for score, _ in pairs], [known for _, known in pairs])
    if not seen or not unseen:
        assert found is None
        return
    wins = [(a > b) + (a == b) / 2 for a in seen for b in unseen]
    assert found == pytest.approx(np.mean(wins))


def test_reliability_is_what_was_said_and_what_came_true() -> None:
    said = [0.05, 0.05, 0.95, 1.0, np.nan]
    bins = reliability(said, [False, True, True, True, False])
    np.testing.assert_allclose(bins[0], [0.05, 0.5, 2])
    np.testing.assert_allclose(bins[9], [0.975, 1.0, 2])
    assert np.isnan(bins[5, :2]).all()
    assert bins[:, 2].sum() == 4


def test_within_counts_right_answers_of_the_seen_alone() -> None:
    error = np.array([3.0, 8.0, 15.0, 2.0, np.nan])
    accepted = np.array([True, True, True, False, True])
    right = np.array([True, True, True, True, False])
    seen = np.array([True, True, True, True, False])
    assert within(error, accepted, right, seen) == {
        "within_20_m": 0.75,
        "within_10_m": 0.5,
        "within_5_m": 0.25,
    }
