"""What a recording, a map, a traverse, a result, a city, a data set or a folder of images holds.

Examples:
  evplace info night.aedat4
  evplace info night.raw --size 640 480      a header without the sensor's size
  evplace info night.aedat4 --json           one object: format, width, height, events, times, dropped
  evplace info campus.evp                    what was learned, by what, and where
  evplace info city                          which drives and sensors, and what to give to other commands
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from evplace.cli._output import USED_GOOD_PART, note, print_facts, print_json
from evplace.cli._recording import RecordingFlags
from evplace.core.errors import DamagedRecordingError


@dataclass(frozen=True)
class Args(RecordingFlags):
    """Flags of `evplace info`."""

    path: tyro.conf.Positional[Path]
    """An event recording of any known format, or a folder that evplace wrote or reads."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Say what is in it; a recording is read to its end."""
    if not args.path.is_dir():
        return _recording(args)
    from evplace.cli._folders import facts_of

    known = facts_of(args.path)
    if known is None:
        return _recording(args)
    if args.json:
        print_json(known)
    else:
        print_facts(f"{args.path}: {known['kind']}", _in_words(known))
    return 0


def _in_words(known: dict[str, Any]) -> dict[str, object]:
    """What is known, as people want it."""
    return {
        name.replace("_", " "): ", ".join(map(str, value)) if isinstance(value, list) else value
        for name, value in known.items()
        if name != "kind" and value not in (None, [])
    }


def _recording(args: Args) -> int:
    """What a recording holds, read to its end."""
    recording = args.opened(args.path)
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
        print_facts(str(args.path), _shown(facts, first, last))
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
