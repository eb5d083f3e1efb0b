"""Poses on a plane of their own: TUM (`timestamp tx ty tz qx qy qz qw`) and EuRoC (the same as csv, in ns).

Layouts: the TUM RGB-D benchmark's "File Formats"; the EuRoC MAV data set's ground truth. Headings are taken
from the movement, as the quaternions' axes differ from one program to the next.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Literal

import numpy as np

from evplace.core.errors import TrackError
from evplace.sources._times import Unit, dated_unit, number, number_us
from evplace.sources.tracks._fixes import Fix, Fixes, Losses, line_of

_CELL = re.compile(r"[,;\s]+")
_FEWEST = 8
"""Time, position and quaternion; EuRoC's ground truth has more behind them."""
_KITTI = 12
_HEADER = re.compile(rb"^\s*#?.*(p_RS_R_x|\btx[ ,;\t]+ty\b)", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Settings:
    """How poses are read."""

    time_unit: Literal["auto", "s", "ms", "us", "ns"] = "auto"
    """Unit of the times. auto: the one in which they are dates, else ns with commas, s without."""
    plane: Literal["auto", "xy", "xz"] = "auto"
    """The axes of the ground. xy: z is up; xz: z is ahead, as a camera's. auto: xy, unless z spans most."""


PRESETS: dict[str, Settings] = {}


def recognises(head: bytes) -> bool:
    """Whether the header names such columns, or the first row is that many numbers and nothing else."""
    if b"\x00" in head:
        return False
    text = head.decode("utf-8-sig", "replace")
    rows = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if _HEADER.search(head[:1000]):
        return True
    return bool(rows) and len(_numbers(rows[0])) >= _FEWEST


def read(path: Path, settings: Settings) -> Fixes:
    """All rows with a time and a position; broken rows are counted."""
    lines = path.read_bytes().decode("utf-8-sig", "replace").splitlines()
    losses, show = Losses(), line_of(lines)
    rows: list[tuple[int, list[Decimal]]] = []
    for line, text in enumerate(lines, 1):
        cells = _numbers(text)
        if len(cells) >= 4:
            rows.append((line, cells))
        elif text.strip() and not text.lstrip().startswith("#") and (rows or line > 1):
            losses.add("broken row", show(line))
    if rows and len(rows[0][1]) == _KITTI:
        raise TrackError("poses of 12 numbers (KITTI) have no times: write them as TUM does, time first")
    unit = _unit(rows, settings, "," in (lines[rows[0][0] - 1] if rows else ""))
    return _placed(rows, unit, settings, losses, show)


def _numbers(text: str) -> list[Decimal]:
    """The numbers of a row; none where anything else stands in it."""
    try:
        return [number(cell) for cell in _CELL.split(text.strip()) if cell]
    except ValueError:
        return []


def _unit(rows: list[tuple[int, list[Decimal]]], settings: Settings, commas: bool) -> Unit:
    if settings.time_unit != "auto":
        return settings.time_unit
    return dated_unit(cells[0] for _, cells in rows) or ("ns" if commas else "s")


def _placed(
    rows: list[tuple[int, list[Decimal]]],
    unit: Unit,
    settings: Settings,
    losses: Losses,
    show: Callable[[int], str],
) -> Fixes:
    fixes, places = [], []
    for line, cells in rows:
        try:
            fixes.append(Fix(number_us(str(cells[0]), unit), np.nan, np.nan, line=line))
            places.append([float(cell) for cell in cells[1:4]])
        except ValueError:
            losses.add("broken row", show(line))
    metres = np.array(places, np.float64).reshape(-1, 3)
    xy, note = on_ground(metres, settings.plane)
    notes = [f"the times of the poses are taken in {unit}", note]
    return Fixes.of(fixes, xy=xy, show=show, losses=losses, notes=notes, unit=unit)


def on_ground(metres: np.ndarray, plane: str = "auto") -> tuple[np.ndarray, str]:
    """(N, 2) of positions (N, 3) in the plane of the ground, and a sentence that says which it is."""
    spans = np.nan_to_num(np.ptp(metres, axis=0)) if len(metres) else np.zeros(3)
    if plane == "auto":
        plane = "xz" if spans[2] > spans[:2].max() else "xy"
    up = "z up" if plane == "xy" else "z ahead"
    told = ", ".join(f"{axis} {span:.0f} m" for axis, span in zip("xyz", spans, strict=True))
    sentence = f"the positions are a local track in the plane {plane} ({up}); they span {told}"
    return metres[:, [0, 1 if plane == "xy" else 2]], sentence
