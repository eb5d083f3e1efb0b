"""The colour camera: exposure that adapts, gamma, noise, 8 bits."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from evplace.core.grey import BT601
from evplace_lab.city.jit import compiled

GREY = 0.24
"""Mean of the linear picture that the exposure aims at."""
LEAST_GAIN, MOST_GAIN = 0.25, 4.0
"""At night the most is not enough, so the picture stays dark and noisy."""
ADAPTS_S = 0.6
"""Time constant of the exposure."""
SHOT, READ = 0.0006, 0.0025
"""Noise variance per unit of signal, and standard deviation of the read noise, both at gain 1."""
STEPS = 4096
GAMMA = 2.2
R, G, B = BT601

_TABLE = np.array([round(255.0 * (k / STEPS) ** (1.0 / GAMMA)) for k in range(STEPS + 1)], np.uint8)


class ColourCamera:
    """Turns linear frames, given in the order of time, into 8-bit pictures."""

    def __init__(self, seed: list[int], most_gain: float = MOST_GAIN) -> None:
        self._most_gain = most_gain
        self._rng = np.random.default_rng(seed)
        self._gain = 0.0
        self._last_us = 0

    def expose(self, radiance: NDArray[np.float32], t_us: int) -> None:
        """Adapt the gain to a frame at a time; call once for each frame, before the pictures of it."""
        wanted = min(max(GREY / max(float(_mean(radiance)), 1e-6), LEAST_GAIN), self._most_gain)
        seconds = (t_us - self._last_us) * 1e-6
        share = 1.0 - math.exp(-seconds / ADAPTS_S) if self._gain else 1.0
        self._gain = wanted if not self._gain else self._gain * (wanted / self._gain) ** share
        self._last_us = t_us

    def picture(self, radiance: NDArray[np.float32]) -> NDArray[np.uint8]:
        """(H, W, 3) uint8 without noise: what a game engine shows, and what `from-8bit` is given."""
        return np.asarray(_coded(radiance, self._gain, _TABLE))

    def noisy_picture(self, radiance: NDArray[np.float32]) -> NDArray[np.uint8]:
        """(H, W, 3) uint8 with shot and read noise, which grow with the gain."""
        noise = self._rng.standard_normal(radiance.shape, np.float32)
        signal = radiance * np.float32(self._gain)
        read = READ * self._gain
        spread = np.sqrt(np.maximum(signal, 0) * np.float32(SHOT * self._gain) + np.float32(read * read))
        return np.asarray(_coded(signal + noise * spread, 1.0, _TABLE))


@compiled
def luminance(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W) linear light of a (H, W, 3) frame: what an event sensor without colours sees.

    `core.grey.luminance`, compiled: it runs on every frame that is rendered.
    """
    out = np.empty(radiance.shape[:2], np.float32)
    for y in range(radiance.shape[0]):
        for x in range(radiance.shape[1]):
            out[y, x] = R * radiance[y, x, 0] + G * radiance[y, x, 1] + B * radiance[y, x, 2]
    return out


@compiled
def grey(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W) uint8 grey of a (H, W, 3) picture: `core.grey.to_grey`, compiled."""
    out = np.empty(picture.shape[:2], np.uint8)
    for y in range(picture.shape[0]):
        for x in range(picture.shape[1]):
            value = R * picture[y, x, 0] + G * picture[y, x, 1] + B * picture[y, x, 2]
            out[y, x] = int(value + 0.5)
    return out


@compiled
def _mean(radiance: NDArray[np.float32]) -> float:
    """The mean brightness of the frame's middle, lights cut off: every second pixel is enough.

    A light meter's weights, coarser than a picture's: with others every exposure of `city-v1` would differ.
    """
    height, width, _ = radiance.shape
    total, count = 0.0, 0
    for y in range(height // 8, height, 2):
        for x in range(width // 8, width - width // 8, 2):
            total += min(0.3 * radiance[y, x, 0] + 0.6 * radiance[y, x, 1] + 0.1 * radiance[y, x, 2], 2.0)
            count += 1
    return total / max(count, 1)


@compiled
def _coded(radiance: NDArray[np.float32], gain: float, table: NDArray[np.uint8]) -> NDArray[np.uint8]:
    out = np.empty(radiance.shape, np.uint8)
    top = len(table) - 1
    for y in range(radiance.shape[0]):
        for x in range(radiance.shape[1]):
            for c in range(3):
                value = min(max(radiance[y, x, c] * gain, 0.0), 1.0)
                out[y, x, c] = table[int(value * top + 0.5)]
    return out
