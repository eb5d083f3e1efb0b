"""The loops of the filter against plain numpy, to the bit: no answer depends on how fast they are."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.matchers import _belief as belief
from evplace.matchers import _route_filter as loops
from evplace.matchers import _surroundings as around

Floats = NDArray[np.float64]
RNG = np.random.default_rng(0)


def plain_move(before: Floats, way: Floats, steps: Floats) -> Floats:
    """Reference by reference, one class after another."""
    out = np.zeros_like(before)
    for v, step in enumerate(steps):
        for r, goal in enumerate(way + step):
            at = int(np.searchsorted(way, goal, "right")) - 1
            if at == len(way) - 1:
                out[at, v] += before[r, v] if goal <= way[at] else 0.0
                continue
            share = (goal - way[at]) / (way[at + 1] - way[at])
            out[at, v] += (1 - share) * before[r, v]
            out[at + 1, v] += share * before[r, v]
    return out


def plain_mix(before: Floats, change: float) -> Floats:
    slower = np.concatenate([before[:, :1], before[:, :-1]], axis=1)
    faster = np.concatenate([before[:, 1:], before[:, -1:]], axis=1)
    return np.asarray((1 - change) * before + 0.5 * change * (slower + faster))


@pytest.mark.parametrize("seconds", [0.0, 0.1, 3.0, 500.0])
def test_a_move_is_the_plain_one(seconds: float) -> None:
    """On items of any distance, some at the same point; beyond the end, too."""
    way = np.cumsum(RNG.uniform(0, 3, 200) * (RNG.random(200) < 0.8))
    before = RNG.random((200, len(belief.SPEEDS)))
    found, steps = np.empty_like(before), belief.SPEEDS * seconds
    loops.move(before, way, steps, found, np.empty(len(steps), np.uint64))
    np.testing.assert_array_equal(found, plain_move(before, way, steps))


def test_classes_are_mixed_as_plainly() -> None:
    before = RNG.random((50, len(belief.SPEEDS)))
    found = np.empty_like(before)
    loops.mix_speeds(before, 0.07, found)
    np.testing.assert_array_equal(found, plain_mix(before, 0.07))


def test_what_an_image_says_counts_as_plainly() -> None:
    """Looked up in a table of exponentials; each reference's belief is the sum of its classes."""
    z = RNG.normal(0, 3, 300).astype(np.float32)
    table, weight = around.evidence(around.USUAL), 0.7
    before, evidence = RNG.random((300, len(belief.SPEEDS))), RNG.random(300)
    nearest = np.clip((z - np.float32(around.GRID[0])) * np.float32(20) + np.float32(0.5), 0, 359)
    says = weight * table[nearest.astype(np.int32)]
    plain = before * np.exp(says)[:, None]
    plain /= plain.sum()
    found, told, marginal = before.copy(), evidence.copy(), np.empty(300)
    loops.weigh(found, told, z, weight * table, np.exp(weight * table))
    loops.share_out(found.reshape(-1), found.sum(), marginal)
    np.testing.assert_array_equal(found, plain)
    np.testing.assert_array_equal(told, evidence + says)
    np.testing.assert_array_equal(marginal, plain.sum(axis=1))


def plain_read(
    shares: Floats, z: Floats, verifying: Floats, way: Floats, xy: Floats, reach: Floats
) -> tuple[int, list[float]]:
    """The stretch of most belief, the item in its middle, the best scores beside it and elsewhere, and how
    far from it the belief lies.
    """
    stretches = np.abs(way - way[:, None]) <= reach[0]
    held = stretches @ shares
    best = np.flatnonzero(stretches[int(held.argmax())])
    centre = shares[best] @ way[best] / shares[best].sum()
    item = int(best[np.abs(way[best] - centre).argmin()])
    beside, away = np.abs(way - way[item]) < reach[1], np.hypot(*(xy - xy[item]).T)
    elsewhere = z[np.minimum(np.abs(way - way[item]), away) > reach[2]]
    spread = np.sqrt(shares @ np.minimum(away, reach[3]) ** 2)
    best_elsewhere = elsewhere.max() if len(elsewhere) else -4.0
    return item, [held.max(), z[beside].max(), best_elsewhere, verifying[beside].max(), spread]


@pytest.mark.parametrize("seed", range(40))
def test_a_belief_is_read_as_plainly(seed: int) -> None:
    """On a road that comes back beside itself; where scores are highest is near by, or anywhere."""
    rng = np.random.default_rng(seed)
    items = int(rng.integers(1, 200))
    way = np.cumsum(rng.uniform(0.5, 3, items))
    xy = np.stack([np.abs(way - way.mean()), 5.0 * (way > way.mean())], axis=1)
    shares, z, verifying = rng.random(items) ** 9, *rng.normal(size=(2, items)).astype(np.float32)
    shares /= shares.sum()
    z += np.exp(-np.square((way - way[shares.argmax()] - rng.normal(0, 15)) / 10)).astype(np.float32) * 6
    found, reach = np.empty(5), np.array([15.0, 4.0, 30.0, 60.0])
    item, signs = plain_read(shares, z, verifying, way, xy, reach)
    assert loops.read(shares, z, verifying, way, xy, reach, found) == item
    np.testing.assert_allclose(found, signs, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("many", [5, 6, 20, 301])
def test_the_usual_content_is_the_median(many: int) -> None:
    values = RNG.random(many)
    assert belief._median(belief.deque(values.tolist())) == np.median(values)
