"""The sparse maps against exact fractions and dense matrices."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace.imaging._resampling import (
    AxisMap,
    Resampler,
    Resize,
    Taps,
    _area,
    _blurred,
    _linear,
    _mirrored,
    axis_map,
)

lengths = st.integers(2, 40)
outputs = st.integers(1, 40)
kinds = st.sampled_from(["area", "linear"])


def dense(sparse: AxisMap, n_in: int) -> NDArray[np.int64]:
    """(out, n_in) the same map, with every weight in its place."""
    full = np.zeros((len(sparse.start), n_in), np.int64)
    for out, start in enumerate(sparse.start):
        full[out, start : start + sparse.weights.shape[1]] = sparse.weights[out]
    return full


def exact(n_in: int, n_kept: int, n_out: int, blur: bool, resize: Resize) -> list[list[Fraction]]:
    """The composed map as rows of fractions: a blur matrix, then what is kept of it, then the resize."""
    spread = [[Fraction(0)] * n_in for _ in range(n_in)]
    for row in range(n_in):
        for shift, weight in ((-1, 1), (0, 2), (1, 1)) if blur else ((0, 4),):
            spread[row][list(np.pad(np.arange(n_in), 1, "reflect"))[row + shift + 1]] += Fraction(weight, 4)
    taps = shares(_area if resize == "area" else _linear, n_kept, n_out)
    return [
        [sum((weight * spread[i][k] for i, weight in row.items()), Fraction(0)) for k in range(n_in)]
        for row in taps
    ]


def shares(
    resize: Callable[[int, int], tuple[list[Taps], int]], n_in: int, n_out: int
) -> list[dict[int, Fraction]]:
    """The taps of each output as shares of it."""
    rows, total = resize(n_in, n_out)
    return [{index: Fraction(weight, total) for index, weight in row.items()} for row in rows]


@given(lengths, st.integers(1, 40), outputs, st.booleans(), kinds)
def test_every_map_is_the_exact_composition(
    n_in: int, n_kept: int, n_out: int, blur: bool, resize: Resize
) -> None:
    assume(n_kept <= n_in)
    sparse = axis_map(n_in, n_kept, n_out, blur, resize)
    assert sparse.start.min() >= 0
    assert sparse.start.max() + sparse.weights.shape[1] <= n_in
    assert np.all(sparse.weights >= 0)
    assert np.all(sparse.weights.sum(1) == sparse.total)
    got = [[Fraction(int(weight), sparse.total) for weight in row] for row in dense(sparse, n_in)]
    assert got == exact(n_in, n_kept, n_out, blur, resize)


@given(lengths, outputs)
def test_areas_take_an_equal_share_of_every_input(n_in: int, n_out: int) -> None:
    total = [
        sum((row.get(k, Fraction(0)) for row in shares(_area, n_in, n_out)), Fraction(0)) for k in range(n_in)
    ]
    assert total == [Fraction(n_out, n_in)] * n_in


@given(lengths, outputs, st.integers(-9, 9), st.integers(-9, 9))
def test_a_line_is_interpolated_exactly_between_the_outer_centres(
    n_in: int, n_out: int, slope: int, start: int
) -> None:
    for out, taps in enumerate(shares(_linear, n_in, n_out)):
        at = Fraction(2 * out + 1, 2) * Fraction(n_in, n_out) - Fraction(1, 2)
        at = min(max(at, Fraction(0)), Fraction(n_in - 1))
        assert sum(weight * (slope * index + start) for index, weight in taps.items()) == slope * at + start
        assert 0 not in taps.values()


@given(lengths)
def test_the_same_length_is_left_as_it_is(n: int) -> None:
    for resize in (_area, _linear):
        assert shares(resize, n, n) == [{k: Fraction(1)} for k in range(n)]


def test_the_borders_are_mirrored_without_repeating_the_edge() -> None:
    assert [_mirrored(k, 5) for k in range(-1, 6)] == [1, 0, 1, 2, 3, 4, 3]
    assert _mirrored(-1, 1) == _mirrored(1, 1) == 0
    assert _blurred({0: 1}, 4) == {1: 2, 0: 2}
    assert _blurred({1: 1}, 4) == {0: 1, 1: 2, 2: 1}
    assert _blurred({0: 1}, 1) == {0: 4}


SHAPES = [(7, 9, 3, 4), (24, 32, 9, 16), (33, 20, 33, 20), (16, 50, 5, 7), (260, 346, 90, 160), (5, 5, 8, 8)]


@pytest.mark.parametrize("resize", ["area", "linear"])
@pytest.mark.parametrize("shape", SHAPES)
def test_binary_canvases_give_the_exact_sums(shape: tuple[int, int, int, int], resize: Resize) -> None:
    """Whole numbers all the way: the only rounding is that of the last float32."""
    rows, columns = (
        axis_map(n, max(n * 3 // 4, 1), out, True, resize)
        for n, out in zip(shape[:2], shape[2:], strict=True)
    )
    canvas = np.random.default_rng(1).integers(-1, 1, shape[:2]).astype(np.int8)
    left, right = dense(rows, shape[0]).astype(object), dense(columns, shape[1]).astype(object)
    sums = left @ -canvas.astype(object) @ right.T
    wanted = (sums / (rows.total * columns.total)).astype(np.float64)
    np.testing.assert_allclose(Resampler(rows, columns).binary(canvas), wanted, rtol=2e-7, atol=1e-9)


@given(st.integers(0, 2**32))
def test_any_values_go_through_the_same_map(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, columns = axis_map(18, 13, 7, True, "area"), axis_map(11, 11, 6, False, "linear")
    canvas = rng.normal(size=(18, 11)).astype(np.float32)
    wanted = dense(rows, 18) / rows.total @ canvas.astype(np.float64) @ (dense(columns, 11) / columns.total).T
    np.testing.assert_allclose(Resampler(rows, columns).values(canvas), wanted, atol=1e-5)


def test_values_and_binary_agree_where_both_can() -> None:
    resampler = Resampler(axis_map(60, 45, 20, True, "area"), axis_map(80, 80, 33, True, "area"))
    canvas = np.random.default_rng(3).integers(-1, 1, (60, 80)).astype(np.int8)
    np.testing.assert_allclose(
        resampler.binary(canvas), resampler.values(-canvas.astype(np.float32)), atol=1e-6
    )


def test_sums_too_large_for_whole_numbers_go_through_floats() -> None:
    rows, columns = axis_map(27_000, 27_000, 1, True, "area"), axis_map(3, 3, 20_011, True, "linear")
    assert rows.total * columns.total >= 1 << 32
    canvas = np.zeros((27_000, 3), np.int8)
    canvas[:13_500] = -1
    np.testing.assert_allclose(Resampler(rows, columns).binary(canvas), 0.5, rtol=1e-6)


@pytest.mark.parametrize(
    ("rows", "columns"),
    [((97, 64), (50, 33)), ((63, 40), (63, 40)), ((960, 90), (97, 64))],
)
def test_sums_stay_in_the_numbers_that_hold_them(rows: tuple[int, int], columns: tuple[int, int]) -> None:
    """A canvas that is set everywhere makes every sum as large as it can be: on both sides of each limit."""
    down, across = (axis_map(n, n, out, True, "area") for n, out in (rows, columns))
    image = Resampler(down, across).binary(np.full((rows[0], columns[0]), -1, np.int8))
    np.testing.assert_allclose(image, 1.0, rtol=1e-6)
