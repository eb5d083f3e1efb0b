"""Live drives of any length in flat memory: what is forgotten, and that no later step misses it."""

from __future__ import annotations

import errno
import io

import numpy as np
import pytest

from evplace.core.errors import InputError
from evplace.matchers import Answer, Rows, _kept, _rows, open_matcher

MATCHERS = ["best", "local", "seqslam", "hmm", "dp", "graph", "bayes"]
ITEMS, QUERIES = 30, 60


def drive(queries: int = QUERIES) -> Rows:
    """A query that passes the map's items again and again."""
    rows = np.random.default_rng(0).uniform(0.05, 0.5, (queries, ITEMS))
    rows[np.arange(queries), np.arange(queries) % ITEMS] = 0.995
    return rows.astype(np.float32)


@pytest.fixture
def forgetful(monkeypatch: pytest.MonkeyPatch) -> None:
    """A live drive keeps three rows and two answers."""
    monkeypatch.setattr(_kept, "LIVE_BYTES", 3 * 6 * ITEMS)
    monkeypatch.setattr(_rows, "LIVE_ANSWERS", 2)


def answers(name: str) -> list[Answer | None]:
    matching = open_matcher(name)
    return [matching.step(row) for row in drive()]


@pytest.mark.parametrize("name", MATCHERS)
def test_no_step_needs_what_is_forgotten(name: str, request: pytest.FixtureRequest) -> None:
    remembered = answers(name)
    request.getfixturevalue("forgetful")
    assert repr(answers(name)) == repr(remembered)


@pytest.mark.usefixtures("forgetful")
@pytest.mark.parametrize("name", ["best", "local", "seqslam", "hmm", "dp", "bayes"])
def test_a_path_knows_nothing_of_what_is_forgotten(name: str) -> None:
    live, whole = open_matcher(name), open_matcher(name)
    whole.extend(drive())
    for row in drive():
        live.step(row)
    path, complete = live.path(), whole.path()
    old = QUERIES - 18
    assert len(path.item) == QUERIES
    assert (path.item[:old] == -1).all()
    assert not path.accepted[:old].any()
    assert np.isnan(path.score[:old]).all()
    assert (complete.item[old - 5 : -7] >= 0).any()
    if name in ("best", "local", "dp"):
        np.testing.assert_array_equal(path.item[-2:], complete.item[-2:])


def test_what_is_given_in_blocks_is_kept_whole(forgetful: None) -> None:
    for name in MATCHERS:
        matching = open_matcher(name)
        matching.extend(drive())
        assert (matching.path().item[10:-10] >= 0).any(), name
        assert (matching.path().item[10:20] >= 0).any(), name


@pytest.mark.parametrize("alpha", [0.1, 0.7])
def test_the_graph_forgets_nodes_that_nothing_reaches(alpha: float) -> None:
    """The same answers as one that forgets none, and no more nodes after many queries than after some."""
    live, whole = (open_matcher("graph", memory=20, alpha=alpha) for _ in range(2))
    rows, sizes = drive(3000), []
    for row in rows:
        answer = live.step(row)
        whole.extend(row[None])
        node = whole._nodes[whole._state[3]]
        assert answer == Answer(int(node["query"]), int(node["item"]), -float(node["own"]), answer.accepted)
        sizes.append(len(live._nodes))
    assert sizes[-1] == sizes[500] < len(whole._nodes)
    path, complete = live.path(), whole.path()
    known = path.item >= 0
    assert not known[0]
    assert known[-20:].all()
    np.testing.assert_array_equal(path.item[known], complete.item[known])


@pytest.mark.parametrize("name", ["hmm", "dp", "bayes"])
@pytest.mark.parametrize("held", [0, 2000])
def test_a_path_through_what_lies_in_a_file_is_the_same(
    name: str, held: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def path() -> str:
        matching = open_matcher(name)
        for start in range(0, QUERIES, 7):
            matching.extend(drive()[start : start + 7])
        return repr(matching.path())

    wanted = path()
    monkeypatch.setattr(_kept, "MEMORY_BYTES", held)
    assert path() == wanted


class Full(io.BytesIO):
    """A file on a full disk."""

    def write(self, _: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_kept, "MEMORY_BYTES", 0)
    monkeypatch.setattr(_kept.tempfile, "TemporaryFile", Full)
    with pytest.raises(InputError, match=r"does not fit into .*No space left"):
        open_matcher("dp").extend(drive())
