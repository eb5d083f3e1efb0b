"""What holds for every data set."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

from evplace.core import families
from evplace.drives.datasets import Drive
from evplace.testing._require import require


def check_dataset(module: ModuleType, make_folder: Callable[[Path], object]) -> None:
    """AssertionError where a data set breaks what `evplace.drives.datasets` promises.

    `make_folder(folder)` fills a folder in the set's layout. The set recognises it, and no other does; it
    recognises neither an empty folder nor one of something else; each drive that it names can be opened.
    """
    who = families.described("datasets", module)
    needs = getattr(module, "NEEDS", "")
    require(
        needs and "\n" not in needs, f"{who} must say in one line of text, 'NEEDS', what a folder must hold"
    )
    with tempfile.TemporaryDirectory(prefix="evplace-") as name:
        folder, other = Path(name) / "set", Path(name) / "other"
        folder.mkdir()
        other.mkdir()
        require(not module.recognises(other), f"{who} takes an empty folder for its own")
        (other / "letter.txt").write_text("Dear reader\n")
        require(not module.recognises(other), f"{who} takes a folder of something else for its own")
        require(not module.drives(other), f"{who} names drives in a folder of something else")
        make_folder(folder)
        require(module.recognises(folder), f"{who} does not recognise its own layout")
        for set_name, part in families.loadable("datasets"):
            if part is not module:
                require(not part.recognises(folder), f"the data set '{set_name}' takes {who} for its own")
        _check_drives(module, folder, who)


def _check_drives(module: ModuleType, folder: Path, who: str) -> None:
    names = module.drives(folder)
    listed = isinstance(names, list) and all(isinstance(name, str) for name in names)
    require(listed and names, f"{who} must list the names of the drives that are there, it gave {names!r}")
    require(len(set(names)) == len(names), f"{who} names a drive twice: {names}")
    for name in names:
        drive = module.open_drive(folder, name)
        require(isinstance(drive, Drive), f"{who} must open a Drive, it gave {type(drive).__name__}")
        width, height = drive.source.size
        require(width > 0 and height > 0, f"{who} opens {name} with a sensor of {width}x{height}")
