from __future__ import annotations

import numpy as np
import pytest

from evplace.core.errors import ScoresError
from evplace.matchers import Path, open_matcher


def test_takes_the_largest_and_the_lowest_among_equals() -> None:
    rows = np.random.default_rng(0).integers(0, 9, (50, 12)).astype(np.float32)
    matcher = open_matcher("best")
    steps = Path.of([matcher.step(row) for row in rows])
    np.testing.assert_array_equal(steps.item, rows.argmax(1))
    np.testing.assert_array_equal(steps.score, rows.max(1))
    assert steps.accepted.all()


def test_threshold_is_strict_and_keeps_the_candidate() -> None:
    matcher = open_matcher("best", threshold=2)
    matcher.extend(np.array([[0.0, 2.0], [3.0, 1.0]]))
    path = matcher.path()
    assert path.item.tolist() == [1, 0]
    assert path.accepted.tolist() == [False, True]


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        (np.zeros((3, 0)), "no item"),
        (np.zeros((2, 2, 2)), "shape"),
        (np.array([[1.0, np.nan]]), "query 0 and item 1 is nan"),
        (np.array([[1.0, 2.0], [-np.inf, 0.0]]), "query 1 and item 0 is -inf"),
        (np.array([[None, 1]], dtype=object), "real numbers"),
    ],
)
def test_bad_rows_are_refused(rows, text) -> None:
    with pytest.raises(ScoresError, match=text):
        open_matcher("best").extend(rows)


def test_rows_of_another_length_are_refused() -> None:
    matcher = open_matcher("best")
    matcher.extend(np.zeros((4, 3)))
    with pytest.raises(ScoresError, match="query 4 has 5 scores, those before it 3"):
        matcher.extend(np.zeros((1, 5)))
