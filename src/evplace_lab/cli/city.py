"""Drive through the virtual city: traverses by day, night, rain, dusk, fog, snow and low sun.

Examples:
  evplace city -o city                                     the benchmark: two paths by day, night and rain
  evplace city -o small --route-length-m 300 --fps 60      minutes, not a quarter of an hour
  evplace city -o winter --conditions day snow --paths 1 --keep-events
  evplace city -o city --on ray                            on a cluster whose nodes share the folder
  evplace city --preview sheet.png                         what it looks like; .webp or .gif moves

Each drive is a folder: a traverse for each sensor (ideal, weak, from-8bit) and for the colour camera, with
the same times and the same truth. A call that was stopped goes on where it was when it is given again.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from evplace.cli._output import print_json, progress, say
from evplace.cli._settings import SettingsFlags
from evplace.cli._workers import WorkerFlags
from evplace.core.errors import SettingsError
from evplace.imaging.sheets import FILMS, PICTURES, check_ending
from evplace_lab.city import CitySettings, generate, moving_preview, preview


@dataclass(frozen=True)
class Args(WorkerFlags, SettingsFlags):
    """Flags of `evplace city`."""

    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """The folder for the drives; drives that are there already are kept."""
    preview: Path | None = None
    """Only write a picture: a contact sheet (.png), or a short drive (.webp, .gif)."""
    city: Annotated[CitySettings, tyro.conf.arg(name="")] = field(default_factory=CitySettings)
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Make the drives that are not there yet, or a picture of some."""
    if args.preview is not None:
        check_ending(args.preview, (*PICTURES, *FILMS), "a picture")
        picture = moving_preview if args.preview.suffix.lower() in FILMS else preview
        picture(args.preview, args.city.seed, args.city.conditions)
        return 0
    if args.out is None:
        raise SettingsError("say where the drives go: evplace city -o FOLDER")
    with args.opened_workers() as workers, progress("driving") as show:
        drives = generate(
            args.out,
            args.city,
            workers,
            lambda at: show(round(at.share * 1000), 1000, f"{at.drive}, {at.left_s:.0f} s left"),
        )
    if args.json:
        print_json({"drives": [str(drive) for drive in drives]})
    else:
        say(*map(str, drives))
    return 0
