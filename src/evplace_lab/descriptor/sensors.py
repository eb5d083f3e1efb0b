"""What a window of frames becomes: the small image of an event camera, of a film, of a frame or of its edges.

An event camera sees linear light. A film is events between gamma-coded frames of 8 bits, with their noise and
what JPEG leaves of them; a frame and edges are what an ordinary camera gives without any events.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evplace.core.events import Size
from evplace.imaging.images import Imager, ImageSettings, frame_image
from evplace.sources.simulators.esim import PRESETS, SensorSettings, Simulator
from evplace_lab.city.camera import ColourCamera, grey, luminance

SIZE = (80, 45)
"""Columns and rows of the small image."""
Radiance = NDArray[np.float32]
Kind = Literal["ideal", "events", "film", "frame", "edges"]
SHARES: dict[Kind, float] = {"ideal": 0.23, "events": 0.38, "film": 0.25, "frame": 0.07, "edges": 0.07}
"""How often each kind is drawn."""
FROM_FRAMES = ("frame", "edges")


@dataclass(frozen=True)
class Sensor:
    """A sensor, and how its images are made."""

    kind: Kind
    settings: SensorSettings
    quality: int
    """Of JPEG, for a film; 0 for none."""
    imager: Imager
    """Of these images."""

    def image(self, frames: list[Radiance], times_us: list[int], seed: int) -> NDArray[np.uint8]:
        """(45, 80) of the window from the first frame (H, W, 3) to the last; `seed` draws all noise."""
        if self.kind in FROM_FRAMES:
            picture = _pictures(frames[-1:], times_us, self.quality, seed)[0]
            return _halved(frame_image(picture, self.imager.settings))
        if self.kind == "film":
            pictures = _pictures(frames, times_us, self.quality, seed)
            light = [picture.astype(np.float32) / np.float32(255) for picture in pictures]
        else:
            light = [luminance(frame) for frame in frames]
        return self._events_of(light, times_us, seed)

    def _events_of(self, light: list[Radiance], times_us: list[int], seed: int) -> NDArray[np.uint8]:
        """The first frame is shown once more before, brighter or darker by less than a threshold, so that
        each pixel is somewhere between two events when the window opens.
        """
        height, width = light[0].shape
        simulator = Simulator((width, height), self.settings, seed)
        eps, least = self.settings.log_eps, min(self.settings.threshold_on, self.settings.threshold_off)
        phase = np.random.default_rng([seed, 2]).uniform(-0.97, 0.97, (height, width)) * least
        simulator.push(((light[0] + eps) * np.exp(phase) - eps).astype(np.float32), times_us[0] - 1)
        simulator.push(light[0], times_us[0])
        for frame, t_us in zip(light[1:], times_us[1:], strict=True):
            self.imager.add(simulator.push(frame, t_us))
        return self.imager.image(times_us[-1])


def _pictures(
    frames: list[Radiance], times_us: list[int], quality: int, seed: int
) -> list[NDArray[np.uint8]]:
    """Grey pictures (H, W) of a colour camera that has got used to the light."""
    camera = ColourCamera([seed, 3])
    camera.expose(frames[0], times_us[0])
    return [_compressed(grey(camera.noisy_picture(frame)), quality) for frame in frames]


def _compressed(picture: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    if not quality:
        return picture
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "jpeg", quality=quality)
    return np.asarray(Image.open(file))


def _halved(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    rows, columns = (side // 2 for side in image.shape)
    halved: NDArray[np.uint8] = np.rint(image.reshape(rows, 2, columns, 2).mean((1, 3))).astype(np.uint8)
    return halved


def draw_kind(rng: np.random.Generator, frames: bool) -> Kind:
    """The kind of a route's sensor; `frames` leaves nothing but these."""
    kind = list(SHARES)[int(rng.choice(len(SHARES), p=list(SHARES.values())))]
    return "frame" if frames else kind


def draw_sensor(rng: np.random.Generator, kind: Kind, size: Size, crop_bottom: float) -> Sensor:
    """A sensor of `size` for one route."""
    scale = 2 if kind in FROM_FRAMES else 1  # edges are found before an image is small
    images = ImageSettings(
        representation="count" if kind != "ideal" and rng.random() < 0.3 else "binary",
        width=scale * SIZE[0],
        height=scale * SIZE[1],
        blur=kind == "ideal" or bool(rng.random() < 0.6),
        crop_bottom=crop_bottom,
        saturation=int(rng.integers(2, 8)),
        tone="edges" if kind == "edges" else "plain",
    )
    settings = PRESETS["ideal"] if kind == "ideal" else _draw_settings(rng, kind == "film")
    quality = int(rng.choice([0, 30, 50, 70, 85, 92]))
    return Sensor(kind, settings, quality, Imager(size, images))


def _draw_settings(rng: np.random.Generator, film: bool) -> SensorSettings:
    """Thresholds, noise and how far it sees into the dark."""
    threshold = float(rng.uniform(0.1, 0.35))
    return SensorSettings(
        threshold_on=threshold,
        threshold_off=threshold * float(rng.uniform(0.8, 1.25)),
        log_eps=_log_uniform(rng, 0.01, 0.1) if film else _log_uniform(rng, 0.003, 0.05),
        noise_hz=0.1 if film else _log_uniform(rng, 0.1, 10.0),
        leak_hz=float(rng.choice([0.0, 0.1])),
        hot_pixels=float(rng.choice([0.0, 0.0005, 0.001])),
        hot_hz=30.0,
        refractory_us=1000,
    )


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
