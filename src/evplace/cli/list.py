"""What there is to choose from: recording formats, track formats, scorers, matchers.

Examples:
  evplace list
  evplace list --json
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass

from evplace import plugs
from evplace.cli._output import print_facts, print_json

FAMILIES = ("readers", "writers", "tracks", "scorers", "matchers")


@dataclass(frozen=True)
class Args:
    """Flags of `evplace list`."""

    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Print every family and its parts, with the first line of each part's description."""
    parts = {family: {name: _about(family, name) for name in plugs.names(family)} for family in FAMILIES}
    if args.json:
        print_json(parts)
        return 0
    for family, described in parts.items():
        print_facts(family, described)
    return 0


def _about(family: str, name: str) -> str:
    return (inspect.getdoc(plugs.load(family, name)) or "").split("\n\n")[0].replace("\n", " ")
