from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace.core.errors import SettingsError
from evplace.matchers import Path, open_matcher
from evplace.matchers.local import Local


def algorithm_1(p: np.ndarray, s: Local) -> list[int]:
    """The paper's listing, line by line, with the readings of the settings."""
    match: list[int] = []
    centre = -1
    for i, row in enumerate(p):
        if i == 0 and s.first == "argmax":
            match.append(int(row.argmax()))
        else:
            ahead = s.K + 1 if s.window == "inclusive" else s.K
            window = [j for j in range(centre - s.K, centre + ahead) if s.wrap or 0 <= j < len(row)]
            window = sorted({j % len(row) for j in window}) if centre >= 0 else []
            window = [j for j in window if s.last_item or j != len(row) - 1]
            local = max(window, key=lambda j: (row[j], -j), default=None)
            if local is not None and row[local] > s.tau2:
                match.append(local)
            else:
                match.append(int(row.argmax()) if row.max() > s.tau1 else -1)
        if match[-1] >= 0 or s.lost == "global":
            centre = match[-1]
    return match


SETTINGS = st.builds(
    Local,
    K=st.integers(1, 7),
    tau1=st.sampled_from([0.4, 0.7, 0.9]),
    tau2=st.sampled_from([0.1, 0.5]),
    first=st.sampled_from(["test", "argmax"]),
    lost=st.sampled_from(["global", "keep_last"]),
    window=st.sampled_from(["inclusive", "half_open"]),
    wrap=st.booleans(),
    last_item=st.booleans(),
)


@given(SETTINGS, st.integers(1, 12), st.integers(0, 40), st.integers(0, 1000), st.integers(1, 9))
def test_equals_the_listing_in_blocks_of_any_size(settings, items, queries, seed, block) -> None:
    p = np.random.default_rng(seed).integers(0, 11, (queries, items)) / 10
    ours = settings.start()
    for start in range(0, queries, block):
        ours.extend(p[start : start + block])
    assert ours.path().item.tolist() == algorithm_1(p, settings)
    stepped = settings.start()
    steps = Path.of([stepped.step(row) for row in p])
    for one, other in zip(steps, ours.path(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_follows_a_weak_neighbour_and_then_gets_lost() -> None:
    rows = np.array([[0.995, 0, 0, 0], [0, 0.02, 0, 0.9], [0, 0, 0.005, 0.9], [0, 0, 0, 0.9], [0, 0, 0, 1]])
    ours = open_matcher("local", K=1)
    ours.extend(rows)
    assert ours.path().item.tolist() == [0, 1, -1, -1, 3]
    assert ours.path().score.tolist() == [0.995, 0.02, 0.9, 0.9, 1]


def test_presets() -> None:
    weak = np.full((1, 4), 0.25)
    assert open_matcher("local").step(weak[0]).item == -1
    assert open_matcher("local", preset="paper").step(weak[0]).item == 0
    notebook = open_matcher("local", preset="notebook")
    notebook.extend(np.array([[0, 0, 1.0], [0, 0.0, 0.5]]))
    assert notebook.path().item.tolist() == [2, -1]


def test_an_empty_window_is_refused() -> None:
    with pytest.raises(SettingsError, match="leaves the window empty"):
        open_matcher("local", K=0, window="half_open")
    with pytest.raises(SettingsError, match="leaves the window empty"):
        open_matcher("local", K=-1)
