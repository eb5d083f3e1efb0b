"""Images of a recording's event store are those of the recording, or the store is refused."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evplace.core.errors import SettingsError
from evplace.core.events import Events
from evplace.core.storage import GrowingArray
from evplace.drives._recorded import StorePlace
from evplace.drives.to_traverse import open_source, record
from evplace.imaging.store import MARK
from evplace.imaging.traverse import Traverse, new_traverse
from evplace.sources.writers import write_recording

SIZE = (67, 45)
FILES = ("bits.npy", "numbers.npy", "counts.npy", "mask.npy", MARK)


def drive(count: int = 20_000) -> Events:
    """Two seconds of events, half a second of which is empty."""
    rng = np.random.default_rng(0)
    t_us = np.sort(rng.integers(0, 1_500_000, count))
    t_us[t_us > 700_000] += 500_000
    x, y = (rng.integers(0, side, count) for side in SIZE)
    return Events.of(t_us + 5000, x, y, rng.random(count) < 0.5, SIZE)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "drive.raw"
    write_recording(path, [drive()], SIZE)
    return path


def images(recording: Path, write: bool = False, stored: bool = True, **settings: Any) -> Traverse:
    """Through a traverse folder, as the command line makes them."""
    mask = settings.pop("mask", None)
    place = StorePlace(recording.with_name("drive.store"), write, {}) if stored else None
    out = recording.with_name("out")
    with new_traverse(out, {}, overwrite=True) as writer:
        record(open_source(recording), writer, None, None, None, mask, place, **settings)
    found = Traverse.load(out)
    return Traverse(np.array(found.images), found.t_us, found.counts, None, None, found.info, found.mask)


def same(first: Traverse, second: Traverse) -> bool:
    arrays = all(
        np.array_equal(getattr(first, name), getattr(second, name)) for name in ("images", "t_us", "counts")
    )
    masks = (first.mask is None) == (second.mask is None)
    told = [{key: one.info[key] for key in ("dropped", "cleaned", "fault")} for one in (first, second)]
    return arrays and masks and told[0] == told[1]


RECIPES: list[dict[str, Any]] = [
    {},
    {"dt": "1/240"},
    {"dt": "1/60", "blur": False},
    {"dt": "1/16", "crop_bottom": 0.0, "width": 20, "height": 11},
    {"dt": "1", "blur_last": True, "resize": "linear"},
]


@pytest.mark.parametrize("settings", RECIPES, ids=str)
def test_other_images_are_made_of_the_store(settings: dict[str, Any], recording: Path) -> None:
    images(recording, write=True)
    made = images(recording, **settings)
    assert made.info["store"] == str(recording.with_name("drive.store"))
    assert same(made, images(recording, stored=False, **settings))


@pytest.mark.parametrize(
    "settings",
    [{"dt": "1/50"}, {"dt": "1/60", "refractory_us": 3000}, {"mask_hot": True, "dt": "1/30"}],
    ids=str,
)
def test_the_pass_that_writes_gives_the_same_images(settings: dict[str, Any], recording: Path) -> None:
    mask = np.random.default_rng(1).random(SIZE[::-1]) < 0.2
    plain = images(recording, stored=False, mask=mask, **settings)
    assert same(plain, images(recording, write=True, mask=mask, **settings))
    again = images(recording, mask=mask, **settings)
    assert again.info["store"]
    assert same(plain, again)


def test_a_longer_dt_of_a_store_with_windows_of_its_own(recording: Path) -> None:
    images(recording, write=True, dt="1/50")
    assert images(recording, dt="1/25").info["store"]
    refused = images(recording)
    assert refused.info["store"] is None
    assert "1/30 s is no multiple: it is not used" in refused.info["notes"][-1]


@pytest.mark.parametrize("name", FILES)
def test_a_flipped_byte_is_refused_and_the_store_made_again(name: str, recording: Path) -> None:
    mask = np.random.default_rng(1).random(SIZE[::-1]) < 0.2
    whole = images(recording, write=True, mask=mask)
    file = recording.with_name("drive.store") / name
    data = bytearray(file.read_bytes())
    for at in (len(data) // 2, len(data) - 5):
        bad = bytearray(data)
        bad[at] ^= 1
        file.write_bytes(bad)
        refused = images(recording, mask=mask)
        assert refused.info["store"] is None
        assert "`store` makes it again" in refused.info["notes"][-1]
        assert same(refused, whole)
    assert "it is made again" in images(recording, write=True, mask=mask).info["notes"][-1]
    assert file.read_bytes() == data
    assert same(images(recording, mask=mask), whole)


@pytest.mark.parametrize(
    "settings", [{"refractory_us": 10}, {"mask": np.eye(45, 67) > 0}], ids=["cleaning", "mask"]
)
def test_a_store_of_another_recipe_is_refused(settings: dict[str, Any], recording: Path) -> None:
    mask = np.zeros(SIZE[::-1], np.bool_)
    images(recording, write=True, mask=mask)
    refused = images(recording, **{"mask": mask} | settings)
    assert refused.info["store"] is None
    assert "of another recording, or of one that was read or cleaned otherwise" in refused.info["notes"][-1]


def test_a_recording_that_was_changed_is_decoded(recording: Path) -> None:
    images(recording, write=True)
    os.utime(recording, ns=(1, 1))
    assert images(recording).info["store"] is None


def test_a_damaged_recording_is_said_to_be_so_from_the_store_too(recording: Path) -> None:
    recording.write_bytes(recording.read_bytes()[:-5001])
    images(recording, write=True)
    made = images(recording)
    assert made.info["store"]
    assert "cut off" in made.info["fault"]
    assert same(made, images(recording, stored=False))


@pytest.mark.parametrize("after", [0, 7])
def test_a_full_disk_keeps_the_traverse(after: int, recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain, append, room = images(recording, stored=False), GrowingArray.append, [after]

    def filling(self: GrowingArray, item: Any) -> None:
        if self._item_shape == (45, 9):
            if not room[0]:
                raise OSError(errno.ENOSPC, "No space left on device")
            room[0] -= 1
        append(self, item)

    monkeypatch.setattr(GrowingArray, "append", filling)
    kept = images(recording, write=True)
    assert same(kept, plain)
    assert "no store was written: the disk is full" in kept.info["notes"][-1]
    assert sorted(path.name for path in recording.parent.iterdir()) == ["drive.raw", "out"]


@pytest.mark.parametrize("settings", [{"representation": "count"}, {"count": 500}], ids=str)
def test_images_that_show_more_have_no_store(settings: dict[str, Any], recording: Path) -> None:
    with pytest.raises(SettingsError, match="`store` keeps where events fell"):
        images(recording, write=True, **settings)
    assert images(recording, **settings).info["store"] is None
