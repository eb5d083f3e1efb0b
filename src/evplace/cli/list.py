"""What there is to choose from: recording formats, track formats, data sets, scorers, matchers and so on.

Examples:
  evplace list
  evplace list datasets                 the public data sets, and what must lie in a folder of each
  evplace list --json
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import tyro

from evplace.cli._output import print_facts, print_json
from evplace.core import families

Family = Literal[
    "readers", "live", "writers", "tracks", "datasets", "representations", "searchers", "scorers", "matchers",
    "exports", "doctor",
]  # fmt: skip


@dataclass(frozen=True)
class Args:
    """Flags of `evplace list`."""

    family: tyro.conf.Positional[Family | None] = None
    """Only these."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Print the families and their parts, with the first lines of each part's description."""
    wanted = get_args(Family) if args.family is None else (args.family,)
    parts = {family: {one.name: one for one in families.entries(family)} for family in wanted}
    if args.json:
        print_json(
            {family: {name: one._asdict() for name, one in found.items()} for family, found in parts.items()}
        )
        return 0
    for family, found in parts.items():
        print_facts(family, {name: _about(one) for name, one in found.items()})
    return 0


def _about(one: families.Entry) -> str:
    if one.fault is not None:
        return one.fault
    return one.about if one.package == families.OURS else f"{one.about} (from {one.package})"
