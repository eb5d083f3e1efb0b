"""Towns and halls in short bursts."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evplace_lab.descriptor import bursts
from evplace_lab.descriptor.bursts import HALL_METRE, Bursts, BurstSettings, is_hall, make_bursts

TINY = BurstSettings(routes=2, drives=2, places=4)
TOWN, HALL = 1, 3


@pytest.fixture(scope="module")
def town() -> Bursts:
    return make_bursts(TOWN, TINY)


@pytest.fixture(scope="module")
def hall() -> Bursts:
    return make_bursts(HALL, TINY)


def test_the_same_seed_gives_the_same_images(town: Bursts, hall: Bursts) -> None:
    for seed, made in ((TOWN, town), (HALL, hall)):
        again = make_bursts(seed, TINY)
        np.testing.assert_array_equal(made.images, again.images)
        np.testing.assert_array_equal(made.poses, again.poses)


def test_another_seed_gives_others(town: Bursts) -> None:
    assert not np.array_equal(town.images, make_bursts(TOWN + 1, TINY).images)


def test_every_place_is_seen_in_every_drive_and_by_every_sensor(town: Bursts, hall: Bursts) -> None:
    for made in (town, hall):
        assert made.images.shape == (2, 2, 4, 2, 45, 80)
        assert made.poses.shape == (2, 2, 4, 3)
        assert (made.images.reshape(-1, 45 * 80).max(axis=1) > 0).mean() > 0.8


def test_two_drives_pass_the_same_places(town: Bursts, hall: Bursts) -> None:
    for made, step in ((town, TINY.step_m), (hall, HALL_METRE * 60 / TINY.places)):
        apart = np.hypot(*np.moveaxis(made.poses[:, 0, :, :2] - made.poses[:, 1, :, :2], -1, 0))
        assert apart.max() < step + 1.5


def test_a_metre_in_a_hall_counts_for_many(hall: Bursts, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bursts, "HALL_METRE", 1.0)
    plain = make_bursts(HALL, TINY)
    np.testing.assert_allclose(hall.poses[..., :2], HALL_METRE * plain.poses[..., :2], rtol=1e-5)
    np.testing.assert_array_equal(hall.poses[..., 2], plain.poses[..., 2])


def test_frames_alone_are_the_last_ones_of_their_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing else is rendered, and the images are the same as with all frames of the windows."""
    asked: list[int] = []
    whole = bursts._burst

    def counted(*args: Any) -> tuple[list[Any], list[int]]:
        asked.append(args[-1])
        return whole(*args[:-1], 0)

    few = dataclasses.replace(TINY, routes=1, frames=True)
    made = make_bursts(TOWN, few)
    monkeypatch.setattr(bursts, "_burst", counted)
    np.testing.assert_array_equal(made.images, make_bursts(TOWN, few).images)
    assert min(asked) > 0


def test_each_fourth_seed_is_halls() -> None:
    assert [is_hall(seed, TINY) for seed in range(5)] == [False, False, False, True, False]
    assert not is_hall(HALL, dataclasses.replace(TINY, hall_every=0))


def test_they_come_back_from_the_disk(town: Bursts, tmp_path: Path) -> None:
    town.save(tmp_path / "towns" / "town.npz")
    loaded = Bursts.load(tmp_path / "towns" / "town.npz")
    np.testing.assert_array_equal(loaded.images, town.images)
    np.testing.assert_array_equal(loaded.poses, town.poses)
