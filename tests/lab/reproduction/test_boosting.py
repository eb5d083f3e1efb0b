"""Gradient boosting of symmetric trees: what it learns, and its loops against plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace.matchers._known import Trees
from evplace_lab.reproduction import _boosting as boosting

Floats = NDArray[np.float64]
FEATURES = 4


@pytest.fixture(scope="module")
def answers() -> tuple[Floats, Floats]:
    """Right where two features agree in sign, mostly; the others are noise."""
    rng = np.random.default_rng(0)
    features = rng.normal(size=(4000, FEATURES))
    agree = features[:, 0] * features[:, 2] > 0
    return features, (rng.random(4000) < np.where(agree, 0.9, 0.1)).astype(np.float64)


@pytest.fixture(scope="module")
def trees(answers: tuple[Floats, Floats]) -> Trees:
    return boosting.boosted(*answers)


def test_a_product_is_learned_which_no_sum_of_features_is(trees: Trees) -> None:
    features = np.random.default_rng(1).normal(size=(2000, FEATURES))
    agree = features[:, 0] * features[:, 2] > 0
    log_odds = trees.log_odds(features)
    assert ((log_odds > 0) == agree).mean() > 0.95
    likely = 1 / (1 + np.exp(-log_odds))
    assert np.median(likely[agree]) == pytest.approx(0.9, abs=0.05)
    assert np.median(likely[~agree]) == pytest.approx(0.1, abs=0.05)


def test_noise_tells_next_to_nothing(trees: Trees) -> None:
    """Whatever is asked of it, the answer hardly changes what is said."""
    features = np.random.default_rng(2).normal(size=(500, FEATURES))
    other = features.copy()
    other[:, [1, 3]] = np.random.default_rng(3).normal(size=(500, 2))
    assert np.abs(trees.log_odds(other) - trees.log_odds(features)).mean() < 0.3
    assert np.isin(trees.feature[:10], [0, 2]).mean() > 0.6


def test_it_is_the_same_twice(answers: tuple[Floats, Floats], trees: Trees) -> None:
    again = boosting.boosted(*answers)
    for one, other in zip(again, trees, strict=True):
        np.testing.assert_array_equal(one, other)
    assert trees.feature.shape == trees.limit.shape == (boosting.TREES, boosting.DEPTH)
    assert trees.says.shape == (boosting.TREES, 2**boosting.DEPTH)


def test_what_is_fitted_is_what_is_said(
    answers: tuple[Floats, Floats], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of features that lie just on a limit: bins and limits cut them alike."""
    monkeypatch.setattr(boosting, "TREES", 5)
    features, right = np.round(answers[0], 1), answers[1]
    told = list[Floats]()
    tree = boosting._tree

    def noted(*arguments: Floats) -> object:
        found = tree(*arguments)  # type: ignore[arg-type]
        told.append(arguments[-1].copy())
        return found

    monkeypatch.setattr(boosting, "_tree", noted)
    np.testing.assert_allclose(boosting.boosted(features, right).log_odds(features), told[-1], rtol=1e-9)


def test_a_tree_lessens_what_is_left_over(answers: tuple[Floats, Floats]) -> None:
    features, right = answers
    start = np.full(len(right), np.log(right.mean() / (1 - right.mean())))

    def left_over(said: Floats) -> float:
        return float(np.mean(np.log1p(np.exp(-np.where(right, said, -said)))))

    whole = boosting.boosted(features, right)
    parts = [whole._replace(feature=whole.feature[:many], says=whole.says[:many]) for many in (1, 20, 150)]
    losses = [left_over(start), *(left_over(part.log_odds(features)) for part in parts)]
    assert losses == sorted(losses, reverse=True)
    assert losses[-1] < 0.4


@given(st.integers(0, 60), st.integers(1, 5), st.integers(0, 3), st.integers(0, 99))
def test_sums_in_bins_are_the_plain_ones(many: int, features: int, level: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    bins = rng.integers(0, boosting.BINS, (many, features)).astype(np.uint8)
    leaf, (slope, bend) = rng.integers(0, 1 << level, many), rng.normal(size=(2, many))
    found = boosting._sums(bins, leaf, slope, bend, 1 << level)
    for values, sums in zip((slope, bend), found, strict=True):
        wanted = np.zeros((features, 1 << level, boosting.BINS))
        for feature in range(features):
            np.add.at(wanted[feature], (leaf, bins[:, feature]), values)
        np.testing.assert_allclose(sums, wanted, atol=1e-12)
