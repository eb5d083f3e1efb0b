"""How far a belief spreads and what else is likely, against plain numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace.matchers import Route
from evplace.matchers._answering import HELD, LIKELY, NOTABLE, OTHERS, Others, Reader
from evplace.matchers._ways import Ways

Floats = NDArray[np.float64]


def plain_radius(belief: Floats, xy: Floats, item: int) -> float:
    held = np.flatnonzero(belief > HELD)
    away = np.hypot(*(xy[held] - xy[item]).T)
    order = np.argsort(away, kind="stable")
    share = np.cumsum(belief[held[order]])
    return float(away[order[np.searchsorted(share, LIKELY * share[-1])]])


def plain_others(belief: Floats, xy: Floats, item: int, together: float, apart: float) -> Others:
    left = np.where(belief > max(HELD, NOTABLE * belief.max()), belief, 0.0)
    found, mass, here = list[int](), 0.0, item
    for _ in range(OTHERS):
        left[np.hypot(*(xy - xy[here]).T) <= apart] = 0.0
        if not left.any():
            break
        here = int(left.argmax())
        if not found:
            mass = float(left[np.hypot(*(xy - xy[here]).T) <= together].sum())
        found.append(here)
    return Others(tuple(found), mass)


def belief_of(rng: np.random.Generator, kind: str, items: int) -> Floats:
    """All much alike; a few places alone; or a few above all others."""
    shares = {
        "flat": rng.uniform(0.9, 1.1, items),
        "sure": np.where(rng.random(items) < 5 / items, rng.random(items), 0.0) + 1e-12,
        "peaks": rng.random(items) ** 8 + 1e-3,
    }[kind]
    return np.asarray(shares / shares.sum())


def streets(rng: np.random.Generator, items: int, spread: str) -> Floats:
    """Along a road; anywhere; most within a metre while one is far away; or all at one point."""
    xy = {
        "road": np.stack([np.arange(items) * 2.0, np.zeros(items)], axis=1),
        "anywhere": rng.uniform(0, 500, (items, 2)),
        "outlier": rng.random((items, 2)) + 1e5 * (np.arange(items) == items // 2)[:, None],
        "point": np.zeros((items, 2)),
    }[spread]
    return np.asarray(xy)


@settings(deadline=None)
@given(
    st.integers(2, 300),
    st.sampled_from(["flat", "sure", "peaks"]),
    st.sampled_from(["road", "anywhere", "outlier", "point"]),
    st.integers(0, 99),
)
@example(300, "flat", "outlier", 0)
def test_it_is_what_plain_numpy_says(items: int, kind: str, spread: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    xy: Any = 5e5 + streets(rng, items, spread)
    reader = Reader(Ways.of(Route(xy, np.full(items, np.nan))))
    belief, item = belief_of(rng, kind, items), int(rng.integers(items))
    radius = max(plain_radius(belief, reader.ways.xy, item), reader.ways.spacing / 2)
    assert reader.uncertainty_m(belief, item) == radius
    found = reader.others(belief, item)
    wanted = plain_others(belief, reader.ways.xy, item, *reader._reach[[0, 2]].tolist())
    assert found.items == wanted.items
    np.testing.assert_allclose(found.mass, wanted.mass, rtol=1e-12)


def test_nothing_believed_has_no_radius_and_no_others() -> None:
    reader = Reader(Ways.of(Route(streets(np.random.default_rng(0), 9, "road"), np.full(9, np.nan))))
    assert np.isnan(reader.uncertainty_m(np.zeros(9), 3))
    assert reader.others(np.zeros(9), 3) == Others((), 0.0)
