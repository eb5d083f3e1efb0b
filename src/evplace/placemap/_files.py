"""The files of a map's folder: its description, what its scorer has learned, and the checksums over both."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from evplace.core import folders
from evplace.core.errors import InputError, PlaceMapError
from evplace.core.storage import read_array, read_bytes, read_json, sha256, write_array

FORMAT = "evplace-map-2"
FORMAT_OF_SEVERAL = "evplace-map-3"
"""Of a map of several drives: each is a map of its own in the folder `drives`."""
OLD_FORMAT = "evplace-map-1"
"""Its recipe and scorer lie in pieces in `settings`."""
SUMS = "SHA256SUMS"
MARK = folders.MAP
"""What tells a folder that was written here from any other: only such a one is replaced."""
TIMES = "times.npy"
DRIVES = "drives"
BELONGS = "belongs.npy"
"""The item that each reference belongs to, of all drives one behind the other."""
RESERVED = (MARK, "items.npy", "drive.npy", TIMES, BELONGS)
"""Files that hold no scorer's content."""
_NAME = re.compile(r"[a-z][a-z0-9_-]*(\.[a-z0-9]+)?")
"""What scorers may call their content."""
_DRIVE = re.compile(r"[a-z0-9_][a-z0-9_-]{0,99}")
"""What drives of a map may be called."""
_SHAPE: dict[str, tuple[type, ...]] = {
    "scorer": (dict,), "places": (dict,), "recipe": (dict, type(None)), "image_shape": (list,),
    "zone": (list, type(None)), "info": (dict,), "items": (str,), "content": (list,),
    "matcher": (dict, type(None)), "learned": (list,), "times": (bool,), "drives": (list,),
}  # fmt: skip
"""What map.json holds: a name and the kinds of JSON that it may be."""


def about_of(folder: Path, what: str) -> dict[str, Any]:
    """map.json, each entry of the kind that it must be; of the format before, as of this one."""
    about = read_json(folder / MARK, what)
    if about.get("format") == OLD_FORMAT:
        about = {"format": FORMAT} | _of_old_format(about, (folder / "references.npy").exists(), what)
    about = {
        "matcher": None,
        "learned": [],
        "times": False,
        "drives": [],
    } | about  # maps of before lack these
    if about.get("format") != (FORMAT_OF_SEVERAL if about["drives"] else FORMAT):
        raise PlaceMapError(f"{what} has the format {about.get('format')!r}, this version reads {FORMAT}")
    for name, kinds in _SHAPE.items():
        if name not in about or not isinstance(about[name], kinds):
            raise PlaceMapError(f"{what} is damaged: '{name}' in {MARK} is missing or of a wrong kind")
    shape, zone, scorer = about["image_shape"], about["zone"], about["scorer"]
    if not (len(shape) in (2, 3) and all(type(side) is int and 0 < side < 1 << 16 for side in shape)):
        raise PlaceMapError(f"{what} is damaged: images of shape {shape!r}")
    if zone is not None and not (
        len(zone) == 2 and type(zone[0]) is int and 0 <= zone[0] <= 60 and isinstance(zone[1], bool)
    ):
        raise PlaceMapError(f"{what} is damaged: {zone!r} is no UTM zone")
    if not isinstance(scorer.get("name"), str) or not isinstance(scorer.get("settings"), dict):
        raise PlaceMapError(f"{what} is damaged: its scorer is {scorer!r}")
    _check_matcher(about, what)
    drives = about["drives"]
    if not all(isinstance(name, str) and _DRIVE.fullmatch(name) for name in drives) or len(set(drives)) < len(
        drives
    ):
        raise PlaceMapError(f"{what} is damaged: its drives are {drives!r}")
    names = about["content"]
    if not all(isinstance(name, str) and _may_be_called(name) for name in names) or len(set(names)) < len(
        names
    ):
        raise PlaceMapError(f"{what} is damaged: its content is {about['content']!r}")
    return about


def _of_old_format(about: dict[str, Any], has_references: bool, what: str) -> dict[str, Any]:
    settings = about.get("settings")
    if not isinstance(settings, dict):
        raise PlaceMapError(f"{what} is damaged: 'settings' in {MARK} is missing or of a wrong kind")
    of_scorer = settings.get("scorer") or {}
    if "train" in settings:
        trained = settings["train"]
        of_scorer = trained if about.get("scorer") == "network" else {**of_scorer, "network": trained}
    recipe = {key: settings.get(key) for key in ("windows", "images", "cleaning")}
    recipe |= {"kind": settings.get("input"), "size": settings.get("sensor")}
    return {
        "scorer": {"name": about.get("scorer"), "package": "evplace", "settings": of_scorer},
        "places": about.get("places"),
        "recipe": None if settings.get("images") is None else recipe,
        "image_shape": settings.get("image_shape"),
        "zone": settings.get("zone"),
        "info": {key: settings[key] for key in ("source", "spacing") if settings.get(key) is not None},
        "items": "images" if has_references else "places",
        "content": ["references.npy"] if has_references else ["network.onnx", "weights.safetensors"],
    }


def _check_matcher(about: dict[str, Any], what: str) -> None:
    matcher, learned = about["matcher"], about["learned"]
    if matcher is not None and not (
        isinstance(matcher.get("name"), str) and isinstance(matcher.get("settings"), dict)
    ):
        raise PlaceMapError(f"{what} is damaged: its matcher is {matcher!r}")
    if not all(isinstance(name, str) and re.fullmatch("[a-z_]+", name) for name in learned):
        raise PlaceMapError(f"{what} is damaged: its matcher has learned {learned!r}")


def files_of(about: dict[str, Any]) -> set[str]:
    """All files of a map but its checksums."""
    learned = {of_matcher(name) for name in about["learned"]}
    parts = {f"{DRIVES}/{name}/{SUMS}" for name in about["drives"]}
    more = ({TIMES} if about["times"] else set()) | ({BELONGS, *parts} if parts else set())
    return {MARK, "items.npy", "drive.npy", *about["content"], *learned, *more}


def of_matcher(name: str) -> str:
    """The file of an array that the map's matcher has learned."""
    return f"matcher-{name}.npy"


def file_of(name: str, value: NDArray[Any] | bytes) -> str:
    """The file in which what a scorer has learned lies; PlaceMapError where it cannot be called `name`."""
    file = name if isinstance(value, bytes) else f"{name}.npy"
    if not _may_be_called(file):
        raise PlaceMapError(f"a scorer cannot call its content '{name}': lower-case letters and one suffix")
    return file


def _may_be_called(file: str) -> bool:
    return _NAME.fullmatch(file) is not None and file not in RESERVED and not file.startswith("matcher-")


def write_content(folder: Path, name: str, value: NDArray[Any] | bytes) -> None:
    """One thing that a scorer has learned."""
    file = folder / file_of(name, value)
    if isinstance(value, bytes):
        file.write_bytes(value)
    else:
        write_array(file, value)


def read_content(folder: Path, files: Sequence[str], what: str) -> dict[str, NDArray[Any] | bytes]:
    """What a scorer has learned, by its names."""
    return {name.removesuffix(".npy"): _read(folder / name, what) for name in files}


def _read(file: Path, what: str) -> NDArray[Any] | bytes:
    if file.suffix == ".npy":
        return read_array(file, what, memory_mapped=True)
    return file.read_bytes()


def write_sums(folder: Path) -> None:
    """SHA256SUMS over all that lies in the folder; of drives of its own, over their SHA256SUMS."""
    files = [file for file in sorted(folder.iterdir()) if file.is_file()]
    files += sorted(folder.glob(f"{DRIVES}/*/{SUMS}"))
    sums = [f"{sha256(file)}  {file.relative_to(folder).as_posix()}\n" for file in files]
    (folder / SUMS).write_text("".join(sums), "ascii")


def linked(old: Path, new: Path) -> None:
    """The files of a map of one drive also under another name: as links, where the disk has any."""
    new.mkdir(parents=True)
    for line in (old / SUMS).read_text("ascii").splitlines():
        _link(old / line.split("  ", 1)[1], new)
    _link(old / SUMS, new)


def _link(file: Path, folder: Path) -> None:
    try:
        os.link(file, folder / file.name)
    except OSError:
        shutil.copyfile(file, folder / file.name)


def check_sums(folder: Path, what: str, needed: set[str]) -> None:
    """PlaceMapError where SHA256SUMS does not name just the files that are read, or a byte has changed."""
    try:
        lines = read_bytes(folder / SUMS, what).decode("ascii").splitlines()
        sums = {name: wanted for wanted, name in (line.split("  ", 1) for line in lines)}
    except (InputError, ValueError) as error:
        raise PlaceMapError(f"{what} has no readable {SUMS}: train it again ({error})") from error
    for name in sorted(needed | set(sums)):
        file = folder / name
        if name not in sums or name not in needed:
            raise PlaceMapError(f"{what} is damaged: {SUMS} and {MARK} do not name the same files ({name})")
        if not file.is_file() or file.is_symlink():
            raise PlaceMapError(f"{what} lacks {name}: copy it again or train it again")
        if sha256(file) != sums[name]:
            raise PlaceMapError(f"{what} is damaged: {name} has changed since it was saved; copy it again")
