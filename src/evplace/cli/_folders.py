"""What `evplace info` says of folders that evplace wrote, of data sets and of films."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.folders import CITY, DOCTOR, DRIVE, KINDS, MAP, RESULT, TRAVERSE, mark_of, marked
from evplace.core.storage import read_json
from evplace.drives import datasets
from evplace.drives.to_traverse import open_source
from evplace.evaluation import Result
from evplace.imaging.recipe import Recipe, shown
from evplace.imaging.traverse import Traverse
from evplace.placemap import PlaceMap
from evplace.sources.film import Film
from evplace.sources.readers import is_recording

Facts = dict[str, Any]


def facts_of(path: Path) -> Facts | None:
    """What lies at a path, its kind first; None for what is read as a recording."""
    mark = mark_of(path)
    if mark is not None:
        return _BY_MARK[mark](path)
    if not path.is_dir():
        return None
    if named := datasets.matching(path):
        return {"kind": "data set", "layout": ", ".join(named), "drives": datasets.drives(path, named[0])}
    if is_recording(path):
        return None
    inside = {
        KINDS[mark]: [str(one.parent) for one in marked(path, mark)] for mark in (MAP, RESULT, TRAVERSE)
    }
    return {"kind": "folder", **inside} if any(inside.values()) else _film(path)


def _map(path: Path) -> Facts:
    place_map = PlaceMap.load(path)
    learned = None if place_map.matcher is None else families.name_of("matchers", place_map.matcher)
    return {
        "kind": "map",
        "scorer": families.name_of("scorers", place_map.scorer),
        "matcher": learned,
        "measured_on_itself": place_map.learned is not None,
        "items": len(place_map.items),
        "places": place_map.places.n,
        **_where(place_map.drive[:, :2], place_map.zone),
        **_recipe(place_map.recipe, place_map.image_shape),
        "source": place_map.info.get("source"),
    }


def _traverse(path: Path) -> Facts:
    traverse = Traverse.load(path)
    track = traverse.track
    return {
        "kind": "traverse",
        "images": len(traverse),
        "span_s": float(traverse.t_us[-1] - traverse.t_us[0]) / 1e6,
        "without_events": int(np.sum(traverse.counts == 0)),
        **_where(traverse.xy, None if track is None else (track.zone, track.northern)),
        **_recipe(traverse.recipe, traverse.images.shape[1:]),
        "source": traverse.info.get("source"),
    }


def _result(path: Path) -> Facts:
    result = Result.load(path)
    shown_figures = ("queries", "items", "accuracy", "accuracy_seen", "rejection_rate", "recall@1", "chance")
    settings: Facts = result.settings
    return {
        "kind": "result",
        "answers": result.timing,
        "matcher": _name(settings.get("matcher")),
        "scorer": _name((settings.get("map") or {}).get("scorer")),
        "rule": (settings.get("truth") or {}).get("by"),
        **{name: result.figures.get(name) for name in shown_figures},
        "query": settings.get("query"),
        "evplace": result.versions.get("evplace"),
    }


def _city(path: Path) -> Facts:
    about = read_json(path / CITY, f"the settings of {path}")
    drives = sorted(found.parent.name for found in path.glob(f"*/{DRIVE}"))
    sensors = sorted({found.parent.name for found in path.glob(f"*/*/{TRAVERSE}")})
    traverses = [str(found.parent) for found in marked(path, TRAVERSE)]
    names = ("version", "seed", "route_length_m", "fps", "image_hz", "dt", "keep_events")
    return {
        "kind": "city",
        "drives": drives,
        "sensors": sensors,
        **{name: about.get(name) for name in names},
        "give": traverses[0] if traverses else None,
    }


def _drive(path: Path) -> Facts:
    traverses = [found.parent.name for found in marked(path, TRAVERSE)]
    recordings = sorted(found.name for found in path.glob("*.aedat4"))
    give = str(path / traverses[0]) if traverses else None
    return {"kind": "drive of a city", "traverses": traverses, "recordings": recordings, "give": give}


def _examination(path: Path) -> Facts:
    about = read_json(path / DOCTOR, f"the findings in {path}")
    states = [finding.get("state") for finding in about.get("findings", []) if isinstance(finding, dict)]
    counts = {state: states.count(state) for state in dict.fromkeys(states)}
    return {"kind": "report of the doctor", "of": about.get("recording"), "findings": counts}


def _film(path: Path) -> Facts:
    source = open_source(path).source
    assert isinstance(source, Film)  # no recording, or it would have said so
    frames = source.frames
    return {
        "kind": "film",
        "images": None if frames is None else len(frames.t_us),
        "size": shown(source.size),
        "times": "the camera's own" if source.timed else "made up from a rate",
    }


def _where(xy: NDArray[np.float64], zone: tuple[int, bool] | None) -> Facts:
    """How much of a drive has positions, and how long its way is."""
    known = xy[np.isfinite(xy).all(axis=1)]
    if zone is None or not len(known):
        return {"positions": "none"}
    length = float(np.hypot(*np.diff(known, axis=0).T).sum())
    plane = f"UTM zone {zone[0]}{' north' if zone[1] else ' south'}" if zone[0] else "a plane of their own"
    return {"positions": f"{len(known)} of {len(xy)}, {plane}", "way_m": round(length, 1)}


def _recipe(recipe: Recipe | None, shape: tuple[int, ...]) -> Facts:
    facts: Facts = {"image_shape": list(shape)}
    if recipe is None:
        return facts | {"made": "not known"}
    facts["of"] = recipe.kind
    facts["sensor"] = None if recipe.size is None else shown(recipe.size)
    if recipe.kind == "events":
        facts |= {"window_s": recipe.windows.dt, "representation": recipe.images.representation}
    return facts


def _name(part: object) -> str | None:
    return str(part["name"]) if isinstance(part, dict) and "name" in part else None


_BY_MARK = {
    MAP: _map, TRAVERSE: _traverse, RESULT: _result, CITY: _city, DRIVE: _drive, DOCTOR: _examination,
}  # fmt: skip
