from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evplace.core.errors import SettingsError
from evplace.matchers import open_matcher
from evplace.matchers._viterbi import Viterbi
from evplace.matchers.hmm import HMM, log_odds, moving_mean, without_leading


def plain_viterbi(gains, low, moves, jump) -> list[int]:
    """The best path by looking at every parent of every cell."""
    queries, items = gains.shape
    total, parents = gains[0].copy(), []
    for q in range(1, queries):
        before, total, row = total, np.empty(items), []
        for r in range(items):
            steps = [(p, r - p - low) for p in range(items)]
            near = [(before[p] + moves[step], -p) for p, step in steps if 0 <= step < len(moves)]
            best = max(near, default=(-np.inf, 0))
            leap = (before.max() + jump, -int(before.argmax()))
            best = leap if leap[0] > best[0] else best
            total[r] = best[0] + gains[q, r]
            row.append(-best[1])
        parents.append(row)
    path = [int(total.argmax())]
    for row in reversed(parents):
        path.append(row[path[-1]])
    return path[::-1]


@settings(max_examples=80)
@given(
    st.integers(1, 12),
    st.integers(1, 14),
    st.integers(-4, 3),
    st.integers(0, 5),
    st.sampled_from([-np.inf, -3.0, -0.5]),
    st.integers(0, 9999),
    st.booleans(),
)
def test_equals_the_plain_search(queries, items, low, spread, jump, seed, ties) -> None:
    rng = np.random.default_rng(seed)
    gains = rng.integers(0, 4, (queries, items)) * 1.0 if ties else rng.normal(size=(queries, items))
    if np.isinf(jump) and not low <= 0 <= low + spread:
        jump = -9.0
    moves = rng.integers(-3, 0, spread + 1) * 0.25
    search = Viterbi(low, moves, jump)
    search.extend(gains)
    assert search.trace().tolist() == plain_viterbi(gains, low, moves, jump)


@given(st.integers(2, 5), st.integers(2, 5), st.integers(0, 999))
def test_full_search_finds_the_cheapest_of_all_paths(queries, items, seed) -> None:
    similarities = np.random.default_rng(seed).uniform(0.1, 1, (queries, items))
    search = open_matcher("dp", K=2)
    search.extend(similarities)
    costs = 1 / similarities
    paths = [p for p in itertools.product(range(items), repeat=queries) if (np.abs(np.diff(p)) <= 2).all()]
    best = min(paths, key=lambda p: sum(costs[q, r] for q, r in enumerate(p)))
    assert search.path().item.tolist() == list(best)


@given(st.integers(1, 30), st.integers(1, 30), st.integers(1, 6), st.integers(0, 999))
def test_reversing_both_drives_reverses_the_path(queries, items, K, seed) -> None:
    similarities = np.random.default_rng(seed).uniform(0.1, 1, (queries, items))
    ahead, back = open_matcher("dp", K=K), open_matcher("dp", K=K)
    ahead.extend(similarities)
    back.extend(similarities[::-1, ::-1])
    np.testing.assert_array_equal(ahead.path().item, items - 1 - back.path().item[::-1])


def test_full_search_costs_no_more_than_the_graph() -> None:
    similarities = np.random.default_rng(0).uniform(0.1, 1, (100, 80))
    sums = {}
    for name, others in (("dp", {}), ("graph", {"relocalise": "none", "alpha": 0.0})):
        matcher = open_matcher(name, **others)
        matcher.extend(similarities)
        sums[name] = -matcher.path().score.sum()
    assert sums["dp"] <= sums["graph"] + 1e-9


def drive(jump_at: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Distances of a noisy drive that jumps once, and where it truly is."""
    rng = np.random.default_rng(2)
    at = np.concatenate([np.arange(jump_at), 20 + np.arange(jump_at, 90)])
    references = rng.normal(size=(120, 40))
    queries = references[at] + rng.normal(size=(90, 40)) * 1.2
    return np.abs(queries[:, None] - references[None]).mean(2), at


@pytest.mark.parametrize("emission", ["contrast", "softmax"])
@pytest.mark.parametrize("drop", [0, 1])
def test_hmm_follows_a_drive_and_its_jump(emission, drop) -> None:
    distances, at = drive()
    model = open_matcher(
        "hmm", emission=emission, drop=drop, temperature=0.5 if emission == "contrast" else 0.1
    )
    model.extend(-distances)
    path = model.path()
    assert (np.abs(path.item - at) <= 1).mean() > 0.9
    assert path.accepted.mean() > 0.9


def test_hmm_is_told_of_another_speed() -> None:
    distances = drive(jump_at=90)[0][::2]
    model = open_matcher("hmm", speed=2.0)
    model.extend(-distances)
    assert (np.abs(model.path().item - 2 * np.arange(45)) <= 1).mean() > 0.9


def test_hmm_takes_the_networks_probabilities() -> None:
    p = np.random.default_rng(0).dirichlet(np.full(30, 0.1), 50)
    odds = log_odds(p, HMM(emission="probabilities"))
    np.testing.assert_allclose(odds, np.log(np.maximum(p, 1e-12) * 30), rtol=1e-5)
    soft = log_odds(p, HMM(emission="softmax"))
    np.testing.assert_allclose(np.exp(soft).mean(1), 1, rtol=1e-5)


def test_without_leading_takes_out_the_largest_components() -> None:
    matrix = np.random.default_rng(0).normal(size=(30, 20)).astype(np.float32) + 3
    left, values, right = np.linalg.svd(matrix, full_matrices=False)
    values[:1] = 0
    np.testing.assert_allclose(without_leading(matrix, 1), (left * values) @ right, atol=1e-3)
    assert without_leading(matrix, 0) is matrix


def test_moving_mean_is_shorter_at_the_ends() -> None:
    assert moving_mean(np.arange(5.0), 3).tolist() == [0.5, 1, 2, 3, 3.5]
    assert moving_mean(np.arange(2.0), 15).tolist() == [0.5, 0.5]


@pytest.mark.parametrize(
    ("name", "values", "text"),
    [
        ("dp", {"K": 0}, "from 1 to"),
        ("dp", {"K": 40000}, "from 1 to"),
        ("hmm", {"v_min": 4}, "v_min <= v_max"),
        ("hmm", {"jump": 0.0}, "no probability"),
        ("hmm", {"speed": 4.0}, "between v_min and v_max"),
        ("hmm", {"steady": 1.5}, "no probability"),
        ("hmm", {"temperature": 0.0}, "temperature above 0"),
        ("hmm", {"R": 3}, "even number"),
    ],
)
def test_settings_out_of_range(name, values, text) -> None:
    with pytest.raises(SettingsError, match=text):
        open_matcher(name, **values)
