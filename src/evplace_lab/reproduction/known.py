"""The weights of the matcher `bayes` that tell right answers from wrong ones, fitted on towns of their own.

Each town's day is the map; its other drives are localised on the whole map, and on maps that lack every other
stretch, so that the drive enters and leaves what is known. The figures are of towns that were left out: at
even odds, the accuracy live and in hindsight, and the share of false accepts. The drives take half an hour of
two cores, all else ten minutes of one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers import _traces as traces
from evplace.matchers._known import of_drive
from evplace.matchers._ways import Ways
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace_lab.city import CitySettings, generate
from evplace_lab.reproduction import Choice, Table

TITLE = "Known and unknown: the weights of bayes, and each town by the weights of the others, in %"
NEEDS = "nothing"
INPUTS: tuple[str, ...] = ()
METHODS: tuple[str, ...] = ()
FORMAT = "evplace-known-1"
TOWNS = (
    CitySettings(fps=60, seed=101, route_length_m=900, sensors=("ideal", "weak")),
    CitySettings(fps=60, seed=102, route_length_m=900, sensors=("ideal", "weak")),
    CitySettings(fps=60, seed=103, route_length_m=1200, sensors=("ideal", "from-8bit")),
    CitySettings(
        fps=60, seed=104, route_length_m=1200, sensors=("ideal", "weak"),
        conditions=("day", "dusk", "fog", "night"),
    ),
)  # fmt: skip
CUT_M = (60.0, 150.0)
"""Shortest and longest stretch that a map lacks, or has."""
CUTS = 2
"""Maps with stretches cut out, for each drive."""
RIDGE = 1e-3
"""Penalty on large weights."""
NEAR_M, SAME_WAY_DEG = 20.0, 34.0
"""An answer so near that looks the same way is right."""
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Answers(NamedTuple):
    """What one drive's answers looked like, and which were right."""

    features: dict[str, Floats]
    """"live" or "late" -> (queries, features)."""
    right: dict[str, Bools]
    known: Bools
    """(queries,) whether any item is right."""


@dataclass(frozen=True)
class Drive:
    """One drive on one map, whole or cut."""

    town: int
    sensor: str
    query: str
    whole: bool
    answers: Answers


def document(
    out: Path, choice: Choice, workers: int, progress: Callable[[int, int, str], None] | None
) -> dict[str, Any]:
    """Make the drives that are missing, fit, and judge; SettingsError for settings of a training."""
    if choice.train:
        raise SettingsError(f"nothing is trained for 'known': leave out {', '.join(choice.train)}")
    began = time.process_time()
    said = progress or (lambda *_: None)
    drives: list[Drive] = []
    for number, town in enumerate(TOWNS):
        folder = out / f"town-{town.seed}"
        generate(folder, town, workers=workers)
        for sensor in town.sensors:
            said(number, len(TOWNS), f"town {town.seed}, {sensor}")
            drives += _drives(folder, town, sensor)
    weights = {kind: _fitted(drives, kind).tolist() for kind in ("live", "late")}
    rows = [row for town in TOWNS for row in _judged(drives, town.seed)]
    return {
        "format": FORMAT,
        "title": TITLE,
        "weights": weights,
        "rows": rows,
        "cpu_s": round(time.process_time() - began, 1),
    }


def tables(document: dict[str, Any]) -> Iterator[Table]:
    """Each town by the weights of the others; and the weights of all."""
    columns = ["town", "sensor", "query", "live", "false accepts", "late", "false accepts"]
    lines = [
        [str(row["town"]), row["sensor"], row["query"],
         *(_shown(row[kind][name]) for kind in ("live", "late") for name in ("accuracy", "false_accepts"))]
        for row in document["rows"]
    ]  # fmt: skip
    yield Table(document["title"], columns, lines)
    weights = document["weights"]
    lines = [[kind, " ".join(f"{weight:.4f}" for weight in weights[kind])] for kind in weights]
    yield Table("For evplace/matchers/_known_weights.py", ["answers", "weights"], lines)


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _drives(folder: Path, town: CitySettings, sensor: str) -> Iterator[Drive]:
    """All drives of a town but the map's own, each on the whole map and on cut ones."""
    day = Traverse.load(folder / "day-1" / sensor)
    assert day.track is not None
    place_map = train(day, PlaceGrid.from_track(day.track))
    rng = np.random.default_rng(town.seed)
    for condition, path in town.drives():
        query = f"{condition}-{path}"
        if query == "day-1":
            continue
        traverse = Traverse.load(folder / query / sensor)
        where = Localizer(place_map)
        seen, rows = where.seen_of(traverse)
        every = np.ones(len(place_map.items), np.bool_)
        for number in range(1 + CUTS):
            keep = _cut(Ways.of(place_map.route()), rng) if number else every
            answers = _answers(place_map, traverse, rows, seen, keep)
            yield Drive(town.seed, sensor, query, number == 0, answers)


def _cut(ways: Ways, rng: np.random.Generator) -> Bools:
    """(items,) which are left: every other of stretches drawn anew."""
    ends = [0.0]
    while ends[-1] < ways.way[-1]:
        ends.append(ends[-1] + rng.uniform(*CUT_M))
    left: Bools = (np.searchsorted(ends, ways.way, "right") + rng.integers(2)) % 2 == 0
    return left


def _answers(
    place_map: PlaceMap, query: Traverse, rows: NDArray[np.float32], seen: Any, keep: Bools
) -> Answers:
    """What the filter says of a drive on the items that are left."""
    route = place_map.route()
    assert route.t_us is not None
    part = route._replace(
        position=route.position[keep], heading_deg=route.heading_deg[keep], t_us=route.t_us[keep]
    )
    ways, learned = Ways.of(part), route.learned or {}
    right = _right(query, part.position, part.heading_deg)
    found = {
        "live": traces.live(ways, rows[:, keep], seen, learned),
        "late": traces.late(ways, rows[:, keep], seen, learned),
    }
    known = np.asarray(right.any(axis=1), np.bool_)
    return Answers(
        {kind: of_drive(one.signs, one.weight, kind == "late") for kind, one in found.items()},
        {kind: right[np.arange(len(right)), one.item] for kind, one in found.items()},
        known,
    )


def _right(query: Traverse, position: Floats, heading_deg: Floats) -> Bools:
    """(queries, items)."""
    track = query.track
    assert track is not None
    apart = np.hypot(*(track.xy[:, None] - position[None]).transpose(2, 0, 1))
    turn = np.abs((track.heading_deg[:, None] - heading_deg + 180) % 360 - 180)
    return np.asarray((apart <= NEAR_M) & (turn <= SAME_WAY_DEG), np.bool_)


def _fitted(drives: list[Drive], kind: str) -> Floats:
    """The weights of 1 and of the features: a logistic regression with a ridge, by Newton's method."""
    features = np.concatenate([drive.answers.features[kind] for drive in drives])
    right = np.concatenate([drive.answers.right[kind] for drive in drives]).astype(np.float64)
    middle, scale = features.mean(axis=0), features.std(axis=0) + 1e-9
    table = np.column_stack([np.ones(len(features)), (features - middle) / scale])
    weights = np.zeros(table.shape[1])
    for _ in range(30):
        said = 1 / (1 + np.exp(-table @ weights))
        slope = table.T @ (right - said) / len(right) - RIDGE * weights
        bend = (table * (said * (1 - said))[:, None]).T @ table / len(right) + RIDGE * np.eye(len(weights))
        weights += np.linalg.solve(bend, slope)
    own = weights[1:] / scale
    return np.concatenate([[weights[0] - middle @ own], own])


def _judged(drives: list[Drive], town: int) -> Iterator[dict[str, Any]]:
    """The whole drives of one town, at even odds, by weights fitted without it."""
    others = {kind: _fitted([one for one in drives if one.town != town], kind) for kind in ("live", "late")}
    for drive in (one for one in drives if one.town == town and one.whole):
        row: dict[str, Any] = {"town": town, "sensor": drive.sensor, "query": drive.query}
        known = drive.answers.known
        for kind, weights in others.items():
            accepted = weights[0] + drive.answers.features[kind] @ weights[1:] > 0
            good = np.where(known, drive.answers.right[kind] & accepted, ~accepted)
            unknown = accepted[~known]
            row[kind] = {
                "accuracy": 100 * float(good.mean()),
                "false_accepts": 100 * float(unknown.mean()) if len(unknown) else None,
            }
        yield row
