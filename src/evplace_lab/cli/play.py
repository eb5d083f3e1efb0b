"""Write a drive as a film: what the camera saw beside what it was taken for, and where on the route.

Examples:
  evplace play night.result campus.evp night.aedat4                 night.result/play.webp
  evplace play night.result campus.evp night -o night.gif --seconds 10
  evplace play net.result net.evp night --reference day             of a network's map, which holds no images

The result is what `evplace evaluate` has made of that map and that drive. Dots on the route are coloured by
what became of each image: blue right, red wrong, yellow and grey rejected. A ring is where the camera is,
and a line goes to where it is taken to be. Any browser shows the film.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from evplace.cli._output import note, print_json, progress, say
from evplace.cli._recording import DriveFlags
from evplace.core.errors import InputError, SettingsError
from evplace.core.storage import check_new_file
from evplace.evaluation import ItemImages, Result
from evplace.evaluation._evaluate import item_images
from evplace.imaging.sheets import FILMS, check_ending, write_film
from evplace.imaging.traverse import Traverse
from evplace.placemap import PlaceMap
from evplace_lab.report._film import FPS, film

LONGEST_S = 60.0
"""A film's pictures are held in memory: these are some 600 MB."""


@dataclass(frozen=True)
class Args(DriveFlags):
    """Flags of `evplace play`."""

    result: tyro.conf.Positional[Path]
    """A result that `evplace evaluate` wrote."""
    map: tyro.conf.Positional[Path]
    """The map that it is of."""
    source: tyro.conf.Positional[Path]
    """The query drive that it is of: a recording, a traverse, or what else `evplace evaluate` takes."""
    reference: Path | None = None
    """The traverse that a network's map was learned from: lends the images of the matches."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """The film to write, .webp or .gif; play.webp in the result unless given."""
    seconds: float = 20.0
    """How long the film lasts, at most: images are left out of a longer drive."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """Print one JSON object: the name of the film."""


def run(args: Args) -> int:
    """Open what the result is of, and write the film."""
    out = args.out or args.result / "play.webp"
    _check(args, out)
    result, place_map = Result.load(args.result), PlaceMap.load(args.map)
    _check_map(args, result, place_map)
    query = place_map.open(args.source, **args.reading())
    _check_query(args, result, query)
    of_items = _item_images(args, place_map, query)
    pictures, frames = [], min(round(args.seconds * FPS), len(query))
    with progress("drawing") as show:
        for picture in film(result, query.images, of_items, frames):
            pictures.append(picture)
            show(len(pictures), frames, "")
        write_film(pictures, out, FPS, args.overwrite)
    print_json({"film": str(out)}) if args.json else say(f"{out}: open it in any browser")
    if result.query_xy is None:
        note(f"{args.result} holds no positions: the film is without a route")
    return 0


def _check(args: Args, out: Path) -> None:
    """What can be said before the work."""
    if not 0 < args.seconds <= LONGEST_S:
        raise SettingsError(
            f"--seconds is how long the film lasts, up to {LONGEST_S:.0f}, not {args.seconds:g}"
        )
    check_ending(out, FILMS, "a film")
    check_new_file(out, args.overwrite)


def _check_map(args: Args, result: Result, place_map: PlaceMap) -> None:
    here, items = place_map.items.position, result.figures["items"]
    known = here if result.item_xy is None else result.item_xy
    if items != len(here) or not np.array_equal(here, known, equal_nan=True):
        raise InputError(
            f"{args.result} is a result of another map than {args.map}, of {items} items and not these "
            f"{len(here)}: give the map that it was evaluated with"
        )


def _check_query(args: Args, result: Result, query: Traverse) -> None:
    if not np.array_equal(query.t_us, result.t_us):
        of = f" (it says {result.settings['query']})" if result.settings.get("query") else ""
        raise InputError(
            f"{args.result} is a result of another drive than {args.source}, of {len(result.t_us)} images "
            f"and not these {len(query)}: give the drive that was evaluated{of}"
        )


def _item_images(args: Args, place_map: PlaceMap, query: Traverse) -> ItemImages:
    """What shows the map's items; InputError where nothing does."""
    reference = Traverse.load(args.reference) if args.reference is not None else None
    found = item_images(place_map, query, reference)
    if found is None:
        raise InputError(
            f"{args.map} holds no images of its places: add --reference DAY, the traverse that it was "
            "learned from"
        )
    return found
