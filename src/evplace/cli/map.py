"""Maps of several drives: add one, merge maps, take drives out, see what is in a map.

Examples:
  evplace map add city.evp night                            a traverse folder, which brings its track
  evplace map add city.evp night.aedat4 --track night.nmea  its images are made as the map's
  evplace map add city.evp night -o new.evp                 city.evp stays as it is
  evplace map merge north.evp south.evp -o city.evp
  evplace map split city.evp --drives day dusk -o bright.evp
  evplace map info city.evp

A place that several drives saw keeps a reference of each, and is found by the one that fits best. What was
known stays, and only the new drive is learned; a change that is stopped leaves the map as it was.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro

from evplace.cli._matcher import NOT_MEASURED, is_measured
from evplace.cli._output import USED_GOOD_PART, note, note_guesses, print_facts, print_json
from evplace.cli._recording import DriveFlags
from evplace.cli._track import TrackFlags
from evplace.core.errors import SettingsError
from evplace.core.storage import check_new_folder
from evplace.imaging.traverse import Traverse
from evplace.placemap import MARK, PlaceMap, add, merge, names_of, parts_of, split, versions_of


@dataclass(frozen=True)
class Args(TrackFlags, DriveFlags):
    """Flags of `evplace map`."""

    action: tyro.conf.Positional[Literal["add", "merge", "split", "info"]]
    """What to do."""
    map: tyro.conf.Positional[Path]
    """A map that `evplace train` wrote."""
    more: tyro.conf.Positional[tuple[Path, ...]] = ()
    """add: the drives, as `evplace train` takes them. merge: the other maps."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """The map to write. For add, the map itself if not given."""
    name: str | None = None
    """add: what the drive is called in the map. Default: as its file or folder."""
    drives: tuple[str, ...] = ()
    """split: which drives are taken."""
    mask: Path | None = None
    """add: pixels of this drive to leave out: a text file of x,y lines, or a .npy file."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """Print one JSON object."""


OF_ADD = ("name", "mask", "track", "drive", "dataset", "size", "time_unit", "stream", "columns")
"""Flags that only add takes."""


def run(args: Args) -> int:
    """Do it, save and say."""
    actions: dict[str, Callable[[Args], int]] = {
        "add": _add, "merge": _merge, "split": _split, "info": _info,
    }  # fmt: skip
    _check_flags(args)
    return actions[args.action](args)


def _check_flags(args: Args) -> None:
    """SettingsError for what means nothing for an action, or is missing."""
    idle = [] if args.action == "add" else [name for name in OF_ADD if getattr(args, name) is not None]
    idle += ["drives"] if args.drives and args.action != "split" else []
    if idle:
        raise SettingsError(f"`{idle[0]}` means nothing for evplace map {args.action}: leave it out")
    if args.action in ("add", "merge") and not args.more:
        what = "drive" if args.action == "add" else "second map"
        raise SettingsError(f"evplace map {args.action} needs a {what}: give it behind {args.map}")
    if args.action in ("split", "info") and args.more:
        raise SettingsError(f"evplace map {args.action} takes one map: leave out {args.more[0]}")
    if args.action in ("merge", "split") and args.out is None:
        raise SettingsError(f"evplace map {args.action} writes a new map: say where with --out")
    own = [name for name in ("name", "mask", "track", "drive") if getattr(args, name) is not None]
    if len(args.more) > 1 and own:
        raise SettingsError(
            f"`{own[0]}` is of one drive, and {len(args.more)} are given: add them one by one"
        )
    if args.out is not None:
        check_new_folder(args.out, args.overwrite, MARK)  # said before the work, not after it


def _add(args: Args) -> int:
    place_map = PlaceMap.load(args.map)
    drives = [_opened(args, place_map, source) for source in args.more]
    names = names_of(args.more if args.name is None else [Path(args.name)])
    added = add(place_map, *drives, names=names)
    for drive in drives:
        note_guesses(drive.info.get("notes"))
    _save(args, added)
    faults = [drive.info["fault"] for drive in drives if drive.info.get("fault")]
    for fault in faults:
        note(f"{fault}; the good part was added")
    return USED_GOOD_PART if faults else 0


def _opened(args: Args, place_map: PlaceMap, source: Path) -> Traverse:
    """A drive, its images made as the map's."""
    return place_map.open(source, args.opened_track(), mask=args.mask, **args.reading())


def _merge(args: Args) -> int:
    _save(args, merge(*(PlaceMap.load(path) for path in (args.map, *args.more))))
    return 0


def _split(args: Args) -> int:
    _save(args, split(PlaceMap.load(args.map), args.drives))
    return 0


def _save(args: Args, place_map: PlaceMap) -> None:
    """Write the map, and say what it holds by now."""
    target = args.map if args.out is None else args.out
    place_map.save(target, overwrite=args.overwrite or args.out is None)
    _say(args, target, place_map)
    if not is_measured(place_map):
        note(NOT_MEASURED)


def _info(args: Args) -> int:
    _say(args, args.map, PlaceMap.load(args.map))
    return 0


def _say(args: Args, path: Path, place_map: PlaceMap) -> None:
    parts, versions = parts_of(place_map), versions_of(place_map)
    items = len(place_map.items)
    facts: dict[str, Any] = {
        "places": place_map.places.n,
        "items": items,
        "references": sum(len(part.item) for part in parts),
    }
    drives = [
        {
            "name": part.name,
            "source": part.map.info.get("source"),
            "references": len(part.item),
            "items": len(np.unique(part.item)),
            "left_out": part.map.info.get("left_out", {}),
        }
        for part in parts
    ]
    if args.json:
        print_json(facts | {"drives": drives, "versions": versions})
        return
    for drive in drives:
        facts[f"drive {drive['name']}"] = (
            f"{drive['references']} references at {drive['items']} items, of {drive['source']}"
            f"{_left_out(drive['left_out'])}"
        )
    for version in versions:
        facts[f"version {version['version']}"] = f"{version['change']} ({version['at'] or 'time not known'})"
    print_facts(str(path), facts)


def _left_out(reasons: dict[str, int]) -> str:
    return "".join(f"; {many} left out: {reason}" for reason, many in reasons.items())
