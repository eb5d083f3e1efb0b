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
from evplace.matchers._known import Judges, of_late, of_live
from evplace.matchers._ways import Ways
from evplace.placemap import PlaceMap, train
from evplace.placemap._training import OwnRows
from evplace.places import PlaceGrid
from evplace.scorers.fused import Fused
from evplace_lab.city import CitySettings, generate
from evplace_lab.reproduction import Choice, Table
from evplace_lab.reproduction._judging import COLOUR, KINDS, USED, Answers, Camera, Drive, Own, fitted, judged

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
CUT_M = (60.0, 150.0)
"""Shortest and longest stretch that a map lacks, or has."""
CUTS = 2
"""Maps with stretches cut out, for each drive."""
BEGINS_ANEW = 250
"""Images, at ten a second, after which a drive begins anew on such a map: beginnings are learned, too."""
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
    rows = [row for town in TOWNS for row in judged(drives, own, town.seed)]
    write_json(out / WEIGHTS, {"format": FORMAT} | {kind: _plain(fitted(drives, kind)) for kind in KINDS})
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
