"""What an event recording holds.

Examples:
  evplace info night.aedat4
  evplace info night.raw --size 640 480      a header without the sensor's size
  evplace info night.aedat4 --json           one object: format, width, height, events, times, dropped
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from evplace.cli._output import USED_GOOD_PART, note, print_facts, print_json
from evplace.cli._recording import RecordingFlags
from evplace.core.errors import DamagedRecordingError


@dataclass(frozen=True)
class Args(RecordingFlags):
    """Flags of `evplace info`."""

    recording: tyro.conf.Positional[Path]
    """An event recording of any known format."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Read the whole recording and say what is in it."""
    recording = args.opened(args.recording)
    fault = None
    try:
        for _ in recording.packets():
            pass
    except DamagedRecordingError as error:
        fault = str(error)
    first, last = recording.t_first_us, recording.t_last_us
    facts = {
        "format": recording.format,
        "width": recording.size[0],
        "height": recording.size[1],
        "events": recording.events or 0,
        "t_first_us": first,
        "t_last_us": last,
        "dropped": recording.dropped,
        "notes": recording.notes,
        "fault": fault,
    }
    if args.json:
        print_json(facts)
    else:
        print_facts(str(args.recording), _shown(facts, first, last))
    if fault is not None:
        note(f"{fault}; the events before it were counted")
    return USED_GOOD_PART if fault is not None else 0


def _shown(facts: dict[str, object], first: int | None, last: int | None) -> dict[str, object]:
    """The facts as people want them: a span and a rate in place of two times."""
    seconds = (last - first) / 1e6 if first is not None and last is not None else 0.0
    events = facts["events"]
    assert isinstance(events, int)
    shown: dict[str, object] = {
        "format": facts["format"],
        "sensor": f"{facts['width']} x {facts['height']}",
        "events": events,
        "span": f"{seconds:.3f} s",
        "rate": f"{events / seconds / 1e6:.3f} million events/s" if seconds else "-",
        "dropped": facts["dropped"],
    }
    notes = facts["notes"]
    assert isinstance(notes, list)
    return shown | {f"note {number}": text for number, text in enumerate(notes, 1)}
