"""The paper's comparison in minutes: learn a street by day, find it at night, in rain and on another path.

Examples:
  evplace demo
  evplace demo --out demo --seed 1
  evplace demo --drive-m 600            a longer street: more places, more time

Nothing is downloaded: the drives are made by the virtual city. The folder keeps result.json, report.png, the
maps, and the result of each row.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from evplace.cli._output import Show, print_json, print_table, progress
from evplace.core.errors import OutputError
from evplace.core.storage import new_file, write_json
from evplace.evaluation import Result
from evplace.evaluation._evaluate import evaluate
from evplace.evaluation.charts import accuracy_chart
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers import Learning
from evplace.scorers.network import Network
from evplace_lab.city import CitySettings, generate

QUERIES = ("night-1", "rain-1", "day-2", "night-2", "rain-2")
INPUTS = {"events": "ideal", "colour": "colour"}
"""Input -> the traverse of each drive that holds it."""
MATCHERS = {"global-max": ("best", None), "Algorithm 1": ("local", "paper")}
TRAINING = Network.presets["paper"]


@dataclass(frozen=True)
class Args:
    """Flags of `evplace demo`."""

    out: Path = Path("evplace-demo")
    """The folder for the drives, the maps and the results; what is there is gone on with."""
    drive_m: float = 300.0
    """Length of the street in metres."""
    seed: int = 0
    """Draws the networks' first weights."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Make the drives, learn the maps, localise the queries, print and keep the answers."""
    drives = built_in_drives(args.out / "city", args.drive_m)
    rows = []
    for name, place_map in _maps(args, drives["day-1"]):
        reference = Traverse.load(drives["day-1"] / INPUTS[name])
        for query in QUERIES:
            traverse = Traverse.load(drives[query] / INPUTS[name])
            for matcher, (kind, preset) in MATCHERS.items():
                result = evaluate(Localizer(place_map, kind, preset), traverse, reference=reference)
                result.save(args.out / "results" / f"{query} {name} {matcher}", overwrite=True)
                rows.append(_row(query, name, matcher, result))
    rows.sort(key=lambda row: (QUERIES.index(str(row["query"])), str(row["matcher"]) != "global-max"))
    with new_file(args.out / "result.json", overwrite=True) as partial:
        write_json(partial, {"rows": rows, "seed": args.seed, "drive_m": args.drive_m})
    accuracy_chart(rows, args.out / "report.png")
    if args.json:
        print_json({"rows": rows})
        return 0
    _print(rows, args.out)
    return 0


def built_in_drives(folder: Path, drive_m: float) -> dict[str, Path]:
    """The drives that everybody has: name -> folder with a traverse for each input."""
    settings = CitySettings(fps=60, sensors=("ideal",), route_length_m=drive_m)
    with progress("driving through the city") as show:
        paths = generate(folder, settings, progress=lambda at: show(round(at.share * 1000), 1000, at.drive))
    return {path.name: path for path in paths}


def _maps(args: Args, day: Path) -> Iterator[tuple[str, PlaceMap]]:
    """The map of each input, learned as the paper says; one that is there already is read."""
    for name, part in INPUTS.items():
        file = args.out / f"{name}.evp"
        if file.exists():
            place_map = PlaceMap.load(file)
            if place_map.scorer != dataclasses.replace(TRAINING, seed=args.seed):
                raise OutputError(f"{file} was trained with another seed or otherwise: give another --out")
            yield name, place_map
            continue
        traverse = Traverse.load(day / part)
        assert traverse.track is not None  # the city knows where it is
        with progress(f"training on {name}") as show:
            learning = Learning(functools.partial(_training_step, show), args.out / f".{name}.checkpoint")
            scorer = dataclasses.replace(TRAINING, seed=args.seed)
            place_map = train(traverse, PlaceGrid.from_track(traverse.track), scorer, learning=learning)
        place_map.save(file)
        yield name, place_map


def _training_step(show: Show, step: int, steps: int, loss: float) -> None:
    show(step, steps, f"loss {loss:.2f}")


def _row(query: str, name: str, matcher: str, result: Result) -> dict[str, object]:
    figures = result.figures
    return {
        "query": query,
        "input": name,
        "matcher": matcher,
        "accuracy": figures["accuracy"],
        "accuracy_seen": figures["accuracy_seen"],
        "rejected": figures["rejection_rate"],
        "chance": figures["chance"],
        "chance_seen": figures["chance_seen"],
        "n": figures["judged"],
    }


def _print(rows: list[dict[str, object]], out: Path) -> None:
    """The table as the paper has it, and the lines of Python that do the same."""
    by_key = {(row["query"], row["matcher"], row["input"]): row for row in rows}
    table = []
    for query, matcher in itertools.product(QUERIES, MATCHERS):
        cells = [by_key[query, matcher, name] for name in INPUTS]
        shown = [cell[figure] for figure in ("accuracy", "accuracy_seen") for cell in cells]
        table.append([query, matcher, *map(_percent, shown), _percent(cells[0]["chance_seen"])])
    columns = ("query", "matcher", *INPUTS, "events, seen", "colour, seen", "chance, seen")
    print_table("Accuracy in % of live answers: the map is day-1, the query as named", columns, table)
    print(f"Kept in {out}: result.json, report.png, the maps and the results. The same in Python:\n")
    print(
        f"  import evplace as ev\n"
        f'  day = ev.open_traverse("{out}/city/day-1/ideal")\n'
        f"  places = ev.PlaceGrid.from_track(day.track, cell_m=20)\n"
        f'  street = ev.train(day, places, preset="paper", seed=0)\n'
        f'  night = ev.open_traverse("{out}/city/night-1/ideal")\n'
        f'  print(ev.evaluate(ev.Localizer(street, "local", "paper"), night).figures["accuracy"])'
    )


def _percent(share: object) -> str:
    return f"{100 * share:.1f}" if isinstance(share, float) else "-"
