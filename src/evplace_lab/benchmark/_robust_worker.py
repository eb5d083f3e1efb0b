"""Some disturbed drives in a process of its own: see `robustness` and `evplace.core.workers`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from evplace.core.storage import new_file, write_json
from evplace.core.workers import serve
from evplace.evaluation._evaluate import evaluate
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace_lab.benchmark._disturbances import CONDITION, MAPS, PATH, QUERIES, SENSOR, Night
from evplace_lab.benchmark.robustness import TOWN
from evplace_lab.city.plan import drive_name
from evplace_lab.demonstration import map_of_network

FIGURES = ("accuracy", "within_5_m", "recall@1", "rejection_rate", "chance")


def work(job: dict[str, Any], say: Callable[[str], None]) -> None:
    """Do the jobs of a share, one level of one recipe each; says each that is done."""
    if not job["jobs"]:
        return
    town = Path(job["jobs"][0]["out"]) / "town"
    day = Traverse.load(town / drive_name("day", PATH) / SENSOR)
    night = Night.load(town / drive_name(CONDITION, PATH), TOWN)
    usual = _maps(day)
    for one in job["jobs"]:
        maps, query = usual, night.traverse
        if one["kind"] in MAPS:
            maps = _maps(MAPS[one["kind"]](day, one["level"]), with_network=False)
        elif one["kind"] in QUERIES:
            query = QUERIES[one["kind"]](night, one["level"])
        with new_file(one["file"], overwrite=True) as partial:
            write_json(partial, {name: _figures(place_map, query) for name, place_map in maps.items()})
        say(f"{one['kind']} {one['level']:g}")


def _maps(day: Traverse, with_network: bool = True) -> dict[str, PlaceMap]:
    """The map of each method; the paper's network comes with evplace, for the places of the true track."""
    assert day.track is not None  # the city knows where it is
    places = PlaceGrid.from_track(day.track)
    maps = {"best": train(day, places), "ncc": train(day, places, "ncc", matcher="best")}
    return maps | ({"paper": map_of_network(day, places, "events")} if with_network else {})


def _figures(place_map: PlaceMap, query: Traverse) -> dict[str, Any]:
    """Of live answers, by view."""
    figures = evaluate(Localizer(place_map), query, rule="view").figures
    return {name: figures.get(name) for name in FIGURES}


if __name__ == "__main__":
    sys.exit(serve(work))
