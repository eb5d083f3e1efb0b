"""What each drive adds to a map: day alone, day with dusk, rain, night, and all of them.

    python bench/best_several.py CITY [--sensors ideal weak] [--drives dusk-1 rain-1 night-1]

The map is day-1, and day-1 with one drive more, and with all; "day, all images" is one of day-1 alone that is
as large as two drives. Drives that lie in the map are no queries. Right is an answer within 20 m that looks
within 34 degrees the same way; where the map has no such view, rejecting is right. Answers are live. What is
gained over day alone stands behind, with the range that nine of ten draws of stretches of ten seconds give.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from best import truth_of
from evplace import Localizer, PlaceGrid, PlaceMap, Traverse, train
from evplace.placemap import add, named, parts_of
from evplace.scorers.fused import Fused

LARGER = "day-1, all images"
STRETCH, DRAWS = 100, 2000
"""Images that are drawn together, ten seconds; and how often."""


class Judged(NamedTuple):
    """One drive on one map."""

    right: NDArray[np.bool_]
    """(queries,) answered right, or rightly rejected."""
    accepted: NDArray[np.bool_]
    known: NDArray[np.bool_]
    single: float
    """Single images that are right, of those that the map knows."""


def map_of(drive: Traverse, name: str, **settings: float) -> PlaceMap:
    """The map of one drive."""
    assert drive.track is not None
    return named(train(drive, PlaceGrid.from_track(drive.track), Fused(**settings)), name)  # type: ignore[arg-type]


def maps(drives: dict[str, Traverse], alone: dict[str, PlaceMap]) -> Iterator[tuple[str, PlaceMap]]:
    """Day alone, larger, and with others."""
    first, *others = drives
    day = alone[first]
    yield first, day
    yield LARGER, alone[LARGER]
    for name in others:
        yield f"{first} + {name}", add(day, drives[name], names=[name])
    if len(others) > 1:
        yield "all", add(day, *(drives[name] for name in others), names=others)
    if len(others) > 2:
        yield f"all but {others[-1]}", add(day, *(drives[name] for name in others[:-1]), names=others[:-1])


def judged(place_map: PlaceMap, query: Traverse) -> Judged:
    """Its answers, live."""
    answered = Localizer(place_map).answers(query, "live")
    found = answered.path
    truth = truth_of(place_map, query)
    known = truth.seen
    right = np.where(known, found.accepted & truth.accepts(found.item), ~found.accepted)
    best = truth.accepts(answered.rows.argmax(axis=1))
    return Judged(right, found.accepted, known, 100 * float(best[known].mean()))


def gain(now: Judged, before: Judged) -> str:
    """In points, with the range of nine of ten draws."""
    rng, change = np.random.default_rng(0), now.right.astype(float) - before.right
    means = [part.mean() for part in np.array_split(change, max(len(change) // STRETCH, 1))]
    drawn = rng.choice(means, (DRAWS, len(means))).mean(axis=1)
    low, high = 100 * np.quantile(drawn, [0.05, 0.95])
    return f"{100 * change.mean():+5.1f} ({low:+.1f} to {high:+.1f})"


def main() -> None:
    """Print a line for each sensor, query and map."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("city", type=Path)
    flags.add_argument("--sensors", nargs="+", default=["ideal", "weak"])
    flags.add_argument("--drives", nargs="+", default=["dusk-1", "rain-1", "night-1"])
    flags.add_argument("--queries", nargs="+", default=["night-1", "night-2", "rain-1", "rain-2", "day-2"])
    flags.add_argument("--more", type=Path, help="a folder with further drives of the same city")
    args = flags.parse_args()
    print(
        "sensor query map (references): accuracy, false accepts, %; recall@1; gain in accuracy over day alone"
    )
    for sensor in args.sensors:
        wanted = dict.fromkeys(["day-1", *args.drives, *args.queries])
        places = {name: [one / name / sensor for one in (args.city, args.more) if one] for name in wanted}
        found = {name: next((one for one in ones if one.exists()), None) for name, ones in places.items()}
        drives = {name: Traverse.load(one) for name, one in found.items() if one is not None}
        known = {name: drives[name] for name in ["day-1", *args.drives] if name in drives}
        alone = {name: map_of(drive, name) for name, drive in known.items()}
        alone[LARGER] = map_of(drives["day-1"], LARGER, every_m=0.4)
        first = dict[str, Judged]()
        for title, place_map in maps(known, alone):
            inside = {part.name for part in parts_of(place_map)}
            references = sum(len(part.item) for part in parts_of(place_map))
            for name in (name for name in args.queries if name in drives and name not in inside):
                query = drives[name]
                now = judged(place_map, query)
                before = first.setdefault(name, now)
                unknown = ~now.known
                false = f"{100 * now.accepted[unknown].mean():5.1f}" if unknown.any() else "    -"
                print(
                    f"{sensor:6} {name:8} {title:22} ({references:5,}) {100 * now.right.mean():6.1f} {false} "
                    f"{now.single:6.1f} {gain(now, before)}", flush=True,
                )  # fmt: skip


if __name__ == "__main__":
    main()
