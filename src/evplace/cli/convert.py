"""Write a recording in another format, chosen by the new file's suffix; or a traverse as a folder of images.

Examples:
  evplace convert night.bag night.npz
  evplace convert night.raw night.aedat4 --size 640 480
  evplace convert night.aedat4 night.h5            in the layout of DSEC
  evplace convert day campus/database              day is a traverse folder: @east@north@...@.jpg, as benches
  evplace convert night campus/queries             of frame-based place recognition read them
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from evplace.cli._output import USED_GOOD_PART, note, print_facts, print_json
from evplace.cli._recording import RecordingFlags
from evplace.core.errors import DamagedRecordingError
from evplace.drives.datasets.utm_folders import write_images
from evplace.imaging.traverse import Traverse
from evplace.sources.writers import write_recording


@dataclass(frozen=True)
class Args(RecordingFlags):
    """Flags of `evplace convert`."""

    source: tyro.conf.Positional[Path]
    """An event recording of any known format, or a traverse folder."""
    target: tyro.conf.Positional[Path]
    """The file to write: .npz, .h5, .aedat4 or .raw (EVT3); of a traverse, the folder of images."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Read, check and write."""
    if (args.source / "traverse.json").exists():
        return _write_images(args)
    recording = args.opened(args.source)
    fault = None
    try:
        write_recording(args.target, recording.packets(), recording.size, overwrite=args.overwrite)
    except DamagedRecordingError as error:
        fault = str(error)
    facts = {
        "events": recording.events or 0,
        "dropped": recording.dropped,
        "notes": recording.notes,
        "fault": fault,
    }
    print_json(facts) if args.json else print_facts(str(args.target), facts)
    if fault is not None:
        note(f"{fault}; the events before it were written")
    return USED_GOOD_PART if fault is not None else 0


def _write_images(args: Args) -> int:
    traverse = Traverse.load(args.source)
    written = write_images(traverse, args.target, args.overwrite)
    facts = {"images": written, "without_position": len(traverse) - written}
    print_json(facts) if args.json else print_facts(str(args.target), facts)
    return 0
