"""Recipes: what makes a difference to images, what does not, and how it is said."""

from __future__ import annotations

import dataclasses
import json
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace.core.errors import SettingsError, TraverseError
from evplace.imaging.images import ImageSettings
from evplace.imaging.recipe import Recipe
from evplace.imaging.windows import WindowSettings
from evplace.sources.cleaning import CleaningSettings

MADE = Recipe("events", (640, 480))
OTHERS: dict[str, Any] = {
    "kind": "frames", "size": (320, 240), "dt": "1/10", "count": 5000, "representation": "count", "width": 80,
    "height": 45, "blur": False, "blur_last": True, "crop_bottom": 0.5, "resize": "linear",
    "refractory_us": 100, "flicker_hz": 50.0,
}  # fmt: skip
"""Setting -> another value of it that changes the images of events."""


@pytest.mark.parametrize("name", OTHERS)
def test_each_setting_that_changes_images_is_a_difference(name: str) -> None:
    other = MADE.changed(**{name: OTHERS[name]})
    with pytest.raises(TraverseError) as error:
        MADE.require_same(other, "the map", "the query", "make it anew")
    text = str(error.value)
    assert "\n" not in text
    assert text.endswith(": make it anew")
    assert text.startswith("the map was made with ")


@pytest.mark.parametrize(
    "values",
    [
        {"saturation": 9}, {"tau_ms": 5.0}, {"bins": 9}, {"tone": "edges"}, {"mask_hot": True},
        {"static_mask": True}, {"dt": "2/60"}, {"size": None}, {"kind": None},
    ],
)  # fmt: skip
def test_what_changes_nothing_passes(values: dict[str, Any]) -> None:
    MADE.require_same(MADE.changed(**values), "a", "b", "c")


def test_settings_of_one_representation_matter_to_it_alone() -> None:
    counts = MADE.changed(representation="count")
    assert set(counts.differences(counts.changed(saturation=9))) == {"saturation"}
    assert not counts.differences(counts.changed(tau_ms=5.0, bins=2))
    surface = MADE.changed(representation="time-surface")
    assert set(surface.differences(surface.changed(tau_ms=5.0, saturation=9))) == {"tau_ms"}
    voxels = MADE.changed(representation="voxel")
    assert set(voxels.differences(voxels.changed(bins=2, saturation=9))) == {"bins", "saturation"}


def test_windows_by_count_have_no_length() -> None:
    counted = MADE.changed(count=5000)
    assert not counted.differences(counted.changed(dt="1/10"))
    assert set(MADE.differences(counted)) == {"count"}


def test_frames_are_compared_by_what_frames_take() -> None:
    frames = Recipe("frames", (640, 480))
    assert not frames.differences(
        frames.changed(dt="1/7", representation="voxel", blur=False, size=(320, 240))
    )
    assert set(frames.differences(frames.changed(tone="edges", width=80))) == {"tone", "width"}
    assert list(frames.differences(frames.changed(size=(1280, 720)))) == ["aspect ratio of the sensor"]


def test_a_blur_that_is_not_there_has_no_place() -> None:
    plain = MADE.changed(blur=False)
    assert not plain.differences(plain.changed(blur_last=True))


def test_the_line_names_both_values_and_how_many_more_differ() -> None:
    other = MADE.changed(dt="1/10", representation="count", width=80)
    with pytest.raises(TraverseError, match=r"the map was made with dt 1/30, the query with 1/10 \(and "):
        MADE.require_same(other, "the map", "the query", "x")
    with pytest.raises(TraverseError, match="sensor size 640x480, b with 320x240: x"):
        MADE.require_same(MADE.changed(size=(320, 240)), "a", "b", "x")


recipes = st.builds(
    Recipe,
    st.sampled_from([None, "events", "frames"]),
    st.none() | st.tuples(st.integers(1, 5000), st.integers(1, 5000)),
    st.builds(WindowSettings, st.sampled_from(["1/60", "0.05", "2"]), st.integers(0, 10_000)),
    st.builds(
        ImageSettings, st.sampled_from(["binary", "count", "voxel"]), st.integers(1, 300),
        st.integers(1, 300),
        st.booleans(), st.booleans(), st.floats(0, 0.9),
    ),
    st.builds(CleaningSettings, st.booleans(), st.booleans(), st.integers(0, 1000), st.floats(0, 200)),
)  # fmt: skip


@given(recipes)
def test_what_is_written_is_read(recipe: Recipe) -> None:
    assert Recipe.from_dict(json.loads(json.dumps(recipe.to_dict()))) == recipe


@given(recipes, recipes)
def test_differences_go_both_ways_and_are_none_from_itself(one: Recipe, other: Recipe) -> None:
    assert not one.differences(one)
    assert {name: pair[::-1] for name, pair in other.differences(one).items()} == one.differences(other)


def test_an_older_recipe_has_defaults_for_what_it_did_not_know() -> None:
    old = {"kind": "events", "size": [80, 60], "windows": {"dt": "1/15"}, "images": {"width": 40}}
    recipe = Recipe.from_dict(old)
    assert recipe.windows.seconds == Fraction(1, 15)
    assert recipe.images == ImageSettings(width=40)
    assert recipe.cleaning == CleaningSettings()


@pytest.mark.parametrize(
    "values",
    [
        {"kind": "sounds"}, {"size": [3]}, {"size": "80x60"}, {"size": [0, 60]}, {"size": [80, 1e9]},
        {"size": [True, 60]}, {"windows": []}, {"windows": {"dt": 5}}, {"windows": {"length": "1/3"}},
        {"images": {"width": "wide"}}, {"images": {"representation": "smell"}}, {"cleaning": 3},
    ],
)  # fmt: skip
def test_damaged_recipes_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(SettingsError):
        Recipe.from_dict(values)


def test_unknown_settings_list_the_known() -> None:
    with pytest.raises(SettingsError, match="unknown setting 'colour': known are bins, blur"):
        MADE.changed(colour="red")
    with pytest.raises(SettingsError, match="'width' cannot be"):
        MADE.changed(width="wide")
    assert MADE.changed() == MADE
    assert dataclasses.replace(MADE, size=(80, 60)) == MADE.changed(size=(80, 60))
