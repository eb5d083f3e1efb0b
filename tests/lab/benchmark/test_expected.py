"""The figures that are kept, the page that shows them, and what is said where a run finds others."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from evplace_lab.benchmark._expected import expected, held
from evplace_lab.city import VERSION, CitySettings
from evplace_lab.cli.bench import _say_held

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


def test_figures_of_the_frozen_city_are_held_against_those_before(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = expected()["ideal"]["night-2"]
    row = {"query": "night-2", "method": "best", **{name: value / 100 for name, value in figures.items()}}
    document = {"rule": "view", "input": "ideal", "rows": [row]}
    (tmp_path / "city.json").write_text(json.dumps({"version": VERSION, **CitySettings().of_drive()}))
    assert held(document, tmp_path) == (len(figures), [])
    _say_held(document, tmp_path)
    assert f"All {len(figures)} figures of 'best' are those of evplace" in capsys.readouterr().out
    row["accuracy"] -= 0.05
    alike, (told,) = held(document, tmp_path)
    assert alike == len(figures) - 1
    _say_held(document, tmp_path)
    said = capsys.readouterr()
    assert said.out.startswith(f"{alike} of {len(figures)} figures of 'best' are those of")
    assert told in said.err
    assert f"accuracy of 'best' is {figures['accuracy'] - 5:.1f} %" in told
    assert held({**document, "rule": "places"}, tmp_path) == (0, [])
    (tmp_path / "city.json").write_text(json.dumps({"version": VERSION, "seed": 101}))
    assert held(document, tmp_path) == (0, [])
