"""The figures that are kept, the page that shows them, and what is said where a run finds others."""

from __future__ import annotations

import json
from pathlib import Path

from evplace_lab.benchmark._expected import deviations, expected
from evplace_lab.city import VERSION, CitySettings

PAGE = Path(__file__).parents[3] / "docs" / "protocol.md"
INPUTS = ("ideal", "from-8bit", "weak", "colour")


def test_the_page_shows_the_figures_that_are_kept() -> None:
    kept, text = expected(), PAGE.read_text("utf-8")
    assert kept["city"] == VERSION
    for query in kept["ideal"]:
        cells = []
        for name in INPUTS:
            figures = kept[name][query]
            off_map = f" / {figures['false_accept_rate']}" if "false_accept_rate" in figures else ""
            cells.append(f"{figures['accuracy']}{off_map}")
        assert f"| {query} | {' | '.join(cells)} |" in text


def test_other_figures_of_the_frozen_city_are_told(tmp_path: Path) -> None:
    figures = expected()["ideal"]["night-2"]
    row = {"query": "night-2", "method": "best", **{name: value / 100 for name, value in figures.items()}}
    document = {"rule": "view", "input": "ideal", "rows": [row]}
    (tmp_path / "city.json").write_text(json.dumps({"version": VERSION, **CitySettings().of_drive()}))
    assert list(deviations(document, tmp_path)) == []
    row["accuracy"] -= 0.05
    (told,) = deviations(document, tmp_path)
    assert f"accuracy of 'best' is {figures['accuracy'] - 5:.1f} %" in told
    assert list(deviations({**document, "rule": "places"}, tmp_path)) == []
    (tmp_path / "city.json").write_text(json.dumps({"version": VERSION, "seed": 101}))
    assert list(deviations(document, tmp_path)) == []
