from __future__ import annotations

import numpy as np
import pytest

from evplace.core.errors import SettingsError
from evplace.evaluation.sweeps import SWEPT, sweep
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
    points = list(sweep(name, scores, None, parameter, distances=distances, **others))
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
        *_, (_, path) = sweep(name, scene())
        np.testing.assert_array_equal(path.accepted, np.isfinite(path.score))


def test_given_values_are_kept_in_their_order() -> None:
    assert [value for value, _ in sweep("local", scene(), [0.9, 0.1, 0.5])] == [0.9, 0.1, 0.5]


def test_every_matcher_but_new_ones_has_a_parameter() -> None:
    assert SWEPT["graph"] == "m"
    with pytest.raises(SettingsError, match="unknown setting 'tau3'"):
        list(sweep("best", scene(), tau3=1))
    with pytest.raises(SettingsError, match="none of the matchers"):
        list(sweep("bst", scene()))
