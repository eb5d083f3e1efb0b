"""What a step of the training sees: some places of some routes, each in every drive.

A batch depends on the seed and the step alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace_lab.descriptor.bursts import Bursts

PAIRS = 0.7
"""Share of images that are the mean of two neighbours, as a map and a query use them."""
ONE_SENSOR = 0.8
"""Share of places that one sensor sees in all drives, as a map and a query are made by one."""
APART = 2
"""Places to either side that stand for a place in another drive, so that no two views are quite alike."""


class Batch(NamedTuple):
    """n images of several routes."""

    images: NDArray[np.float32]
    """(n, 45, 80) in 0 to 255."""
    poses: NDArray[np.float32]
    """(n, 3) x, y, yaw."""
    route: NDArray[np.int64]
    """(n,) images of two routes are never of one place."""


def draw_batch(towns: Sequence[Bursts], seed: int, step: int, routes: int, places: int) -> Batch:
    """`places` of each of `routes`, in every drive of theirs."""
    rng = np.random.default_rng([seed, step])
    n_routes = towns[0].images.shape[0]
    chosen = rng.choice(len(towns) * n_routes, routes, replace=routes > len(towns) * n_routes)
    parts = [_of_route(towns[k // n_routes], k % n_routes, places, rng) for k in map(int, chosen)]
    images, poses = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return Batch(images, poses, np.repeat(np.arange(routes), len(images) // routes))


def _of_route(
    town: Bursts, route: int, places: int, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Images and poses of one route; half of the routes are seen in a mirror."""
    images, poses = town.images[route], town.poses[route]
    n_drives, n_places, n_sensors = images.shape[:3]
    shape = (places, n_drives)
    place = rng.choice(n_places, (places, 1), replace=places > n_places)
    place = np.clip(place + rng.integers(-APART, APART + 1, shape), 0, n_places - 2)
    drive = np.broadcast_to(np.arange(n_drives), shape)
    sensor = np.where(
        rng.random((places, 1)) < ONE_SENSOR,
        rng.integers(0, n_sensors, (places, 1)),
        rng.integers(0, n_sensors, shape),
    )
    one = images[drive, place, sensor].astype(np.float32)
    two = images[drive, place + 1, sensor].astype(np.float32)
    paired = (rng.random(shape) < PAIRS)[..., None, None]
    seen = np.where(paired, (one + two) / 2, two).reshape(-1, *images.shape[3:])
    if rng.random() < 0.5:
        seen = seen[..., ::-1]
    return seen, poses[drive, place + 1].reshape(-1, 3)
