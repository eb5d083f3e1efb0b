"""The demo, on made drives in place of the city's."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from evplace.cli import main
from evplace.imaging.traverse import Traverse
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers.network import Network
from evplace_lab.cli import demo


@pytest.fixture
def drives(tmp_path: Path, day: Traverse, night: Traverse, monkeypatch: pytest.MonkeyPatch) -> Path:
    """day-1 and every query, each with events and with colour; no network of the usual street."""
    made = {"day-1": day, **dict.fromkeys(demo.QUERIES, night)}
    for name, traverse in made.items():
        for part in demo.INPUTS.values():
            (tmp_path / "city" / name).mkdir(parents=True, exist_ok=True)
            traverse.save(tmp_path / "city" / name / part)
    folders = {name: tmp_path / "city" / name for name in made}
    monkeypatch.setattr(demo, "built_in_drives", lambda folder, drive_m: folders)
    monkeypatch.setattr(
        demo, "_map_of_network", lambda reference, places, name: train(reference, places, "ncc")
    )
    return tmp_path


def test_the_demo_keeps_what_it_prints(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = drives / "demo"
    assert main(["demo", "--out", str(out)]) == 0
    output = capsys.readouterr().out
    assert "import evplace as ev" in output
    assert "At night, events find" in output
    rows = json.loads((out / "result.json").read_text())["rows"]
    assert len(rows) == len(demo.QUERIES) * len(demo.METHODS) * len(demo.INPUTS)
    assert set(rows[0]) >= {"query", "input", "matcher", "accuracy", "accuracy_seen", "rejected", "n"}
    assert (out / "report.html").read_text().startswith("<!doctype html>")
    assert PlaceMap.load(out / "events best.evp").matcher is not None
    assert len(list((out / "results").iterdir())) == len(rows)
    assert main(["demo", "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == rows


def test_another_street_needs_training(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--out", f"{tmp_path}/demo", "--drive-m", "600"]) == 2
    assert "add --train" in capsys.readouterr().err
    assert not (tmp_path / "demo").exists()


def test_the_networks_that_come_along_answer_on_the_usual_street(day: Traverse) -> None:
    """They are of its places; here they only have to run on images of its shape."""
    import numpy as np

    for name, shape in (("events", (90, 160)), ("colour", (90, 160, 3))):
        images = np.random.default_rng(0).integers(0, 256, (len(day), *shape), np.uint8)
        reference = dataclasses.replace(day, images=images)
        assert reference.track is not None
        places = PlaceGrid.from_track(reference.track)
        place_map = demo._map_of_network(reference, places, name)
        scores = Network().open(place_map.content).rows(images[:2])
        assert scores.shape[0] == 2
        np.testing.assert_allclose(scores.sum(axis=1), 1, atol=1e-4)
