"""Each image as the mean of itself and one or more taken shortly before: noise goes, what lasts stays."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Images = NDArray[np.uint8]


@dataclass(frozen=True)
class Averaging:
    """Which earlier images are taken."""

    images: int = 2
    """Images in a mean."""
    apart_s: float = 0.1
    """Seconds from one to the next; at ten images a second or more, any rate gives the same."""


class Averager:
    """Averages the images of one drive, one after another."""

    def __init__(self, averaging: Averaging) -> None:
        self._back_us = [round(averaging.apart_s * 1e6 * k) for k in range(1, averaging.images)]
        self._before: deque[tuple[int, Images]] = deque()

    def push(self, image: Images, t_us: int) -> Images:
        """The mean of an image (h, w) or (h, w, C) and the earlier ones.

        Of each time, the image nearest to it is taken; where the nearest is further off than half the time,
        as at a drive's start or at a low rate, none.
        """
        taken = [image]
        for back_us in self._back_us:
            nearest = min(self._before, key=lambda one: abs(one[0] - t_us + back_us), default=None)
            if nearest is not None and 2 * abs(nearest[0] - t_us + back_us) <= self._back_us[0]:
                taken.append(nearest[1])
        self._keep(image, t_us)
        if len(taken) == 1:
            return image
        total = image.astype(np.uint16)
        for other in taken[1:]:
            total += other
        return np.asarray((total + len(taken) // 2) // len(taken), np.uint8)

    def _keep(self, image: Images, t_us: int) -> None:
        if not self._back_us:
            return
        self._before.append((t_us, image.copy()))
        while self._before[0][0] < t_us - 2 * self._back_us[-1]:
            self._before.popleft()


def averaged(images: Images, t_us: NDArray[np.int64], averaging: Averaging) -> Images:
    """(n, ...) the images of a drive, each averaged with those before it."""
    averager = Averager(averaging)
    return np.stack([averager.push(image, int(time)) for image, time in zip(images, t_us, strict=True)])
