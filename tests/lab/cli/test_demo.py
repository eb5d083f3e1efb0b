"""The demo, on made drives in place of the city's."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evplace.cli import main
from evplace.imaging.traverse import Traverse
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers.network import Network
from evplace_lab import demonstration
from evplace_lab.cli import demo


@pytest.fixture
def drives(tmp_path: Path, day: Traverse, night: Traverse, monkeypatch: pytest.MonkeyPatch) -> Path:
    """day-1 and every query, each with events and with colour; no network of the usual street."""
    made = {"day-1": day, **dict.fromkeys(demonstration.USUAL.queries, night)}
    for name, traverse in made.items():
        for part in demonstration.INPUTS.values():
            (tmp_path / "city" / name).mkdir(parents=True, exist_ok=True)
            traverse.save(tmp_path / "city" / name / part)
    folders = {name: tmp_path / "city" / name for name in made}
    monkeypatch.setattr(demo, "built_in_drives", lambda folder, street, watch: folders)
    monkeypatch.setattr(demo, "preview", lambda path, conditions: Image.new("L", (8, 8)).save(path))
    monkeypatch.setattr(
        demonstration, "map_of_network", lambda reference, places, name: train(reference, places, "ncc")
    )
    return tmp_path


@pytest.fixture(autouse=True)
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The addresses that a browser would have been shown."""
    addresses: list[str] = []
    monkeypatch.setattr(demo, "show_page", addresses.append)
    return addresses


def test_the_demo_keeps_what_it_prints(
    drives: Path, capsys: pytest.CaptureFixture[str], opened: list[str]
) -> None:
    out = drives / "demo"
    assert main(["demo", "--out", str(out)]) == 0
    output = capsys.readouterr().out
    assert (
        output.index("6 drives of 300 m")
        < output.index(f"{out}/street.png")
        < output.index("At night, events find")
    )
    assert "evplace train day.aedat4 --track day.nmea" in output
    assert "At night, events find" in output
    assert [Path(address).name for address in opened] == ["street.png", "report.html"]
    rows = json.loads((out / "result.json").read_text())["rows"]
    usual = demonstration.USUAL
    assert len(rows) == len(usual.queries) * len(demonstration.METHODS) * len(demonstration.INPUTS)
    assert set(rows[0]) >= {"query", "input", "matcher", "accuracy", "accuracy_seen", "rejected", "n"}
    assert (out / "report.html").read_text().startswith("<!doctype html>")
    assert PlaceMap.load(out / "events best.evp").matcher is not None
    assert len(list((out / "results").iterdir())) == len(rows)
    assert main(["demo", "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == rows


def test_the_quick_demo_has_a_folder_of_its_own(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = drives / "demo"
    assert main(["demo", "--quick", "--out", str(out)]) == 0
    assert "2 drives of 300 m" in capsys.readouterr().out
    rows = json.loads((out / "quick" / "result.json").read_text())["rows"]
    assert {row["query"] for row in rows} == {"night-1"}
    assert (out / "quick" / "report.html").exists()


def test_the_printed_python_gives_the_printed_figure(
    drives: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = drives / "demo"
    assert main(["demo", "--quick", "--out", str(out)]) == 0
    _, _, after = capsys.readouterr().out.partition("The same in Python")
    lines = "\n".join(line.strip() for line in after.splitlines()[1:])
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(lines, {})
    rows = json.loads((out / "quick" / "result.json").read_text())["rows"]
    of_events = next(row for row in rows if row["input"] == "events" and row["matcher"] == "best")
    assert float(printed.getvalue()) == of_events["accuracy"]


def test_another_street_needs_training(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--out", f"{tmp_path}/demo", "--drive-m", "600"]) == 2
    assert "add --train" in capsys.readouterr().err
    assert not (tmp_path / "demo").exists()


def test_the_networks_that_come_along_answer_on_the_usual_street(day: Traverse) -> None:
    """They are of its places; here they only have to run on images of its shape."""
    for name, shape in (("events", (90, 160)), ("colour", (90, 160, 3))):
        images = np.random.default_rng(0).integers(0, 256, (len(day), *shape), np.uint8)
        reference = dataclasses.replace(day, images=images)
        assert reference.track is not None
        places = PlaceGrid.from_track(reference.track)
        place_map = demonstration.map_of_network(reference, places, name)
        scores = Network().open(place_map.content).rows(images[:2])
        assert scores.shape[0] == 2
        np.testing.assert_allclose(scores.sum(axis=1), 1, atol=1e-4)
