"""The weights of the matcher `bayes` that tell right answers from wrong ones, fitted on towns of their own.

Each town's day is the map; its other drives are localised on the whole map, and on maps that lack every other
stretch, so that the drive enters and leaves what is known. The figures are of towns that were left out, live
and in hindsight, at the threshold for 1 % of false accepts: the accuracy on the whole map, and the share of
false accepts on all. Two ways to find that threshold stand beside one another: by what the map tells of
itself, as `bayes` does, and by the other towns' drives. The drives take half an hour of two cores, all else
ten minutes of one.
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
from evplace.core.workers import Workers
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers import _traces as traces
from evplace.matchers._calibration import strangers
from evplace.matchers._known import of_late, of_live
from evplace.matchers._ways import Ways
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers import scorer_of
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
KINDS = ("live", "late")
USED = "the map"
"""Where `bayes` takes its thresholds from."""
CUT_M = (60.0, 150.0)
"""Shortest and longest stretch that a map lacks, or has."""
CUTS = 2
"""Maps with stretches cut out, for each drive."""
ASKED = 0.01
"""Share of false accepts for which the thresholds are."""
RIDGE = 1e-3
"""Penalty on large weights."""
LIVE_COUNTS = 0.5
"""What the log-odds of a live answer count beside those of the late one."""
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


@dataclass(frozen=True)
class Own:
    """What one map tells of itself."""

    town: int
    sensor: str
    features: dict[str, Floats]
    """"live" or "late" -> (unknown, features) of images whose places are cut out."""


def document(
    out: Path, choice: Choice, workers: Workers, progress: Callable[[int, int, str], None] | None
) -> dict[str, Any]:
    """Make the drives that are missing, fit, and judge; SettingsError for settings of a training."""
    if choice.train:
        raise SettingsError(f"nothing is trained for 'known': leave out {', '.join(choice.train)}")
    began = time.process_time()
    said = progress or (lambda *_: None)
    drives: list[Drive] = []
    own: list[Own] = []
    for number, town in enumerate(TOWNS):
        folder = out / f"town-{town.seed}"
        generate(folder, town, workers=workers)
        for sensor in town.sensors:
            said(number, len(TOWNS), f"town {town.seed}, {sensor}")
            place_map = _map_of(folder, sensor)
            own.append(_own(place_map, town.seed, sensor))
            drives += _drives(folder, town, sensor, place_map)
    weights = {kind: _fitted(drives, kind) for kind in KINDS}
    return {
        "format": FORMAT,
        "title": TITLE,
        "weights": {kind: found.tolist() for kind, found in weights.items()},
        "rows": [row for town in TOWNS for row in _judged(drives, own, town.seed)],
        "cpu_s": round(time.process_time() - began, 1),
    }


def tables(document: dict[str, Any]) -> Iterator[Table]:
    """Each town by the weights of the others; and the weights of all."""
    rows = document["rows"]
    columns = ["town", "sensor", "query", "live", "false accepts", "late", "false accepts"]
    lines = [
        [str(row["town"]), row["sensor"], row["query"],
         *(_shown(row[kind][USED][name]) for kind in KINDS for name in ("accuracy", "false_accepts"))]
        for row in rows
    ]  # fmt: skip
    yield Table(document["title"], columns, lines)
    lines = [
        [kind, way, *(_shown(_mean(rows, kind, way, name)) for name in ("accuracy", "false_accepts"))]
        for kind in KINDS
        for way in rows[0][kind]
    ]
    yield Table("Where the threshold comes from", ["answers", "by", "accuracy", "false accepts"], lines)
    weights = document["weights"]
    lines = [[kind, " ".join(f"{weight:.4f}" for weight in weights[kind])] for kind in weights]
    yield Table("For evplace/matchers/_known_weights.py", ["answers", "weights"], lines)


def _mean(rows: list[dict[str, Any]], kind: str, way: str, name: str) -> float:
    """Over all drives that have it."""
    found = [row[kind][way][name] for row in rows]
    return float(np.mean([value for value in found if value is not None]))


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _map_of(folder: Path, sensor: str) -> PlaceMap:
    """The map of a town's day."""
    day = Traverse.load(folder / "day-1" / sensor)
    assert day.track is not None
    return train(day, PlaceGrid.from_track(day.track))


def _own(place_map: PlaceMap, town: int, sensor: str) -> Own:
    """What the map tells of itself."""
    references = place_map.references
    assert references is not None
    opened = scorer_of(place_map.scorer).open(place_map.content)
    found = strangers(place_map.route(), lambda items: opened.rows(references[items]))
    assert found is not None
    return Own(town, sensor, {"live": found.live, "late": found.late})


def _drives(folder: Path, town: CitySettings, sensor: str, place_map: PlaceMap) -> Iterator[Drive]:
    """All drives of a town but the map's own, each on the whole map and on cut ones."""
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
        {
            "live": of_live(found["live"].signs, found["live"].weight),
            "late": of_late(found["late"].signs, found["late"].live, found["late"].weight),
        },
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
    """The weights of 1 and of the features.

    Of late answers those of both sides are fitted by themselves; then the log-odds of live ones are added by
    LIVE_COUNTS, and the sum scaled anew.
    """
    right = np.concatenate([drive.answers.right[kind] for drive in drives]).astype(np.float64)
    features = np.concatenate([drive.answers.features[kind] for drive in drives])
    if kind == "live":
        return _regression(features, right)
    sides = len(features[0]) - len(drives[0].answers.features["live"][0])
    own, live = _regression(features[:, :sides], right), _fitted(drives, "live")
    weights = np.concatenate([[own[0] + LIVE_COUNTS * live[0]], own[1:], LIVE_COUNTS * live[1:]])
    shift, scale = _regression((weights[0] + features @ weights[1:])[:, None], right)
    return np.asarray(scale * weights + shift * np.eye(len(weights))[0], np.float64)


def _regression(features: Floats, right: Floats) -> Floats:
    """The weights of 1 and of the features: a logistic regression with a ridge, by Newton's method."""
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


def _judged(drives: list[Drive], own: list[Own], town: int) -> Iterator[dict[str, Any]]:
    """The drives of one town, by weights and thresholds fitted without it."""
    rest = [one for one in drives if one.town != town]
    weights = {kind: _fitted(rest, kind) for kind in KINDS}
    for mine in (one for one in own if one.town == town):
        thresholds = {kind: _thresholds(mine, rest, kind, weights[kind]) for kind in KINDS}
        queries = [one for one in drives if one.town == town and one.sensor == mine.sensor]
        for query in dict.fromkeys(one.query for one in queries):
            group = [one for one in queries if one.query == query]
            row: dict[str, Any] = {"town": town, "sensor": mine.sensor, "query": query}
            for kind in KINDS:
                row[kind] = {
                    way: _at(group, kind, weights[kind], limit) for way, limit in thresholds[kind].items()
                }
            yield row


def _thresholds(mine: Own, rest: list[Drive], kind: str, weights: Floats) -> dict[str, float]:
    """Where it comes from -> the threshold for as many false accepts as are asked for."""
    own, elsewhere = (
        float(np.quantile(unknown, 1 - ASKED))
        for unknown in (_said(mine.features[kind], weights), _unknown(rest, kind, weights))
    )
    return {USED: own, "other towns": elsewhere}


def _at(group: list[Drive], kind: str, weights: Floats, limit: float) -> dict[str, float | None]:
    """One query's accuracy on the whole map, and its false accepts on all maps, in %."""
    (whole,) = (one.answers for one in group if one.whole)
    accepted = _said(whole.features[kind], weights) > limit
    good = np.where(whole.known, whole.right[kind] & accepted, ~accepted)
    unknown = _unknown(group, kind, weights)
    return {
        "accuracy": 100 * float(good.mean()),
        "false_accepts": 100 * float((unknown > limit).mean()) if len(unknown) else None,
    }


def _said(features: Floats, weights: Floats) -> Floats:
    """(n,) the probabilities by some weights."""
    return np.asarray(1 / (1 + np.exp(-(weights[0] + features @ weights[1:]))), np.float64)


def _unknown(drives: list[Drive], kind: str, weights: Floats) -> Floats:
    """The probabilities of all images of places that their maps lack."""
    return np.concatenate([_said(one.answers.features[kind][~one.answers.known], weights) for one in drives])
