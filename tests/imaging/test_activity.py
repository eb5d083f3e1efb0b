"""How much an image shows."""

from __future__ import annotations

import numpy as np

from evplace.imaging.activity import activity


def test_event_images_show_their_mean_and_camera_images_what_changed() -> None:
    film = np.array([[[0, 10], [20, 30]], [[0, 10], [20, 30]], [[255, 10], [20, 31]]], np.uint8)
    np.testing.assert_allclose(activity(film, of_events=True), [15, 15, 79])
    np.testing.assert_allclose(activity(film, of_events=False), [np.nan, 0, 64])
