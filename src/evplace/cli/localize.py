"""Say where a drive is: one match for each window of events.

Examples:
  evplace localize campus.evp night.aedat4                     a line a window
  evplace localize campus.evp night.aedat4 -o night.csv        or .gpx, .geojson, .nmea, .tum, .jsonl
  evplace localize campus.evp night.aedat4 --format nmea
  evplace localize campus.evp night --matcher seqslam --set ds=20
  evplace localize campus.evp night.aedat4 --mask night_hot_pixels.txt
  evplace localize campus.evp night.aedat4 --near-m 200 --track night.nmea    a GPS that is good to 200 m
  evplace localize campus.evp night.aedat4 --near-m 200          near the last match, where there is one
  evplace localize campus.evp night.aedat4 --json              a JSON object a line
  evplace localize campus.evp night.aedat4 --watch             at the camera's pace, as `evplace serve` does
  evplace localize campus.evp udp:3333 --watch                 any source of `evplace list live`
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from evplace.cli._matcher import MatcherFlags, matches_noted
from evplace.cli._output import USED_GOOD_PART, note, note_guesses
from evplace.cli._recording import DriveFlags
from evplace.cli._settings import Part, a_part_of
from evplace.cli._track import TrackFlags
from evplace.core.errors import DamagedRecordingError, SettingsError
from evplace.core.storage import check_new_file, new_file
from evplace.drives._recorded import packets_onto
from evplace.drives.to_traverse import Reading, open_source_for, recorded_as
from evplace.exports import format_of, located
from evplace.imaging.traverse import MARK as TRAVERSE
from evplace.localizer import SURE, Localizer, Match
from evplace.placemap import PlaceMap
from evplace.serving.watching import watch
from evplace.sources.cleaning import pixel_mask
from evplace.sources.film import Film
from evplace.sources.live import Facts, open_live
from evplace.sources.readers import Recording
from evplace.sources.simulators.recording import SimulatedRecording


@dataclass(frozen=True)
class Args(MatcherFlags, TrackFlags, DriveFlags):
    """Flags of `evplace localize`."""

    PARTS: ClassVar[tuple[Part, ...]] = (*TrackFlags.PARTS, *MatcherFlags.PARTS)

    map: tyro.conf.Positional[Path]
    """A map that `evplace train` wrote."""
    source: tyro.conf.Positional[Path]
    """An event recording, a video, a folder of images, a data set or a traverse folder."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Write a file instead of standard output; its suffix names the format."""
    format: Annotated[str | None, a_part_of("exports")] = None
    """What is written; `evplace list exports` says what each is. By default the suffix of --out says it."""
    mask: Path | None = None
    """Pixels of this drive to leave out: a text file of x,y lines, or a .npy file."""
    near_m: float | None = None
    """Compare only with references within so many metres of where --track says that the drive is, or without
    one, of the last match; with all of them where neither is known."""
    unchecked: bool = False
    """Do not hold the map against its checksums: those of a very large one, which is mapped into memory, take
    a while."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """One JSON object a line, as --format json."""
    watch: bool = False
    """Localise at the camera's own pace, and show what is known now line by line."""


class _Drive:
    """The matches of a recording or of a traverse, one after another; `fault` is what broke off.

    Its input is open once it is made.
    """

    def __init__(self, where: Localizer, args: Args) -> None:
        self._where, self._args = where, args
        self.fault: str | None = None
        self.matches, self.accepted = 0, 0
        self._events = self._opened()
        if self._events is None:
            self._query = where.map.open(args.source, mask=where.mask, **args.reading())
        else:
            note_guesses(self._events.notes)

    def __iter__(self) -> Iterator[Match]:
        for match in self._of_images() if self._events is None else self._of_events(self._events):
            self.matches += match.state != "no-events"
            self.accepted += match.state in SURE
            yield match

    def _of_images(self) -> Iterator[Match]:
        self.fault = self._query.info.get("fault")
        yield from self._where.match_traverse(self._query)

    def _of_events(self, events: Recording | SimulatedRecording) -> Iterator[Match]:
        try:
            for packet in packets_onto(events, self._where.canvas(events.size)):
                yield from self._where.push(packet)
        except DamagedRecordingError as error:
            self.fault = str(error)
        yield from self._where.finish()

    def _opened(self) -> Recording | SimulatedRecording | None:
        """What can be pushed packet by packet, its mask measured; None for images."""
        recipe = self._where.map.recipe
        if (self._args.source / TRAVERSE).exists() or recipe is None:
            return None
        known = self._args.reading()
        size = {"size": known.pop("size")} if "size" in known else {}
        drive = open_source_for(self._args.source, recipe, size, Reading(**known))
        source = recorded_as(recipe.kind, drive)
        if isinstance(source, Film):
            return None
        given = self._where.mask if self._where.mask is not None else drive.mask
        self._where.mask = pixel_mask(source.packets(), source.size, recipe.cleaning, given)
        return source


def run(args: Args) -> int:
    """Localise and print, or write, the matches."""
    if args.json and args.format not in (None, "json"):
        raise SettingsError(f"`json` and `format={args.format}` ask for two formats: give one")
    if args.out is not None:
        check_new_file(args.out, args.overwrite)
    place_map = PlaceMap.load(args.map, unchecked=args.unchecked)
    form = format_of(args.out, "json" if args.json else args.format, place_map)
    where = Localizer(
        place_map, args.matcher, args.preset, args.mask, args.near_m, args.opened_track(),
        **args.matcher_settings(),
    )  # fmt: skip
    if args.watch:
        return _watched(where, args)
    matches = _Drive(where, args)
    lines = form.lines(located(matches, place_map))
    if args.out is None:
        for line in lines:
            print(line)
    else:
        with new_file(args.out, args.overwrite) as partial, partial.open("w", encoding="utf-8") as file:
            file.writelines(f"{line}\n" for line in lines)
    for text in matches_noted(where, matches.matches, matches.accepted):
        note(text)
    if matches.fault is not None:
        note(f"{matches.fault}; the good part was localised")
    return USED_GOOD_PART if matches.fault is not None else 0


def _watched(where: Localizer, args: Args) -> int:
    """Localise a live source, or a recording as if it were one."""
    if args.out is not None or args.json or args.format is not None:
        raise SettingsError("`watch` shows lines in a terminal: leave out `out`, `json` and `format`")
    size = args.size or (None if where.map.recipe is None else where.map.recipe.size)
    source = open_live(str(args.source), size)
    note_guesses(list(Facts.of(source).notes))
    fault = watch(where, source, args.map, str(args.source))
    if fault is not None:
        note(f"{fault}; the good part was localised")
    return USED_GOOD_PART if fault is not None else 0
