"""Make a pair of small recordings to try things on: a street by day and at night, with GPS logs.

Examples:
  evplace sample                        day.h5, night.h5 and their logs in evplace-sample, 11 MB
  evplace sample -o street

Made by the virtual city, in a minute; nothing is downloaded. What `evplace doctor`, `train`, `localize` and
`evaluate` say of real recordings they say of these, and the lines to try are printed.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from evplace.cli._output import print_json, progress, say
from evplace.core.storage import new_folder
from evplace.drives.to_traverse import open_traverse
from evplace.sources.readers import open_recording
from evplace.sources.writers import write_recording
from evplace_lab.city import CitySettings, generate
from evplace_lab.city.recording import write_logs

SETTINGS = CitySettings(
    fps=60, width=64, height=48, sensors=("ideal",), route_length_m=300.0, conditions=("day", "night"),
    paths=(1,), keep_events=True,
)  # fmt: skip
MARK = "day.h5"
"""What tells a folder that was written here: only such a one is replaced."""


@dataclass(frozen=True)
class Args:
    """Flags of `evplace sample`."""

    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("evplace-sample")
    """The folder to write."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """Print one JSON object: the names of the recordings."""


def run(args: Args) -> int:
    """Drive by day and at night, and keep the recordings."""
    with new_folder(args.out, args.overwrite, MARK) as folder:
        _make(folder)
    recordings = [args.out / f"{name}.h5" for name in SETTINGS.conditions]
    if args.json:
        print_json({"recordings": [str(path) for path in recordings]})
        return 0
    day, night = (f"{path} --track {path.with_suffix('.nmea')}" for path in recordings)
    street, result = args.out.with_name(f"{args.out.name}.evp"), args.out.with_name(f"{args.out.name}.result")
    say(
        f"A street of {SETTINGS.route_length_m:.0f} m by day and at night: {args.out}. To try on it:",
        "",
        f"  evplace doctor {day}",
        f"  evplace train {day} -o {street}",
        f"  evplace localize {street} {recordings[1]}",
        f"  evplace evaluate {street} {night} -o {result}",
        f"  evplace report {result}",
        f"  evplace play {result} {street} {recordings[1]}",
    )
    return 0


def _make(folder: Path) -> None:
    """day.h5, day.nmea, day.csv and the same of the night."""
    with tempfile.TemporaryDirectory(dir=folder) as city, progress("driving") as show:
        generate(
            Path(city) / "city", SETTINGS, progress=lambda at: show(round(at.share * 1000), 1000, at.drive)
        )
        for name in SETTINGS.conditions:
            drive = Path(city) / "city" / f"{name}-1"
            recording = open_recording(drive / "ideal.aedat4")
            write_recording(folder / f"{name}.h5", recording.packets(), recording.size)
            track = open_traverse(drive / "ideal").track
            assert track is not None  # the city knows where it is
            write_logs(folder / name, track)
