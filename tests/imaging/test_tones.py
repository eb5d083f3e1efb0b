"""Tones of camera images: what they keep and what they make of flat images."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from evplace.core.errors import SettingsError
from evplace.imaging.images import ImageSettings, frame_image
from evplace.imaging.tones import EDGE_SHARE, edges, normalised, toned

ANY = arrays.arrays(np.uint8, st.sampled_from([(9, 16), (9, 16, 3), (1, 1), (2, 5, 3)]))


def picture(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (90, 160, 3), np.uint8)


def test_normalising_undoes_brightness_and_contrast() -> None:
    dark = (picture() * 0.25 + 10).astype(np.uint8)
    bright, levelled = normalised(picture()), normalised(dark)
    assert np.abs(bright.astype(int) - levelled).max() <= 2
    assert bright.mean() == pytest.approx(128, abs=1)


def test_edges_are_where_the_picture_changes() -> None:
    image = np.zeros((40, 40), np.uint8)
    image[:, 20:] = 200
    found = edges(image)
    assert set(np.unique(found)) == {0, 255}
    assert (np.flatnonzero(found.any(axis=0)) == [19, 20]).all()
    assert (edges(picture()) > 0).mean() == pytest.approx(EDGE_SHARE, abs=0.01)
    assert not edges(np.full((8, 8, 3), 77, np.uint8)).any()


@given(ANY)
def test_every_tone_gives_bytes_of_the_same_size(image: np.ndarray) -> None:
    for tone in ("plain", "normalised", "edges"):
        (made,) = toned(image[None], tone)
        assert made.dtype == np.uint8
        assert made.shape[:2] == image.shape[:2]


def test_frames_get_the_settings_tone_and_others_are_refused() -> None:
    made = frame_image(picture(), ImageSettings(tone="edges", width=80, height=45))
    assert made.shape == (45, 80)
    with pytest.raises(SettingsError, match="known are plain, normalised, edges"):
        toned(picture()[None], "sepia")
