"""Where the default recogniser goes wrong on a drive: its longest failures, with pictures to look at.

    python bench/best_worst.py CITY --sensor weak --query night-1 -o worst.png [--lag-s 0]

A failure is a run of images without a right answer. Each is a line of the text and a row of the picture: the
image in its middle, the reference that was answered, and the right one. How many images are lost to which
kind of failure stands above, and how many of these lie near a border of the map.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from best import truth_of
from evplace import Localizer, PlaceGrid, Traverse, evaluate, train
from evplace.evaluation import Result
from evplace.imaging.activity import activity
from evplace.imaging.sheets import as_shown

KINDS = (
    "missed: right, not accepted",
    "missed: elsewhere, not accepted",
    "wrong place",
    "never seen, accepted",
)
NEAR = 20
"""Images: so near a border between known and unknown, the filter has yet to find out."""


class Failure(NamedTuple):
    """Images from `first` to before `end`, all of one kind."""

    kind: int
    first: int
    end: int


def kinds_of(result: Result) -> NDArray[np.int64]:
    """(queries,) index into KINDS, -1 where all is well."""
    accepted = result.answers.accepted
    missed = np.where(result.right, 0, 1)
    seen = np.where(accepted, np.where(result.right, -1, 2), missed)
    return np.where(result.seen, seen, np.where(accepted, 3, -1))


def failures(kinds: NDArray[np.int64]) -> list[Failure]:
    """The longest first."""
    edges = np.flatnonzero(np.diff(kinds, prepend=-2, append=-2))
    runs = [Failure(int(kinds[a]), int(a), int(b)) for a, b in itertools.pairwise(edges)]
    return sorted((run for run in runs if run.kind >= 0), key=lambda run: run.first - run.end)


def summary(result: Result, shown: NDArray[np.float64]) -> list[str]:
    """A line a kind: how many images, near a border, in standing, near the drive's first images."""
    kinds, queries = kinds_of(result), np.arange(len(result.seen))
    borders = np.flatnonzero(np.diff(result.seen))
    near = np.array([bool((np.abs(borders - query) <= NEAR).any()) for query in queries])
    still = shown < 0.5 * np.nanmedian(shown)
    lines = []
    for kind, name in enumerate(KINDS):
        here = kinds == kind
        lines.append(
            f"{name:32} {here.sum():5} of {len(kinds)}: near a border {np.sum(near & here)}, "
            f"standing {np.sum(still & here)}, first {NEAR} {np.sum((queries < NEAR) & here)}"
        )
    return lines


def line(failure: Failure, result: Result, apart_m: float) -> str:
    """One failure in words."""
    at = (failure.first + failure.end) // 2
    return (
        f"images {failure.first} to {failure.end - 1}: {KINDS[failure.kind]}, "
        f"P {result.answers.score[at]:.2f}, {apart_m:.0f} m apart"
    )


def picture(rows: list[tuple[str, list[NDArray[np.uint8] | None]]]) -> Image.Image:
    """Rows of three images under their lines."""
    width, height = 320, 180
    sheet = Image.new("RGB", (3 * (width + 8), len(rows) * (height + 26)), "white")
    draw = ImageDraw.Draw(sheet)
    for number, (text, images) in enumerate(rows):
        top = number * (height + 26)
        draw.text((4, top + 6), text, "black")
        for column, image in enumerate(images):
            if image is not None:
                one = Image.fromarray(as_shown(image, events=True)).resize((width, height))
                sheet.paste(one, (column * (width + 8), top + 22))
    return sheet


def row_of(result: Result, failure: Failure, query: Traverse, day: Any) -> tuple[str, list[Any]]:
    """A failure's line and its images."""
    at = (failure.first + failure.end) // 2
    place_map, images = day
    item, true = int(result.answers.item[at]), int(result.true_item[at])  # type: ignore[index]
    where = place_map.items.position[item]
    apart = float(np.hypot(*(query.track.xy[at] - where)))  # type: ignore[union-attr]
    chosen = [query.images[at], images[item], images[true] if true >= 0 else None]
    return line(failure, result, apart), chosen


def main() -> None:
    """Print the failures and draw them."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("city", type=Path)
    flags.add_argument("--sensor", default="ideal")
    flags.add_argument("--query", default="night-1")
    flags.add_argument("--lag-s", type=float, default=0.0)
    flags.add_argument("--many", type=int, default=8)
    flags.add_argument("-o", "--output", type=Path)
    args = flags.parse_args()
    day = Traverse.load(args.city / "day-1" / args.sensor)
    assert day.track is not None
    place_map = train(day, PlaceGrid.from_track(day.track))
    query = Traverse.load(args.city / args.query / args.sensor)
    result = evaluate(Localizer(place_map, lag_s=args.lag_s), query, truth_of(place_map, query))
    shown = activity(query.images, of_events=True)
    print(f"{args.sensor} {args.query}, accuracy {100 * result.figures['accuracy']:.1f} %")
    print("\n".join(summary(result, shown)))
    worst = failures(kinds_of(result))[: args.many]
    rows = [row_of(result, one, query, (place_map, place_map.references)) for one in worst]
    print("\n".join(text for text, _ in rows))
    if args.output:
        picture(rows).save(args.output)


if __name__ == "__main__":
    main()
