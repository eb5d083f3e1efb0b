"""Maps of several drives: a drive is added, maps are merged, drives are taken out as a map of their own.

Each drive of a map stays a whole map by itself: what is taken out is what was put in.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import PlaceMapError, SettingsError, TraverseError
from evplace.imaging.traverse import Traverse
from evplace.placemap import Items, PlaceMap
from evplace.placemap._parts import Part, places_in
from evplace.placemap._thinning import thin
from evplace.placemap._training import calibrate, calibrate_more, learned_map
from evplace.places import PlaceGrid, PlaceRuns, Places
from evplace.scorers import Learning

SAME_DRIVE = 0.5
"""Two drives that share this share of their images are one."""


def add(place_map: PlaceMap, *references: Traverse, names: Sequence[str] | None = None) -> PlaceMap:
    """A map with some more drives; what it knows already stays as it is, and its items keep their numbers.

    `names` are what the drives are called in the map; by default they are those of their sources. Raises
    TraverseError where their images were not made as the map's or have no positions, PlaceMapError where the
    map cannot grow: its items are places, or it holds such a drive already.
    """
    found = place_map
    for number, reference in enumerate(references):
        _check_can_grow(found)
        _check_made_alike(found, reference)
        moved = _in_its_zone(reference, found)
        learned = learned_map(moved, _places_of(moved, found), found.scorer, Learning())
        name = name_of(learned, "drive") if names is None else names[number]
        found = _joined(found, Part(_free_name(name, found), learned, np.zeros(0, np.int64)))
    known = len(parts_of(place_map))
    added = ", ".join(part.name for part in found.parts[known:])
    if not added:
        return place_map
    return calibrate_more(_noted(place_map, found, f"added {added}"), place_map.learned, known)


def merge(*maps: PlaceMap) -> PlaceMap:
    """One map of all drives of some maps, in their order.

    Raises PlaceMapError where they have not one scorer, one recipe, one zone and one size of places, or hold
    the same drive.
    """
    first, *others = maps
    found = first
    for other in others:
        _check_can_grow(found)
        _check_alike(found, other)
        for part in parts_of(other):
            found = _joined(found, part._replace(name=_free_name(part.name, found)))
    return calibrate(_noted(first, found, f"merged {len(maps)} maps")) if others else first


def split(place_map: PlaceMap, drives: Sequence[str]) -> PlaceMap:
    """A map of some of a map's drives, by their names; SettingsError where it has none of a name.

    Of one drive it is the map that `train` makes of it.
    """
    parts = {part.name: part for part in parts_of(place_map)}
    unknown = [name for name in drives if name not in parts]
    if unknown or not drives:
        asked = f"no drive '{unknown[0]}'" if unknown else "no drive without a name"
        raise SettingsError(f"the map has {asked}: it has {', '.join(parts)}")
    first, *others = (part for part in parts.values() if part.name in drives)
    if not others:
        return first.map if first.map.learned else calibrate(first.map, place_map.matcher)
    found = named(first.map, first.name)
    for part in others:
        found = _joined(found, part, thinning=False)
    found = _noted(found, found, f"split off {', '.join(part.name for part in found.parts)}")
    return calibrate(found, place_map.matcher)


def named(place_map: PlaceMap, name: str) -> PlaceMap:
    """A map of one drive that is called so once others come to it."""
    return dataclasses.replace(place_map, parts=(Part(name, place_map, np.arange(len(place_map.items))),))


def parts_of(place_map: PlaceMap) -> tuple[Part, ...]:
    """The drives of a map; of a map of one drive, that one."""
    if place_map.parts:
        return place_map.parts
    return (Part(name_of(place_map, "first"), place_map, np.arange(len(place_map.items))),)


def versions_of(place_map: PlaceMap) -> list[dict[str, Any]]:
    """What a map was, from its first drive on: version, time, change, drives, items and references."""
    kept = place_map.info.get("versions")
    return list(kept) if isinstance(kept, list) else [_version(place_map, 1, None, "trained")]


def _noted(before: PlaceMap, after: PlaceMap, change: str) -> PlaceMap:
    """The map after a change, with one more version."""
    versions = versions_of(before)
    now = datetime.now(UTC).isoformat(timespec="seconds")
    versions.append(_version(after, len(versions) + 1, now, change))
    return dataclasses.replace(after, info=after.info | {"versions": versions})


def _version(place_map: PlaceMap, number: int, at: str | None, change: str) -> dict[str, Any]:
    parts = parts_of(place_map)
    return {
        "version": number,
        "at": at,
        "change": change,
        "drives": [part.name for part in parts],
        "items": len(place_map.items),
        "references": sum(len(part.item) for part in parts),
    }


def name_of(place_map: PlaceMap, otherwise: str) -> str:
    """How the drive of a map of one is called: as the folder or file that it is from."""
    source = Path(str(place_map.info.get("source") or otherwise)).stem
    return safe_name(source) or otherwise


def names_of(sources: Sequence[Path]) -> list[str]:
    """What drives are called that come from these files and folders: as them, or with the folder around."""
    names = [safe_name(source.stem) for source in sources]
    if len(set(names)) < len(names):
        names = [safe_name(f"{source.absolute().parent.name}-{source.stem}") for source in sources]
    return [name or "drive" for name in names]


def safe_name(text: str) -> str:
    """A text as the name of a drive: small letters, digits, - and _; empty where nothing is left."""
    return re.sub(r"[^a-z0-9_-]+", "-", text.lower()).strip("-")[:60]


def _joined(place_map: PlaceMap, part: Part, thinning: bool = True) -> PlaceMap:
    """The map with one more part, whose items are found here; it is not measured.

    `thinning` says that references which add nothing are left out.
    """
    parts, more = parts_of(place_map), part.map
    _check_new(parts, part)
    item, fresh = places_in(place_map.items, more.items)
    new = thin(parts, part._replace(item=item)) if thinning else part._replace(item=item)
    places = _all_places(place_map.places, more.places)
    return dataclasses.replace(
        place_map,
        places=places,
        items=_all_items(place_map.items, more.items, fresh, places),
        drive=np.concatenate([place_map.drive, more.drive]),
        content={},
        info={},
        learned=None,
        parts=(*parts, new),
        sums=None,
    )


def _all_items(known: Items, new: Items, fresh: NDArray[np.int64], places: Places) -> Items:
    """Those of a map, and those of one more drive that are new."""
    position = np.concatenate([known.position, new.position[fresh]])
    heading = np.concatenate([known.heading_deg, new.heading_deg[fresh]])
    assert known.t_us is not None  # a map that can grow has times
    assert new.t_us is not None
    t_us = np.concatenate([known.t_us, new.t_us[fresh]])
    place = known.place if not len(fresh) else places.label(places.where(position))
    return Items(place, position, heading, t_us=t_us)


def _all_places(known: Places, new: Places) -> Places:
    """Those of a map, with the cells that one more drive came to."""
    if not (isinstance(known, PlaceGrid) and isinstance(new, PlaceGrid)):
        return known
    here = set(map(tuple, known.cells.tolist()))
    more = [cell for cell in new.cells.tolist() if tuple(cell) not in here]
    cells = np.concatenate([known.cells, np.array(more, np.int64).reshape(-1, 2)])
    return dataclasses.replace(known, cells=cells)


def _places_of(reference: Traverse, place_map: PlaceMap) -> Places:
    """The places of one more drive, as those of the map are."""
    places = place_map.places
    if isinstance(places, PlaceGrid):
        if reference.track is None:
            raise TraverseError(
                "the drive has no positions, the map's have: give its `track`, so that it is known where its "
                "images belong"
            )
        return PlaceGrid.from_track(reference.track, places.cell_m, places.origin)
    if isinstance(places, PlaceRuns) and len(reference) != places.n_images:
        raise TraverseError(
            f"the map has no positions, so a drive must be in step with it, image by image: the map's has "
            f"{places.n_images} images, this one {len(reference)}; train both with a `track`"
        )
    return places


def _in_its_zone(reference: Traverse, place_map: PlaceMap) -> Traverse:
    """The drive with its positions in the map's metres; TrackError where they cannot be that."""
    track, zone = reference.track, place_map.zone
    if track is None or zone is None or (track.zone, track.northern) == zone:
        return reference
    return dataclasses.replace(reference, track=track.in_zone(*zone))


def _zone(zone: tuple[int, bool] | None) -> str:
    if zone is None or not zone[0]:
        return "on a local plane" if zone else "not known"
    return f"in UTM zone {zone[0]} {'north' if zone[1] else 'south'}"


def _check_can_grow(place_map: PlaceMap) -> None:
    """PlaceMapError for a map that no drive can be added to."""
    if place_map.items.are_places:
        raise PlaceMapError(
            f"the items of the map are places ({families.described('scorers', place_map.scorer)}), which are "
            "learned all at once: a map of several drives needs a scorer whose items are images, such as "
            "'fused'"
        )
    if place_map.items.t_us is None:
        raise PlaceMapError(
            "the map was trained by an earlier version, which kept no times of its references: train it again"
        )


def _check_made_alike(place_map: PlaceMap, reference: Traverse) -> None:
    """TraverseError where a drive's images were not made as the map's."""
    way_out = "make its images anew as the map's (evplace map add does, on its recording), or train two maps"
    if place_map.recipe is not None and reference.recipe is not None:
        place_map.recipe.require_same(reference.recipe, "the map", "the drive", way_out)
    shape = reference.images.shape[1:]
    if shape != place_map.image_shape:
        raise TraverseError(
            f"the map was made from images of shape {place_map.image_shape}, the drive's are {shape}: "
            f"{way_out}"
        )


def _check_alike(one: PlaceMap, other: PlaceMap) -> None:
    """PlaceMapError where two maps cannot be one."""
    _check_can_grow(other)
    if one.recipe is not None and other.recipe is not None:
        one.recipe.require_same(other.recipe, "the first map", "the other", "train both alike")
    here, there = _kinds(one), _kinds(other)
    for what, value in here.items():
        if there[what] != value:
            raise PlaceMapError(
                f"maps of one scorer, zone and size of places can be merged: {what} is {value} in the first, "
                f"{there[what]} in the other; train one of them again as the other"
            )


def _kinds(place_map: PlaceMap) -> dict[str, Any]:
    """What must be the same in maps that are merged."""
    places = place_map.places.to_dict()
    left_out = ("cells", "zone", "northern")
    return {
        "the scorer": place_map.scorer,
        "the shape of images": place_map.image_shape,
        "the zone": _zone(place_map.zone),
        "the kind of places": {key: value for key, value in places.items() if key not in left_out},
    }


def _check_new(parts: Sequence[Part], part: Part) -> None:
    """PlaceMapError where a map holds a drive already: its images, taken at the same times."""
    for known in parts:
        _, ours, theirs = np.intersect1d(_times(known), _times(part), return_indices=True)
        least = max(1, round(SAME_DRIVE * min(len(known.item), len(part.map.items))))
        here, there = known.map.images_of(ours), part.map.images_of(theirs)
        if len(ours) < least or here is None or there is None:
            continue
        same = int((here == there).reshape(len(ours), -1).all(axis=1).sum())
        if same >= least:
            raise PlaceMapError(
                f"the map holds the drive '{part.name}' already, as '{known.name}': {same} of "
                f"{len(part.map.items)} references are the same; leave it out"
            )


def _times(part: Part) -> NDArray[np.int64]:
    """(references,) when they were taken, in microseconds."""
    t_us = part.map.items.t_us
    assert t_us is not None  # a map that can grow has times
    return t_us


def _free_name(name: str, place_map: PlaceMap) -> str:
    """The name, or where a drive is called so, with the first free number behind it."""
    taken = {part.name for part in parts_of(place_map)}
    numbers = (f"{name}-{number}" for number in range(2, len(taken) + 3))
    return name if name not in taken else next(one for one in numbers if one not in taken)
