"""Compare results side by side, and say in which settings they differ; nothing is run again.

Examples:
  evplace compare night.result rain.result
  evplace compare results/* --figures accuracy average_precision
  evplace compare results/* --json
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from evplace.cli._output import print_json, print_table
from evplace.core.errors import SettingsError
from evplace.evaluation import compare


@dataclass(frozen=True)
class Args:
    """Flags of `evplace compare`."""

    results: tyro.conf.Positional[tuple[Path, ...]]
    """Result folders that `evplace evaluate` wrote."""
    figures: tuple[str, ...] = (
        "accuracy",
        "accuracy_seen",
        "precision",
        "recall",
        "average_precision",
        "recall@1",
    )
    """Which figures to show."""
    json: bool = False
    """Print one JSON object with all figures, and the settings in which the results differ."""


def run(args: Args) -> int:
    """Print one row a result."""
    if not args.results:
        raise SettingsError(
            "nothing to compare: give result folders, and give them first: --figures takes all words after it"
        )
    rows = compare(args.results)
    if args.json:
        print_json({"results": rows})
        return 0
    unknown = [name for name in args.figures if all(name not in row for row in rows)]
    if unknown:
        raise SettingsError(f"no result has the figure '{unknown[0]}': known are {', '.join(rows[0])}")
    names = [str(row["result"]) for row in rows]
    print_table("", ("result", *args.figures), [[row["result"], *map(row.get, args.figures)] for row in rows])
    differing = _differing(rows)
    if differing:
        lines = [[name, *(_text(row.get(name)) for row in rows)] for name in differing]
        print_table("What differs", ("setting", *names), lines)
    return 0


def _differing(rows: list[dict[str, Any]]) -> list[str]:
    """The settings in which the results differ: which parts were used, and settings that they have in common.

    What only one part has needs no line beside another part's name; nor has what a map remembers to be
    matched with, where it was matched otherwise.
    """
    figures = {name for row in rows for name in row if not _is_setting(name)}
    named = dict.fromkeys(name for row in rows for name in row if name not in figures)
    found = []
    for name in named:
        values = {_text(row.get(name)) for row in rows}
        shared = name.endswith(".name") or sum(row.get(name) is not None for row in rows) > 1
        if len(values) > 1 and shared and not name.startswith("map.matcher."):
            found.append(name)
    return found


def _is_setting(name: str) -> bool:
    return "." in name or name in ("answers", "query")


def _text(value: object) -> str:
    return "-" if value is None else str(value)
