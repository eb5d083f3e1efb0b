"""Turn recordings, videos, folders of images or drives of data sets into traverse folders.

Examples:
  evplace images night.aedat4 -o night
  evplace images night.aedat4 -o night --track night.nmea       with positions
  evplace images night.aedat4 -o night --dt 1/60 --sheet night.png
  evplace images night.aedat4 -o night --mask-hot --flicker-hz 100
  evplace images night.aedat4 -o night --mask night_hot_pixels.txt
  evplace images night.aedat4 -o night --store       and then, without decoding again:
  evplace images night.aedat4 -o fine --dt 1/60
  evplace images day.aedat4 -o day --track day.nmea --every-m 2      an image every two metres
  evplace images frames/ -o day --crop-bottom 0 --width 80 --height 80
  evplace images film.mp4 -o day                     events are simulated; --kind frames keeps the colours
  evplace images brisbane/ --drive sunset1 -o sunset1         with its GPS; see evplace list datasets
  evplace images day.raw dusk.raw night.raw -o drives         drives/day, drives/dusk and drives/night
  evplace images *.raw -o drives --track "logs/{name}.nmea"   each with its own log
  evplace images brisbane/ --drive all -o drives --on ray     all of a set, on a cluster

Many drives are made several at a time. A call that was stopped goes on where it was when it is given again.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from evplace.cli._many import Made, are_many, run_many
from evplace.cli._output import USED_GOOD_PART, note, print_facts, print_json, warned
from evplace.cli._recipe import recipe_settings
from evplace.cli._recording import RecordingFlags
from evplace.cli._settings import a_part_of
from evplace.cli._track import TrackFlags
from evplace.cli._workers import WorkerFlags
from evplace.core.storage import check_new_file
from evplace.drives._recorded import StorePlace
from evplace.drives.datasets import Drive
from evplace.drives.to_traverse import open_source, record
from evplace.imaging.images import ImageSettings
from evplace.imaging.sheets import contact_sheet
from evplace.imaging.spacing import SpacingSettings
from evplace.imaging.traverse import Traverse, TraverseWriter, new_traverse
from evplace.imaging.windows import WindowSettings
from evplace.sources.cleaning import CleaningSettings

MOST_BYTES = 10**9
"""Bytes of images that are written unasked."""


@dataclass(frozen=True)
class Args(WorkerFlags, TrackFlags, RecordingFlags):
    """Flags of `evplace images`."""

    sources: tyro.conf.Positional[tuple[Path, ...]]
    """An event recording, a video, a folder of images, or a data set's folder; or several of them."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The traverse folder to write; for many drives, the folder of their traverse folders."""
    drive: str | None = None
    """For a data set: which drive; or several, as a,b,c; or all."""
    dataset: Annotated[str | None, a_part_of("datasets")] = None
    """For a data set that is not recognised by its layout: its name."""
    kind: Literal["events", "frames"] | None = None
    """events: simulate them where there are only images (as is done for videos and data sets of films);
    frames: keep the camera's images, in colour where they have colours."""
    list: Path | None = None
    """For a folder of images: a .csv or .txt whose first column names the images to take, in order."""
    fps: float = 30.0
    """For a folder of images without timestamps.txt: images a second."""
    sheet: Path | None = None
    """Also write a .png that shows some of the images."""
    windows: Annotated[WindowSettings, tyro.conf.arg(name="")] = field(default_factory=WindowSettings)
    images: Annotated[ImageSettings, tyro.conf.arg(name="")] = field(default_factory=ImageSettings)
    cleaning: Annotated[CleaningSettings, tyro.conf.arg(name="")] = field(default_factory=CleaningSettings)
    spacing: Annotated[SpacingSettings, tyro.conf.arg(name="")] = field(default_factory=SpacingSettings)
    mask: Path | None = None
    """Pixels to leave out: a text file of x,y lines, or a .npy file (a mask.npy of a traverse will do)."""
    store: bool = False
    """Also keep where events fell, beside the traverse, in SOURCE.store: other images of this recording (dt a
    multiple of 1/240 s, blur, crop, size) are then made of that, without decoding. It is used by itself."""
    yes: bool = False
    """Write the images even where they come to more than 1 GB."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """Print one JSON object."""
    given: Annotated[tuple[str, ...], tyro.conf.Suppress] = ()

    def brought(self) -> dict[str, Any]:
        """The windows and images of the source's own, where one is named."""
        if not self.sources or are_many(self):
            return {}
        drive = _source(self)
        return {"windows": drive.recipe.windows, "images": drive.recipe.images}


def run(args: Args) -> int:
    """Write the traverse, and the sheet if asked; or those of many drives."""
    if are_many(args):
        return run_many("images", args)
    facts, notes, code = made(args)
    if args.json:
        print_json(facts)
    else:
        print_facts(str(args.out), facts)
    for text in notes:
        note(text)
    return code


def made(args: Args) -> Made:
    """Write the traverse of one drive, and its sheet."""
    if args.sheet is not None:
        check_new_file(args.sheet, args.overwrite)
    with warned() as notes, new_traverse(args.out, {}, args.overwrite) as writer:
        writer.most_bytes = None if args.yes else MOST_BYTES
        fault = _record(args, writer)
    traverse = Traverse.load(args.out)
    if args.sheet is not None:
        are_events = traverse.recipe is not None and traverse.recipe.kind == "events"
        contact_sheet(traverse.images, args.sheet, args.overwrite, events=are_events)
    notes += [str(guess) for guess in traverse.info.get("notes") or []]
    if len(traverse) == 1:
        notes.append("there is one image only, of the whole recording: a shorter --dt makes more")
    if fault is not None:
        notes.append(f"{fault}; the good part was written")
    return Made(_facts(traverse, fault), notes, USED_GOOD_PART if fault is not None else 0)


def _facts(traverse: Traverse, fault: str | None) -> dict[str, Any]:
    """What is said of a traverse."""
    return {
        "images": len(traverse),
        "shape": list(traverse.images.shape[1:]),
        "empty": int((traverse.counts == 0).sum()),
        "with_position": int(traverse.track.known.sum()) if traverse.track is not None else 0,
        "left_out": traverse.info.get("left_out", {}),
        "dropped": traverse.info.get("dropped", {}),
        "masked_pixels": int(traverse.mask.sum()) if traverse.mask is not None else 0,
        "cleaned": traverse.info.get("cleaned", {}),
        "made_of_store": traverse.info.get("store"),
        "fault": fault,
    }


def _record(args: Args, writer: TraverseWriter) -> str | None:
    """Write the images; returns what broke off, if anything."""
    drive, track = _source(args), args.opened_track()
    return record(drive, writer, track, None, args.spacing, args.mask, _store(args), **_named(args))


def _store(args: Args) -> StorePlace:
    """Beside the traverse, by the recording's name."""
    name = args.sources[0].resolve().name + (f"-{args.drive}" if args.drive is not None else "")
    reading = {"time_unit": args.time_unit, "stream": args.stream, "columns": args.columns}
    return StorePlace(args.out.with_name(f"{name}.store"), args.store, reading)


def _named(args: Args) -> dict[str, Any]:
    return recipe_settings(args) | ({} if args.kind is None else {"kind": args.kind})


def _source(args: Args) -> Drive:
    fps = args.fps if "fps" in args.given else None
    return open_source(
        args.sources[0], args.size, args.time_unit, args.drive, args.dataset, args.list, fps, args.stream,
        args.columns,
    )  # fmt: skip
