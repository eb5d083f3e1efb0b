"""Pictures of an examination."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from evplace.core import drawing
from evplace.core.storage import check_new_folder, new_folder, write_json
from evplace.doctor._outcome import Curve, Examination, Map

FINDINGS = "findings.json"
"""What marks a folder that was written here: only such a one is replaced."""
INK, SHADE, MARK = "#1b6ca8", "#efb998", "#c4622d"


def check_drawing(folder: str | Path, overwrite: bool = False) -> None:
    """Raises what `draw` would raise: for saying so before an examination, which may take minutes."""
    drawing.check_drawing()
    check_new_folder(folder, overwrite, FINDINGS)


def draw(examination: Examination, folder: str | Path, overwrite: bool = False) -> None:
    """Write a folder: findings.json, and a .png for each curve and map.

    MissingExtraError without matplotlib; OutputError where the folder exists and is not to be replaced.
    """
    check_drawing(folder, overwrite)
    with new_folder(folder, overwrite, FINDINGS) as partial:
        write_json(partial / FINDINGS, as_json(examination))
        for drawn in examination.drawings:
            figure = drawing.new_figure(9, 4.5)
            axes = figure.add_subplot(title=drawn.title)
            if isinstance(drawn, Curve):
                _curve(axes, drawn)
            else:
                _map(figure, axes, drawn)
            drawing.save(figure, partial / f"{drawn.name}.png")


def as_json(examination: Examination) -> dict[str, Any]:
    """The examination without its drawings, as JSON holds it: finite numbers or None."""
    findings = [asdict(finding) for finding in examination.findings]
    for finding in findings:
        value = finding["value"]
        finding["value"] = float(value) if value is not None and np.isfinite(value) else None
    return {
        "recording": examination.path,
        "facts": examination.facts,
        "findings": findings,
        "fault": examination.fault,
    }


def _curve(axes: Any, curve: Curve) -> None:
    axes.plot(curve.x, curve.y, color=INK, linewidth=1)
    for start, stop, what in curve.spans:
        axes.axvspan(start, stop, color=SHADE, alpha=0.5, label=what)
    if curve.spans:
        handles, labels = axes.get_legend_handles_labels()
        axes.legend(handles[:1], labels[:1], frameon=False)
    axes.set(xlabel=curve.across, ylabel=curve.up)


def _map(figure: Any, axes: Any, shown: Map) -> None:
    rows, columns = shown.values.shape
    side = shown.pixels
    image = axes.imshow(
        shown.values, cmap="viridis", interpolation="nearest", vmin=0, vmax=shown.top,
        extent=(-0.5, columns * side - 0.5, rows * side - 0.5, -0.5),
    )  # fmt: skip
    axes.plot(*shown.marks.T, "o", markerfacecolor="none", markeredgecolor=MARK, markersize=7)
    axes.set(xlabel="column", ylabel="row")
    figure.colorbar(image, label=shown.label)
