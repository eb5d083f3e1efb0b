"""What holds for every matcher."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evplace.core import families
from evplace.core.errors import ScoresError, SettingsError
from evplace.core.settings import to_dict
from evplace.matchers import Path, open_matcher

NAMES = families.names("matchers")
PRESETS = [(name, preset) for name in NAMES for preset in [None, *families.load("matchers", name).PRESETS]]


def assert_same(one: Path, other: Path) -> None:
    for ours, theirs in zip(one, other, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_all_are_there() -> None:
    assert {"best", "local", "seqslam", "graph", "dp", "hmm"} <= set(NAMES)


@pytest.mark.parametrize(("name", "preset"), PRESETS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@settings(max_examples=12)
@given(
    seed=st.integers(0, 99),
    queries=st.integers(0, 60),
    items=st.integers(1, 40),
    block=st.integers(1, 23),
    distances=st.booleans(),
)
def test_packets_of_any_size_give_the_same_answers(
    name, preset, dtype, seed, queries, items, block, distances
) -> None:
    scores = np.random.default_rng(seed).uniform(0, 1, (queries, items)).astype(dtype)
    scores = -scores if distances else scores
    whole = open_matcher(name, preset, distances)
    whole.extend(scores)
    pieces = open_matcher(name, preset, distances)
    for start in range(0, queries, block):
        pieces.extend(scores[start : start + block])
    assert_same(whole.path(), pieces.path())
    single = open_matcher(name, preset, distances)
    answers = [single.step(row) for row in scores]
    assert_same(whole.path(), single.path())
    assert all(a.query <= i for i, a in enumerate(answers) if a is not None)
    path = whole.path()
    assert len(path.item) == len(path.score) == len(path.accepted) == queries
    assert ((path.item >= -1) & (path.item < items)).all()
    assert not path.accepted[path.item < 0].any()


@pytest.mark.parametrize(("name", "preset"), PRESETS)
def test_a_query_equal_to_the_reference_is_matched_to_itself(name, preset) -> None:
    images = np.random.default_rng(0).normal(size=(60, 30))
    distances = np.abs(images[:, None] - images[None]).mean(2)
    matcher = open_matcher(name, preset, distances=True, **({"tau1": -0.5} if name == "local" else {}))
    matcher.extend(-distances)
    path = matcher.path()
    answered = path.item >= 0
    assert answered.sum() >= 46  # SeqSLAM has no answer at the two ends
    np.testing.assert_array_equal(path.item[answered], np.flatnonzero(answered))
    assert path.accepted[answered].mean() > 0.9


@pytest.mark.parametrize(("name", "preset"), PRESETS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_scores_that_are_not_finite_are_refused(name, preset, bad) -> None:
    scores = np.full((4, 3), 0.5)
    scores[2, 1] = bad
    matcher = open_matcher(name, preset)
    with pytest.raises(ScoresError, match="query 2 and item 1 is"):
        matcher.extend(scores)
    stepped = open_matcher(name, preset)
    stepped.step(scores[0])
    with pytest.raises(ScoresError, match="query 1 and item 1 is"):
        stepped.step(scores[2])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bad", [np.zeros((3, 0)), np.zeros(4), np.zeros((1, 2, 2)), np.array([["a"]])])
def test_what_is_no_table_of_scores_is_refused(name, bad) -> None:
    with pytest.raises(ScoresError):
        open_matcher(name).extend(bad)
    with pytest.raises(ScoresError):
        open_matcher(name).step(np.zeros(0))


@pytest.mark.parametrize(("name", "preset"), PRESETS)
def test_one_reference_and_ties_are_answered(name, preset) -> None:
    for items in (1, 40):
        matcher = open_matcher(name, preset)
        matcher.extend(np.full((40, items), 0.5))
        again = open_matcher(name, preset)
        again.extend(np.full((40, items), 0.5))
        assert_same(matcher.path(), again.path())
        assert set(matcher.path().item[:1]) <= {-1, 0}


@pytest.mark.parametrize("name", NAMES)
def test_settings_are_saved_and_unknown_ones_refused(name) -> None:
    module = families.load("matchers", name)
    assert module.Settings(**to_dict(module.Settings())) == module.Settings()
    with pytest.raises(SettingsError, match="unknown setting"):
        open_matcher(name, colour="red")
    with pytest.raises(SettingsError, match="has no preset 'papr'"):
        open_matcher(name, "papr")
