"""What there is to choose from: recording formats, track formats, data sets, scorers, matchers.

Examples:
  evplace list
  evplace list datasets                 the public data sets, and what must lie in a folder of each
  evplace list --json
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Literal, get_args

import tyro

from evplace.cli._output import print_facts, print_json
from evplace.core import families as plugs

Family = Literal["readers", "writers", "tracks", "datasets", "scorers", "matchers"]


@dataclass(frozen=True)
class Args:
    """Flags of `evplace list`."""

    family: tyro.conf.Positional[Family | None] = None
    """Only these."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Print the families and their parts, with the first lines of each part's description."""
    families = get_args(Family) if args.family is None else (args.family,)
    parts = {family: {name: _about(family, name) for name in plugs.names(family)} for family in families}
    if args.json:
        print_json(parts)
        return 0
    for family, described in parts.items():
        print_facts(family, described)
    return 0


def _about(family: str, name: str) -> str:
    part = plugs.load(family, name)
    about = (inspect.getdoc(part) or "").split("\n\n")[0].replace("\n", " ")
    return f"{about} Needs {part.NEEDS}." if family == "datasets" else about
