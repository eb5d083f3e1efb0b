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
