"""Events of city frames, one by one against the simulator's plain numpy twin."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.core.events import Events
from evplace.sources.simulators.esim import PRESETS, Simulator
from evplace_lab.city import Film, build_town
from evplace_lab.city.camera import ColourCamera, grey, luminance

sys.path.insert(0, str(Path(__file__).parents[2] / "sources" / "simulators"))

from test_esim import NumpyTwin

SIZE = (160, 120)


def same_within_a_microsecond(ours: Events, twins: Events) -> None:
    """The logarithms of numba and numpy may differ in the last bit, which can move a crossing by 1 us."""
    for events in (ours, twins):
        assert np.all(np.diff(events.t_us) >= 0)
    a, b = (events_by_pixel(events) for events in (ours, twins))
    np.testing.assert_array_equal(a[:, [0, 1, 3]], b[:, [0, 1, 3]])
    assert np.abs(a[:, 2] - b[:, 2]).max(initial=0) <= 1


def events_by_pixel(events: Events) -> NDArray[np.int64]:
    order = np.lexsort((events.t_us, events.x, events.y))
    columns = (events.y, events.x, events.t_us, events.p)
    return np.stack([column[order].astype(np.int64) for column in columns], axis=1)


@pytest.mark.parametrize("preset", ["ideal", "weak", "from-8bit"])
@pytest.mark.parametrize("condition", ["day", "night"])
def test_city_frames_give_the_twins_events(preset: str, condition: str) -> None:
    film = Film(build_town(0), 1, condition, SIZE, 0)
    settings = dataclasses.replace(PRESETS[preset], noise_hz=0.0, hot_pixels=0.0)
    sensor, camera = Simulator(SIZE, settings, seed=1), ColourCamera([0])
    twin, total = NumpyTwin(sensor), 0
    for t_us in film.times(120)[600:612]:
        radiance = film.radiance(t_us)
        camera.expose(radiance, t_us)
        frame = grey(camera.picture(radiance)) if preset == "from-8bit" else luminance(radiance)
        events = sensor.push(frame, t_us)
        same_within_a_microsecond(events, twin.push(frame, t_us))
        total += len(events)
    assert total > 1000
