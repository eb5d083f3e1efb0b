"""Each representation against a plain twin, event by event, for any events in any pieces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace.core.errors import RecordingError
from evplace.core.events import Events
from evplace.imaging.representations import Representation
from evplace.imaging.representations.binary import Binary
from evplace.imaging.representations.count import Count
from evplace.imaging.representations.polarity import Polarity
from evplace.imaging.representations.time_surface import TimeSurface
from evplace.imaging.representations.voxel import Voxel

SIZE = (7, 5)
SATURATION, TAU_US, BINS = 3, 40.0, 4

event = st.tuples(st.integers(0, 200), st.integers(0, 6), st.integers(0, 4), st.booleans())
windows = st.lists(event, max_size=40).map(sorted)


def events_of(rows: list[tuple[int, int, int, bool]]) -> Events:
    t_us, x, y, p = zip(*rows, strict=True) if rows else ([], [], [], [])
    return Events.of(t_us, x, y, p, SIZE)


def binary(rows: list[tuple[int, int, int, bool]], _: int) -> NDArray[np.float64]:
    grid = np.zeros((1, 5, 7))
    for _, x, y, _ in rows:
        grid[0, y, x] = -1
    return grid


def polarity(rows: list[tuple[int, int, int, bool]], _: int) -> NDArray[np.float64]:
    grid = np.zeros((2, 5, 7))
    for _, x, y, p in rows:
        grid[int(p), y, x] = -1
    return grid


def count(rows: list[tuple[int, int, int, bool]], _: int) -> NDArray[np.float64]:
    grid = np.zeros((1, 5, 7))
    for _, x, y, _ in rows:
        grid[0, y, x] = min(grid[0, y, x] + 1 / SATURATION, 1)
    return grid


def surface(rows: list[tuple[int, int, int, bool]], now: int) -> NDArray[np.float64]:
    grid = np.zeros((1, 5, 7))
    for t_us, x, y, _ in rows:
        grid[0, y, x] = np.exp(-max(now - t_us, 0) / TAU_US)
    return grid


def voxel(rows: list[tuple[int, int, int, bool]], _: int) -> NDArray[np.float64]:
    """A triangle of weights about each bin's time (Zhu et al. 2019)."""
    grid = np.zeros((BINS, 5, 7))
    for t_us, x, y, p in rows:
        span = max(rows[-1][0] - rows[0][0], 1)
        at = (BINS - 1) * (t_us - rows[0][0]) / span
        grid[:, y, x] += (1 if p else -1) * np.maximum(0, 1 - np.abs(np.arange(BINS) - at))
    return np.clip(grid / SATURATION, -1, 1) / 2 + 0.5


KINDS: dict[str, tuple[Callable[[], Representation], Callable[..., NDArray[np.float64]]]] = {
    "binary": (lambda: Binary(SIZE), binary),
    "polarity": (lambda: Polarity(SIZE), polarity),
    "count": (lambda: Count(SIZE, SATURATION), count),
    "time-surface": (lambda: TimeSurface(SIZE, TAU_US / 1000), surface),
    "voxel": (lambda: Voxel(SIZE, BINS, SATURATION), voxel),
}
every = pytest.mark.parametrize("kind", KINDS)


@every
@given(windows, st.integers(0, 40))
def test_it_equals_its_twin_in_one_piece_and_in_two(
    kind: str, rows: list[tuple[int, int, int, bool]], cut: int
) -> None:
    make, twin = KINDS[kind]
    whole, pieces = make(), make()
    whole.add(events_of(rows))
    for part in (rows[:cut], rows[cut:]):
        pieces.add(events_of(part))
    got = whole.channels(200)
    np.testing.assert_allclose(got, twin(rows, 200), atol=1e-5)
    np.testing.assert_array_equal(got, pieces.channels(200))
    assert got.dtype == (np.int8 if kind in ("binary", "polarity") else np.float32)


@every
@given(windows, windows)
def test_after_clear_only_the_next_window_counts(
    kind: str, first: list[tuple[int, int, int, bool]], second: list[tuple[int, int, int, bool]]
) -> None:
    make, twin = KINDS[kind]
    one = make()
    one.add(events_of(first))
    one.channels(200)
    one.clear()
    second = [(t_us + 200, x, y, p) for t_us, x, y, p in second]
    one.add(events_of(second))
    remembered = first + second if kind == "time-surface" else second
    np.testing.assert_allclose(one.channels(400), twin(remembered, 400), atol=1e-5)


@every
@pytest.mark.parametrize(("x", "y"), [(7, 0), (0, 5), (65535, 65535), (7, 4)])
def test_an_event_outside_is_refused_and_named(kind: str, x: int, y: int) -> None:
    one = KINDS[kind][0]()
    events = Events.of([0, 1], [0, x], [0, y], [True, True], SIZE)
    with pytest.raises(RecordingError, match=f"column {x}, row {y} lies outside the sensor of 7x5"):
        one.add(events)


@every
def test_corners_are_inside(kind: str) -> None:
    one = KINDS[kind][0]()
    one.add(events_of([(0, 0, 0, True), (1, 6, 4, True), (2, 0, 4, False), (3, 6, 0, False)]))
    grid = one.channels(10)
    changed = np.argwhere(np.any(grid != grid[0, 2, 3], axis=0))
    assert changed.tolist() == [[0, 0], [0, 6], [4, 0], [4, 6]]


def test_an_event_after_the_windows_end_is_as_fresh_as_can_be() -> None:
    one = TimeSurface(SIZE, TAU_US / 1000)
    one.add(events_of([(50, 1, 1, True)]))
    assert one.channels(20)[0, 1, 1] == 1.0


def test_events_of_one_time_fall_into_the_first_bin() -> None:
    one = Voxel(SIZE, BINS, SATURATION)
    one.add(events_of([(9, 2, 2, True)] * 3))
    np.testing.assert_allclose(one.channels(9)[:, 2, 2], [1.0, 0.5, 0.5, 0.5])
