"""Pictures of an examination."""

from __future__ import annotations

import importlib.util
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from evplace.core.errors import MissingExtraError
from evplace.core.storage import check_new_folder, new_folder, write_json
from evplace.doctor._outcome import Curve, Examination, Map

FINDINGS = "findings.json"
"""What tells a folder that was written here from any other: only such a one is replaced."""
INK, SHADE, MARK = "#1b6ca8", "#efb998", "#c4622d"


def check_drawing(folder: str | Path, overwrite: bool = False) -> None:
    """Raises what `draw` would raise: for saying so before an examination, which may take minutes."""
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError("matplotlib", "report", "drawing an examination")
    check_new_folder(folder, overwrite, FINDINGS)


def draw(examination: Examination, folder: str | Path, overwrite: bool = False) -> None:
    """Write a folder: findings.json, and a .png for each curve and map.

    MissingExtraError without matplotlib; OutputError where the folder exists and is not to be replaced.
    """
    check_drawing(folder, overwrite)
    from matplotlib.figure import Figure

    with new_folder(folder, overwrite, FINDINGS) as partial:
        write_json(partial / FINDINGS, as_json(examination))
        for drawing in examination.drawings:
            figure = Figure(figsize=(9, 4.5), layout="constrained")
            axes = figure.add_subplot(title=drawing.title)
            if isinstance(drawing, Curve):
                _curve(axes, drawing)
            else:
                _map(figure, axes, drawing)
            figure.savefig(partial / f"{drawing.name}.png", dpi=120)


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
    axes.spines[["top", "right"]].set_visible(False)


def _map(figure: Any, axes: Any, drawing: Map) -> None:
    rows, columns = drawing.values.shape
    side = drawing.pixels
    shown = axes.imshow(
        drawing.values, cmap="viridis", interpolation="nearest", vmin=0, vmax=drawing.top,
        extent=(-0.5, columns * side - 0.5, rows * side - 0.5, -0.5),
    )  # fmt: skip
    axes.plot(*drawing.marks.T, "o", markerfacecolor="none", markeredgecolor=MARK, markersize=7)
    axes.set(xlabel="column", ylabel="row")
    figure.colorbar(shown, label=drawing.label)
