"""Learn a route: one drive -> a map.

Examples:
  evplace train day.aedat4 --track day.nmea -o campus.evp            places of 20 m, the network
  evplace train day.aedat4 --track day.nmea -o campus.evp --mask-hot later drives are cleaned like it
  evplace train day -o campus.evp --preset paper --seed 1            day is a traverse folder
  evplace train day -o campus.evp --scorer ncc --set sigma=2         no training: images are the map
  evplace train day -o campus.evp --run-length 10                    no GPS: ten images are a place

A run that was stopped goes on where it was when the same command is given again.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from evplace.cli._output import USED_GOOD_PART, note, note_guesses, print_facts, print_json, progress
from evplace.cli._track import TrackFlags
from evplace.core import settings as settings_room
from evplace.core.errors import TraverseError
from evplace.core.storage import check_new_folder
from evplace.drives.to_traverse import open_traverse
from evplace.imaging.images import ImageSettings
from evplace.imaging.spacing import SpacingSettings
from evplace.imaging.traverse import Traverse
from evplace.imaging.windows import WindowSettings
from evplace.placemap import MARK
from evplace.places import PlaceGrid, PlaceRuns, Places
from evplace.scorers import checked_settings
from evplace.scorers._network.training import PRESETS, TrainSettings, train
from evplace.sources.cleaning import CleaningSettings


@dataclass(frozen=True)
class Args(TrackFlags):
    """Flags of `evplace train`."""

    drive: tyro.conf.Positional[Path]
    """The drive to learn: an event recording, a folder of images, or a traverse folder."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The map to write."""
    cell_m: float = 20.0
    """Side of a place in metres (paper: rho = 20)."""
    run_length: int = 0
    """Without GPS: how many images make a place."""
    tolerance: int = 0
    """Without GPS: how many places off an answer may be."""
    scorer: str = "network"
    """network, sad or ncc."""
    set: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """A setting of the scorer, as name=value."""
    preset: Literal["paper", "notebook"] | None = None
    """paper: as printed; notebook: as the author's published notebook does."""
    train: Annotated[TrainSettings, tyro.conf.arg(name="")] = field(default_factory=TrainSettings)
    windows: Annotated[WindowSettings, tyro.conf.arg(name="")] = field(default_factory=WindowSettings)
    images: Annotated[ImageSettings, tyro.conf.arg(name="")] = field(default_factory=ImageSettings)
    cleaning: Annotated[CleaningSettings, tyro.conf.arg(name="")] = field(default_factory=CleaningSettings)
    spacing: Annotated[SpacingSettings, tyro.conf.arg(name="")] = field(default_factory=SpacingSettings)
    mask: Path | None = None
    """Pixels of this drive to leave out: a text file of x,y lines, or a .npy file."""
    settings: Path | None = None
    """A TOML file with any of these settings; train, windows, images, cleaning and spacing are its tables."""
    size: tuple[int, int] | None = None
    """Width and height of the sensor in pixels, where the file does not say."""
    time_unit: Literal["s", "ms", "us", "ns"] | None = None
    """Unit of the times, where the file does not say."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Learn and save the map."""
    check_new_folder(args.out, args.overwrite, MARK)  # said before the training, not after it
    scorer_settings = checked_settings(args.scorer, settings_room.from_pairs(args.set))
    day = open_traverse(
        args.drive, args.opened_track(), args.windows, args.images, args.size, args.time_unit,
        args.cleaning, args.spacing, args.mask,
    )  # fmt: skip
    places = _places(args, day)
    began = time.monotonic()
    with progress("training") as show:
        learned = train(
            day,
            places,
            args.scorer,
            _train_settings(args),
            progress=lambda step, steps, loss: show(step, steps, f"loss {loss:.3f}"),
            checkpoint=args.out.with_name(f".{args.out.name}.checkpoint"),
            scorer_settings=scorer_settings,
        )
    seconds = time.monotonic() - began
    learned.save(args.out, args.overwrite)
    facts = {
        "scorer": learned.scorer,
        "images": len(day),
        "places": places.n,
        "items": len(learned.items),
        "seconds": round(seconds, 1),
    }
    print_json(facts) if args.json else print_facts(str(args.out), facts)
    note_guesses(day.info.get("notes"))
    if day.info.get("fault"):
        note(f"{day.info['fault']}; the good part was learned")
        return USED_GOOD_PART
    return 0


def _places(args: Args, day: Traverse) -> Places:
    if args.run_length:
        return PlaceRuns(len(day), args.run_length, args.tolerance)
    if day.track is None:
        raise TraverseError(
            f"{args.drive} has no positions: add --track with its GPS log, or --run-length for places "
            "that are stretches of images"
        )
    return PlaceGrid.from_track(day.track, args.cell_m)


def _train_settings(args: Args) -> TrainSettings:
    """The preset's settings, under those flags that differ from the defaults."""
    if args.preset is None:
        return args.train
    plain, given = settings_room.to_dict(TrainSettings()), settings_room.to_dict(args.train)
    changed = {name: value for name, value in given.items() if value != plain[name]}
    return settings_room.make(TrainSettings, changed, PRESETS[args.preset])
