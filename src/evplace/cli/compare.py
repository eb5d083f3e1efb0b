"""Compare results side by side; reads what was saved and never runs anything again.

Examples:
  evplace compare night.result rain.result
  evplace compare results/* --figures accuracy average_precision
  evplace compare results/* --json
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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
    print_table(
        "", ("result", *args.figures), [[row["result"], *[row.get(n) for n in args.figures]] for row in rows]
    )
    return 0
