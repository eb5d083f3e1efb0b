"""What a step of the training sees: some places of some routes, each in every drive.

A batch depends on the seed and the step alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from evplace_lab.descriptor.bursts import Bursts

PAIRS = 0.7
"""Share of images that are the mean of two neighbours, as a map and a query use them."""
ONE_SENSOR = 0.8
"""Share of places that one sensor sees in all drives, as a map and a query are made by one."""
APART = 2
"""Places to either side that stand for a place in another drive, so that no two views are quite alike."""


class Routes(NamedTuple):
    """All routes of some towns, on the device that trains."""

    images: Tensor
    """(routes, drives, places, sensors, 45, 80) uint8."""
    poses: Tensor
    """(routes, drives, places, 3) x, y, yaw."""

    @classmethod
    def of(cls, towns: Iterable[Bursts], device: str) -> Routes:
        """The routes of `towns`, one after the other."""
        parts = [[torch.from_numpy(array).to(device) for array in town] for town in towns]
        images, poses = (torch.cat(columns) for columns in zip(*parts, strict=True))
        return cls(images, poses)


class Batch(NamedTuple):
    """n images of several routes."""

    images: Tensor
    """(n, 45, 80) float32 in 0 to 255."""
    poses: Tensor
    """(n, 3) x, y, yaw."""
    route: Tensor
    """(n,) images of two routes are never of one place."""


def draw_batch(all_routes: Routes, seed: int, step: int, routes: int, places: int) -> Batch:
    """`places` of each of `routes`, in every drive of theirs; half of the routes are seen in a mirror."""
    rng = np.random.default_rng([seed, step])
    n_routes, n_drives, n_places, n_sensors = all_routes.images.shape[:4]
    shape = (routes, min(places, n_places), n_drives)
    route = rng.choice(n_routes, (routes, 1, 1), replace=routes > n_routes)
    place = rng.random((routes, n_places)).argsort(1)[:, :places, None]
    place = np.clip(place + rng.integers(-APART, APART + 1, shape), 0, n_places - 2)
    sensor = _sensors(rng, shape, n_sensors)
    seen = (route * n_drives + np.arange(n_drives)) * n_places + place
    paired, mirrored = rng.random(shape) < PAIRS, rng.random((routes, 1, 1)) < 0.5

    def there(values: NDArray[np.generic]) -> Tensor:
        whole = np.array(np.broadcast_to(values, shape)).reshape(-1)
        return torch.from_numpy(whole).to(all_routes.images.device, non_blocking=True)

    flat = all_routes.images.flatten(0, 3)
    one, two = (flat[there((seen + after) * n_sensors + sensor)].float() for after in (0, 1))
    images = torch.where(there(paired)[:, None, None], (one + two) / 2, two)
    images = torch.where(there(mirrored)[:, None, None], images.flip(2), images)
    return Batch(
        images, all_routes.poses.flatten(0, 2)[there(seen + 1)], there(np.arange(routes)[:, None, None])
    )


def _sensors(rng: np.random.Generator, shape: tuple[int, int, int], n_sensors: int) -> NDArray[np.int64]:
    """The sensor of each image, for most places one in all drives."""
    one = rng.integers(0, n_sensors, (*shape[:2], 1))
    return np.where(rng.random((*shape[:2], 1)) < ONE_SENSOR, one, rng.integers(0, n_sensors, shape))
