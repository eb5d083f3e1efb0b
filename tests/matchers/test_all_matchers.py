"""What holds for every matcher."""

from __future__ import annotations

import numpy as np
import pytest

from evplace.core import families
from evplace.core.errors import ScoresError, SettingsError
from evplace.matchers import open_matcher
from evplace.testing import check_matcher

NAMES = families.names("matchers")
PRESETS = [(name, preset) for name in NAMES for preset in [None, *families.load("matchers", name).presets]]


def test_all_are_there() -> None:
    assert {"best", "local", "seqslam", "graph", "dp", "hmm"} <= set(NAMES)


@pytest.mark.parametrize(("name", "preset"), PRESETS)
def test_each_meets_the_contract(name, preset) -> None:
    check_matcher(families.make("matchers", name, preset))


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
def test_words_are_no_scores(name) -> None:
    with pytest.raises(ScoresError, match="scores are real numbers"):
        open_matcher(name).extend(np.array([["a"]]))


@pytest.mark.parametrize("name", NAMES)
def test_unknown_settings_and_presets_are_refused(name) -> None:
    with pytest.raises(SettingsError, match="unknown setting"):
        open_matcher(name, colour="red")
    with pytest.raises(SettingsError, match="has no preset 'papr'"):
        open_matcher(name, "papr")
