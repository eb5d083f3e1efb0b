"""The weights of the matcher `bayes` that tell right answers from wrong ones, fitted on towns of their own.

Each town's day is the map; its other drives are localised on the whole map, and on maps that lack every
other stretch, so that the drive enters and leaves what is known: with all images and with some, by the
default and by edges alone, on events and on colour. The figures are of towns that were left out, live and in
hindsight, at the threshold for 1 % of false accepts: the accuracy on the whole map, and the share of false
accepts on all. Three ways to find that threshold stand beside one another: by what the map tells of itself,
by the other towns' drives, and halfway between them, as `bayes` does. The drives take half an hour of two
cores, all else an hour of one.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.core.storage import write_json
from evplace.core.workers import Workers
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers import Learned, Seen
from evplace.matchers import _traces as traces
from evplace.matchers._calibration import strangers
from evplace.matchers._known import ASKED, Judges, limit, of_late, of_live, said
from evplace.matchers._ways import Ways
from evplace.placemap import PlaceMap, train
from evplace.placemap._training import OwnRows
from evplace.places import PlaceGrid
from evplace.scorers.fused import Fused
from evplace_lab.city import CitySettings, generate
from evplace_lab.reproduction import Choice, Table
from evplace_lab.reproduction._boosting import boosted

TITLE = "Known and unknown: what tells right answers from wrong ones, each town by the others, in %"
NEEDS = "nothing"
INPUTS: tuple[str, ...] = ()
METHODS: tuple[str, ...] = ()
FORMAT = "evplace-known-2"
WEIGHTS = "known-weights.json"
"""The file of the weights of all towns: `evplace/matchers/_known.json`."""
DIGITS = 6
"""That are kept of a weight."""
TOWNS = (
    CitySettings(fps=60, seed=101, route_length_m=900, sensors=("ideal", "weak")),
    CitySettings(fps=60, seed=102, route_length_m=900, sensors=("ideal", "weak")),
    CitySettings(fps=60, seed=103, route_length_m=1200, sensors=("ideal", "from-8bit")),
    CitySettings(
        fps=60, seed=104, route_length_m=1200, sensors=("ideal", "weak"),
        conditions=("day", "dusk", "fog", "night"),
    ),
)  # fmt: skip
COLOUR = "colour"
"""The camera that each town has besides its sensors."""
KINDS = ("live", "late")
USED = "both, halfway"
"""Where `bayes` takes its thresholds from: the map, and other towns."""
CUT_M = (60.0, 150.0)
"""Shortest and longest stretch that a map lacks, or has."""
CUTS = 2
"""Maps with stretches cut out, for each drive."""
BEGINS_ANEW = 250
"""Images, at ten a second, after which a drive begins anew on such a map: beginnings are learned, too."""
ASKED_FOR = 0.01
"""Share of false accepts for which the thresholds are."""
RIDGE = 1e-3
"""Penalty on large weights."""
HOW_MUCH_LIVE, HOW_MUCH_LATE = 1, 2
"""So many of the last features say how much was seen: of live answers, and of both sides of late ones."""
LIVE_COUNTS = 0.5
"""What the log-odds of a live answer count beside those of the late one."""
NEAR_M, SAME_WAY_DEG = 20.0, 34.0
"""An answer so near that looks the same way is right."""
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Way(NamedTuple):
    """A way to localise the drives of a town."""

    label: str
    map_every: int = 1
    """Every so many images of the day are the map's."""
    every: int = 1
    """Every so many of a drive are queries."""
    scorer: Fused = Fused()


USUAL = Way("ten images a second")
OF_EVENTS = (
    USUAL,
    Way("two a second", every=5),
    Way("one a second", every=10),
    Way("one a second, and of the map", map_every=10, every=10),
    Way("edges alone", scorer=Fused(trained=False)),
)


class Answers(NamedTuple):
    """What one drive's answers looked like, and which were right."""

    features: dict[str, Floats]
    """"live" or "late" -> (queries, features)."""
    right: dict[str, Bools]
    known: Bools
    """(queries,) whether any item is right."""
    slow: Bools
    """(queries,) whether each came long after the one before it."""


class Camera(NamedTuple):
    """What the map is of, and how it is localised on."""

    town: int
    sensor: str
    way: str


@dataclass(frozen=True)
class Drive:
    """One drive on one map, whole or cut."""

    camera: Camera
    query: str
    whole: bool
    answers: Answers
    broken: bool = False
    """Whether it begins anew every so often."""

    @property
    def counts(self) -> Bools:
        """(queries,) what trees and rates are made of: on cut maps, broken drives of a quick camera, and
        those of a slow one that go on, which has too few images to begin often.
        """
        return np.asarray(np.where(self.answers.slow, not self.broken, self.whole or self.broken), np.bool_)


@dataclass(frozen=True)
class Own:
    """What one map tells of itself."""

    camera: Camera
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
        for sensor in (*town.sensors, COLOUR):
            said(number, len(TOWNS), f"town {town.seed}, {sensor}")
            for way in OF_EVENTS if sensor != COLOUR else (USUAL,):
                found = _localised(folder, town, sensor, way)
                own.append(found[0])
                drives += found[1]
    rows = [row for town in TOWNS for row in _judged(drives, own, town.seed)]
    write_json(out / WEIGHTS, {"format": FORMAT} | {kind: _plain(_fitted(drives, kind)) for kind in KINDS})
    return {"format": FORMAT, "title": TITLE, "rows": rows, "cpu_s": round(time.process_time() - began, 1)}


def _plain(judges: Judges) -> dict[str, Any]:
    """As JSON holds it."""
    quick, slow, usual = judges
    return {
        "start": _rounded(np.array(quick.start)),
        "feature": quick.feature.tolist(),
        "limit": _rounded(quick.limit),
        "says": _rounded(quick.says),
        "slow": _rounded(slow),
        "usual": _rounded(usual),
    }


def _rounded(values: Floats) -> Any:
    return np.vectorize(lambda value: float(f"{value:.{DIGITS}g}"), otypes=[float])(values).tolist()


def tables(document: dict[str, Any]) -> Iterator[Table]:
    """Each town by the weights of the others, and what that comes to for each way to localise."""
    rows = document["rows"]
    columns = ["town", "sensor", "query", "live", "false accepts", "late", "false accepts"]
    lines = [
        [str(row["town"]), row["sensor"], row["query"],
         *(_shown(row[kind][USED][name]) for kind in KINDS for name in ("accuracy", "false_accepts"))]
        for row in rows if row["way"] == USUAL.label
    ]  # fmt: skip
    yield Table(document["title"], columns, lines)
    names = ("accuracy", "false_accepts", "most")
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault("colour" if row["sensor"] == COLOUR else row["way"], []).append(row)
    lines = [
        [label, kind, by, *(_shown(_over(group, kind, by, name)) for name in names)]
        for label, group in groups.items()
        for kind in KINDS
        for by in group[0][kind]
    ]
    columns = ["drives", "answers", "by", "accuracy", "false accepts", "at most"]
    yield Table("By what threshold, on the average", columns, lines)


def _over(rows: list[dict[str, Any]], kind: str, by: str, name: str) -> float:
    """Of all drives that have it, the average, or the most of false accepts."""
    found = [row[kind][by]["false_accepts" if name == "most" else name] for row in rows]
    values = [value for value in found if value is not None]
    return float(np.max(values) if name == "most" else np.mean(values))


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _localised(folder: Path, town: CitySettings, sensor: str, way: Way) -> tuple[Own, list[Drive]]:
    """What the map of a town's day tells of itself, and the town's other drives on it."""
    day = Traverse.load(folder / "day-1" / sensor)[:: way.map_every]
    assert day.track is not None
    place_map = train(day, PlaceGrid.from_track(day.track), way.scorer)
    camera = Camera(town.seed, sensor, way.label)
    return _own(place_map, camera), list(_drives(folder, town, place_map, camera, way.every))


def _own(place_map: PlaceMap, camera: Camera) -> Own:
    """What the map tells of itself."""
    own = OwnRows(place_map)
    found = strangers(own.route(math.nan), own.rows)
    assert found is not None
    return Own(camera, {"live": found.live, "late": found.late})


def _drives(
    folder: Path, town: CitySettings, place_map: PlaceMap, camera: Camera, every: int
) -> Iterator[Drive]:
    """All drives of a town but the map's own, each on the whole map and on cut ones."""
    rng = np.random.default_rng(town.seed)
    for condition, path in town.drives():
        query = f"{condition}-{path}"
        if query == "day-1":
            continue
        traverse = Traverse.load(folder / query / camera.sensor)[::every]
        seen, rows = Localizer(place_map).seen_of(traverse)
        whole = np.ones(len(place_map.items), np.bool_)
        for number in range(1 + CUTS):
            keep = _cut(Ways.of(place_map.route()), rng) if number else whole
            yield Drive(camera, query, number == 0, _answers(place_map, traverse, rows, seen, keep))
            if number:
                pieces = max(len(seen) * every // BEGINS_ANEW, 1)
                answers = _answers(place_map, traverse, rows, seen, keep, pieces)
                yield Drive(camera, query, False, answers, broken=True)


def _cut(ways: Ways, rng: np.random.Generator) -> Bools:
    """(items,) which are left: every other of stretches drawn anew."""
    ends = [0.0]
    while ends[-1] < ways.way[-1]:
        ends.append(ends[-1] + rng.uniform(*CUT_M))
    left: Bools = (np.searchsorted(ends, ways.way, "right") + rng.integers(2)) % 2 == 0
    return left


def _answers(
    place_map: PlaceMap,
    query: Traverse,
    rows: NDArray[np.float32],
    seen: list[Seen],
    keep: Bools,
    pieces: int = 1,
) -> Answers:
    """What the filter says of a drive on the items that are left, each of its pieces begun anew."""
    route = place_map.route()
    assert route.t_us is not None
    part = route._replace(
        position=route.position[keep], heading_deg=route.heading_deg[keep], t_us=route.t_us[keep]
    )
    ways, learned = Ways.of(part), route.learned or {}
    seen = [one._replace(verifying=None if one.verifying is None else one.verifying[keep]) for one in seen]
    right = _right(query, part.position, part.heading_deg)
    known = np.asarray(right.any(axis=1), np.bool_)
    each = [
        _piece(ways, rows[at][:, keep], [seen[one] for one in at], right[at], known[at], learned)
        for at in np.array_split(np.arange(len(rows)), pieces)
    ]
    together = {
        name: {kind: np.concatenate([getattr(one, name)[kind] for one in each]) for kind in KINDS}
        for name in ("features", "right")
    }
    return Answers(**together, known=known, slow=np.concatenate([one.slow for one in each]))


def _piece(
    ways: Ways, rows: NDArray[np.float32], seen: list[Seen], right: Bools, known: Bools, learned: Learned
) -> Answers:
    """The same of one piece, of whose images these items are right."""
    live, late = traces.live(ways, rows, seen, learned), traces.late(ways, rows, seen, learned)
    at = np.arange(len(right))
    return Answers(
        {"live": of_live(live.signs, live.weight), "late": of_late(late.signs, late.live, late.weight)},
        {"live": right[at, live.item], "late": right[at, late.item]},
        known,
        live.slow,
    )


def _right(query: Traverse, position: Floats, heading_deg: Floats) -> Bools:
    """(queries, items)."""
    track = query.track
    assert track is not None
    apart = np.hypot(*(track.xy[:, None] - position[None]).transpose(2, 0, 1))
    turn = np.abs((track.heading_deg[:, None] - heading_deg + 180) % 360 - 180)
    return np.asarray((apart <= NEAR_M) & (turn <= SAME_WAY_DEG), np.bool_)


def _fitted(drives: list[Drive], kind: str) -> Judges:
    """What judges answers of a kind, and what it says of images of places that maps lack.

    The latter by what is fitted without their town, where there are others: it would say too little of its
    own.
    """
    towns = list(dict.fromkeys(drive.camera.town for drive in drives))
    unknown: list[tuple[Floats, Bools]] = []
    for town in towns:
        judges = _judges([one for one in drives if one.camera.town != town] or drives, kind)
        unknown += [_unknown(one, kind, judges) for one in drives if one.camera.town == town]
    found, slow = (np.concatenate(column) for column in zip(*unknown, strict=True))
    usual = [_log_odds(np.quantile(found[slow == flag], 1 - ASKED)) for flag in (False, True)]
    return _judges(drives, kind)._replace(usual=np.array(usual))


def _judges(drives: list[Drive], kind: str) -> Judges:
    """Trees, by the answers of quick cameras; a regression, by all of events, of drives that go on."""
    quick = [drive.counts & ~drive.answers.slow for drive in drives]
    right, features = (
        np.concatenate([of(drive.answers)[chosen] for drive, chosen in zip(drives, quick, strict=True)])
        for of in (_right_of(kind), _features_of(kind))
    )
    going_on = [one for one in drives if one.camera.sensor != COLOUR and not one.broken]
    return Judges(boosted(features, right), _linear(going_on, kind), np.zeros((2, len(ASKED))))


def _log_odds(probability: Floats) -> Floats:
    held = np.clip(probability, 1e-9, 1 - 1e-9)
    return np.asarray(np.log(held / (1 - held)), np.float64)


def _right_of(kind: str) -> Callable[[Answers], Floats]:
    return lambda answers: answers.right[kind].astype(np.float64)


def _features_of(kind: str) -> Callable[[Answers], Floats]:
    return lambda answers: answers.features[kind]


def _linear(drives: list[Drive], kind: str) -> Floats:
    """The weights of 1 and of the features; 0 of how much was seen, which is no matter of more or less.

    Of late answers those of both sides are fitted by themselves; then the log-odds of live ones are added by
    LIVE_COUNTS, and the sum scaled anew.
    """
    right, features = (
        np.concatenate([of(drive.answers) for drive in drives])
        for of in (_right_of(kind), _features_of(kind))
    )
    if kind == "live":
        return _without(HOW_MUCH_LIVE, features, right)
    sides = len(features[0]) - len(drives[0].answers.features["live"][0])
    own, live = _without(HOW_MUCH_LATE, features[:, :sides], right), _linear(drives, "live")
    weights = np.concatenate([[own[0] + LIVE_COUNTS * live[0]], own[1:], LIVE_COUNTS * live[1:]])
    shift, scale = _regression((weights[0] + features @ weights[1:])[:, None], right)
    return np.asarray(scale * weights + shift * np.eye(len(weights))[0], np.float64)


def _without(last: int, features: Floats, right: Floats) -> Floats:
    """A regression on all but the last few features, whose weights are 0."""
    return np.concatenate([_regression(features[:, :-last], right), np.zeros(last)])


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
    rest = [one for one in drives if one.camera.town != town]
    judges = {kind: _fitted(rest, kind) for kind in KINDS}
    for mine in (one for one in own if one.camera.town == town):
        thresholds = {kind: _thresholds(mine, kind, judges[kind]) for kind in KINDS}
        queries = [one for one in drives if one.camera == mine.camera]
        for query in dict.fromkeys(one.query for one in queries):
            group = [one for one in queries if one.query == query]
            row: dict[str, Any] = {**mine.camera._asdict(), "query": query}
            for kind in KINDS:
                row[kind] = {
                    by: _at(group, kind, judges[kind], limits) for by, limits in thresholds[kind].items()
                }
            yield row


def _thresholds(mine: Own, kind: str, judges: Judges) -> dict[str, Floats]:
    """Where they come from -> (2,) for as many false accepts as are asked, of quick and of slow cameras."""
    features = mine.features[kind]
    own = [said(judges, features, np.full(len(features), slow)) for slow in (False, True)]
    at = int(np.flatnonzero(ASKED == ASKED_FOR)[0])
    return {
        USED: np.array([limit(one, judges, bool(slow), ASKED_FOR) for slow, one in enumerate(own)]),
        "the map": np.array([np.quantile(one, 1 - ASKED_FOR) for one in own]),
        "other towns": 1 / (1 + np.exp(-judges.usual[:, at])),
    }


def _at(group: list[Drive], kind: str, judges: Judges, limits: Floats) -> dict[str, float | None]:
    """One query's accuracy on the whole map, and its false accepts on all maps, in %."""
    (whole,) = (one.answers for one in group if one.whole)
    accepted = said(judges, whole.features[kind], whole.slow) > limits[whole.slow.astype(int)]
    good = np.where(whole.known, whole.right[kind] & accepted, ~accepted)
    unknown = [_unknown(one, kind, judges) for one in group]
    wrong = np.concatenate([found > limits[slow.astype(int)] for found, slow in unknown])
    return {
        "accuracy": 100 * float(good.mean()),
        "false_accepts": 100 * float(wrong.mean()) if len(wrong) else None,
    }


def _unknown(drive: Drive, kind: str, judges: Judges) -> tuple[Floats, Bools]:
    """The probabilities of the images of places that a drive's map lacks, and which are of a slow camera."""
    answers, there = drive.answers, ~drive.answers.known & drive.counts
    return said(judges, answers.features[kind][there], answers.slow[there]), answers.slow[there]
