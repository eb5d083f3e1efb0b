"""What the reader met, in files with known faults."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examined import SIZE, at_times, noise

from evplace.core.events import Events
from evplace.doctor import Examination, examine
from evplace.sources.writers import write_recording


def written(folder: Path, events: Events, **columns: Any) -> Path:
    """An npz file of these events, some columns changed."""
    kept = {"t_us": events.t_us, "x": events.x, "y": events.y, "p": events.p} | columns
    np.savez(folder / "made.npz", width=SIZE[0], height=SIZE[1], **kept)
    return folder / "made.npz"


def states(found: Examination) -> dict[str, str]:
    names = (
        "reading",
        "remarks",
        "events outside the sensor",
        "order of time",
        "leaps of the clock",
        "clock",
    )
    return {name: found.named(name).state for name in names}


EVENTS = noise(2000, 10)


def test_a_whole_file_is_good(tmp_path: Path) -> None:
    assert set(states(examine(written(tmp_path, EVENTS))).values()) == {"good"}


def test_events_outside_are_counted(tmp_path: Path) -> None:
    x = EVENTS.x.copy()
    x[::100] = 200
    finding = examine(written(tmp_path, EVENTS, x=x)).named("events outside the sensor")
    assert (finding.state, finding.value) == ("bad", pytest.approx(1, rel=0.01))
    assert "`size`" in finding.advice


def test_steps_back_are_counted(tmp_path: Path) -> None:
    t_us = EVENTS.t_us.copy()
    t_us[5000:5007] -= 100_000
    found = examine(written(tmp_path, EVENTS, t_us=t_us))
    finding = found.named("order of time")
    assert (finding.state, finding.value) == ("look", pytest.approx(100 * 7 / len(EVENTS)))
    assert found.named("clock").state == "good"


def test_a_leap_that_comes_back_is_counted(tmp_path: Path) -> None:
    t_us = EVENTS.t_us.copy()
    t_us[5000:5003] += 10**10
    finding = examine(written(tmp_path, EVENTS, t_us=t_us)).named("leaps of the clock")
    assert finding.state == "look"
    assert finding.sentence.startswith("3 of")


@pytest.mark.parametrize("bits", [24, 30])
def test_a_clock_that_starts_anew_unseen(tmp_path: Path, bits: int) -> None:
    """The writer of the file did not count the turns: half of the events are lost."""
    t_us = (EVENTS.t_us + (1 << bits) - 5_000_000) % (1 << bits)
    found = examine(written(tmp_path, EVENTS, t_us=t_us))
    finding = found.named("clock")
    assert (finding.state, finding.value) == ("bad", pytest.approx((1 << bits) / 1e6, rel=0.001))
    assert f"{bits}-bit clock" in finding.sentence
    assert str(1 << bits) in finding.advice
    assert found.named("order of time").value == pytest.approx(50, abs=3)


def test_turns_that_the_reader_saw_are_good(tmp_path: Path) -> None:
    t_us = np.arange(0, 40_000_000, 1000)
    events = Events.of(t_us, t_us % 7, t_us % 5, t_us % 2, SIZE)
    write_recording(tmp_path / "made.raw", [events], SIZE)
    finding = examine(tmp_path / "made.raw").named("clock")
    assert (finding.state, finding.value) == ("good", 2)


def test_a_guessed_size_is_remarked(tmp_path: Path) -> None:
    np.savez(tmp_path / "made.npz", t_us=EVENTS.t_us, x=EVENTS.x, y=EVENTS.y, p=EVENTS.p)
    finding = examine(tmp_path / "made.npz").named("remarks")
    assert (finding.state, finding.value) == ("look", 1)
    assert "inferred" in finding.sentence


@pytest.mark.parametrize(("suffix", "turn"), [("raw", "16.8 s"), ("aedat4", None)])
def test_a_silence_may_have_been_a_turn_of_the_clock_longer(
    suffix: str, turn: str | None, tmp_path: Path
) -> None:
    """EVT3 counts 24 bits of microseconds: what it does not write for a turn, nobody can know."""
    t_us = np.arange(0, 6_000_000, 100)
    quiet = at_times(t_us[(t_us < 3_000_000) | (t_us >= 3_400_000)])
    write_recording(tmp_path / f"quiet.{suffix}", [quiet], SIZE)
    write_recording(tmp_path / f"busy.{suffix}", [at_times(t_us)], SIZE)
    busy, quiet = (examine(tmp_path / f"{name}.{suffix}").findings for name in ("busy", "quiet"))
    told = [finding.sentence for finding in quiet if finding.name == "turns of the clock"]
    assert all(finding.name != "turns of the clock" for finding in busy)
    assert len(told) == (turn is not None)
    assert turn is None or f"every {turn}" in told[0]
