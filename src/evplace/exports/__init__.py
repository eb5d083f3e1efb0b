"""Matches -> files for other programs: one file a format; its name is the format's name.

Each file holds `ABOUT`, one line of text; `SUFFIX`, by which the format is chosen from a file's name;
`NEEDS`, what a map must know of its positions ("degrees", "metres" or ""); and `lines(found)`, which turns
`Located` matches into lines of text, one by one as they come. Where a format has no room for a match that the
method does not stand by, it is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from evplace.core import families
from evplace.core.errors import OutputError
from evplace.localizer import SURE, Match
from evplace.placemap import PlaceMap
from evplace.sources.tracks import Track


class Located(NamedTuple):
    """A match, and where on Earth its item lies."""

    match: Match
    latitude: float
    """Degrees (WGS 84); NaN where unknown."""
    longitude: float

    @property
    def is_sure(self) -> bool:
        """Whether the method stands by the match, and knows where it lies."""
        return self.match.state in SURE and self.match.position is not None


def located(matches: Iterable[Match], place_map: PlaceMap) -> Iterator[Located]:
    """Each match with its latitude and longitude."""
    for match in matches:
        found = None if match.position is None else place_map.geodetic(match.position)
        yield Located(match, *(found or (math.nan, math.nan)))


def of_track(track: Track) -> Iterator[Located]:
    """A track's own positions in the form of matches: for writing a log of it."""
    columns = (track.t_us, track.easting, track.northing, track.heading_deg, track.latitude, track.longitude)
    for at, (t_us, east, north, heading, latitude, longitude) in enumerate(zip(*columns, strict=True)):
        facing = None if math.isnan(heading) else float(heading)
        match = Match(
            int(t_us), at, -1, (float(east), float(north)), math.nan, "localised", heading_deg=facing
        )
        yield Located(match, float(latitude), float(longitude))


def format_of(path: Path | None, name: str | None, place_map: PlaceMap) -> ModuleType:
    """The format that is named, else that of a file's suffix, else csv.

    OutputError for an unknown suffix, and where the map does not know what the format needs.
    """
    chosen = name or ("csv" if path is None else _by_suffix(path))
    module: ModuleType = families.load("exports", chosen)
    geodetic = place_map.zone is not None and place_map.zone[0] != 0
    if module.NEEDS == "degrees" and not geodetic:
        raise OutputError(
            f"{chosen} holds latitudes and longitudes, which this map does not know: choose csv, json or tum"
        )
    if module.NEEDS == "metres" and place_map.zone is None:
        raise OutputError(f"{chosen} holds positions, which this map does not know: choose csv or json")
    return module


def _by_suffix(path: Path) -> str:
    suffixes = {part.SUFFIX: name for name, part in families.loadable("exports")}
    if path.suffix.lower() not in suffixes:
        known = ", ".join(f"{suffix} ({name})" for suffix, name in sorted(suffixes.items()))
        raise OutputError(
            f"cannot tell the format of {path} from its suffix: known are {known}; or name one by `format`"
        )
    return suffixes[path.suffix.lower()]
