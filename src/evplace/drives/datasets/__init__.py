"""Folders of public data sets -> drives: what was recorded, where, and how it is cut by default.

One file a data set, recognised by its layout. To add one, add its file and its test. The file's docstring
opens with what the set is and gives citation, licence, layout and address; it says what of the layout was
checked, and against what. The file holds:

- `NEEDS`, one line of text that says what must lie in the folder;
- `recognises(folder) -> bool`: whether the layout is there, told from names alone;
- `drives(folder) -> list[str]`: the names of the drives that are there;
- `open_drive(folder, name) -> Drive`: the parts of one of them; DatasetError, TraverseError or TrackError
  where one is missing or does not fit.

Nothing is downloaded.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evplace.core import families
from evplace.core.errors import DatasetError, EvplaceError, PartError
from evplace.imaging.recipe import Recipe
from evplace.sources.film import Film
from evplace.sources.readers import Recording
from evplace.sources.tracks import Track

__all__ = ["Drive", "drives", "matching", "open_drive"]


@dataclass(frozen=True)
class Drive:
    """The parts of one drive."""

    source: Recording | Film
    """An event recording, or camera images."""
    track: Track | None = None
    """Where the camera was, on the clock of `source`."""
    mask: Path | None = None
    """A list of the sensor's hot pixels: a text file of `x,y` lines."""
    simulate: bool | None = False
    """Whether camera images become simulated events unless they are asked for themselves; None: never,
    because they are no film (event images, or photos in no order of time)."""
    recipe: Recipe = field(default_factory=Recipe)
    """How its images are made, unless the user says otherwise."""


def open_drive(folder: str | Path, drive: str | None = None, dataset: str | None = None) -> Drive:
    """The drive of that name in a data set's folder; the only one there is where `drive` is None.

    The set is recognised by its layout, or named by `dataset`. Raises DatasetError for a folder of no known
    layout or of several, and for a drive that is not there; SettingsError for an unknown data set.
    """
    place = Path(folder)
    name = _name_of(place, dataset)
    part = families.load("datasets", name)
    known = _drives(part, place)
    if not known:
        raise DatasetError(f"{place} holds no drive of {name}, which needs: {part.NEEDS}")
    if drive is None and len(known) > 1:
        raise DatasetError(f"{place} holds {len(known)} drives: say which with `drive`: {', '.join(known)}")
    if drive is not None and drive not in known:
        raise DatasetError(f"{place} holds no drive '{drive}': it holds {', '.join(known)}")
    with families.blaming("datasets", part):
        opened = part.open_drive(place, drive or known[0])
    if not isinstance(opened, Drive):
        raise PartError(
            f"{families.described('datasets', part)} must open a Drive, it gave {type(opened).__name__}"
        )
    if isinstance(opened.source, Recording):
        opened.source.hold("datasets", part)
    return opened


def drives(folder: str | Path, dataset: str | None = None) -> list[str]:
    """The names of the drives in a data set's folder; errors as `open_drive`."""
    place = Path(folder)
    return _drives(families.load("datasets", _name_of(place, dataset)), place)


def matching(folder: Path) -> list[str]:
    """The data sets whose layout the folder has."""
    return _matching(folder, [])


def _matching(folder: Path, faults: list[EvplaceError]) -> list[str]:
    return sorted(families.recognising("datasets", lambda part: bool(part.recognises(folder)), faults))


def _drives(part: Any, folder: Path) -> list[str]:
    with families.blaming("datasets", part):
        found: list[str] = part.drives(folder)
    if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
        raise PartError(
            f"{families.described('datasets', part)} must list its drives' names, it gave {found!r}"
        )
    return found


def _name_of(folder: Path, dataset: str | None) -> str:
    if not folder.is_dir():
        raise DatasetError(f"there is no folder {folder}: give the folder of a data set")
    if dataset is not None:
        return dataset
    faults: list[EvplaceError] = []
    found = _matching(folder, faults)
    if not found:
        known = ", ".join(families.names("datasets"))
        raise DatasetError(
            f"{folder} has the layout of no known data set: known are {known}; "
            f"`evplace list datasets` says what each needs{families.besides(faults)}"
        )
    if len(found) > 1:
        raise DatasetError(f"{folder} may be {' or '.join(found)}: say which with `dataset`")
    return found[0]
