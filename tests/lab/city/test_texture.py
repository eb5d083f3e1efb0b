"""Textures: the closed forms against plain sums, and what must hold at every place."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace_lab.city.texture import (
    band,
    hash01,
    mix,
    noise,
    plus,
    pulse,
    sample,
    scale,
    smoothstep,
    times,
)

near = st.floats(-50.0, 50.0)
share = st.floats(0.0, 1.0)
colour = st.tuples(share, share, share)


def plain_hash(x: int, y: int, seed: int) -> float:
    """The same numbers with Python's own, unbounded integers."""
    low = (1 << 64) - 1
    h = (x * 0x9E3779B97F4A7C15 & low) ^ (y * 0xC2B2AE3D27D4EB4F & low)
    h ^= seed * 0x165667B19E3779F9 & low
    for _ in range(2):
        h = (h ^ h >> 32) * 0xD6E8FEB86659FD93 & low
    return (h >> 40) / (1 << 24)


@given(st.integers(-(1 << 31), 1 << 31), st.integers(-(1 << 31), 1 << 31), st.integers(0, 1 << 20))
def test_the_hash_equals_its_twin_of_unbounded_integers(x: int, y: int, seed: int) -> None:
    assert hash01(x, y, seed) == plain_hash(x, y, seed)


def test_hashes_of_neighbours_have_nothing_to_do_with_each_other() -> None:
    grid = np.array([[hash01(x, y, 3) for x in range(60)] for y in range(60)])
    for a, b in ((grid[:, 1:], grid[:, :-1]), (grid[1:], grid[:-1])):
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 0.05
    assert np.histogram(grid, 10, (0, 1))[0].min() > 0.7 * grid.size / 10


@given(st.integers(-100, 100), st.integers(-100, 100), st.integers(0, 50))
def test_noise_passes_through_the_hashes_of_whole_numbers(x: int, y: int, seed: int) -> None:
    assert noise(float(x), float(y), seed) == pytest.approx(hash01(x, y, seed), abs=1e-12)


@given(near, near)
def test_noise_is_a_smooth_blend_of_the_four_corners(x: float, y: float) -> None:
    i, j = math.floor(x), math.floor(y)
    u, v = (t * t * (3 - 2 * t) for t in (x - i, y - j))
    low = (1 - u) * hash01(i, j, 7) + u * hash01(i + 1, j, 7)
    high = (1 - u) * hash01(i, j + 1, 7) + u * hash01(i + 1, j + 1, 7)
    assert noise(x, y, 7) == pytest.approx((1 - v) * low + v * high, abs=1e-12)


@given(near, st.floats(0.01, 6.0), share, share)
def test_pulses_and_gaps_fill_every_footprint(x: float, footprint: float, start: float, width: float) -> None:
    """What a train covers and what its gaps cover add up to all, and only the phase counts."""
    width *= 1 - start
    covered = pulse(x, footprint, start, width)
    gaps = pulse(x, footprint, 0.0, start) + pulse(x, footprint, start + width, 1 - start - width)
    assert covered + gaps == pytest.approx(1.0, abs=1e-9)
    assert pulse(x + 3, footprint, start, width) == pytest.approx(covered, abs=1e-7)


@given(near, st.integers(1, 5), share, share)
def test_over_whole_periods_only_the_width_counts(x: float, periods: int, start: float, width: float) -> None:
    width *= 1 - start
    assert pulse(x, float(periods), start, width) == pytest.approx(width, abs=1e-9)


@given(near, st.floats(0.01, 6.0), near, st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_bands_side_by_side_are_one_band(x: float, footprint: float, low: float, a: float, b: float) -> None:
    parts = band(x, footprint, low, low + a) + band(x, footprint, low + a, low + a + b)
    assert parts == pytest.approx(band(x, footprint, low, low + a + b), abs=1e-9)


def test_a_point_is_in_a_band_or_not() -> None:
    assert [band(x, 0.0, 1.0, 2.0) for x in (0.9, 1.5, 2.1)] == pytest.approx([0, 1, 0])
    assert band(1.0, 0.5, 1.0, 2.0) == pytest.approx(0.5)
    assert band(1.5, 4.0, 1.0, 2.0) == pytest.approx(0.25)


@given(near, near, near)
def test_smoothstep_falls_where_its_ends_are_turned(a: float, b: float, x: float) -> None:
    if abs(a - b) < 1e-3:
        return
    value = smoothstep(a, b, x)
    assert 0 <= value <= 1
    assert value + smoothstep(b, a, x) == pytest.approx(1.0, abs=1e-9)
    assert smoothstep(a, b, 0.75 * a + 0.25 * b) == pytest.approx(10 / 64, abs=1e-9)
    assert (smoothstep(a, b, a), smoothstep(a, b, b)) == (0.0, 1.0)


@given(colour, colour, share)
def test_colours_are_mixed_one_by_one(a: tuple[float, ...], b: tuple[float, ...], k: float) -> None:
    one, two = np.array(a), np.array(b)
    np.testing.assert_allclose(mix(a, b, k), one + (two - one) * k, atol=1e-12)
    np.testing.assert_allclose(scale(a, k), one * k, atol=1e-12)
    np.testing.assert_allclose(plus(a, b), one + two, atol=1e-12)
    np.testing.assert_allclose(times(a, b), one * two, atol=1e-12)
    np.testing.assert_allclose(mix(a, b, 1.0), b, atol=1e-12)


@given(st.floats(0.6, 5.4), st.floats(0.6, 3.4))
def test_a_plane_is_sampled_exactly(x: float, y: float) -> None:
    """Cell (row, column) has its centre at column + 1/2, row + 1/2."""
    rows, columns = np.mgrid[:4, :6] + 0.5
    assert sample((2 * columns - 3 * rows + 1).astype(np.float32), x, y) == pytest.approx(
        2 * x - 3 * y + 1, abs=1e-2
    )


def test_outside_the_grid_its_edge_is_held() -> None:
    grid = np.arange(12, dtype=np.float32).reshape(3, 4)
    for (x, y), corner in (((-9, -9), 0), ((99, -9), 3), ((-9, 99), 8), ((99, 99), 11)):
        assert sample(grid, float(x), float(y)) == pytest.approx(corner, abs=0.01)
