"""JSON lines: one object a match, null for what is unknown."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Iterator

from evplace.exports import Located

ABOUT = "a JSON object a line for each match"
SUFFIX = ".jsonl"
NEEDS = ""


def lines(found: Iterable[Located]) -> Iterator[str]:
    """An object a match."""
    for one in found:
        values = dataclasses.asdict(one.match) | {"latitude": one.latitude, "longitude": one.longitude}
        yield json.dumps({name: None if _is_nan(value) else value for name, value in values.items()})


def _is_nan(value: object) -> bool:
    return isinstance(value, float) and math.isnan(value)
