"""What a folder may hold, and what is wrong with it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from made_results import QUERIES, make_result, table2, write_run

from evplace.core.errors import EvaluationError, InputError
from evplace_lab.report._found import look


def test_a_whole_run(tmp_path: Path) -> None:
    found = look(write_run(tmp_path / "run", results=11))
    assert found.name == "run"
    assert found.table is not None
    assert len(found.table.rows) == 2 * 2 * len(QUERIES) * 3
    assert found.table.rest["took_s"] == 321.5
    assert found.curves is not None
    assert (len(found.curves.rows), len(found.curves.others)) == (4, 4)
    assert found.ablations is not None
    assert [row.verdict for row in found.ablations.rows] == ["no effect seen", "worse", "better"]
    assert list(found.results)[:3] == ["night-0 events", "night-1 events", "night-2 events"]
    assert list(found.results)[-1] == "night-10 events"


def test_one_result_and_a_folder_of_results(tmp_path: Path) -> None:
    make_result().save(tmp_path / "all" / "a.result")
    make_result(1).save(tmp_path / "all" / "b.result")
    (tmp_path / "all" / "notes").mkdir()
    assert list(look(tmp_path / "all" / "a.result").results) == ["a.result"]
    found = look(tmp_path / "all")
    assert list(found.results) == ["a.result", "b.result"]
    assert (found.table, found.curves, found.ablations) == (None, None, None)


def test_results_of_one_name(tmp_path: Path) -> None:
    for place in ("a", "results/a", "results/b"):
        make_result().save(tmp_path / place)
    assert sorted(look(tmp_path).results) == ["a", "b", "results/a"]


def test_what_is_no_folder_or_holds_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for name in ("none", "file"):
        with pytest.raises(InputError, match=f"{name} is no folder"):
            look(tmp_path / name)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="nothing to report on: give a result that"):
        look(tmp_path / "empty")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "evplace-table-2"}, "made by a newer version"),
        ({"format": "evplace-curves-1"}, "not evplace-table-1"),
        ({"format": None}, "not evplace-table-1"),
        ({"rows": 3}, "its rows are no list"),
        ({"rows": [3]}, "its rows hold"),
        ({"rows": [{"query": "night-1"}]}, "an entry without 'input'"),
        ({"rows": [{"query": 3, "input": "events", "matcher": "m", "mean": 1}]}, "the query 3"),
        ({"rows": [{"query": "q", "input": "e", "matcher": "m", "mean": "1"}]}, "the mean '1'"),
        ({"rows": [{"query": "q", "input": "e", "matcher": "m", "mean": float("nan")}]}, "NaN is no"),
        ({"rows": [{"query": "q", "input": "e", "matcher": "m", "mean": True}]}, "the mean True"),
    ],
)
def test_a_damaged_table(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    (tmp_path / "table2.json").write_text(json.dumps(table2() | change))
    with pytest.raises(InputError, match=words) as raised:
        look(tmp_path)
    assert "table2.json" in str(raised.value)


@pytest.mark.parametrize("content", ["", "[]", "{", "\x00"])
def test_files_that_are_no_json(tmp_path: Path, content: str) -> None:
    for name in ("table2", "figure5", "ablations"):
        (tmp_path / f"{name}.json").write_text(content)
        with pytest.raises(InputError, match=f"{name}.json is damaged"):
            look(tmp_path)
        (tmp_path / f"{name}.json").unlink()


def test_damaged_curves(tmp_path: Path) -> None:
    for points, words in [([[1, 2]], "3 numbers are wanted"), (3, "no list"), ([["a", 1, 1]], "'a'")]:
        curves = {"format": "evplace-curves-1", "curves": [{"panel": "p", "points": points}]}
        (tmp_path / "figure5.json").write_text(json.dumps(curves))
        with pytest.raises(InputError, match=words):
            look(tmp_path)


def test_a_damaged_result_is_named(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run")
    (run / "results" / "night-1 events" / "pr_curve.npy").write_bytes(b"")
    with pytest.raises(EvaluationError, match="night-1 events is damaged"):
        look(run)
