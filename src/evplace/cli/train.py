"""Learn a route: one drive, or several of different light and weather -> a map.

Examples:
  evplace train day.aedat4 --track day.nmea -o campus.evp            the default: nothing is trained
  evplace train day.aedat4 --track day.nmea -o campus.evp --mask-hot later drives are cleaned like it
  evplace train day -o campus.evp --preset paper --seed 1            the paper's network, on a traverse folder
  evplace train day -o campus.evp --scorer ncc --set sigma=2         no training: images are the map
  evplace train day -o campus.evp --index bits                       of many references few are compared
  evplace train day -o campus.evp --run-length 10                    no GPS: ten images are a place
  evplace train brisbane/ --drive sunset1 -o sunset1.evp             a drive of a data set, with its GPS
  evplace train day dusk night -o city.evp                           traverse folders with their tracks

A run that was stopped goes on where it was when the same command is given again.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar

import tyro

from evplace.cli._matcher import NOT_MEASURED, is_measured
from evplace.cli._output import USED_GOOD_PART, note, note_guesses, print_facts, print_json, progress
from evplace.cli._recipe import recipe_settings, spacing_given
from evplace.cli._recording import DriveFlags
from evplace.cli._settings import Pairs, Part, a_part_of, a_preset_of
from evplace.cli._track import TrackFlags
from evplace.core import families
from evplace.core.errors import SettingsError, TraverseError
from evplace.core.settings import make
from evplace.core.storage import check_new_folder
from evplace.drives.to_traverse import open_traverse
from evplace.imaging.images import ImageSettings
from evplace.imaging.spacing import SpacingSettings
from evplace.imaging.traverse import Traverse
from evplace.imaging.windows import WindowSettings
from evplace.matchers.local import Local
from evplace.placemap import MARK, PlaceMap, add, default_scorer, named, names_of, train
from evplace.places import PlaceGrid, PlaceRuns, Places
from evplace.scorers import Descriptor, Learning, Scorer, require
from evplace.scorers.network import TrainSettings
from evplace.sources.cleaning import CleaningSettings


@dataclass(frozen=True)
class Args(TrackFlags, DriveFlags):
    """Flags of `evplace train`."""

    PARTS: ClassVar[tuple[Part, ...]] = (
        *TrackFlags.PARTS,
        Part.of("scorers", "scorer", preset="preset", usual=lambda args: default_scorer(args.preset)),
    )
    TABLE_PRESETS: ClassVar[Mapping[str, Mapping[str, Any]]] = {"train": TrainSettings.presets}

    sources: tyro.conf.Positional[tuple[Path, ...]]
    """The drive to learn: a recording, a video, a folder of images, a data set or a traverse folder; or
    several, of one sensor: `evplace map --help` says more."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The map to write."""
    cell_m: float = 20.0
    """Side of a place in metres (paper: rho = 20)."""
    run_length: int = 0
    """Without GPS: how many images make a place."""
    tolerance: int = 0
    """Without GPS: how many places off an answer may be."""
    scorer: Annotated[str | None, a_part_of("scorers")] = None
    """What compares images with the map; `evplace list scorers` says what each does. Default: fused, or that
    of the preset."""
    matcher: Annotated[str | None, a_part_of("matchers")] = None
    """What the map remembers to be matched with. Default: bayes, and local where the items are places."""
    index: Annotated[str | None, a_part_of("searchers")] = None
    """For fused: how references are searched; `evplace list searchers` says what each does. Default: exact,
    which compares with all of them, up to 300,000, beyond that faiss."""
    set: Pairs = ()
    """A setting of the scorer, as name=value."""
    preset: Annotated[str | None, a_preset_of("scorers")] = None
    """best: fused, without training. paper: the paper's network, trained as printed, and its Algorithm 1;
    notebook: as the author's notebook does; tuned: as good as we get it. Or one of a scorer that is named."""
    train: Annotated[TrainSettings, tyro.conf.arg(name="")] = field(default_factory=TrainSettings)
    windows: Annotated[WindowSettings, tyro.conf.arg(name="")] = field(default_factory=WindowSettings)
    images: Annotated[ImageSettings, tyro.conf.arg(name="")] = field(default_factory=ImageSettings)
    cleaning: Annotated[CleaningSettings, tyro.conf.arg(name="")] = field(default_factory=CleaningSettings)
    spacing: Annotated[SpacingSettings, tyro.conf.arg(name="")] = field(default_factory=SpacingSettings)
    mask: Path | None = None
    """Pixels of this drive to leave out: a text file of x,y lines, or a .npy file."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """Print one JSON object."""
    given: Annotated[tuple[str, ...], tyro.conf.Suppress] = ()


def run(args: Args) -> int:
    """Learn and save the map."""
    check_new_folder(args.out, args.overwrite, MARK)  # said before the training, not after it
    if len(args.sources) > 1:
        _check_several(args)
    scorer = _scorer(args)
    require(scorer)
    drives = [_opened(args, source) for source in args.sources]
    reference = drives[0]
    places = _places(args, reference)
    began = time.monotonic()
    with progress("training") as show:
        learning = Learning(
            lambda step, steps, loss: show(step, steps, f"loss {loss:.3f}"),
            args.out.with_name(f".{args.out.name}.checkpoint"),
        )
        matcher = Local.presets["paper"] if args.preset == "paper" and args.matcher is None else args.matcher
        learned = train(reference, places, scorer, learning=learning, matcher=matcher)
    if len(drives) > 1:
        first, *others = names_of(args.sources)
        learned = add(named(learned, first), *drives[1:], names=others)
    seconds = time.monotonic() - began
    learned.save(args.out, args.overwrite)
    facts = {
        "scorer": families.name_of("scorers", learned.scorer),
        "matcher": families.name_of("matchers", learned.matcher),
        "images": sum(map(len, drives)),
        "places": learned.places.n,
        "items": len(learned.items),
        "seconds": round(seconds, 1),
    }
    print_json(facts) if args.json else print_facts(str(args.out), facts)
    return _said(learned, drives)


def _said(learned: PlaceMap, drives: list[Traverse]) -> int:
    """Say what a user should know of the drives and the map; returns the exit code."""
    for drive in drives:
        note_guesses(drive.info.get("notes"))
    if not is_measured(learned):
        note(NOT_MEASURED)
    faults = [drive.info["fault"] for drive in drives if drive.info.get("fault")]
    for fault in faults:
        note(f"{fault}; the good part was learned")
    return USED_GOOD_PART if faults else 0


def _opened(args: Args, source: Path) -> Traverse:
    return open_traverse(
        source, args.opened_track(), spacing=spacing_given(args), mask=args.mask,
        **(args.reading() | recipe_settings(args)),
    )  # fmt: skip


def _check_several(args: Args) -> None:
    """SettingsError where something is given that belongs to one drive, or that learns all at once."""
    if (args.scorer or default_scorer(args.preset)) == "network":
        raise SettingsError(
            "the scorer 'network' learns places, all at once and from one drive: take one whose items are "
            "images, such as fused, or give one drive"
        )
    own = [name for name in ("track", "mask", "drive") if getattr(args, name) is not None]
    if own:
        raise SettingsError(
            f"`{own[0]}` is of one drive, and {len(args.sources)} are given: add those that need it one at a "
            "time, with evplace map add"
        )


def _places(args: Args, reference: Traverse) -> Places:
    if args.run_length:
        return PlaceRuns(len(reference), args.run_length, args.tolerance)
    if reference.track is None:
        raise TraverseError(
            f"{args.sources[0]} has no positions: add --track with its GPS log, or --run-length for places "
            "that are stretches of images"
        )
    return PlaceGrid.from_track(reference.track, args.cell_m)


def _scorer(args: Args) -> Scorer | Descriptor:
    """The scorer with its settings: for one that is trained by these flags, those of the training."""
    name = args.scorer or default_scorer(args.preset)
    values = dict(args.set)
    if args.index is not None:
        _check_indexed(name)
        values["index"] = args.index
    if name == "network":
        return make(TrainSettings, values, args.train)
    trained = [name for name in vars(args.train) if name in args.given]
    if trained:
        raise SettingsError(
            f"`{trained[0]}` means nothing for the scorer '{name}': leave it out, or add --scorer network"
        )
    part: Scorer | Descriptor = families.make("scorers", name, args.preset, values)
    return part


def _check_indexed(scorer: str) -> None:
    """SettingsError where a scorer compares with all references, whatever is asked for."""
    if "index" not in families.settings_of("scorers", scorer)[0].__dataclass_fields__:
        raise SettingsError(f"`index` means nothing for the scorer '{scorer}': leave it out, or take fused")
