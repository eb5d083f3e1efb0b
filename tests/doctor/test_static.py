"""Static regions: a bonnet of known height."""

from __future__ import annotations

import pytest
from examined import SIZE, found, noise

from evplace.core.events import Events
from evplace.doctor import static


def above(rows: int) -> Events:
    events = noise(60_000, 3)
    keep = events.y < rows
    return Events.of(events.t_us[keep], events.x[keep], events.y[keep], events.p[keep], SIZE)


def test_a_bonnet_is_measured() -> None:
    finding = found(static, above(32), "static regions")
    assert (finding.state, finding.value) == ("look", pytest.approx(100 / 3))
    assert "rows 32 to 47, columns 0 to 63" in finding.sentence
    assert "`static_mask=True`" in finding.advice


def test_a_sensor_that_sees_everything_is_good_and_few_events_do_not_tell() -> None:
    assert found(static, above(48), "static regions").state == "good"
    assert found(static, noise(1000, 3), "static regions").state == "unknown"
