"""Cleaning on the way from events to images and matches: one path, whatever the packets."""

from __future__ import annotations

import dataclasses
import itertools
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conftest import Drive, make_drive, write_drive
from evplace.cli import main
from evplace.core.errors import RecordingError, SettingsError, TraverseError
from evplace.core.events import Events
from evplace.drives.to_traverse import open_traverse
from evplace.imaging.recipe import Recipe
from evplace.imaging.stream import EventImages, images_of
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer, Match
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.sources.cleaning import CleaningSettings, pixel_mask, read_mask

HOT = ((5, 7), (40, 20), (79, 59))
ALL = CleaningSettings(mask_hot=True, refractory_us=2000, flicker_hz=100)


def with_hot_pixels(drive: Drive, rate_hz: float = 400.0) -> Drive:
    """The drive, with the pixels HOT firing all the time."""
    events, rng = drive.events, np.random.default_rng(5)
    n = int(rate_hz * events.t_us[-1] / 1e6)
    hot = [
        Events.of(
            np.sort(rng.integers(1, events.t_us[-1], n)),
            np.full(n, x),
            np.full(n, y),
            rng.random(n) < 0.5,
            events.size,
        )
        for x, y in HOT
    ]
    whole = Events.concatenate([events, *hot])
    order = np.argsort(whole.t_us, kind="stable")
    return Drive(
        Events(whole.t_us[order], whole.x[order], whole.y[order], whole.p[order], whole.size), drive.track
    )


NOISY = with_hot_pixels(make_drive(seed=1, noise=0.02))


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A recording with hot pixels, and its track."""
    return write_drive(tmp_path_factory.mktemp("noisy"), "noisy", NOISY)


@pytest.fixture(scope="module")
def clean_map(day: Traverse, places: PlaceGrid) -> PlaceMap:
    """A map whose drives are cleaned of hot pixels."""
    assert day.recipe is not None
    recipe = day.recipe.changed(mask_hot=True, refractory_us=100)
    return train(dataclasses.replace(day, recipe=recipe), places, scorer="ncc")


def images(parts: Sequence[Events], cleaning: CleaningSettings) -> tuple[np.ndarray, dict[str, int]]:
    mask = pixel_mask(parts, NOISY.events.size, cleaning)
    stream = EventImages(NOISY.events.size, Recipe(cleaning=cleaning), mask)
    found = [image for image, _ in images_of(parts, stream)]
    return np.stack(found), stream.cleaned


@settings(max_examples=10)
@given(cuts=st.lists(st.integers(0, 60_000), max_size=12))
def test_the_size_of_packets_changes_nothing(cuts: list[int]) -> None:
    events = NOISY.events
    edges = [0, *sorted(min(cut, len(events)) for cut in cuts), len(events)]
    parts = [events[a:b] for a, b in itertools.pairwise(edges)]
    one, many = images([events], ALL), images(parts, ALL)
    np.testing.assert_array_equal(one[0], many[0])
    assert one[1] == many[1]
    assert set(one[1]) == {"masked", "flicker", "refractory"}
    assert one[1]["masked"] >= 0.9 * len(HOT) * 400 * 2


def test_nothing_is_cleaned_by_default() -> None:
    plain, cleaned = images([NOISY.events], CleaningSettings())
    assert cleaned == {}
    without, _ = images([NOISY.events], CleaningSettings(mask_hot=True))
    assert (plain != without).any()


def test_masked_images_are_those_of_events_without_hot_pixels(noisy: tuple[Path, Path]) -> None:
    found = open_traverse(noisy[0], mask_hot=True)
    assert found.mask is not None
    assert {(x, y) for y, x in np.argwhere(found.mask)} == set(HOT)
    hot = np.zeros((60, 80), np.bool_)
    hot[tuple(np.array(HOT).T[::-1])] = True
    events = NOISY.events
    keep = ~hot[events.y, events.x]
    kept = Events(events.t_us[keep], events.x[keep], events.y[keep], events.p[keep], events.size)
    np.testing.assert_array_equal(found.images, images([kept], CleaningSettings())[0])
    assert found.info["cleaned"] == {"masked": int((~keep).sum())}


def test_the_mask_of_a_traverse_is_kept_and_serves_a_stream(
    noisy: tuple[Path, Path], clean_map: PlaceMap, tmp_path: Path
) -> None:
    assert main(["images", str(noisy[0]), "-o", f"{tmp_path}/n", "--mask-hot", "--refractory-us", "100"]) == 0
    found = Traverse.load(tmp_path / "n")
    assert found.mask is not None
    found.save(tmp_path / "again")
    np.testing.assert_array_equal(Traverse.load(tmp_path / "again").mask, found.mask)
    where = Localizer(clean_map, "best", mask=tmp_path / "n" / "mask.npy")
    live = [m for start in range(0, len(NOISY.events), 997) for m in where.push(NOISY.events[start:][:997])]
    live += where.finish()
    assert live == list(Localizer(clean_map, "best").match_traverse(found))


def test_a_live_stream_needs_a_mask_where_the_map_was_learned_with_one(clean_map: PlaceMap) -> None:
    with pytest.raises(SettingsError, match="give a `mask`"):
        list(Localizer(clean_map, "best").push(NOISY.events))
    nothing = np.zeros((60, 80), np.bool_)
    found: list[Match] = list(Localizer(clean_map, "best", mask=nothing).push(NOISY.events))
    assert found


def test_commands_clean_later_drives_as_the_map_was(
    noisy: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording, track = noisy
    learn = ["train", str(recording), "--track", str(track), "-o", f"{tmp_path}/m", "--scorer", "ncc"]
    assert main([*learn, "--mask-hot", "--refractory-us", "500"]) == 0
    assert PlaceMap.load(tmp_path / "m").recipe.cleaning.mask_hot
    flags = ["--mask-hot", "--refractory-us", "500"]
    assert main(["images", str(recording), "-o", f"{tmp_path}/n", "--track", str(track), *flags]) == 0
    answers = []
    for drive in (str(recording), f"{tmp_path}/n"):
        capsys.readouterr()
        assert main(["localize", f"{tmp_path}/m", drive, "--matcher", "best"]) == 0
        answers.append(capsys.readouterr().out)
    assert answers[0] == answers[1]
    query = ["evaluate", f"{tmp_path}/m", str(recording), "--track", str(track), "-o", f"{tmp_path}/r"]
    assert main([*query, "--matcher", "best"]) == 0
    text = tmp_path / "hot.txt"
    text.write_text("".join(f"{x},{y}\n" for x, y in HOT))
    capsys.readouterr()
    out = ["images", str(recording), "-o", f"{tmp_path}/by-file", "--mask", str(text), "--json"]
    assert main(out) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["masked_pixels"] == 3
    assert facts["cleaned"]["masked"] > 0
    first, second = Traverse.load(tmp_path / "n"), Traverse.load(tmp_path / "by-file")
    np.testing.assert_array_equal(first.mask, second.mask)


def test_images_that_are_made_are_not_cleaned_again(noisy: tuple[Path, Path], tmp_path: Path) -> None:
    open_traverse(noisy[0]).save(tmp_path / "plain")
    with pytest.raises(TraverseError, match="mask_hot False, not True: make it again"):
        open_traverse(tmp_path / "plain", mask_hot=True)
    with pytest.raises(TraverseError, match="`mask` cannot change them"):
        open_traverse(tmp_path / "plain", mask=np.zeros((60, 80), np.bool_))
    assert len(open_traverse(tmp_path / "plain", mask_hot=False)) == 60


def test_camera_images_are_not_cleaned(tmp_path: Path) -> None:
    from PIL import Image

    Image.fromarray(np.zeros((20, 30), np.uint8)).save(tmp_path / "0.png")
    with pytest.raises(TraverseError, match="no events to clean"):
        open_traverse(tmp_path, refractory_us=5)


def test_masks_of_every_kind(tmp_path: Path) -> None:
    twin = np.zeros((60, 80), np.bool_)
    twin[tuple(np.array(HOT).T[::-1])] = True
    text = tmp_path / "hot_pixels.txt"
    text.write_text("# hot\nx,y\n5,7\n\n40 20  # a corner\r\n79, 59\n")
    np.save(tmp_path / "pixels.npy", np.array(HOT))
    np.save(tmp_path / "mask.npy", twin)
    for given_mask in (text, tmp_path / "pixels.npy", tmp_path / "mask.npy", str(text), twin, np.array(HOT)):
        np.testing.assert_array_equal(read_mask(given_mask, (80, 60)), twin)
    (tmp_path / "none.txt").write_text("")
    assert not read_mask(tmp_path / "none.txt", (80, 60)).any()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"5,7\nx,y\n", "line 2 is no pixel"),
        (b"80,7\n", "80,7, which a 80x60 sensor lacks"),
        (b"\xff\xfe5,7", "cannot be used"),
        (b"\x93NUMPY junk", "cannot be used"),
        (np.zeros((5, 5), np.bool_), r"shape \(5, 5\)"),
        (np.zeros((5, 2)), "must be booleans"),
        (np.array([[0, -1]]), "0,-1"),
        (np.array([{}]), "cannot be used"),
    ],
)
def test_masks_that_are_none(content: bytes | np.ndarray, words: str, tmp_path: Path) -> None:
    path = tmp_path / "mask"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        with path.open("wb") as file:
            np.save(file, content)
    with pytest.raises(RecordingError, match=words):
        read_mask(path, (80, 60))


def test_a_mask_that_is_missing_and_settings_that_cannot_be(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot read the mask"):
        read_mask(tmp_path / "nowhere.txt", (80, 60))
    with pytest.raises(SettingsError, match="'refractory_us' cannot be -1"):
        CleaningSettings(refractory_us=-1)
    with pytest.raises(SettingsError, match="'flicker_hz' cannot be nan"):
        CleaningSettings(flicker_hz=float("nan"))


def test_a_given_and_a_measured_mask_add_up() -> None:
    size = NOISY.events.size
    both = pixel_mask([NOISY.events], size, CleaningSettings(mask_hot=True), np.array([[1, 1]]))
    assert both is not None
    assert {(x, y) for y, x in np.argwhere(both)} == {*HOT, (1, 1)}
    assert pixel_mask([NOISY.events], size, CleaningSettings()) is None
