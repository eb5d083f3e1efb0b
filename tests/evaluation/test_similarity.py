"""The matrix of similarities that a result keeps to look at."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evplace.core.errors import EvaluationError
from evplace.evaluation import Result
from evplace.evaluation._evaluate import evaluate
from evplace.evaluation._similarity import MOST, similarities
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import train
from evplace.places import PlaceGrid


def test_what_stands_out_in_its_row_is_bright_however_rows_are_scaled() -> None:
    rng = np.random.default_rng(0)
    scores = rng.normal(size=(1000, 700)).astype(np.float32)
    scores[np.arange(1000), np.arange(1000) * 7 // 10] += 12
    scores *= rng.uniform(0.1, 10, (1000, 1))
    scores[500] = 0
    shown = similarities(scores)
    assert shown is not None
    assert shown.shape == (MOST[0], MOST[1])
    at = np.argmax(shown, axis=1)
    wanted = np.linspace(0, MOST[1] - 1, MOST[0])
    assert np.median(np.abs(at - wanted)) <= 1
    assert shown.max() == 255
    small = similarities(np.zeros((3, 2), np.float32))
    assert small is not None
    assert small.tolist() == [[0, 0]] * 3
    assert similarities(np.zeros((0, 5), np.float32)) is None


def test_a_result_keeps_it(day: Traverse, night: Traverse, places: PlaceGrid, tmp_path: Path) -> None:
    result = evaluate(Localizer(train(day, places, "ncc")), night)
    assert result.similarity is not None
    result.save(tmp_path / "night.result")
    kept = Result.load(tmp_path / "night.result").similarity
    assert kept is not None
    np.testing.assert_array_equal(kept, result.similarity)
    np.save(tmp_path / "night.result" / "similarity.npy", np.zeros(3))
    with pytest.raises(EvaluationError, match="similarity"):
        Result.load(tmp_path / "night.result")
