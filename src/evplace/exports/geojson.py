"""GeoJSON (RFC 7946): a point for each position that the method stands by, with what is known of it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator

from evplace.exports import Located

ABOUT = "GeoJSON, a point for each sure position"
SUFFIX = ".geojson"
NEEDS = "degrees"


def lines(found: Iterable[Located]) -> Iterator[str]:
    """A collection, a feature a line."""
    yield '{"type": "FeatureCollection", "features": ['
    before = ""
    for one in found:
        if one.is_sure:
            yield before + json.dumps(_feature(one))
            before = ","
    yield "]}"


def _feature(one: Located) -> dict[str, object]:
    match = one.match
    known = {
        "t_us": match.t_us, "state": match.state, "place": match.place, "heading_deg": match.heading_deg,
        "probability": match.probability, "uncertainty_m": match.uncertainty_m,
    }  # fmt: skip
    properties = {
        name: value
        for name, value in known.items()
        if value is not None and not (isinstance(value, float) and math.isnan(value))
    }
    point = {"type": "Point", "coordinates": [round(one.longitude, 7), round(one.latitude, 7)]}
    return {"type": "Feature", "geometry": point, "properties": properties}
