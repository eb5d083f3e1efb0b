"""Learn a route: one drive -> a map.

Examples:
  evplace train day.aedat4 --track day.nmea -o campus.evp            the default: nothing is trained
  evplace train day.aedat4 --track day.nmea -o campus.evp --mask-hot later drives are cleaned like it
  evplace train day -o campus.evp --preset paper --seed 1            the paper's network, on a traverse folder
  evplace train day -o campus.evp --scorer ncc --set sigma=2         no training: images are the map
  evplace train day -o campus.evp --run-length 10                    no GPS: ten images are a place
  evplace train brisbane/ --drive sunset1 -o sunset1.evp             a drive of a data set, with its GPS

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
from evplace.placemap import MARK, default_scorer, train
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

    source: tyro.conf.Positional[Path]
    """The drive to learn: a recording, a video, a folder of images, a data set or a traverse folder."""
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
    scorer = _scorer(args)
    require(scorer)
    reference = open_traverse(
        args.source, args.opened_track(), spacing=spacing_given(args), mask=args.mask,
        **(args.reading() | recipe_settings(args)),
    )  # fmt: skip
    places = _places(args, reference)
    began = time.monotonic()
    with progress("training") as show:
        learning = Learning(
            lambda step, steps, loss: show(step, steps, f"loss {loss:.3f}"),
            args.out.with_name(f".{args.out.name}.checkpoint"),
        )
        matcher = Local.presets["paper"] if args.preset == "paper" and args.matcher is None else args.matcher
        learned = train(reference, places, scorer, learning=learning, matcher=matcher)
    seconds = time.monotonic() - began
    learned.save(args.out, args.overwrite)
    facts = {
        "scorer": families.name_of("scorers", learned.scorer),
        "matcher": families.name_of("matchers", learned.matcher),
        "images": len(reference),
        "places": places.n,
        "items": len(learned.items),
        "seconds": round(seconds, 1),
    }
    print_json(facts) if args.json else print_facts(str(args.out), facts)
    note_guesses(reference.info.get("notes"))
    if not is_measured(learned):
        note(NOT_MEASURED)
    if reference.info.get("fault"):
        note(f"{reference.info['fault']}; the good part was learned")
        return USED_GOOD_PART
    return 0


def _places(args: Args, reference: Traverse) -> Places:
    if args.run_length:
        return PlaceRuns(len(reference), args.run_length, args.tolerance)
    if reference.track is None:
        raise TraverseError(
            f"{args.source} has no positions: add --track with its GPS log, or --run-length for places "
            "that are stretches of images"
        )
    return PlaceGrid.from_track(reference.track, args.cell_m)


def _scorer(args: Args) -> Scorer | Descriptor:
    """The scorer with its settings: for one that is trained by these flags, those of the training."""
    name = args.scorer or default_scorer(args.preset)
    if name == "network":
        return make(TrainSettings, dict(args.set), args.train)
    trained = [name for name in vars(args.train) if name in args.given]
    if trained:
        raise SettingsError(
            f"`{trained[0]}` means nothing for the scorer '{name}': leave it out, or add --scorer network"
        )
    part: Scorer | Descriptor = families.make("scorers", name, args.preset, dict(args.set))
    return part
