"""What a page opens with: a line under its title, the best result, its similarities."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from made_results import make_result

from evplace.evaluation import Result
from evplace.matchers import Path as Answers
from evplace_lab.report import report
from evplace_lab.report._pictures import _stretched, are_events


def data_of(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    data: dict[str, Any] = json.loads(found[1])
    return data


def test_the_best_result_is_opened_and_the_title_is_explained(tmp_path: Path) -> None:
    made = make_result()
    worse = dataclasses.replace(made, figures={**made.figures, "accuracy": 0.1})
    shown = dataclasses.replace(made, similarity=np.arange(12, dtype=np.uint8).reshape(3, 4))
    for name, result in {"a": worse, "b": shown}.items():
        result.save(tmp_path / "results" / name)
    page = report(tmp_path / "results", tmp_path / "page.html").page.read_text()
    data = data_of(page)
    assert data["best"] == 1
    assert [bool(one["similarity"]) for one in data["results"]] == [False, True]
    assert "2 results (live answers), of which the best is opened below." in page
    single = report(tmp_path / "results" / "b", tmp_path / "single.html").page.read_text()
    assert f"of {made.figures['judged']} images answered rightly, by local" in single


def test_images_of_few_counts_are_stretched() -> None:
    image = np.zeros((4, 5), np.uint8)
    image[1, 2], image[2, 2] = 3, 1
    assert _stretched(image).max() == 255
    assert _stretched(image)[2, 2] == 85
    assert not _stretched(np.zeros((2, 2), np.uint8)).any()
    made = make_result()
    for recipe, events in (({"kind": "events"}, True), (None, False)):
        assert are_events(dataclasses.replace(made, settings={"map": {"recipe": recipe}})) is events


def nothing_accepted() -> Result:
    made = make_result()
    none = np.zeros(len(made.judged), np.bool_)
    return dataclasses.replace(made, answers=Answers(made.answers.item, made.answers.score, none))


def test_the_outcomes_of_a_page_say_that_nothing_was_accepted(tmp_path: Path) -> None:
    nothing_accepted().save(tmp_path / "none")
    page = report(tmp_path / "none", tmp_path / "none.html").page.read_text()
    outcomes = set(data_of(page)["results"][0]["outcome"])
    assert outcomes <= {2, 3, -1}
    assert "No answer was accepted" in page
