"""The folders that evplace writes: how each kind is known, and what to say where another is given."""

from __future__ import annotations

from pathlib import Path

TRAVERSE, MAP, RESULT = "traverse.json", "map.json", "pr_curve.npy"
CITY, DRIVE, DOCTOR = "city.json", "poses.npy", "findings.json"
KINDS = {
    TRAVERSE: "a traverse", MAP: "a map", RESULT: "a result", CITY: "a city", DRIVE: "a drive of a city",
    DOCTOR: "a report of the doctor",
}  # fmt: skip
"""A file that stands in each such folder, and what the folder is."""


def mark_of(path: str | Path) -> str | None:
    """The file that tells what kind of folder of ours `path` is; None where it is none."""
    folder = Path(path)
    return next((mark for mark in KINDS if (folder / mark).is_file()), None)


def instead(path: str | Path, wanted: str | None = None) -> str | None:
    """What to say of a folder that is not of the kind of the mark `wanted`: what it is, and what to give.

    Without `wanted`, a recording was. None where nothing is known of the folder.
    """
    folder, mark = Path(path), mark_of(path)
    near = _near(folder, wanted) if wanted is not None else None
    if mark is None and near is None:
        return None
    what = "holds other folders" if mark is None else f"is {KINDS[mark]}"
    asked = "a recording" if wanted is None else KINDS[wanted]
    return f"{folder} {what}, not {asked}" + (f": give {near}" if near is not None else "")


def marked(folder: Path, mark: str) -> list[Path]:
    """The marks of folders in a folder, else in those in it, in order; event images before colour ones."""
    found = list(folder.glob(f"*/{mark}")) or list(folder.glob(f"*/*/{mark}"))
    return sorted(found, key=lambda one: (one.parent.name == "colour", one))


def _near(folder: Path, mark: str) -> Path | None:
    """The first folder with this mark in a folder, in those in it, or around it."""
    if not folder.is_dir():
        return None
    found = marked(folder, mark)
    around = folder.parent / mark
    return found[0].parent if found else around.parent if around.is_file() else None
