from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import tyro

from evplace.cli.match import Args, run
from evplace.core.errors import OutputError, ScoresError, SettingsError
from evplace.matchers import open_matcher

SCORES = np.random.default_rng(0).uniform(0.1, 1, (40, 30)).astype(np.float32)


@pytest.fixture
def scores(tmp_path: Path) -> Path:
    path = tmp_path / "scores.npy"
    np.save(path, SCORES)
    return path


def read(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_the_command_of_the_manual(scores, tmp_path, capsys) -> None:
    out = tmp_path / "matches.csv"
    line = f"{scores} --matcher graph --set K=5 --set alpha=0.3 --set m=2.6 --preset isl -o {out} --json"
    assert run(tyro.cli(Args, args=line.split())) == 0
    graph = open_matcher("graph", "isl", K=5, alpha=0.3, m=2.6)
    graph.extend(SCORES)
    rows = read(out)
    assert list(rows[0]) == ["query", "reference", "score", "accepted"]
    assert [int(row["query"]) for row in rows] == list(range(40))
    assert [int(row["reference"]) for row in rows] == graph.path().item.tolist()
    assert [row["accepted"] == "1" for row in rows] == graph.path().accepted.tolist()
    accepted = int(graph.path().accepted.sum())
    assert json.loads(capsys.readouterr().out) == {"queries": 40, "references": 30, "accepted": accepted}


def test_distances_and_no_answer(tmp_path, capsys) -> None:
    table = np.abs(np.arange(30)[:, None] - np.arange(30)[None]) * 5
    np.save(tmp_path / "d.npy", table)
    run(Args(tmp_path / "d.npy", tmp_path / "m.csv", "seqslam", "openseqslam2", (("ds", 5),), distances=True))
    references = [int(row["reference"]) for row in read(tmp_path / "m.csv")]
    assert references == [-1, -1, *range(2, 28), -1, -1]
    assert read(tmp_path / "m.csv")[0]["score"] == "nan"
    assert "of 30 queries matched to 30 references" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (None, "No such file"),
        (b"", r"not a whole \.npy"),
        (b"query,reference\n", r"not a whole \.npy"),
        (np.zeros((2, 2, 2)), r"has \(2, 2, 2\)"),
        (np.zeros((0, 5)), r"has \(0, 5\)"),
        (np.zeros((3, 3), complex), "real numbers"),
        (np.array([[1, None]], object), r"not a whole \.npy"),
        (np.array([[1.0, np.nan]]), "query 0 and item 1 is nan"),
    ],
)
def test_bad_files_leave_no_output(tmp_path, content, text) -> None:
    path = tmp_path / "scores.npy"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        np.save(path, content, allow_pickle=True)
    with pytest.raises(ScoresError, match=text):
        run(Args(path, tmp_path / "m.csv", "best"))
    assert not (tmp_path / "m.csv").exists()


def test_a_file_cut_short_is_refused(scores, tmp_path) -> None:
    scores.write_bytes(scores.read_bytes()[:-7])
    with pytest.raises(ScoresError, match=r"not a whole \.npy"):
        run(Args(scores, tmp_path / "m.csv"))


def test_an_existing_output_is_kept(scores, tmp_path) -> None:
    out = tmp_path / "m.csv"
    out.write_text("mine")
    with pytest.raises(OutputError, match="exists"):
        run(Args(scores, out, "best"))
    assert out.read_text() == "mine"
    assert run(Args(scores, out, "best", overwrite=True)) == 0


def test_unknown_names_are_refused(scores, tmp_path) -> None:
    with pytest.raises(SettingsError, match="none of the matchers"):
        run(Args(scores, tmp_path / "m.csv", "fab-map"))
    with pytest.raises(SettingsError, match="unknown setting 'k'"):
        run(Args(scores, tmp_path / "m.csv", "graph", None, (("k", 5),)))


def street(queries: int = 40, references: int = 60) -> np.ndarray:
    """Distances of a drive along a street, with noise."""
    apart = np.abs(np.arange(queries)[:, None] * references / queries - np.arange(references)[None])
    return np.sqrt(apart) + np.random.default_rng(1).uniform(0.1, 0.5, apart.shape)


def remarks(capsys, *arguments: object) -> list[str]:
    """The remarks of a call that ends well."""
    capsys.readouterr()
    run(tyro.cli(Args, args=[str(argument) for argument in arguments]))
    return capsys.readouterr().err.splitlines()


@pytest.mark.parametrize("shape", [(40, 60), (60, 40), (40, 40), (30, 200), (200, 30)])
def test_the_layout_turns_the_matrix_and_what_was_assumed_is_told(tmp_path, capsys, shape) -> None:
    table = street(*shape)
    np.save(tmp_path / "rows.npy", table)
    np.save(tmp_path / "columns.npy", np.asfortranarray(table.T))
    common = ["--distances", "--matcher", "best", "--overwrite"]
    first = remarks(capsys, tmp_path / "rows.npy", "-o", tmp_path / "a.csv", *common)
    assert first == [
        "evplace: rows are taken for queries, columns for references: --layout reference-query turns them"
    ]
    turned = ["--layout", "reference-query"]
    assert remarks(capsys, tmp_path / "columns.npy", "-o", tmp_path / "b.csv", *common, *turned) == []
    given = ["--layout", "query-reference"]
    assert remarks(capsys, tmp_path / "rows.npy", "-o", tmp_path / "c.csv", *common, *given) == []
    assert len({(tmp_path / name).read_text() for name in ("a.csv", "b.csv", "c.csv")}) == 1
    assert len(read(tmp_path / "a.csv")) == shape[0]


@pytest.mark.parametrize("transform", [np.asarray, np.square, lambda d: d * 1000, np.log, lambda d: d - 100])
@pytest.mark.parametrize("matcher", ["best", "seqslam"])
def test_distances_taken_for_scores_are_told(tmp_path, capsys, transform, matcher) -> None:
    np.save(tmp_path / "d.npy", transform(street()))
    common = [tmp_path / "d.npy", "-o", tmp_path / "m.csv", "--overwrite", "--matcher", matcher]
    layout = ["--layout", "query-reference"]
    wrong = remarks(capsys, *common, *layout)
    assert any("look like distances" in line and line.endswith("give --distances") for line in wrong)
    assert not any("look like" in line for line in remarks(capsys, *common, *layout, "--distances"))
    np.save(tmp_path / "d.npy", -transform(street()))
    wrong = remarks(capsys, *common, *layout, "--distances")
    assert any("look like scores" in line and line.endswith("leave out --distances") for line in wrong)


def test_real_scores_are_taken_for_what_they_are(data, tmp_path, capsys) -> None:
    """Of ten techniques, one or two have too little order to tell; none is told wrongly."""
    tables = np.load(data / "scores" / "vprbench_corridor.npz")
    names = [name for name in tables.files if tables[name].ndim == 2]
    found = 0
    for name in names:
        np.save(tmp_path / "s.npy", tables[name])
        common = [tmp_path / "s.npy", "-o", tmp_path / "m.csv", "--overwrite", "--matcher", "best"]
        assert not any("look like" in line for line in remarks(capsys, *common))
        found += any("look like scores" in line for line in remarks(capsys, *common, "--distances"))
    assert found >= len(names) - 3


@pytest.mark.parametrize(
    ("shape", "ds"), [((10, 60), 15), ((60, 10), 15), ((4, 4), 5), ((14, 14), 15), ((1, 100), 2)]
)
def test_a_sequence_longer_than_a_side_is_one_line(tmp_path, shape, ds) -> None:
    np.save(tmp_path / "s.npy", np.random.default_rng(0).random(shape))
    with pytest.raises(ScoresError, match=rf"ds = {ds} queries fits {shape[0]} queries and {shape[1]} ref"):
        run(Args(tmp_path / "s.npy", tmp_path / "m.csv", "seqslam", None, (("ds", ds),)))
    assert not (tmp_path / "m.csv").exists()


@pytest.mark.parametrize("matcher", ["graph", "dp"])
@pytest.mark.parametrize("scores", [-street(), np.zeros((20, 20)), np.full((5, 9), -1e-3)])
def test_scores_of_which_none_is_positive(tmp_path, matcher, scores) -> None:
    np.save(tmp_path / "s.npy", scores)
    with pytest.raises(ScoresError, match=f"no score is above 0, and {matcher} takes similarities"):
        run(Args(tmp_path / "s.npy", tmp_path / "m.csv", matcher))
    assert not (tmp_path / "m.csv").exists()


@pytest.mark.parametrize("scores", [-street(), 0.5 * SCORES, SCORES - 1])
def test_nothing_accepted_is_told_with_the_thresholds(tmp_path, capsys, scores) -> None:
    np.save(tmp_path / "s.npy", scores)
    lines = remarks(capsys, tmp_path / "s.npy", "-o", tmp_path / "m.csv")
    assert any("no match is accepted" in line and "tau1=0.99" in line for line in lines)
