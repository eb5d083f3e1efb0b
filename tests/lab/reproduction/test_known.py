"""The fit of the weights by which `bayes` tells right answers from wrong ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evplace.core.errors import SettingsError
from evplace_lab.reproduction import Choice, known


def drive(town: int, seed: int, weights: list[float]) -> known.Drive:
    """Answers that are right with the probability that these weights say."""
    rng = np.random.default_rng(seed)
    features = rng.standard_normal((20_000, len(weights) - 1)) * [1.0, 3.0] + [0.5, -2.0]
    right = rng.random(len(features)) < 1 / (1 + np.exp(-(weights[0] + features @ weights[1:])))
    both = {"live": features, "late": features}
    answers = known.Answers(both, {"live": right, "late": right}, rng.random(len(right)) < 0.7)
    return known.Drive(town, "ideal", "night-1", whole=True, answers=answers)


def test_the_weights_are_found_that_the_answers_follow() -> None:
    wanted = [-0.4, 1.5, -0.5]
    np.testing.assert_allclose(known._fitted([drive(1, 0, wanted)], "live"), wanted, atol=0.08)


def test_a_town_is_judged_by_the_weights_of_the_others() -> None:
    drives = [drive(1, 0, [0.0, 2.0, 0.0]), drive(2, 1, [0.0, -2.0, 0.0])]
    features = np.random.default_rng(2).standard_normal((5000, 2)) * [1.0, 3.0] + [0.5, -2.0]
    own = known.Own(1, "ideal", {"live": features, "late": features})
    (row,) = known._judged(drives, [own], 1)
    assert (row["town"], row["sensor"], row["query"]) == (1, "ideal", "night-1")
    weights = known._fitted(drives[1:], "live")
    assert weights[1] < 0  # the other town's weights point the other way
    one = drives[0].answers
    said = known._said(one.features["live"], weights)
    limit = np.quantile(known._said(features, weights), 0.99)
    accepted = said > limit
    good = np.where(one.known, one.right["live"] & accepted, ~accepted)
    assert row["live"]["the map"]["accuracy"] == pytest.approx(100 * good.mean())
    assert row["live"]["the map"]["false_accepts"] == pytest.approx(100 * accepted[~one.known].mean())
    assert row["live"]["the map"]["false_accepts"] == pytest.approx(1, abs=0.5)


def test_halfway_lies_between_the_map_and_other_towns() -> None:
    drives = [drive(1, 0, [0.0, 2.0, 0.0]), drive(2, 1, [0.0, 2.0, 0.0])]
    sure = known.Own(1, "ideal", dict.fromkeys(known.KINDS, np.full((200, 2), 3.0)))
    limits = known._thresholds(sure, drives[1:], "late", known._fitted(drives[1:], "late"))
    assert limits["other towns"] < limits["halfway"] < limits["the map"]


def test_settings_of_a_training_mean_nothing(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="nothing is trained for 'known': leave out steps"):
        known.document(tmp_path, Choice(train={"steps": 3}), 1, None)
