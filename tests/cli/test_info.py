"""What `evplace info` says of each kind of folder, and what is said where another kind is given."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from evplace.cli import main
from evplace.evaluation._evaluate import evaluate
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import train
from evplace.places import PlaceGrid

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory, day: Traverse, night: Traverse) -> Path:
    """A city of one drive, a map, a result, and a folder of images."""
    out = tmp_path_factory.mktemp("folders")
    for sensor in ("colour", "ideal"):
        (out / "city" / "day-1").mkdir(parents=True, exist_ok=True)
        day.save(out / "city" / "day-1" / sensor)
    (out / "city" / "city.json").write_text('{"version": "city-v1", "seed": 3}')
    np.save(out / "city" / "day-1" / "poses.npy", np.zeros((2, 6)))
    assert day.track is not None
    street = train(day, PlaceGrid.from_track(day.track), "ncc")
    street.save(out / "street.evp")
    evaluate(Localizer(street), night).save(out / "night.result")
    (out / "images").mkdir()
    for i in range(3):
        Image.fromarray(np.full((20, 30), 40 * i, np.uint8)).save(out / "images" / f"{i}.png")
    return out


def told(capsys: Capture, *words: object) -> dict[str, Any]:
    capsys.readouterr()
    assert main([*map(str, words), "--json"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_each_kind_of_folder_says_what_it_is(folders: Path, day: Traverse, capsys: Capture) -> None:
    street = told(capsys, "info", folders / "street.evp")
    assert (street["kind"], street["scorer"], street["matcher"]) == ("map", "ncc", "bayes")
    drive = told(capsys, "info", folders / "city/day-1/ideal")
    assert (drive["kind"], drive["images"], drive["of"]) == ("traverse", len(day), "events")
    result = told(capsys, "info", folders / "night.result")
    assert (result["kind"], result["answers"], result["scorer"]) == ("result", "live", "ncc")
    city = told(capsys, "info", folders / "city")
    assert (city["kind"], city["drives"], city["seed"]) == ("city", ["day-1"], 3)
    assert city["give"] == str(folders / "city/day-1/ideal")
    assert told(capsys, "info", folders / "city/day-1")["traverses"] == ["ideal", "colour"]
    images = told(capsys, "info", folders / "images")
    assert (images["kind"], images["images"], images["size"]) == ("film", 3, "30x20")
    assert told(capsys, "info", folders)["a map"] == [str(folders / "street.evp")]
    assert main(["info", str(folders / "city")]) == 0
    assert ["give", str(folders / "city/day-1/ideal")] in [
        line.split() for line in capsys.readouterr().out.splitlines()
    ]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("train", "city", "-o", "x.evp"), "city is a city, not a traverse: give city/day-1/ideal"),
        (
            ("train", "city/day-1", "-o", "x.evp"),
            "is a drive of a city, not a traverse: give city/day-1/ideal",
        ),
        (("train", "street.evp", "-o", "x.evp"), "street.evp is a map, not a traverse"),
        (("train", "night.result", "-o", "x.evp"), "night.result is a result, not a traverse"),
        (("localize", "city", "city/day-1/ideal"), "city is a city, not a map"),
        (("localize", "night.result", "city/day-1/ideal"), "night.result is a result, not a map"),
        (("localize", "street.evp", "city"), "city is a city, not a traverse: give city/day-1/ideal"),
        (("compare", "street.evp"), "street.evp is a map, not a result"),
        (("report", "street.evp"), "street.evp is a map, not a result"),
        (("doctor", "city/day-1/ideal"), "is a traverse, images that are made already"),
        (("doctor", "city"), "city is a city, not a traverse"),
        (("serve", "--map", "street.evp", "--source", "city"), "city is a city, not a recording"),
        (
            ("reproduce", "table2", "--city", "city/day-1", "-o", "x"),
            "is a drive of a city, not a city: give city",
        ),
    ],
)
def test_another_kind_is_named_with_the_right_path(
    words: tuple[str, ...], text: str, folders: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folders)
    assert main(list(words)) == 2
    assert text in capsys.readouterr().err
    assert not (folders / words[-1]).exists() or words[-1] not in ("x.evp", "x")
