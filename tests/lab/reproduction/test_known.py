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
    (row,) = known._judged(drives, 1)
    assert (row["town"], row["query"]) == (1, "night-1")
    one = drives[0].answers
    accepted = (known._fitted(drives[1:], "live")[1:] @ one.features["live"].T) > 0
    assert row["live"]["accuracy"] < 50  # the other town's weights point the other way
    assert row["live"]["false_accepts"] == pytest.approx(100 * accepted[~one.known].mean(), abs=2)


def test_settings_of_a_training_mean_nothing(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="nothing is trained for 'known': leave out steps"):
        known.document(tmp_path, Choice(train={"steps": 3}), 1, None)
