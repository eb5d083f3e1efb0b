"""Say where a drive is: one match for each window of events.

Examples:
  evplace localize campus.evp night.aedat4                     a line a window
  evplace localize campus.evp night.aedat4 -o night.csv
  evplace localize campus.evp night --matcher seqslam --set ds=20
  evplace localize campus.evp night.aedat4 --mask night_hot_pixels.txt
  evplace localize campus.evp night.aedat4 --json              a JSON object a line
"""

from __future__ import annotations

import csv
import dataclasses
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from evplace.cli._output import USED_GOOD_PART, note, note_guesses
from evplace.core import settings
from evplace.core.errors import DamagedRecordingError
from evplace.core.storage import new_file
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer, Match
from evplace.placemap import PlaceMap
from evplace.sources.cleaning import pixel_mask
from evplace.sources.readers import open_recording

COLUMNS = ("t_us", "place", "easting", "northing", "score", "state")


@dataclass(frozen=True)
class Args:
    """Flags of `evplace localize`."""

    map: tyro.conf.Positional[Path]
    """A map that `evplace train` wrote."""
    drive: tyro.conf.Positional[Path]
    """An event recording, or a traverse folder."""
    matcher: str = "local"
    """best (global-max), local (Algorithm 1), seqslam, graph, dp or hmm."""
    preset: str | None = None
    """A preset of the matcher, for example paper."""
    set: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """A setting of the matcher, as name=value: K=5, tau1=0.99, tau2=0.01 for local."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Write a .csv file instead of standard output."""
    mask: Path | None = None
    """Pixels of this drive to leave out: a text file of x,y lines, or a .npy file."""
    size: tuple[int, int] | None = None
    """Width and height of the sensor in pixels, where the file does not say."""
    time_unit: Literal["s", "ms", "us", "ns"] | None = None
    """Unit of the times, where the file does not say."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """One JSON object a line."""


class _Drive:
    """The matches of a recording or of a traverse, one after another; `fault` is what broke off."""

    def __init__(self, where: Localizer, args: Args) -> None:
        self._where, self._args = where, args
        self.fault: str | None = None

    def __iter__(self) -> Iterator[Match]:
        if (self._args.drive / "traverse.json").exists():
            yield from self._where.match_traverse(Traverse.load(self._args.drive))
            return
        recording = open_recording(self._args.drive, self._args.size, time_unit=self._args.time_unit)
        note_guesses(recording.notes)
        where = self._where
        where.mask = pixel_mask(recording.packets(), recording.size, where.cleaning, where.mask)
        try:
            for events in recording.packets():
                yield from self._where.push(events)
        except DamagedRecordingError as error:
            self.fault = str(error)
        yield from self._where.finish()


def run(args: Args) -> int:
    """Localise and print, or write, the matches."""
    values = settings.from_pairs(args.set)
    where = Localizer(PlaceMap.load(args.map), args.matcher, args.preset, args.mask, **values)
    matches = _Drive(where, args)
    if args.out is not None:
        with (
            new_file(args.out, args.overwrite) as partial,
            partial.open("w", newline="", encoding="utf-8") as file,
        ):
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(_row(match) for match in matches)
    elif args.json:
        for match in matches:
            print(json.dumps(_object(match)))
    else:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(COLUMNS)
        for match in matches:
            writer.writerow(_row(match))
    if matches.fault is not None:
        note(f"{matches.fault}; the good part was localised")
    return USED_GOOD_PART if matches.fault is not None else 0


def _row(match: Match) -> list[object]:
    easting, northing = match.position or ("", "")
    score = "" if match.score != match.score else f"{match.score:.6g}"
    return [match.t_us, match.place, _metres(easting), _metres(northing), score, match.state]


def _metres(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.2f}"


def _object(match: Match) -> dict[str, object]:
    values = dataclasses.asdict(match)
    values["score"] = None if match.score != match.score else match.score
    return values
