"""Windows of frames as small images."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.imaging.images import Imager, ImageSettings
from evplace.sources.simulators.esim import PRESETS, SensorSettings
from evplace_lab.descriptor.sensors import FROM_FRAMES, SHARES, Sensor, draw_kind, draw_sensor

SIZE = (96, 72)
TIMES = [0, 20_000, 40_000]
IMAGES = ImageSettings(width=80, height=45, crop_bottom=0.0)
QUIET = SensorSettings(noise_hz=0.0, threshold_spread=0.0)


def frames(step: int, low: float = 0.1) -> list[NDArray[np.float32]]:
    """A bright bar on a darker ground that moves to the right by `step` columns a frame."""
    made = [np.full((SIZE[1], SIZE[0], 3), low, np.float32) for _ in TIMES]
    for k, frame in enumerate(made):
        frame[:, 40 + step * k : 50 + step * k] = 0.9
    return made


def sensor(kind: str, settings: SensorSettings = QUIET, quality: int = 0) -> Sensor:
    images = dataclasses.replace(IMAGES, tone="edges" if kind == "edges" else "plain")
    if kind in FROM_FRAMES:
        images = dataclasses.replace(images, width=160, height=90)
    return Sensor(kind, settings, quality, Imager(SIZE, images))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["ideal", "events", "film"])
def test_what_moves_is_seen_where_it_moves(kind: str) -> None:
    image = sensor(kind).image(frames(2), TIMES, 0).astype(float)
    assert image[:, 33:46].mean() > 5 * image[:, :25].mean() + 10


def test_a_still_scene_gives_no_events_without_noise() -> None:
    assert not sensor("events").image(frames(0), TIMES, 0).any()


def test_a_still_film_does_for_it_has_noise() -> None:
    dark, fine = [frame * 0.02 for frame in frames(0)], dataclasses.replace(QUIET, threshold_on=0.1)
    assert sensor("film", fine).image(dark, TIMES, 0).any()


def test_edges_need_no_movement() -> None:
    image = sensor("edges").image(frames(0), TIMES, 0)
    sides = np.flatnonzero(
        image.mean(axis=0) > 100
    )  # the frame's noise has edges, too, but in no column many
    assert set(sides) <= {32, 33, 41, 42}
    assert {33, 41} <= set(sides)


def test_a_frame_is_the_picture_in_small() -> None:
    image = sensor("frame").image(frames(0), TIMES, 0).astype(float)
    assert image.shape == (45, 80)
    assert image[:, 34:41].mean() > 2 * image[:, :25].mean()


def test_levels_stand_anywhere_when_the_window_opens() -> None:
    """A rise of half a threshold gives events at the quarter of the pixels that are near enough to one."""
    low, high = (np.full((SIZE[1], SIZE[0], 3), value, np.float32) for value in (0.5, 0.5 * np.exp(0.1)))
    seen = sensor("events").image([low, high], TIMES[:2], 0)
    assert 0.2 * 255 < seen.mean() < 0.28 * 255


def test_the_seed_draws_all_noise() -> None:
    noisy = sensor("film", PRESETS["weak"], quality=50)
    one, same, other = (noisy.image(frames(1), TIMES, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)


def test_every_kind_is_drawn() -> None:
    rng = np.random.default_rng(0)
    drawn = [draw_sensor(rng, draw_kind(rng, frames=False), SIZE, 0.25) for _ in range(80)]
    assert {draw_kind(rng, frames=True) for _ in range(20)} == {"frame"}
    assert {one.kind for one in drawn} == set(SHARES)
    assert {one.imager.settings.representation for one in drawn} == {"binary", "count"}
    assert all(one.imager.settings.tone == "edges" for one in drawn if one.kind == "edges")
