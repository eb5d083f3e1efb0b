"""Results -> one HTML page that opens without a network, and PNG plots beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from evplace.core.drawing import is_drawn_here
from evplace.core.errors import MissingExtraError, OutputError
from evplace.core.storage import check_new_file, new_file
from evplace_lab.report._found import look
from evplace_lab.report._page import page
from evplace_lab.report._plots import plots

__all__ = ["Written", "report"]


@dataclass(frozen=True)
class Written:
    """What a report left behind."""

    page: Path
    """The HTML file."""
    plots: list[Path]
    """The .png files beside it."""
    remark: str | None
    """What it went without, and what to do."""


def report(folder: str | Path, out: str | Path | None = None, overwrite: bool = False) -> Written:
    """Write a page of all that `folder` holds, by default as report.html in it.

    `folder` is a result that `evplace evaluate` wrote, a folder of results, or one that also holds
    table2.json, real.json, figure5.json or ablations.json. Without matplotlib there are no plots beside the
    page. Raises InputError where there is nothing to show or something is damaged, OutputError where the page
    or a plot exists (unless `overwrite`) or cannot be written.
    """
    found = look(Path(folder))
    target = Path(folder) / "report.html" if out is None else Path(out)
    remark = None
    try:
        planned = plots(found, target)
    except MissingExtraError as error:
        planned, remark = {}, f"No plots beside this page: {error}"
    check_new_file(target, overwrite)
    # Plots of ours without their page are those of a report that was stopped.
    there = next((plot for plot in planned if plot.exists() and not is_drawn_here(plot)), None)
    if there is not None and not overwrite:
        raise OutputError(f"{there} exists: name another page, remove it, or add `overwrite=True`")
    with new_file(target, overwrite) as partial:
        partial.write_text(page(found, remark), "utf-8")
        for plot, draw in planned.items():
            draw(plot)
    return Written(target, list(planned), remark)
