"""The main job in minutes: learn a street by day, find it at night, in rain and from another path.

Examples:
  evplace demo
  evplace demo --out demo
  evplace demo --drive-m 600 --train    a longer street; trains the paper's networks on it, with torch
  evplace demo --live                   the drive at night on a page, as it goes (the extra 'web')

Nothing is downloaded and no torch is needed: the virtual city makes the drives, and the paper's networks for
its usual street come with evplace (`--train` makes them anew). The folder keeps report.html, report.png,
result.json, the maps, and the result of each row.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np

from evplace.cli._output import Show, print_json, print_table, progress, say
from evplace.core.errors import MissingExtraError, SettingsError
from evplace.core.storage import new_file, write_json
from evplace.evaluation import Result
from evplace.evaluation._evaluate import evaluate
from evplace.evaluation.charts import accuracy_chart
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers.local import Local
from evplace.placemap import MARK, Items, PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers import Learning
from evplace.scorers.network import GRAPH, Network
from evplace_lab.city import CitySettings, generate
from evplace_lab.report import report

QUERIES = ("night-1", "rain-1", "day-2", "night-2", "rain-2")
INPUTS = {"events": "ideal", "colour": "colour"}
"""Input -> the traverse of each drive that holds it."""
METHODS = ("best", "paper")
"""Presets of a whole method: what evplace does by itself, and the paper's network with its Algorithm 1."""
USUAL_M = 300.0
"""Length of the street whose networks come with evplace."""


@dataclass(frozen=True)
class Args:
    """Flags of `evplace demo`."""

    out: Path = Path("evplace-demo")
    """The folder for the drives, the maps and the results; what is there is gone on with."""
    drive_m: float = USUAL_M
    """Length of the street in metres."""
    train: bool = False
    """Train the paper's networks here, in place of those that come with evplace; needs torch."""
    json: bool = False
    """Print one JSON object."""
    live: bool = False
    """Only learn the street by day, then replay the drive at night and open the page that shows it."""
    port: int = 8000
    """The port of that page."""


def run(args: Args) -> int:
    """Make the drives, learn the maps, localise the queries, print and keep the answers."""
    if args.live:
        return _live(args)
    if args.drive_m != USUAL_M and not args.train:
        raise SettingsError(
            f"the paper's networks that come with evplace are of the street of {USUAL_M:.0f} m: add --train "
            "to train others, which needs torch"
        )
    drives = built_in_drives(args.out / "city", args.drive_m)
    rows = [row for name in INPUTS for method in METHODS for row in _rows(args, drives, name, method)]
    rows.sort(key=lambda row: QUERIES.index(str(row["query"])))
    with new_file(args.out / "result.json", overwrite=True) as partial:
        write_json(partial, {"rows": rows, "drive_m": args.drive_m})
    with contextlib.suppress(MissingExtraError):
        accuracy_chart(rows, args.out / "report.png")
    page = report(args.out / "results", args.out / "report.html", overwrite=True).page
    if args.json:
        print_json({"rows": rows})
        return 0
    _print(rows)
    say(
        "",
        _sentence(rows),
        "",
        f"To look at: {page}. The same in Python, on your own drives:",
        "",
        "  import evplace as ev",
        f'  day = ev.open_traverse("{args.out}/city/day-1/ideal")',
        "  street = ev.train(day, ev.PlaceGrid.from_track(day.track, cell_m=20))",
        f'  night = ev.open_traverse("{args.out}/city/night-1/ideal")',
        '  print(ev.evaluate(ev.Localizer(street), night).figures["accuracy"])',
    )
    return 0


def _live(args: Args) -> int:
    """Learn the street by day, and serve the drive at night, over and over, until a signal comes."""
    from evplace.cli import serve
    from evplace.serving.server import check_web

    check_web()  # before the minutes that follow
    settings = CitySettings(
        fps=60, sensors=("ideal",), route_length_m=args.drive_m, conditions=("day", "night"), paths=(1,),
        keep_events=True,
    )  # fmt: skip
    drives = _driven(args.out / "live", settings)
    place_map = args.out / "live.evp"
    if not (place_map / MARK).exists():
        reference = Traverse.load(drives["day-1"] / INPUTS["events"])
        assert reference.track is not None  # the city knows where it is
        train(reference, PlaceGrid.from_track(reference.track), preset="best").save(place_map)
    night = drives["night-1"] / f"{INPUTS['events']}.aedat4"
    return serve.run(
        serve.Args(map=place_map, source=str(night), source_set=(("loops", 0),), port=args.port, open=True)
    )


def built_in_drives(folder: Path, drive_m: float) -> dict[str, Path]:
    """The drives that everybody has: name -> folder with a traverse for each input."""
    return _driven(folder, CitySettings(fps=60, sensors=("ideal",), route_length_m=drive_m))


def _driven(folder: Path, settings: CitySettings) -> dict[str, Path]:
    with progress("driving through the city") as show:
        paths = generate(folder, settings, progress=lambda at: show(round(at.share * 1000), 1000, at.drive))
    return {path.name: path for path in paths}


def _rows(args: Args, drives: dict[str, Path], name: str, method: str) -> Iterator[dict[str, object]]:
    """How one method finds all queries by one input."""
    reference = Traverse.load(drives["day-1"] / INPUTS[name])
    place_map = _map(args, reference, name, method)
    with progress(f"{method} on {name}") as show:
        for number, query in enumerate(QUERIES):
            traverse = Traverse.load(drives[query] / INPUTS[name])
            result = evaluate(Localizer(place_map), traverse, rule="view", reference=reference)
            result.save(args.out / "results" / f"{query} {name} {method}", overwrite=True)
            show(number + 1, len(QUERIES), query)
            yield _row(query, name, method, result)


def _map(args: Args, reference: Traverse, name: str, method: str) -> PlaceMap:
    """The map of one method and input; one that is there already is read."""
    file = args.out / f"{name} {method}.evp"
    if (file / MARK).exists():
        return PlaceMap.load(file)
    assert reference.track is not None  # the city knows where it is
    places = PlaceGrid.from_track(reference.track)
    if method == "paper" and not args.train:
        place_map = _map_of_network(reference, places, name)
    else:
        with progress(f"learning {name}") as show:
            learning = Learning(functools.partial(_step, show), args.out / f".{name}.checkpoint")
            place_map = train(reference, places, preset=method, learning=learning)
    place_map.save(file)
    return place_map


def _map_of_network(reference: Traverse, places: PlaceGrid, name: str) -> PlaceMap:
    """The paper's network of the usual street as it comes with evplace."""
    track = reference.track
    assert track is not None
    graph = (resources.files("evplace_lab.cli") / "networks" / f"{name}.onnx").read_bytes()
    return PlaceMap(
        Network.presets["paper"],
        places,
        Items(np.arange(places.n), places.centres(), np.full(places.n, np.nan), are_places=True),
        np.column_stack([reference.xy, track.heading_deg]),
        {GRAPH: graph},
        reference.images.shape[1:],
        reference.recipe,
        (track.zone, track.northern),
        matcher=Local.presets["paper"],
    )


def _step(show: Show, step: int, steps: int, loss: float) -> None:
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
        "unseen_rejected": figures["unseen_rejected"],
        "chance": figures["chance"],
        "chance_seen": figures["chance_seen"],
        "n": figures["judged"],
    }


def _print(rows: list[dict[str, object]]) -> None:
    """A line a query: each method on each input, of all images and of those whose place the map has."""
    by_key = {(row["query"], row["input"], row["matcher"]): row for row in rows}
    kinds = list(itertools.product(METHODS, INPUTS))
    table = []
    for query in QUERIES:
        cells = [by_key[query, name, method] for method, name in kinds]
        shown = [cell[figure] for figure in ("accuracy", "accuracy_seen") for cell in cells]
        table.append([query, *map(_percent, shown), _percent(cells[0]["chance_seen"])])
    heads = [f"{method}, {name}" for method, name in kinds]
    columns = ("query", *heads, *(f"{head}, seen" for head in heads), "chance, seen")
    print_table(
        "Accuracy in % of live answers; seen: the map has that view; the map is day-1, the query as named",
        columns,
        table,
    )


def _sentence(rows: list[dict[str, object]]) -> str:
    """What was seen, in words."""
    share = {(row["query"], row["input"], row["matcher"]): row["accuracy_seen"] for row in rows}
    night = {kind: _percent(share["night-1", *kind]) for kind in itertools.product(INPUTS, METHODS)}
    best = [row for row in rows if row["matcher"] == "best" and row["input"] == "events"]
    called = [float(str(row["unseen_rejected"])) for row in best if row["unseen_rejected"] is not None]
    found = (
        f"At night, events find {night['events', 'best']} % of the street's images and colour "
        f"{night['colour', 'best']} %; the paper's method finds {night['events', 'paper']} and "
        f"{night['colour', 'paper']} %."
    )
    if not called:
        return found
    return (
        f"{found} On the other path, {_percent(sum(called) / len(called))} % of the images of streets that "
        "the map has never seen were called just that."
    )


def _percent(share: object) -> str:
    return f"{100 * share:.1f}" if isinstance(share, float) else "-"
