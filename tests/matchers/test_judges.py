"""What tells right answers from wrong ones: signs, their means, and the sums that judge them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace.matchers import _known
from evplace.matchers._belief import SPEEDS
from evplace.matchers._known import (
    ASKED,
    LATE_SIGNS,
    LONGER,
    SIGNS,
    SPANS,
    TINY,
    Judges,
    Means,
    Trees,
    limit,
    means_ahead,
    means_of,
    of_late,
    of_live,
    probability,
    said,
    signs_of,
)

Floats = NDArray[np.float64]
LIVE_FEATURES = SIGNS * len(SPANS) + 1
LATE_FEATURES = LATE_SIGNS * len(SPANS) + len(LONGER) + 2 + LIVE_FEATURES


def made_trees(rng: np.random.Generator, features: int, trees: int = 3, depth: int = 2) -> Trees:
    """Limits are such that some features lie on them."""
    return Trees(
        float(rng.normal()),
        rng.integers(0, features, (trees, depth)),
        rng.integers(-1, 2, (trees, depth)).astype(np.float64),
        rng.normal(size=(trees, 2**depth)),
    )


def plain_log_odds(trees: Trees, features: Floats) -> Floats:
    """Image by image, tree by tree: the answers to a tree's questions as a number in bits."""
    return np.array(
        [
            trees.start
            + sum(
                says[sum(2**bit for bit, (at, limit) in enumerate(zip(asked, limits, strict=True))
                         if one[at] > limit)]
                for asked, limits, says in zip(trees.feature, trees.limit, trees.says, strict=True)
            )
            for one in features
        ]
    )  # fmt: skip


@given(st.integers(1, 6), st.integers(0, 5), st.integers(1, 4), st.integers(0, 9), st.integers(0, 99))
def test_trees_say_what_their_leaves_add_up_to(
    features: int, trees: int, depth: int, many: int, seed: int
) -> None:
    """A feature that is just the limit is not above it."""
    rng = np.random.default_rng(seed)
    made = made_trees(rng, features, trees, depth)
    values = np.where(rng.random((many, features)) < 0.4, rng.integers(-1, 2, (many, features)), 1.5)
    values += 0.5 * (rng.random(values.shape) < 0.3)
    np.testing.assert_allclose(made.log_odds(values), plain_log_odds(made, values), rtol=1e-12, atol=1e-12)
    turned = np.asfortranarray(values)
    np.testing.assert_array_equal(made.log_odds(turned), made.log_odds(values))


@given(st.integers(1, 30), st.sampled_from([LATE_SIGNS, SIGNS]), st.integers(0, 99))
def test_running_means_are_those_of_a_whole_drive(images: int, signs: int, seed: int) -> None:
    """Image by image or all at once, whatever the images weigh, nothing or much."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(images, signs))
    weights = rng.choice([0.0, 0.3, 1.0, 1.5], images)
    running = Means(signs)
    each = np.array([running.add(one, weight) for one, weight in zip(values, weights, strict=True)])
    whole = means_of(values, weights, SPANS)
    assert whole.shape == (images, signs * len(SPANS) + 1)
    np.testing.assert_allclose(each, whole, rtol=1e-9, atol=1e-12)


def test_a_mean_is_over_its_span() -> None:
    """The sum that it is said to be, in closed form: what lies a span back counts 1 / e as much."""
    values, weights = np.random.default_rng(0).normal(size=(12, 2)), np.ones(12)
    weights[3] = 4.0  # counts for one
    back = np.arange(12)[::-1]
    shares = np.exp(-back[:, None] / SPANS)
    wanted = (values[:, :, None] * shares[:, None]).sum(axis=0) / shares.sum(axis=0)
    *means, seen = means_of(values, weights, SPANS)[-1]
    found = np.reshape(means, (2, len(SPANS)))
    assert seen == pytest.approx(shares[:, -1].sum(), rel=1e-6)
    np.testing.assert_allclose(found, wanted, rtol=1e-6)
    np.testing.assert_allclose(found[:, 0], values[-1])  # the shortest span: the image alone
    ahead = means_ahead(values, weights)[0, :-1].reshape(2, len(SPANS) - 1)
    shares = shares[::-1, 1:]
    np.testing.assert_allclose(
        ahead, (values[:, :, None] * shares[:, None]).sum(axis=0) / shares.sum(axis=0), rtol=1e-6
    )


def test_signs_are_what_they_are_called() -> None:
    read = np.array([0.7, 5.0, 2.0, 4.0, 12.0])
    wanted = [5.0, 3.0, np.log((0.7 + TINY) / (0.3 + TINY)), 4.0, np.log(13.0)]
    assert signs_of(read) == pytest.approx(np.array(wanted))
    assert signs_of(read).shape == (LATE_SIGNS,)
    speeds = np.array([0.1, 0.2, 0.3, 0.4])
    assert signs_of(read, speeds)[:LATE_SIGNS] == pytest.approx(np.array(wanted))


def test_signs_stay_in_bounds() -> None:
    """Whatever a score or a belief may be."""
    most, least = np.array([1.1, 90.0, -90.0, 90.0, 0.0]), np.array([-0.1, -90.0, 90.0, -90.0, 0.0])
    sure = np.log((1 + TINY) / TINY)
    assert signs_of(most) == pytest.approx(np.array([12.0, 8.0, sure, 12.0, 0.0]))
    assert signs_of(least) == pytest.approx(np.array([-1.0, -6.0, -sure, -1.0, 0.0]))


def test_the_last_sign_is_how_sure_the_speed_is() -> None:
    """The entropy of the belief in each class, whatever its sum."""
    read, one = np.array([0.5, 1.0, 1.0, 1.0, 1.0]), np.eye(len(SPEEDS))[2]
    shares = np.array([0.5, 0.25, 0.125, 0.125])
    assert signs_of(read, 7 * shares).shape == (SIGNS,)
    assert signs_of(read, 7 * shares)[-1] == pytest.approx(1.75 * np.log(2), abs=1e-6)
    assert signs_of(read, np.ones(len(SPEEDS)))[-1] == pytest.approx(np.log(len(SPEEDS)), abs=1e-6)
    assert signs_of(read, one)[-1] == pytest.approx(0.0, abs=1e-6)
    assert np.isfinite(signs_of(read, np.zeros(len(SPEEDS)))).all()


def made_judges(seed: int, features: int) -> Judges:
    rng = np.random.default_rng(seed)
    return Judges(made_trees(rng, features), rng.normal(size=1 + features), np.zeros((2, len(ASKED))))


@pytest.fixture
def judged(monkeypatch: pytest.MonkeyPatch) -> tuple[Judges, Judges]:
    """Some weights of live answers and of late ones."""
    both = made_judges(1, LIVE_FEATURES), made_judges(2, LATE_FEATURES)
    monkeypatch.setattr(_known, "judges", lambda: both)
    return both


@pytest.mark.parametrize("late", [False, True])
def test_each_image_is_judged_by_trees_or_by_the_regression(
    judged: tuple[Judges, Judges], late: bool
) -> None:
    """Whichever camera it is of; live and late answers each by their own."""
    quick, slow, _ = judged[late]
    features = np.random.default_rng(3).normal(size=(9, len(slow) - 1))
    is_slow = np.arange(9) % 3 == 0
    log_odds = np.where(is_slow, slow[0] + features @ slow[1:], quick.log_odds(features))
    wanted = 1 / (1 + np.exp(-log_odds))
    np.testing.assert_allclose(probability(features, is_slow), wanted)
    for flag in (False, True):
        alone = [probability(one[None], flag)[0] for one in features]
        np.testing.assert_allclose(np.array(alone)[is_slow == flag], wanted[is_slow == flag])
    np.testing.assert_allclose(said(judged[late], features, is_slow), wanted)


def test_features_are_as_many_as_the_shipped_weights() -> None:
    """And each question of a tree is about one of them, each of its leaves says something finite."""
    rng = np.random.default_rng(0)
    live, late, weights = rng.normal(size=(7, SIGNS)), rng.normal(size=(7, LATE_SIGNS)), np.ones(7)
    _known.judges.cache_clear()
    made = of_live(live, weights), of_late(late, live, weights)
    assert [one.shape[1] for one in made] == [LIVE_FEATURES, LATE_FEATURES]
    for judges, features in zip(_known.judges(), made, strict=True):
        trees = judges.quick
        assert judges.slow.shape == (1 + features.shape[1],)
        assert trees.feature.shape == trees.limit.shape
        assert trees.says.shape == (len(trees.feature), 2 ** trees.feature.shape[1])
        assert 0 <= trees.feature.min() <= trees.feature.max() < features.shape[1]
        assert all(np.isfinite(one).all() for one in (trees.start, trees.limit, trees.says, judges.slow))
        for slow in (False, True):
            found = probability(features, slow)
            assert ((found > 0) & (found < 1)).all()


def test_the_shipped_file_is_as_small_as_it_says() -> None:
    """Live and late answers and no more; few digits, since the package carries it."""
    held = json.loads(_known.WEIGHTS.read_text())
    assert held.pop("format") == "evplace-known-2"
    assert set(held) == {"live", "late"}
    assert all(set(one) == {"start", "feature", "limit", "says", "slow", "usual"} for one in held.values())
    assert _known.WEIGHTS.stat().st_size < 200_000


@pytest.mark.parametrize("slow", [False, True])
def test_a_limit_lies_halfway_between_the_map_and_other_towns(slow: bool) -> None:
    """By the log-odds; where the map has never said anything, or is sure, it is still a probability."""
    by = made_judges(0, LIVE_FEATURES)._replace(usual=np.stack([-np.log(ASKED), -2 * np.log(ASKED)]))
    unknown = np.linspace(0, 1, 1001)
    for asked in (1e-4, 0.01, 0.02, 0.5):
        own, other = np.quantile(unknown, 1 - asked), -(1 + slow) * np.log(asked)
        found = limit(unknown, by, slow, asked)
        assert np.log(found / (1 - found)) == pytest.approx((np.log(own / (1 - own)) + other) / 2)
    assert 0 < limit(np.zeros(5), by, slow, 0.01) < limit(np.ones(5), by, slow, 0.01) < 1
    limits = [limit(unknown, by, slow, asked) for asked in (0.3, 0.1, 0.03, 0.01, 0.003, 0.0002)]
    assert limits == sorted(limits)


def test_other_towns_need_more_the_less_is_asked_for() -> None:
    for judges in _known.judges():
        assert (np.diff(judges.usual, axis=1) <= 0).all()
        assert judges.usual.shape == (2, len(ASKED))
