"""Measure a map anew: what places that it has never seen score on it.

Examples:
  evplace calibrate campus.evp                       with the matcher that the map remembers
  evplace calibrate old.evp --matcher bayes          a map that remembers none yet

`evplace train` does it by itself. The map's own images are localised while stretches of the map are cut out.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from evplace.cli._matcher import NOT_MEASURED, is_measured
from evplace.cli._output import note, print_facts, print_json
from evplace.cli._settings import a_part_of
from evplace.core import families
from evplace.matchers.bayes import UNKNOWN, Bayes
from evplace.placemap import PlaceMap, calibrate


@dataclass(frozen=True)
class Args:
    """Flags of `evplace calibrate`."""

    map: tyro.conf.Positional[Path]
    """A map that `evplace train` wrote; what was measured is written into it."""
    matcher: Annotated[str | None, a_part_of("matchers")] = None
    """What the map is to be matched with from now on. Default: as it remembers."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Measure, save and say."""
    place_map = PlaceMap.load(args.map)
    chosen = None if args.matcher is None else families.make("matchers", args.matcher, None, {})
    measured = calibrate(place_map, chosen)
    measured.save(args.map, overwrite=True)
    facts: dict[str, object] = {"matcher": families.name_of("matchers", measured.matcher)}
    if measured.learned and isinstance(measured.matcher, Bayes):
        limits = measured.matcher.limits(measured.learned)
        facts["unknown_images"] = len(measured.learned[UNKNOWN])
        facts |= {f"threshold_{name}": round(limit, 3) for name, limit in limits.items()}
    print_json(facts) if args.json else print_facts(str(args.map), facts)
    if not is_measured(measured):
        note(NOT_MEASURED)
    return 0
