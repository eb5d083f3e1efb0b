"""What `evplace demo` shows: a street of the virtual city, learned by day and looked for otherwise."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np

from evplace.evaluation import Result
from evplace.evaluation._evaluate import evaluate
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers.local import Local
from evplace.placemap import MARK, Items, PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers import Learning
from evplace.scorers.network import GRAPH, Network
from evplace_lab.city import CitySettings, Progress, generate

INPUTS = {"events": "ideal", "colour": "colour"}
"""Input -> the traverse of each drive that holds it."""
REFERENCE = "day-1"
CPU_S_A_METRE = 0.17
"""Seconds of one core for a metre of one drive, all in all, on a Xeon of 2023."""
SETTLE_S = 45.0
"""Seconds that do not depend on the street: loops that are compiled, the page."""

METHODS = ("best", "paper")
"""Presets of a whole method: what evplace does by itself, and the paper's network with its Algorithm 1."""

Row = dict[str, object]
Watch = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Street:
    """How much is shown."""

    length_m: float = 300.0
    conditions: tuple[str, ...] = ("day", "night", "rain")
    paths: tuple[int, ...] = (1, 2)

    @property
    def queries(self) -> tuple[str, ...]:
        """The drives that are looked for."""
        names = [f"{condition}-{path}" for path in self.paths for condition in self.conditions]
        return tuple(name for name in names if name != REFERENCE)

    @property
    def minutes(self) -> float:
        """About how long all of it takes on this machine."""
        drives = len(self.queries) + 1
        cores = min(os.cpu_count() or 1, drives)
        return (SETTLE_S + CPU_S_A_METRE * self.length_m * drives / cores) / 60


USUAL = Street()
"""Its networks come with evplace."""
QUICK = Street(conditions=("day", "night"), paths=(1,))
"""Seen in a minute or two. A shorter street gives a map too few images to tell well what is known."""


def built_in_drives(folder: Path, street: Street, watch: Callable[[Progress], None]) -> dict[str, Path]:
    """The drives that everybody has: name -> folder with a traverse for each input."""
    settings = CitySettings(
        fps=60, sensors=("ideal",), route_length_m=street.length_m, conditions=street.conditions,
        paths=street.paths,
    )  # fmt: skip
    return {path.name: path for path in generate(folder, settings, progress=watch)}


def results(
    out: Path, drives: dict[str, Path], street: Street, trained_here: bool, watch: Watch
) -> Iterator[Row]:
    """How each method finds each query by each input; maps and results are kept in `out`."""
    total = len(INPUTS) * len(METHODS) * len(street.queries)
    done = 0
    for name in INPUTS:
        for method in METHODS:
            reference = Traverse.load(drives[REFERENCE] / INPUTS[name])
            place_map = _map(out, reference, name, method, trained_here, watch)
            for query in street.queries:
                watch(done, total, f"{query}, {name}, {method}")
                traverse = Traverse.load(drives[query] / INPUTS[name])
                result = evaluate(Localizer(place_map), traverse, rule="view", reference=reference)
                result.save(out / "results" / f"{query} {name} {method}", overwrite=True)
                done += 1
                yield _row(query, name, method, result)
    watch(total, total, "")


def python_of(drives: dict[str, Path]) -> list[str]:
    """Lines of Python that give the demo's own figure of its first query, events and default method."""
    at_night = next(name for name in drives if name != REFERENCE)
    day, night = (str(drives[name] / INPUTS["events"]) for name in (REFERENCE, at_night))
    return [
        "import evplace as ev",
        f"day = ev.open_traverse({day!r})",
        'street = ev.train(day, ev.PlaceGrid.from_track(day.track), preset="best")',
        f"night = ev.open_traverse({night!r})",
        'result = ev.evaluate(ev.Localizer(street), night, rule="view")',
        'print(result.figures["accuracy"])',
    ]


def _map(
    out: Path, reference: Traverse, name: str, method: str, trained_here: bool, watch: Watch
) -> PlaceMap:
    """The map of one method and input; one that is there already is read."""
    file = out / f"{name} {method}.evp"
    if (file / MARK).exists():
        return PlaceMap.load(file)
    assert reference.track is not None  # the city knows where it is
    places = PlaceGrid.from_track(reference.track)
    if method == "paper" and not trained_here:
        place_map = map_of_network(reference, places, name)
    else:
        learning = Learning(functools.partial(_step, watch, name), out / f".{name}.checkpoint")
        place_map = train(reference, places, preset=method, learning=learning)
    place_map.save(file)
    return place_map


def map_of_network(reference: Traverse, places: PlaceGrid, name: str) -> PlaceMap:
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


def _step(watch: Watch, name: str, step: int, steps: int, loss: float) -> None:
    watch(step, steps, f"learning {name}, loss {loss:.2f}")


def _row(query: str, name: str, method: str, result: Result) -> Row:
    figures = result.figures
    return {
        "query": query,
        "input": name,
        "matcher": method,
        "accuracy": figures["accuracy"],
        "accuracy_seen": figures["accuracy_seen"],
        "rejected": figures["rejection_rate"],
        "unseen_rejected": figures["unseen_rejected"],
        "chance": figures["chance"],
        "chance_seen": figures["chance_seen"],
        "n": figures["judged"],
    }
