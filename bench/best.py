"""How well the default recogniser does on a city of drives: accuracy, false accepts, single images.

    python bench/best.py CITY [--sensors ideal weak] [--scorer fused] [--lag-s 2] [--every 10]

The map is day-1 of each sensor. Right is an answer within 20 m that looks within 34 degrees the same way;
where the map has no such view, rejecting is right. All images of a drive are queries, or every so many of
them, as of a slower camera. Answers are live, with a lag, and in hindsight, at the false-accept rate that was
asked for.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from evplace import Localizer, PlaceGrid, PlaceMap, Track, Traverse, evaluate, train
from evplace.evaluation import Result
from evplace.evaluation.truth import Truth, by_view

QUERIES = ("night-1", "rain-1", "day-2", "night-2", "rain-2")


def truth_of(place_map: PlaceMap, query: Traverse) -> Truth:
    """By distance and heading alone."""
    items = place_map.items
    assert query.track is not None
    assert items.t_us is not None
    return by_view(query.track, Track.local(items.t_us, items.position, items.heading_deg))


def shown(result: Result) -> str:
    """The figures of one kind of answer."""
    names = ("accuracy", "accuracy_seen", "within_10_m", "within_5_m", "false_accept_rate", "auroc")
    values = (result.figures[name] for name in names)
    return " ".join("     -" if value is None else f"{100 * value:6.1f}" for value in values)


def main() -> None:
    """Print a line for each sensor, query and kind of answer."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("city", type=Path)
    flags.add_argument("--sensors", nargs="+", default=["ideal", "weak"])
    flags.add_argument("--queries", nargs="+", default=QUERIES)
    flags.add_argument("--scorer", default="fused")
    flags.add_argument("--lag-s", type=float, default=2.0)
    flags.add_argument("--false-accept", type=float, default=0.01)
    flags.add_argument("--threshold", type=float)
    flags.add_argument("--every", type=int, default=1)
    args = flags.parse_args()
    print(
        "sensor query answers: accuracy, of seen, within 10 m, 5 m, false accepts, AUROC, %; recall@1 of seen"
    )
    for sensor in args.sensors:
        day = Traverse.load(args.city / "day-1" / sensor)
        assert day.track is not None
        place_map = train(day, PlaceGrid.from_track(day.track), args.scorer)
        for name in args.queries:
            if not (args.city / name / sensor).exists():
                continue
            query = Traverse.load(args.city / name / sensor)[:: args.every]
            truth = truth_of(place_map, query)
            common = {"false_accept": args.false_accept, "threshold": args.threshold}
            for kind, answers, more in (
                ("live", "live", {}), ("lag", "live", {"lag_s": args.lag_s}), ("hindsight", "hindsight", {}),
            ):  # fmt: skip
                result = evaluate(Localizer(place_map, **common, **more), query, truth, answers=answers)
                single = 100 * result.figures["recall@1_seen"]
                print(f"{sensor:9} {name:8} {kind:9} {shown(result)} {single:6.1f}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
