"""What lies in an HDF5 file itself: nothing else on the machine is opened for it."""

from __future__ import annotations

from typing import Any

import h5py

from evplace.sources.readers._source import printable


def outside(file: h5py.File) -> list[str]:
    """What the file only points to."""
    found: list[str] = []

    def look(name: str, link: Any) -> None:
        if isinstance(link, h5py.ExternalLink) or (
            isinstance(link, h5py.HardLink)
            and file.get(name, getclass=True) is h5py.Dataset
            and not _inside(file[name])
        ):
            found.append(printable(name))

    file.visititems_links(look)
    return found


def _inside(rows: h5py.Dataset) -> bool:
    """Whether a data set lies in the file itself."""
    return not rows.is_virtual and not rows.external


def arrays_in(group: h5py.Group) -> dict[str, h5py.Dataset]:
    """The data sets of a group by their names, those of other files left out."""
    names = [
        name
        for name in group
        if isinstance(group.get(name, getlink=True), h5py.HardLink)
        and group.get(name, getclass=True) is h5py.Dataset
    ]
    return {name: group[name] for name in names if _inside(group[name])}
