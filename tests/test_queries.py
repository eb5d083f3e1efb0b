"""A query is made as its map was, or refused in one line: in Python and on the command line alike."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from conftest import Drive, make_drive, write_drive
from evplace.cli import main
from evplace.core.errors import InputError, PlaceMapError, SettingsError, TraverseError
from evplace.core.events import Events
from evplace.drives.to_traverse import open_traverse
from evplace.evaluation._evaluate import evaluate
from evplace.imaging.recipe import Recipe
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A day and a night with their logs, and a map of counts in windows of 1/15 s."""
    folder = tmp_path_factory.mktemp("queries")
    write_drive(folder, "day", make_drive())
    write_drive(folder, "night", make_drive(seed=1, noise=0.02))
    reference = open_traverse(folder / "day.aedat4", folder / "day.csv", dt="1/15", representation="count")
    assert reference.track is not None
    train(reference, PlaceGrid.from_track(reference.track), "ncc").save(folder / "counts.evp")
    return folder


@pytest.fixture(scope="module")
def counts_map(files: Path) -> PlaceMap:
    return PlaceMap.load(files / "counts.evp")


def fault(capsys: Capture, *words: object) -> str:
    capsys.readouterr()
    assert main([str(word) for word in words]) == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    return text


def test_a_map_opens_a_query_as_it_was_made_itself(files: Path, counts_map: PlaceMap) -> None:
    query = counts_map.open(files / "night.aedat4", files / "night.csv")
    assert query.recipe == counts_map.recipe
    assert len(query) == 30
    assert evaluate(Localizer(counts_map, "best"), query).figures["accuracy"] > 0.9


OTHERWISE: list[dict[str, Any]] = [
    {"dt": "1/10"}, {"representation": "binary"}, {"representation": "voxel"}, {"crop_bottom": 0.0},
    {"blur": False}, {"saturation": 2}, {"refractory_us": 500}, {"flicker_hz": 100.0}, {"count": 2000},
]  # fmt: skip


@pytest.mark.parametrize("values", OTHERWISE, ids=str)
def test_a_query_made_otherwise_is_refused(
    files: Path, counts_map: PlaceMap, values: dict[str, Any], tmp_path: Path, capsys: Capture
) -> None:
    made = {"dt": "1/15", "representation": "count"} | values
    query = open_traverse(files / "night.aedat4", files / "night.csv", **made)
    name, value = next(iter(values.items()))
    for use in (
        lambda: list(Localizer(counts_map, "best").match_traverse(query)),
        lambda: Localizer(counts_map, "best").answers(query, "hindsight"),
        lambda: evaluate(Localizer(counts_map, "best"), query),
    ):
        with pytest.raises(InputError, match=r"the map was made .*make the query"):
            use()
    query.save(tmp_path / "query")
    with pytest.raises(InputError, match="the map was made"):
        counts_map.open(tmp_path / "query")
    for command in (
        ("localize", files / "counts.evp", tmp_path / "query"),
        ("evaluate", files / "counts.evp", tmp_path / "query", "-o", tmp_path / "result"),
    ):
        assert "the map was made" in fault(capsys, *command)
    assert not (tmp_path / "result").exists()
    with pytest.raises(TraverseError, match=f"{name} .*what is asked for|leave that out"):
        counts_map.open(files / "night.aedat4", **{name: value})


def test_a_query_of_another_sensor_is_refused(image_map: PlaceMap, night_drive: Drive) -> None:
    """Also where its images have the size that the map's have."""
    events = night_drive.events
    larger = Events(events.t_us, events.x, events.y, events.p, (160, 120))
    assert image_map.recipe is not None
    recipe = dataclasses.replace(image_map.recipe, size=(160, 120))
    images = np.zeros((3, *image_map.image_shape), np.uint8)
    other = Traverse(images, np.arange(3), np.ones(3, np.int64), recipe=recipe)
    with pytest.raises(TraverseError, match="sensor size 80x60, the query with 160x120"):
        Localizer(image_map).answers(other)
    with pytest.raises(InputError, match="80x60 pixels, this recording has 160x120"):
        list(Localizer(image_map).push(larger))


def test_what_is_harmless_passes(image_map: PlaceMap, night: Traverse) -> None:
    assert night.recipe is not None
    masked = dataclasses.replace(
        night, recipe=night.recipe.changed(mask_hot=True), mask=np.zeros((60, 80), bool)
    )
    wanted = Localizer(image_map, "best").answers(night).path
    for query in (masked, dataclasses.replace(night, recipe=None), dataclasses.replace(night, track=None)):
        np.testing.assert_array_equal(Localizer(image_map, "best").answers(query).path.item, wanted.item)


def test_frames_and_events_are_not_mixed(image_map: PlaceMap, day: Traverse, places: PlaceGrid) -> None:
    frames = dataclasses.replace(day, recipe=Recipe("frames", (80, 60)))
    with pytest.raises(TraverseError, match="kind events, the query with frames"):
        Localizer(image_map).answers(frames)
    with pytest.raises(TraverseError, match="kind frames, the query with events"):
        Localizer(train(frames, places, "sad")).answers(day)


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--dt", "1/7"), "dt 1/30, not 1/7"),
        (("--representation", "voxel"), "representation binary, not voxel"),
        (("--width", "80"), "width 160, not 80"),
        (("--no-blur",), "blur True, not False"),
        (("--mask-hot",), "mask_hot False, not True"),
        (("--size", "320", "240"), "sensor size 80x60, not 320x240"),
        (("--every-m", "5"), "--spacing cannot"),
        (("--time-unit", "us"), "--time-unit cannot"),
        (("--tone", "edges"), "--tone means nothing"),
    ],
)
def test_what_cannot_be_asked_of_a_traverse_is_refused(
    files: Path, tmp_path: Path, capsys: Capture, flags: tuple[str, ...], words: str
) -> None:
    open_traverse(files / "day.aedat4", files / "day.csv").save(tmp_path / "day")
    text = fault(capsys, "train", tmp_path / "day", "-o", tmp_path / "m", "--scorer", "ncc", *flags)
    assert words in text
    assert not (tmp_path / "m").exists()


def test_what_a_traverse_has_already_may_be_asked_for(files: Path, tmp_path: Path) -> None:
    open_traverse(files / "day.aedat4", files / "day.csv", dt="1/15").save(tmp_path / "day")
    flags = ["--dt", "1/15", "--width", "160", "--no-mask-hot"]
    assert main(["train", f"{tmp_path}/day", "-o", f"{tmp_path}/m", "--scorer", "ncc", *flags]) == 0
    assert len(open_traverse(tmp_path / "day", recipe=Recipe().changed(dt="1/15"))) == 30
    with pytest.raises(TraverseError, match="dt 1/15, the recipe asked for with 1/30"):
        open_traverse(tmp_path / "day", recipe=Recipe())


def test_how_images_of_others_were_made_is_not_known(tmp_path: Path) -> None:
    images = np.zeros((3, 90, 160), np.uint8)
    Traverse(images, np.arange(3), np.ones(3, np.int64)).save(tmp_path / "theirs")
    assert open_traverse(tmp_path / "theirs").recipe is None
    with pytest.raises(TraverseError, match="is not known: leave out `dt`"):
        open_traverse(tmp_path / "theirs", dt="1/30")


def test_a_recording_without_a_size_has_that_of_the_map(
    image_map: PlaceMap, night_drive: Drive, tmp_path: Path
) -> None:
    """What would be inferred from its events is another sensor's."""
    events = night_drive.events
    np.savez(tmp_path / "night.npz", t=events.t_us, x=events.x, y=events.y, p=events.p)
    query = image_map.open(tmp_path / "night.npz", night_drive.track, time_unit="us")
    assert query.recipe is not None
    assert query.recipe.size == (80, 60)
    assert open_traverse(tmp_path / "night.npz", time_unit="us").recipe != query.recipe


def test_films_are_localised_as_the_map_was_made(tmp_path: Path, capsys: Capture) -> None:
    """Camera images by the map's recipe, from a folder of images, by `localize` and by `evaluate`."""
    rng = np.random.default_rng(0)
    for name in ("day", "night"):
        (tmp_path / name).mkdir()
        for number, image in enumerate(np.random.default_rng(1).integers(0, 256, (8, 24, 32, 3), np.uint8)):
            noisy = np.clip(image + rng.normal(0, 5, image.shape), 0, 255).astype(np.uint8)
            Image.fromarray(noisy).save(tmp_path / name / f"{number}.png")
    flags = ["--scorer", "ncc", "--run-length", "1", "--width", "32", "--height", "18"]
    assert main(["train", f"{tmp_path}/day", "-o", f"{tmp_path}/m", *flags]) == 0
    capsys.readouterr()
    assert main(["localize", f"{tmp_path}/m", f"{tmp_path}/night", "--matcher", "best", "--json"]) == 0
    assert [json.loads(line)["place"] for line in capsys.readouterr().out.splitlines()] == list(range(8))
    query = PlaceMap.load(tmp_path / "m").open(tmp_path / "night")
    assert query.images.shape == (8, 18, 32, 3)


def test_old_folders_open(files: Path, counts_map: PlaceMap, tmp_path: Path) -> None:
    """Of the format before, as they lie on people's disks."""
    recipe = counts_map.recipe
    assert recipe is not None
    parts = recipe.to_dict()
    pieces = {name: parts[name] for name in ("windows", "images", "cleaning")}
    old = {**pieces, "input": "events", "sensor": [80, 60], "source": "day.aedat4"}
    query = open_traverse(files / "night.aedat4", files / "night.csv", recipe)
    query.save(tmp_path / "night")
    about = json.loads((tmp_path / "night" / "traverse.json").read_text())
    (tmp_path / "night" / "traverse.json").write_text(
        json.dumps({"format": "evplace-traverse-1", "track": about["track"], "info": old})
    )
    assert Traverse.load(tmp_path / "night").recipe == recipe
    np.testing.assert_array_equal(
        Localizer(counts_map, "best").answers(Traverse.load(tmp_path / "night")).path.item,
        Localizer(counts_map, "best").answers(query).path.item,
    )


def test_the_radius_of_the_field(files: Path, counts_map: PlaceMap, tmp_path: Path, capsys: Capture) -> None:
    query = counts_map.open(files / "night.aedat4", files / "night.csv")
    where = Localizer(counts_map, "best")
    by_radius = evaluate(where, query, rule="radius", radius_m=3.0)
    apart = by_radius.error_m
    assert by_radius.right.tolist() == (apart <= 3).tolist()
    assert by_radius.settings["truth"] == {"by": "radius", "radius_m": 3.0}
    out = ("evaluate", files / "counts.evp", files / "night.aedat4", "--track", files / "night.csv")
    flags = ("--matcher", "best", "--rule", "radius", "--radius-m", "3", "--json", "-o", tmp_path / "r")
    assert main([str(word) for word in (*out, *flags)]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["accuracy"] == pytest.approx(by_radius.figures["accuracy"])


def test_a_map_of_nothing_known_refuses_settings(day: Traverse, places: PlaceGrid) -> None:
    theirs = train(dataclasses.replace(day, recipe=None), places, "ncc")
    with pytest.raises(PlaceMapError, match="cannot localise events"):
        list(Localizer(theirs).push(make_drive().events))
    with pytest.raises(SettingsError, match="unknown setting 'colour'"):
        Recipe().changed(colour="red")
