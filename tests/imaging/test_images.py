"""The fused pass against a plain numpy twin, OpenCV's facts, and the other representations."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.core.errors import RecordingError, SettingsError, TraverseError
from evplace.core.events import Events
from evplace.imaging.images import Imager, ImageSettings, event_image, frame_image

CHANNELS = {"polarity": (2,), "voxel": (5,)}
SIZES = [(320, 240), (640, 480), (346, 260), (1280, 720), (128, 128), (80, 80), (7, 7), (2000, 1500)]


def random_events(size: tuple[int, int], n: int = 5000, seed: int = 0) -> Events:
    rng = np.random.default_rng(seed)
    x, y = rng.integers(0, size[0], n), rng.integers(0, size[1], n)
    return Events.of(np.sort(rng.integers(0, 30_000, n)), x, y, rng.integers(0, 2, n), size)


def plain_blur(image: NDArray[np.float64]) -> NDArray[np.float64]:
    for axis in (0, 1):
        padded = np.pad(image, [(1, 1) if a == axis else (0, 0) for a in (0, 1)], mode="reflect")
        before, here, after = (np.take(padded, range(k, k + image.shape[axis]), axis) for k in (0, 1, 2))
        image = before / 4 + here / 2 + after / 4
    return image


def plain_resize(image: NDArray[np.float64], n: int, kind: str) -> NDArray[np.float64]:
    """Along the first axis; area by a running integral, linear by np.interp."""
    n_in = len(image)
    if kind == "area":
        integral = np.concatenate([np.zeros((1, image.shape[1])), np.cumsum(image, axis=0)])
        edges = np.arange(n + 1) * n_in / n
        at = np.stack([np.interp(edges, np.arange(n_in + 1), column) for column in integral.T], axis=1)
        return np.diff(at, axis=0) * n / n_in
    centres = (np.arange(n) + 0.5) * n_in / n - 0.5
    return np.stack([np.interp(centres, np.arange(n_in), column) for column in image.T], axis=1)


def plain_image(events: Events, kind: str = "area") -> NDArray[np.float64]:
    """Eq. 3, blur, crop and resize, step by step."""
    binary = np.zeros((events.size[1], events.size[0]))
    binary[events.y, events.x] = 1
    cropped = plain_blur(binary)[: events.size[1] * 3 // 4]
    return plain_resize(plain_resize(cropped, 90, kind).T, 160, kind).T


@pytest.mark.parametrize(("size", "kind"), list(itertools.product(SIZES, ["area", "linear"])))
def test_the_fused_pass_equals_its_twin(size: tuple[int, int], kind: str) -> None:
    events = random_events(size)
    settings = ImageSettings(resize=kind)  # type: ignore[arg-type]
    np.testing.assert_allclose(event_image(events, settings), plain_image(events, kind), atol=1e-6)


def test_one_event_is_blurred_as_the_papers_kernel() -> None:
    settings = ImageSettings(width=5, height=5, crop_bottom=0.0)
    image = event_image(Events.of([0], [2], [2], [True], (5, 5)), settings)
    assert (image[1:4, 1:4] * 16).tolist() == [[1, 2, 1], [2, 4, 2], [1, 2, 1]]
    assert image.sum() == 1


def test_many_events_at_a_pixel_count_once_whatever_their_sign() -> None:
    once = Events.of([0], [3], [3], [True], (8, 8))
    often = Events.of([0, 1, 2], [3, 3, 3], [3, 3, 3], [True, False, True], (8, 8))
    assert (event_image(once) == event_image(often)).all()


def test_the_bottom_quarter_is_removed() -> None:
    events = Events.of([0], [10], [230], [True], (320, 240))
    assert not event_image(events).any()
    assert event_image(events, ImageSettings(crop_bottom=0)).any()


def test_images_are_bytes_and_each_window_starts_afresh() -> None:
    events = random_events((320, 240))
    imager = Imager(events.size)
    imager.add(events)
    image = imager.image(30_000)
    assert image.dtype == np.uint8
    assert image.shape == (90, 160)
    np.testing.assert_allclose(image / 255, plain_image(events), atol=0.5 / 255 + 1e-6)
    assert not imager.image(60_000).any()


def test_pieces_of_a_window_make_the_same_image() -> None:
    events = random_events((346, 260))
    for kind in ("binary", "polarity", "count", "time-surface", "voxel"):
        settings = ImageSettings(representation=kind)
        whole, pieces = Imager(events.size, settings), Imager(events.size, settings)
        whole.add(events)
        for part in (events[:7], events[7:7], events[7:]):
            pieces.add(part)
        image = whole.image(30_000)
        assert (image == pieces.image(30_000)).all(), kind
        assert image.shape == (90, 160, *CHANNELS.get(settings.representation, ()))


def on_its_own_grid(kind: str, **settings: object) -> ImageSettings:
    plain: dict[str, object] = {"width": 4, "height": 4, "blur": False, "crop_bottom": 0.0}
    return ImageSettings(representation=kind, **(plain | settings))  # type: ignore[arg-type]


EVENTS = Events.of([0, 10, 10, 20], [0, 1, 1, 2], [0, 1, 1, 2], [True, False, True, False], (4, 4))


def test_count() -> None:
    image = event_image(EVENTS, on_its_own_grid("count", saturation=4))
    np.testing.assert_allclose(np.diag(image), [0.25, 0.5, 0.25, 0], atol=1e-7)


def test_polarity() -> None:
    image = event_image(EVENTS, on_its_own_grid("polarity"))
    assert image[[0, 1, 2, 3], [0, 1, 2, 3]].tolist() == [[0, 1], [1, 1], [1, 0], [0, 0]]


def test_time_surface_decays_and_remembers() -> None:
    imager = Imager((4, 4), on_its_own_grid("time-surface", tau_ms=0.01))
    imager.add(EVENTS)
    np.testing.assert_allclose(np.diag(imager.image_float(20)), [np.exp(-2), np.exp(-1), 1, 0], atol=1e-6)
    np.testing.assert_allclose(np.diag(imager.image_float(30)), np.exp([-3, -2, -1, -99]), atol=1e-6)


def test_voxel_shares_each_event_between_two_bins() -> None:
    events = Events.of([0, 5, 20], [0, 1, 2], [0, 1, 2], [True, True, False], (4, 4))
    image = event_image(events, on_its_own_grid("voxel", bins=3, saturation=1))
    wanted = [[1, 0, 0], [0.5, 0.5, 0], [0, 0, -1], [0, 0, 0]]
    np.testing.assert_allclose(image[[0, 1, 2, 3], [0, 1, 2, 3]], np.array(wanted) / 2 + 0.5, atol=1e-6)


@pytest.mark.parametrize("kind", ["binary", "polarity", "count", "time-surface", "voxel"])
def test_events_outside_the_sensor_are_refused(kind: str) -> None:
    outside = Events.of([0], [4], [0], [True], (4, 4))
    with pytest.raises(RecordingError, match="outside the sensor of 4x4"):
        event_image(outside, on_its_own_grid(kind))


@pytest.mark.parametrize(
    "wrong", [{"representation": "rgb"}, {"crop_bottom": 1.0}, {"width": 0}, {"tau_ms": -1.0}, {"bins": 0}]
)
def test_settings_that_cannot_be_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(SettingsError):
        ImageSettings(**wrong)  # type: ignore[arg-type]


def test_a_colour_frame_is_cropped_and_resized_only() -> None:
    frame = np.zeros((120, 160, 3), np.uint8)
    frame[:60, :, 0] = 255
    frame[90:] = 99
    image = frame_image(frame)
    assert image.shape == (90, 160, 3)
    assert (image[:60, :, 0] == 255).all()
    assert not image[60:].any()
    assert (frame_image(frame[..., 0]) == image[..., 0]).all()


def test_a_frame_that_is_no_image_is_refused() -> None:
    with pytest.raises(TraverseError, match="float64"):
        frame_image(np.zeros((4, 4)))  # type: ignore[arg-type]


def test_the_blur_can_come_last_as_in_the_notebook() -> None:
    events = random_events((320, 240))
    plain = event_image(events, ImageSettings(blur=False))
    last = event_image(events, ImageSettings(blur_last=True))
    np.testing.assert_allclose(last, plain_blur(plain.astype(np.float64)), atol=1e-5)
    assert not np.allclose(last, event_image(events), atol=1e-3)
    np.testing.assert_array_equal(event_image(events, ImageSettings(blur=False, blur_last=True)), plain)
