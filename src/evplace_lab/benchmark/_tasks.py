"""Tasks: one drive that is known, one that is looked for, and what is right."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from evplace.core.errors import InputError
from evplace.core.folders import CITY, TRAVERSE, instead
from evplace.evaluation.truth import Truth, by_cells, by_radius, by_view
from evplace.imaging.traverse import Traverse
from evplace.placemap import Items, PlaceMap
from evplace.places import PlaceGrid
from evplace.sources.tracks import Track

Rule = Literal["view", "places", "radius"]
RADIUS_M = 25.0
DATABASE = "day-1"


@dataclass(frozen=True)
class Task:
    """Find the images of one drive of a city among those of another."""

    city: Path
    query_name: str
    part: str
    """Which traverse of each drive: ideal, weak, from-8bit or colour."""
    rule: Rule = "view"
    database_name: str = DATABASE

    @cached_property
    def database(self) -> Traverse:
        """The drive that is known."""
        return Traverse.load(self.city / self.database_name / self.part)

    @cached_property
    def query(self) -> Traverse:
        """The drive that is looked for."""
        return Traverse.load(self.city / self.query_name / self.part)

    @property
    def condition(self) -> str:
        """Of the query: night of night-1."""
        return self.query_name.rpartition("-")[0]

    @property
    def shape(self) -> tuple[int, int]:
        """Queries and references, all images of both drives, in their order."""
        return len(self.query), len(self.database)

    @property
    def places(self) -> PlaceGrid:
        """The cells of 20 m of the known drive."""
        return PlaceGrid.from_track(_track(self.database))

    @cached_property
    def items(self) -> Items:
        """Every image of the known drive is an item."""
        track, places = _track(self.database), self.places
        labels = np.asarray(places.label(places.where(track.xy)), np.int64)
        return Items(labels, track.xy, track.heading_deg, t_us=self.database.t_us)

    def truth(self, items: Items) -> Truth:
        """Which of the items are right for each query."""
        here = _track(self.query)
        if self.rule == "radius":
            return by_radius(here.xy, items.position, RADIUS_M)
        if self.rule == "places":
            return by_cells(here.xy, items.position, self.places.cell_m, self.places.origin)
        times = np.arange(len(items)) if items.t_us is None else items.t_us
        return by_view(here, Track.local(times, items.position, items.heading_deg))

    def truth_of(self, place_map: PlaceMap) -> Truth:
        """The same for the items of a map."""
        return self.truth(place_map.items)


def tasks_of(city: Path, part: str, queries: tuple[str, ...] = (), rule: Rule = "view") -> list[Task]:
    """The tasks of a city's drives, in order; InputError where a drive or its images are not there."""
    if not (city / CITY).exists():
        raise InputError(
            instead(city, CITY) or f"{city} holds no drives: make them with evplace city -o {city}"
        )
    there = sorted(found.parent.parent.name for found in city.glob(f"*/{part}/{TRAVERSE}"))
    if DATABASE not in there:
        parts = sorted({found.parent.name for found in city.glob(f"*/*/{TRAVERSE}")})
        raise InputError(f"{city} holds no {DATABASE}/{part}: its images are {', '.join(parts) or 'none'}")
    wanted = queries or tuple(name for name in there if name != DATABASE)
    for name in wanted:
        if name not in there:
            raise InputError(f"{city} holds no {name}/{part}: its drives are {', '.join(there)}")
    return [Task(city, name, part, rule) for name in wanted]


def _track(traverse: Traverse) -> Track:
    if traverse.track is None:
        raise InputError("a drive of the benchmark has no positions: make the city anew")
    return traverse.track
