"""The checks of every event, against a plain twin, and against the faults that they are for."""

from __future__ import annotations

import numpy as np
import pytest

from evplace.sources.readers._checks import JUMP_US, LOOK_AHEAD, NOTHING_YET, REASONS, checked
from evplace.sources.readers._source import Block

SIZE = (100, 50)


def block(t_us: list[int] | np.ndarray, x: list[int] | None = None) -> Block:
    count = len(t_us)
    columns = np.zeros(count, np.uint16) if x is None else np.array(x, np.uint16)
    return Block(np.array(t_us, np.int64), columns, np.zeros(count, np.uint16), np.ones(count, np.bool_))


def drops(counts: list[int]) -> dict[str, int]:
    return {reason: count for reason, count in zip(REASONS, counts, strict=True) if count}


def plain(t_us: np.ndarray, x: np.ndarray) -> tuple[list[int], dict[str, int]]:
    """The rules in the words of the docstring, without the jumps."""
    kept: list[int] = []
    counts = {"out_of_range": 0, "backwards": 0}
    for i in range(len(t_us)):
        if x[i] >= SIZE[0]:
            counts["out_of_range"] += 1
        elif kept and t_us[i] < t_us[kept[-1]]:
            counts["backwards"] += 1
        else:
            kept.append(i)
    return kept, {reason: count for reason, count in counts.items() if count}


def test_good_events_are_passed_on_not_copied() -> None:
    given = block([5, 5, 6, 7])
    good, rest, counts = checked(given, SIZE, last_us=5, final=False)
    assert good.t_us is given.t_us
    assert (rest, drops(counts)) == (None, {})


@pytest.mark.parametrize("seed", range(20))
def test_same_as_the_plain_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t_us = np.sort(rng.integers(0, 1000, 500)) + rng.integers(-1, 2, 500) * rng.integers(0, 5)
    x = rng.integers(0, 103, 500)
    good, rest, counts = checked(block(t_us, list(x)), SIZE, NOTHING_YET, final=True)
    kept, expected = plain(t_us, x)
    assert rest is None
    assert np.array_equal(good.t_us, t_us[kept])
    assert drops(counts) == expected


def test_one_leap_into_the_future_costs_one_event() -> None:
    t_us = np.arange(10_000)
    t_us[[0, 3000, 9999]] = 1 << 50
    good, _, counts = checked(block(t_us), SIZE, NOTHING_YET, final=True)
    assert drops(counts) == {"jump": 2}  # the very last one has nothing after it that speaks against it
    assert len(good.t_us) == 9998


def test_a_gap_in_the_recording_is_kept() -> None:
    t_us = np.concatenate([np.arange(5000), np.arange(5000) + 3600 * 1_000_000])
    good, _, counts = checked(block(t_us), SIZE, NOTHING_YET, final=True)
    assert (len(good.t_us), drops(counts)) == (10_000, {})


def test_what_cannot_be_judged_yet_is_handed_back() -> None:
    t_us = np.arange(100)
    t_us[50:] += 10 * JUMP_US
    good, rest, _ = checked(block(t_us), SIZE, last_us=0, final=False)
    assert rest is not None
    assert (len(good.t_us), len(rest.t_us)) == (50, 50)
    assert len(rest.t_us) <= LOOK_AHEAD


def test_a_recording_where_every_other_time_is_wrong_is_judged_in_time() -> None:
    t_us = np.arange(1_000_000)
    t_us[1::2] += 1 << 40
    good, _, counts = checked(block(t_us), SIZE, 0, final=True)
    assert len(good.t_us) + sum(counts) == 1_000_000
    assert np.all(np.diff(good.t_us) >= 0)


def test_how_far_back_dropped_events_lay() -> None:
    good, _, counts = checked(block([10, 500, 480, 490, 100, 600]), SIZE, NOTHING_YET, final=True)
    assert (good.back_us, drops(counts)) == (400, {"backwards": 3})
