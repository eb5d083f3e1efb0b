"""TUM poses, `timestamp tx ty tz qx qy qz qw`, as evo and others read them: sure positions, in metres.

x is east, y is north, z is 0; the quaternion turns x ahead, and is that of no turn where the heading is
unknown. Layout: the TUM RGB-D benchmark's "File Formats".
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from evplace.exports import Located

ABOUT = "TUM poses in the map's metres, of the sure positions"
SUFFIX = ".tum"
NEEDS = "metres"


def lines(found: Iterable[Located]) -> Iterator[str]:
    """A remark that names the columns, then a line a position."""
    yield "# timestamp tx ty tz qx qy qz qw"
    for one in found:
        if one.is_sure and one.match.position is not None:
            easting, northing = one.match.position
            heading = 90.0 if one.match.heading_deg is None else one.match.heading_deg
            half = math.radians(90.0 - heading) / 2
            time = f"{one.match.t_us // 1_000_000}.{one.match.t_us % 1_000_000:06d}"
            turned = f"0 0 {math.sin(half):.6f} {math.cos(half):.6f}"
            yield f"{time} {easting:.3f} {northing:.3f} 0 {turned}"
