"""Show results: one HTML page that opens without a network, and PNG plots beside it.

Examples:
  evplace report night.result                    one result
  evplace report results                         a folder of results, side by side
  evplace report results -o night.html --overwrite

The page is report.html in the folder unless named. It holds tables, precision-recall curves, the drive
against the map, the route coloured by error, and sample matches.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from evplace.cli._output import note, print_json, say
from evplace_lab.report import report


@dataclass(frozen=True)
class Args:
    """Flags of `evplace report`."""

    folder: tyro.conf.Positional[Path]
    """A result that `evplace evaluate` wrote, or a folder of results, tables and curves."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """The page to write; report.html in the folder unless given."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """Print one JSON object: the names of the files."""


def run(args: Args) -> int:
    """Write the page and say where it is."""
    written = report(args.folder, args.out, args.overwrite)
    if args.json:
        print_json({"page": str(written.page), "plots": [str(plot) for plot in written.plots]})
    else:
        say(f"{written.page}: open it in any browser", *(f"  {plot}" for plot in written.plots))
    if written.remark:
        note(written.remark)
    return 0
