"""Empty windows: the same as the windows of the images."""

from __future__ import annotations

import numpy as np
import pytest
from examined import at_times, found
from hypothesis import given
from hypothesis import strategies as st

from evplace.doctor import empty
from evplace.imaging.windows import TimeWindows, WindowSettings


@given(
    st.lists(st.integers(0, 400_000), min_size=1, max_size=50),
    st.sampled_from(["1/30", "1/60", "0.001", "0.0333333", "7/1000", "1"]),
)
def test_as_many_as_the_windows_that_images_are_made_of(times: list[int], dt: str) -> None:
    events = at_times(np.array(times) + 123)
    windows = TimeWindows(WindowSettings(dt).seconds)
    closed = [window for _, window in windows.push(events) if window is not None]
    last = windows.finish()
    assert last is not None
    counts = [window.events for window in [*closed, last]]
    finding = found(empty, events, "empty windows", dt=dt)
    assert finding.value == pytest.approx(100 * counts.count(0) / len(counts))


def test_a_long_silence_costs_no_time() -> None:
    events = at_times(np.array([0, 10**15]))
    finding = found(empty, events, "empty windows", dt="0.000001")
    assert finding.state == "bad"
    assert finding.value == pytest.approx(100)


@pytest.mark.parametrize(("every_us", "state"), [(30_000, "good"), (35_000, "look"), (100_000, "bad")])
def test_states(every_us: int, state: str) -> None:
    assert found(empty, at_times(np.arange(0, 5_000_000, every_us)), "empty windows").state == state
