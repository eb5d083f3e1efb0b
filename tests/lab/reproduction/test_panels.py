"""The panels of real sets: drawn by their adapters where the data are there, else they say what they need."""

from __future__ import annotations

from pathlib import Path

import pytest

from conftest import make_drive, write_drive
from evplace.core.workers import workers_of
from evplace.placemap import train
from evplace_lab.report._found import Found, Sheet
from evplace_lab.report._tables import lacking
from evplace_lab.reproduction import Choice, figure5
from evplace_lab.reproduction._cases import Case
from evplace_lab.reproduction._panels import Panels


@pytest.fixture
def panels(tmp_path: Path) -> Panels:
    """Data that hold a campus, and no Oxford."""
    (tmp_path / "data" / "campus").mkdir(parents=True)
    write_drive(tmp_path / "data" / "campus", "day", make_drive())
    write_drive(tmp_path / "data" / "campus", "night", make_drive(seed=1, noise=0.02))
    return Panels(tmp_path / "city", tmp_path / "out", tmp_path / "data")


def of_real_sets(drives: Panels) -> list[Case]:
    return [case for case in figure5.cases(drives, Choice(seeds=1)) if ": " in case.query]


def test_a_set_that_is_there_is_looked_for_and_one_that_is_not_says_what_it_needs(panels: Panels) -> None:
    cases = of_real_sets(panels)
    assert {case.query for case in cases} == {"campus: own: night"}
    assert {case.database for case in cases} == {"campus: own: day"}
    assert {case.scorer for case in cases} >= {"network", "seqslam", "cosine", "ncc"}
    assert of_real_sets(Panels(panels.city, panels.beside)) == []
    recipes = {recipe.panel: figure5._is_there(recipe, panels) for recipe in figure5._chosen()}
    assert recipes == {"day-night": True, "day-rain": True, "Oxford RobotCar": False, "campus": True}


def test_its_drives_are_made_once_by_their_adapter(panels: Panels) -> None:
    case = next(case for case in of_real_sets(panels) if case.scorer == "ncc")
    panels = Panels.from_dict(panels.to_dict())
    panels.prepare([case], workers_of(1))
    made = sorted((panels.beside / "real").iterdir())
    panels.prepare([case], workers_of(1))
    assert sorted((panels.beside / "real").iterdir()) == made
    day, night = (panels.opened(drive, case) for drive in (case.database, case.query))
    assert len(day) == pytest.approx(60 / case.every, abs=1)
    assert night.recipe is not None
    assert night.recipe.kind == "events"
    place_map = train(day, panels.places(day, case), case.scorer_part, matcher="best")
    truths = panels.truths(place_map, night, case)
    assert "places" in truths
    assert truths["places"].judged.any()
    before = panels.source(case)
    (panels.data / "campus" / "night.csv").write_text("timestamp,latitude,longitude\n")  # type: ignore[operator]
    assert panels.source(case) != before


def test_the_page_shows_what_is_lacking() -> None:
    command = "evplace reproduce figure5 --data DATA"
    told = [{"panel": "campus", "needs": "recordings <by night>", "command": command}]
    curves = Sheet((), (), {"lacking": told})
    html = lacking(Found("out", None, curves, None, {}))
    assert "Needs data: recordings &lt;by night&gt;" in html
    assert f"<code>{command}</code>" in html
    assert lacking(Found("out", None, Sheet((), (), {"lacking": 3}), None, {})) == ""
    assert lacking(Found("out", None, None, None, {})) == ""
