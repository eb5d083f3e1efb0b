from __future__ import annotations

import numpy as np
import pytest

from evplace.core.errors import SettingsError
from evplace.core.families import make
from evplace.evaluation.sweeps import sweep
from evplace.matchers import open_matcher


def scene(seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    scores = rng.uniform(0.05, 0.5, (60, 50)).astype(np.float32)
    at = np.clip(np.arange(60) - 5, 0, 49)
    scores[np.arange(60), at] += rng.uniform(0, 0.5, 60).astype(np.float32)
    return scores


CASES = [
    ("best", "threshold", {}),
    ("local", "tau1", {}),
    ("local", "tau2", {"K": 2}),
    ("seqslam", "mu", {"ds": 5}),
    ("seqslam", "threshold", {"ds": 5}),
    ("graph", "m", {"relocalise": "none"}),
    ("graph", "m", {"relocalise": "all"}),
    ("dp", "m", {}),
    ("hmm", "threshold", {}),
]


@pytest.mark.parametrize(("name", "parameter", "others"), CASES)
@pytest.mark.parametrize("distances", [False, True])
def test_every_point_is_what_the_matcher_answers_there(name, parameter, others, distances) -> None:
    scores = scene() - 1 if distances else scene()
    points = list(
        sweep(make("matchers", name, values=others), scores, None, parameter, distances, "hindsight")
    )
    assert len(points) > 10
    if parameter == "threshold" and name == "seqslam":
        others = {**others, "selection": "threshold"}
    for value, path in points[:: max(1, len(points) // 7)]:
        matcher = open_matcher(name, distances=distances, **others, **{parameter: float(value)})
        matcher.extend(scores)
        for ours, theirs in zip(path, matcher.path(), strict=True):
            np.testing.assert_array_equal(ours, theirs, f"{name} at {parameter} = {value}")


def test_the_last_point_accepts_all_that_was_found() -> None:
    for name in ("best", "seqslam", "dp", "hmm"):
        *_, (_, path) = sweep(make("matchers", name), scene())
        np.testing.assert_array_equal(path.accepted, np.isfinite(path.score))


def test_given_values_are_kept_in_their_order() -> None:
    assert [value for value, _ in sweep(make("matchers", "local"), scene(), [0.9, 0.1, 0.5])] == [
        0.9,
        0.1,
        0.5,
    ]


def test_each_matcher_says_what_its_curve_is_drawn_over() -> None:
    usual = {name: make("matchers", name).sweep().parameter for name in ("best", "local", "seqslam", "graph")}
    assert usual == {"best": "threshold", "local": "tau1", "seqslam": "mu", "graph": "m"}


def test_any_setting_can_be_swept_with_a_run_for_each_value() -> None:
    for _, path in sweep(make("matchers", "hmm"), scene(), [0.5, 0.9], "steady"):
        assert len(path.item) == 60
    with pytest.raises(SettingsError, match="unknown setting 'tau3'"):
        list(sweep(make("matchers", "best"), scene(), [1.0], "tau3"))
