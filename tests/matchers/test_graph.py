from __future__ import annotations

import heapq

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evplace.core.errors import ScoresError, SettingsError
from evplace.matchers import Path, open_matcher


class PlainGraph:
    """The same search in plain Python, which walks the whole path whenever it wants the mean."""

    def __init__(self, costs, K, alpha, m, relocalise) -> None:
        self.costs, self.K, self.alpha, self.m, self.relocalise = costs, K, alpha, m, relocalise
        self.parent, self.acc, self.heap = {}, {(-1, 0): 0.0}, []
        self.best = (-1, 0)

    def path(self, node):
        nodes = []
        while node[0] >= 0:
            nodes.append(node)
            node = self.parent[node]
        return nodes

    def lost(self, q) -> bool:
        if self.relocalise == "none":
            return False
        last = self.path(self.best)[:5]
        return q == 0 or (len(last) == 5 and all(self.costs[n] > self.m for n in last))

    def worth(self, n) -> bool:
        if n == self.best:
            return True
        mean = np.mean([self.costs[p] for p in self.path(self.best)])
        ahead = (self.best[0] - n[0]) * mean * self.alpha
        return self.acc[n] + ahead < self.acc[self.best]

    def expand(self, n, items) -> None:
        children = [(n[0] + 1, r) for r in items]
        for child in children:
            if child not in self.parent:
                self.parent[child], self.acc[child] = n, self.acc[n] + self.costs[child]
                heapq.heappush(self.heap, (self.acc[child], child))
        c = min(children, key=lambda child: (self.costs[child], child))
        if c[0] > self.best[0] or (c[0] == self.best[0] and self.acc[c] <= self.acc[self.best]):
            self.best = c

    def take(self, q) -> None:
        items = self.costs.shape[1]
        if self.lost(q):
            low, high = (
                (0, items) if self.relocalise == "all" else (max(0, q - self.K), min(items, q + self.K))
            )
            candidates = [(q, r) for r in range(low, high)] or [(q, self.best[1])]
            child = min(candidates, key=lambda c: (self.costs[c], c))
            self.parent[child] = self.best
            self.acc[child] = self.costs[child] - (0 if q == 0 else 1)
            self.best, self.heap = child, [(self.acc[child], child)]
            return
        if q == 0:
            self.expand((-1, 0), range(items))
            return
        while True:
            _, n = heapq.heappop(self.heap)
            if self.worth(n):
                self.expand(n, range(max(0, n[1] - self.K), min(items, n[1] + self.K + 1)))
                if n[0] == q - 1:
                    return


@settings(max_examples=60)
@given(
    st.integers(1, 6),
    st.sampled_from([0.0, 0.1, 0.3, 0.7, 1.0]),
    st.sampled_from([1.5, 2.5, 5.0]),
    st.sampled_from(["all", "window", "none"]),
    st.integers(1, 30),
    st.integers(1, 40),
    st.integers(0, 9999),
)
def test_equals_the_plain_search(K, alpha, m, relocalise, items, queries, seed) -> None:
    similarities = np.random.default_rng(seed).uniform(0.1, 1, (queries, items))
    graph = open_matcher("graph", K=K, alpha=alpha, m=m, relocalise=relocalise)
    plain = PlainGraph(1 / similarities, K, alpha, m, relocalise)
    for q, row in enumerate(similarities):
        answer = graph.step(row)
        plain.take(q)
        assert (answer.query, answer.item) == plain.best
    assert graph.path().item.tolist() == [r for _, r in reversed(plain.path(plain.best))]
    np.testing.assert_array_equal(
        graph.path().accepted, 1 / similarities[range(queries), graph.path().item] <= m
    )


@settings(max_examples=100)
@given(
    st.integers(1, 4),
    st.sampled_from([0.0, 0.3, 1.0]),
    st.sampled_from(["all", "none"]),
    st.sampled_from([0, 2, 5]),
    st.integers(1, 12),
    st.integers(0, 9999),
)
def test_ties_and_impossible_nodes_always_give_a_path_of_allowed_moves(
    K, alpha, relocalise, memory, items, seed
) -> None:
    similarities = np.random.default_rng(seed).integers(0, 3, (30, items)) / 2
    graph = open_matcher("graph", K=K, alpha=alpha, relocalise=relocalise, memory=memory)
    graph.extend(similarities)
    item = graph.path().item
    assert len(item) == 30
    assert ((item >= 0) & (item < items)).all()
    if relocalise == "none":
        assert (np.abs(np.diff(item)) <= K).all()


def test_a_short_memory_keeps_two_rows_and_long_ones_change_nothing() -> None:
    similarities = np.random.default_rng(3).uniform(0.1, 1, (300, 30))
    paths = []
    for memory in (0, 300, 1000):
        graph = open_matcher("graph", memory=memory, alpha=0.1)
        graph.extend(similarities)
        paths.append(graph.path().item.tolist())
    assert paths[0] == paths[1] == paths[2]
    short = open_matcher("graph", memory=2, alpha=0.1)
    short.extend(similarities)
    assert short._scores.shape == (2, 30)
    assert len(short.path().item) == 300


def test_memory_does_not_grow_with_the_queries_but_for_the_nodes_seen() -> None:
    graph = open_matcher("graph", memory=10, alpha=0.7)
    images = np.random.default_rng(0).normal(size=(400, 20))
    graph.extend(np.exp(-np.abs(images[:, None] - images[None]).mean(2)))
    assert graph._scores.shape == (10, 400)
    assert len(graph._nodes) < 50 * 400


def test_rows_that_are_still_to_come_hold_no_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory that is not yet written holds anything, and nodes are looked up by what rows hold."""
    real = np.empty

    def used(*size: object, **kind: object) -> np.ndarray:
        memory = real(*size, **kind)
        memory.view(np.uint8)[...] = 1
        return memory

    monkeypatch.setattr(np, "empty", used)
    graph = open_matcher("graph", memory=50)
    for row in np.random.default_rng(0).uniform(0.1, 1, (5, 30)):
        graph.step(row)
    assert not graph._grid[5:].any()


def test_similarities_of_0_or_less_never_match() -> None:
    similarities = np.array([[0.9, -1.0, 0.0], [0.0, -0.5, 1e-12], [-0.9, 0.8, 0.0]])
    graph = open_matcher("graph")
    graph.extend(similarities)
    path = graph.path()
    assert path.item.tolist()[::2] == [0, 1]
    assert path.accepted.tolist() == [True, False, True]


def test_negative_distances_are_refused() -> None:
    with pytest.raises(ScoresError, match="distance is negative"):
        open_matcher("graph", distances=True).extend(np.array([[-1.0, 0.5]]))


def test_finds_back_after_five_hidden_queries() -> None:
    at = np.concatenate([np.arange(20), np.arange(60, 90)])
    similarities = 0.2 + 1e-3 * np.random.default_rng(0).uniform(size=(50, 100))
    similarities[np.arange(50), at] = 0.9
    graph = open_matcher("graph")
    graph.extend(similarities)
    item = graph.path().item
    assert (item[:20] == at[:20]).all()
    assert (item[25:] == at[25:]).all()
    stuck = open_matcher("graph", "opr")
    stuck.extend(similarities)
    assert (stuck.path().item[20:27] != at[20:27]).all()


def test_high_looks_at_the_highest_scores() -> None:
    similarities = np.random.default_rng(5).uniform(0.1, 1, (80, 40))
    paths: list[Path] = []
    for way in ("high", "all"):
        graph = open_matcher("graph", relocalise=way, m=1.3)
        graph.extend(similarities)
        paths.append(graph.path())
    np.testing.assert_array_equal(paths[0].item, paths[1].item)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"K": 0}, "at least 1"),
        ({"alpha": 1.5}, "from 0 to 1"),
        ({"alpha": -0.1}, "from 0 to 1"),
        ({"memory": 1}, "at least 2"),
        ({"relocalise": "some"}, "it takes 'all'"),
    ],
)
def test_settings_out_of_range(values, text) -> None:
    with pytest.raises(SettingsError, match=text):
        open_matcher("graph", **values)
